"""The angle of a log with a rate at the level that the balance of torques gives it: zero, bias and random walk."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swingid.balance.level import amounts_left
from swingid.checks.latency import with_latency

if TYPE_CHECKING:
    from swingid.balance.choice import Choice
    from swingid.checks.latency import Moved
    from swingid.preparation.prepared import Part, Prepared

ROUNDS = 5
"""Fits at most; each leaves about the square of the error of the angle."""


def chosen_at_level(prepared: Prepared, memory: str = "auto") -> tuple[Prepared, Part, Choice, Moved]:
    """The prepared log with its angle at the level of the balance, its part to use, and the momentum fit of it.

    A measured angle stays as it is. Raises UnanswerableError where the motion allows no fit.
    """
    for again in range(ROUNDS):
        part = prepared.part(reread=True)
        choice, moved = with_latency(part, memory)
        amounts = amounts_left(choice.law, choice.signals)
        if amounts is None or again == ROUNDS - 1:
            break
        prepared = prepared.relevelled(amounts)
    return prepared, part, choice, moved
