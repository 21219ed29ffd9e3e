"""The steps of a motion, and what is read along them, as arrays: the kernels of `motion` with their room."""

from __future__ import annotations

import numpy as np

from swingid.methods.output_error.motion import (
    BLOCK,
    READ_ANGLE,
    READ_WHEEL,
    WIDEST,
    motion_readings,
    motion_steps,
)
from swingid.model import motion as noted
from swingid.model.motion import LONGEST
from swingid.model.parameters import SIZE
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import KernelPointer
from swingid.numerics.shooting import Prediction

Steps = tuple[Array, Ints]
"""The steps of a motion (n, FIELDS), and the first of each segment (k + 1,)."""

READ = (np.arange(4)[:, None] & (READ_ANGLE, READ_WHEEL)) > 0
"""Whether the angle, the wheel's angle is read, by the bits of `flags`."""

CHATTERS = 50
"""Times as many steps as one per knot and `LONGEST`, from about which on a motion counts as divergent: its friction
changes sides all the time. Motions that resemble a log take hardly more than once as many."""


def steps_of(
    step: KernelPointer,
    begin: KernelPointer,
    knots: Array,
    inputs: Array,
    flags: Ints,
    bounds: Ints,
    states: Array,
    p: Array,
) -> Steps | None:
    """The steps of a motion, see `motion_steps`; None where it diverges."""
    begins = np.zeros(len(bounds), dtype=np.int64)
    time = float(np.sum(knots[bounds[1:] - 1] - knots[bounds[:-1]]))
    least = max(len(knots), int(time / LONGEST))
    room = least + least // 4 + 100
    while room <= CHATTERS * least:
        nodes = np.empty((room, noted.FIELDS))
        ended = motion_steps(step, begin, knots, inputs, flags, bounds, states, p, nodes, begins)
        if ended != noted.FULL:
            return None if ended == noted.DIVERGED else (nodes, begins)
        room *= 4
    return None


def read_along(steps: Steps | None, measured: Array) -> Prediction:
    """What is read along the steps of a motion, without derivatives; not finite where it diverges from `measured`."""
    none = np.empty((len(measured), 0))
    if steps is None:
        return Prediction(measured, none, finite=False)
    nodes = steps[0][: steps[1][-1]]
    read = READ[nodes[:, noted.FLAG].astype(np.int64)]
    outputs, rates = nodes[:, noted.ANGLE : noted.TURN + 1 : 2][read], nodes[:, noted.SPEED : noted.WHEEL + 1 : 2][read]
    return Prediction(outputs, none, rates=rates, steps=steps)


def slopes_along(
    steps: Steps, initial: Ints, p: Array, entries: tuple[Ints, Ints, Array], peaks: Array, columns: int
) -> Array:
    """Derivatives (r, columns ≤ `WIDEST`) of what is read along the steps of a motion, see `motion_readings`.

    Its room is made here, for in a kernel that costs a third of a second of compiling.
    """
    assert columns <= WIDEST
    nodes, begins = steps
    flags = nodes[: begins[-1], noted.FLAG].astype(np.int64)
    slopes, rows = np.empty((int(np.bitwise_count(flags).sum()), columns)), np.zeros((2, SIZE + len(peaks)))
    room = np.zeros(BLOCK * WIDEST), np.zeros((3, 7)), np.zeros(7), rows, np.zeros((3, 9))
    motion_readings(nodes, begins, initial, p, *entries, peaks, slopes, *room)
    return slopes
