"""A step of one run that holds a stop, a release or an edge of the dead zone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.model.integrator import NOW, V1, V2, Z
from swingid.model.integrator import Q1 as ANGLE
from swingid.model.integrator import Q2 as WHEEL_ANGLE
from swingid.model.motion import LONGEST, advance
from swingid.simulate.ensemble.lane_functions import njit_threads
from swingid.simulate.ensemble.lanes import COMMAND, FLAG, LANES, Q1, Q2, U, Y

Array = NDArray[np.float64]


@njit_threads
def redo(
    lane: Array, p: Array, h: float, work: Array, nothing: Array, nowhere: Array, counts: NDArray[np.int64]
) -> None:
    """Take the flagged steps of a block again, with each change located: `advance` of the single run."""
    for i in range(LANES):
        if lane[FLAG * LANES + i] == 0.0:
            continue
        work[NOW, ANGLE], work[NOW, V1] = lane[Q1 * LANES + i], lane[U * LANES + i] / h
        work[NOW, WHEEL_ANGLE], work[NOW, V2] = lane[Q2 * LANES + i], lane[Y * LANES + i] / h
        work[NOW, Z] = 0.0
        advance(0.0, h, lane[COMMAND * LANES + i], work, min(h, LONGEST), p[i], nothing, nowhere, counts)
        lane[Q1 * LANES + i], lane[U * LANES + i] = work[NOW, ANGLE], work[NOW, V1] * h
        lane[Q2 * LANES + i], lane[Y * LANES + i] = work[NOW, WHEEL_ANGLE], work[NOW, V2] * h
