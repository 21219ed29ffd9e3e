"""What is noticed in a log (`Finding`), where it came from (`Source`), and the repairs by name, with their switches."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import TYPE_CHECKING, Literal

from swingid.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping


class Kind(Enum):
    """What a finding or a message is about, where something is done because of it; codes and words are for readers."""

    ENCODER_NONLINEARITY = auto()
    LATE_CHANNEL = auto()
    GRAVITY_TORQUE = auto()
    ANGLE_ZERO = auto()
    CALIBRATED = auto()
    NOT_IDENTIFIABLE = auto()
    GRAVITY_AND_INERTIA = auto()
    WHEEL_STILL = auto()
    NO_SCALE = auto()
    ANGLE_BESIDE = auto()


OFF = "repair-off"
"""Code of the note on a repair that is switched off (`Recording.repairs_off`)."""

JUMPS = "jumps of an angle"
"""Source in the budget of the inertia: what jumps that were found in an angle do to it."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that was noticed in a log: a `code` for scripts, a sentence for people.

    A ``"warning"`` may affect the result; a ``"note"`` states what was done or assumed. `repair` names the repair
    (a key of `REPAIRS`) that it reports, done or (code `OFF`) switched off. spans: from when to when (s) what a
    warning reports happened; where that is outside of the rows that a method used, it is a note. Empty: everywhere.
    of_time: relative standard uncertainty of the time that a repair restored; of_zero: standard uncertainty (rad) of
    the zero of the angle, where the log states it. of_pivot: standard uncertainties (rad) of cosine and sine part of
    the angle by a pivot that was fitted to the marks of a video; None where none was. source: of the budget that has
    all of what it does to the inertia; where the rest of the budget outweighs that, it is a note.
    """

    code: str
    message: str
    level: Literal["note", "warning"]
    repair: str | None = None
    kind: Kind | None = None
    spans: tuple[tuple[float, float], ...] = ()
    of_time: float = 0.0
    of_zero: float = 0.0
    of_pivot: tuple[float, float] | None = None
    source: str = ""

    def within(self, start: float, stop: float) -> Finding:
        """Return the finding as it counts where only the rows from start to stop (s) are used."""
        outside = self.spans and all(end < start or begin > stop for begin, end in self.spans)
        return replace(self, level="note") if outside else self


@dataclass(frozen=True, slots=True)
class Source:
    """The file that a recording came from: path as given, its SHA-256; None for data made in memory.

    read: whether its channels are columns that were read by the conventions of a rig file.
    """

    path: str | None = None
    sha256: str | None = None
    read: bool = field(default=False, compare=False)


REPAIRS: dict[str, str] = {
    "blanks": "rows without a number, or that do not split into columns, are left out",
    "sort": "rows in the wrong place are sorted by time",
    "repeats": "of rows with one time only the first is kept",
    "device-clock": "times of a live run are taken by the computer's clock where the device's contradicts it",
    "clock": "stamps that scatter about a constant rate are replaced by that rate",
    "unwrap": "angles logged within one turn are made continuous",
    "spikes": "single samples that fit neither neighbour are left out",
    "lost-rows": "stamps made of the row number are moved by the rows that the motion shows to be missing",
    "limit": "commanded voltages beyond the rig's voltage_limit are taken as the limit",
    "encoders": "the encoders' nonlinearity that the rig file states is corrected in the angles that a method uses, "
    "and a wheel's angle that is polled in beat with the rows is moved to them",
    "calibrate": "undeclared encoder nonlinearity and latency are estimated from the log (momentum)",
    "latency": "the latency that the rig file states is corrected in the angles that a method uses",
    "zero": "the angle of a free decay is counted from the centre of its swings, where the body hangs",
    "push": "rows of a driven log during an external torque are excluded from what a method uses",
}
"""Every repair that a log may see. Each that was made is named in the result's provenance."""


def switched_off(switches: Mapping[str, bool] | None) -> frozenset[str]:
    """The repairs that `switches` (name to True or False) turns off; UsageError for another name or value."""
    for name, on in (switches or {}).items():
        if name not in REPAIRS:
            near = difflib.get_close_matches(name, REPAIRS, n=1)
            hint = f"the nearest is {near[0]}" if near else f"there are {', '.join(REPAIRS)}"
            raise UsageError(f"no repair is called {name!r}; {hint}.", code="unknown-repair")
        if on not in (True, False):
            raise UsageError(f"the repair {name!r} is {on!r}; give True or False.", code="bad-repair")
    return frozenset(name for name, on in (switches or {}).items() if not on)


def notes_of(off: frozenset[str]) -> list[Finding]:
    """A note for each repair that is switched off."""
    return [Finding(OFF, f"the repair {name!r} was switched off.", "note", name) for name in sorted(off)]
