"""Motion under a held command: from one instant to another, through every stop, release and reversal.

Steps are as long as their error estimate allows (a Stribeck peak passes in a fraction of a millisecond,
LuGre bristles settle faster still), and end exactly where a mode ends. Nothing is smoothed.

Guard against chattering: should a held interval hold more than `MANY_EVENTS` mode changes, then steps that
end in one are no longer shortened below `GUARD` seconds; what passed zero in them is stopped. Speeds err by
one such step's change at most, the motion goes on, and the count of guarded steps is reported.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.model.integrator import FIRST, LAST, NEW, Q1, Q2, STATES, V1, V2, Z, derivative, quintic, step
from swingid.model.sticking import choose_mode, first_dip, locate, margin, stop_reversed
from swingid.numerics.compiled import njit

LONGEST = 1e-3  # s: no step is longer, so that two reversals seldom fall into one
STRETCH = 1.0 + 1e-6
SHORTEST = 1e-12  # s: a step this short is taken whatever its error estimate
MANY_EVENTS, GUARD = 64, 1e-6
# Places in `counts`.
STEPS, EVENTS, GUARDED, PROBES, COUNTS = 0, 1, 2, 3, 4


@njit
def fill_probes(
    t: float,
    h: float,
    until: float,
    y: NDArray[np.float64],
    work: NDArray[np.float64],
    instants: NDArray[np.float64],
    seen: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> None:
    """State at all of the sorted `instants` up to `until` (s) in the step of h from (t, y) to work[NEW]."""
    i, k, kh, new = counts[PROBES], work[FIRST], work[LAST], work[NEW]
    while i < len(instants) and instants[i] <= until:
        x = (instants[i] - t) / h
        seen[i, Q1], seen[i, V1] = quintic(x, h, y[Q1], y[V1], k[V1], new[Q1], new[V1], kh[V1])
        seen[i, Q2], seen[i, V2] = quintic(x, h, y[Q2], y[V2], k[V2], new[Q2], new[V2], kh[V2])
        rise = new[Z] - y[Z]
        start, end = h * k[Z] - rise, rise - h * kh[Z]
        seen[i, Z] = y[Z] + x * (rise + (1.0 - x) * ((1.0 - x) * start + x * end))
        i += 1
    counts[PROBES] = i


@njit
def try_step(
    t: float,
    t_end: float,
    u: float,
    y: NDArray[np.float64],
    mode: NDArray[np.int64],
    p: NDArray[np.float64],
    work: NDArray[np.float64],
    longest: NDArray[np.float64],
) -> float:
    """Step from y that its error estimate allows, at most to t_end; returns its length (s).

    longest[0] is the length tried first, and becomes the one to try next.
    """
    left = t_end - t
    # A rest of rounding size is not worth a step of its own.
    h = float(left if left <= longest[0] * STRETCH else longest[0])
    while True:
        error = step(y, h, mode, u, p, work)
        factor = min(5.0, max(0.2, 0.9 * error ** (-0.2))) if error > 0.0 else 5.0
        if error <= 1.0 or h <= SHORTEST:
            if h < left or factor < 1.0:
                longest[0] = min(h * factor, LONGEST)
            else:
                longest[0] = min(max(h * factor, longest[0]), LONGEST)
            return h
        h *= min(factor, 0.9)


@njit
def advance(
    t: float,
    t_end: float,
    u: float,
    y: NDArray[np.float64],
    mode: NDArray[np.int64],
    p: NDArray[np.float64],
    work: NDArray[np.float64],
    longest: NDArray[np.float64],
    instants: NDArray[np.float64],
    seen: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> None:
    """Move y and `mode` from t to t_end (s) under the held command u (V; direct drive N m), in place.

    `seen` (n, 5) receives the state at the sorted `instants` (n,) passed on the way. Scratch: `work` (9,
    5), `longest` (1,) > 0 the step length carried on, `counts` (4,) steps, mode changes, guarded steps,
    probes.
    """
    choose_mode(y, mode, u, p)
    derivative(y, mode, u, p, work[FIRST])
    events = 0
    while t < t_end:
        h = try_step(t, t_end, u, y, mode, p, work, longest)
        ended = margin(work[NEW], work[LAST], mode, u, p) < 0.0
        if not ended:
            low = first_dip(y, h, mode, work)
            if low < h:
                step(y, low, mode, u, p, work)
                ended = margin(work[NEW], work[LAST], mode, u, p) < 0.0
                h = low
        if ended:
            floor = min(h, GUARD) if events >= MANY_EVENTS else 0.0
            h = locate(y, h, mode, u, p, work)
            if h < floor:
                h = floor
                step(y, h, mode, u, p, work)
                counts[GUARDED] += 1
        whole = not ended and h >= t_end - t
        until = t_end if whole else t + h
        fill_probes(t, h, until, y, work, instants, seen, counts)
        counts[STEPS] += 1
        t = until
        for i in range(STATES):
            y[i] = work[NEW, i]
        if ended:
            events += 1
            counts[EVENTS] += 1
            stop_reversed(y, mode)
            choose_mode(y, mode, u, p)
            derivative(y, mode, u, p, work[FIRST])
        else:
            work[FIRST] = work[LAST]
