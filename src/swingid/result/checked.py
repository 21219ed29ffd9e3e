"""What consistency checks of an answer give; checks add up, and a method hands the sum to its result."""

from __future__ import annotations

from dataclasses import dataclass

from swingid.result.data import Message


@dataclass(frozen=True)
class Checked:
    """Warnings and notes of checks, and names of those that were carried out (`checks.table.CHECKS`)."""

    warnings: tuple[Message, ...] = ()
    notes: tuple[Message, ...] = ()
    ran: tuple[str, ...] = ()

    def __add__(self, other: Checked) -> Checked:
        """Both, in this order."""
        return Checked(self.warnings + other.warnings, self.notes + other.notes, self.ran + other.ran)


def warned(*warnings: Message, ran: str = "") -> Checked:
    """Only warnings; ran: the check that gives them."""
    return Checked(warnings=warnings, ran=(ran,) if ran else ())


def noted(*notes: Message, ran: str = "") -> Checked:
    """Only notes; ran: the check that gives them."""
    return Checked(notes=notes, ran=(ran,) if ran else ())
