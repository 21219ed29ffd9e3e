"""The clock of a device against that of the computer that recorded it.

A sample arrives late by the line, an adapter and the operating system, and never early. So the least delays of blocks
of a run lie on a straight line, whose slope is the relative deviation of the two clocks (Moon, Skelly and Towsley,
Estimation and removal of clock skew from network delay measurements, IEEE INFOCOM 1999).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array

BLOCKS, FEWEST, SHORTEST = 24, 8, 0.25
"""Blocks of a run, least number of them, and their least duration (s): fifty turns of the host's loop, of which one at
least is prompt."""

TURN = 0.005
"""Period of the host's loop (s): arrivals are seen at its turns."""

ROUNDS = 3
"""In which the least delays are found again, the slope of the round before removed."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """A device's clock against the computer's.

    deviation: relative, positive where the device's is fast; spread: its standard uncertainty by the delays; scatter:
    root of the mean square of the least delays about their line (s).
    """

    deviation: float
    spread: float
    scatter: float

    @property
    def is_unsteady(self) -> bool:
        """Return whether the least delays scatter by more than a turn: a clock has jumped, or the host stood still."""
        return self.scatter > TURN


def compare(device: Array, host: Array) -> Comparison | None:
    """Compare the clocks by the times of samples (s) and of their arrival (s), both (n,), rising.

    None for a run shorter than `FEWEST` blocks, for time that goes back, and for a block without samples.
    """
    span = float(device[-1] - device[0]) if len(device) > 1 else 0.0
    blocks = min(BLOCKS, int(span / SHORTEST)) if math.isfinite(span) else 0
    if blocks < FEWEST or (np.diff(device) < 0).any():
        return None
    edges = np.searchsorted(device, device[0] + span * np.arange(blocks) / blocks)
    edges = np.append(edges, len(device))
    if (np.diff(edges) == 0).any():
        return None
    late, slope = host - device, 0.0
    for _ in range(ROUNDS):
        residuals = late - slope * device
        least = np.array([a + int(np.argmin(residuals[a:b])) for a, b in pairwise(edges)])
        x, y = device[least] - device[least].mean(), late[least] - late[least].mean()
        slope = float(x @ y / (x @ x))
    scatter = math.sqrt(float(np.sum((y - slope * x) ** 2)) / (blocks - 2))
    # neighbouring delays may be alike, so their scatter counts once and not once per block
    by_scatter = math.sqrt(12.0) * scatter / span
    # an arrival is seen at the next turn, at both ends of the run
    by_turns = min(TURN, span / (len(device) - 1)) / (math.sqrt(6.0) * span)
    return Comparison(-slope / (1.0 + slope), math.hypot(by_scatter, by_turns), scatter)
