"""Places of the modulating functions: three kinds of windows that give the inertia under different assumptions.

law     windows all over the motion; friction is a small basis fitted beside the inertia
swing   as law, but each window inside one swing, away from the turning points
even    windows centred on the turning points; friction odd in speed vanishes there without any law
"""

from __future__ import annotations

import numpy as np

from swingid.balance.rows import Signals, Windows
from swingid.numerics.arrays import Bools

FEWEST_SAMPLES = 6


def law_windows(signals: Signals, half: float) -> Windows:
    """Windows of half-length `half` every half/2, none across a rest or a gap of the log."""
    time = signals.nodes.time
    centres = np.arange(time[0] + half, time[-1] - half, half / 2)
    windows = Windows(centres, np.full(len(centres), half))
    return windows.select(_clear(signals, windows))


def swing_windows(signals: Signals) -> Windows:
    """Three windows inside each swing, of 0.8 of its duration, away from both turning points."""
    begins, ends = signals.motion.turning_times[:-1], signals.motion.turning_times[1:]
    duration = ends - begins
    middles = (begins + ends) / 2
    shifts = np.array([-0.06, 0.0, 0.06])
    centres = (middles[:, None] + duration[:, None] * shifts).ravel()
    windows = Windows(centres, np.repeat(0.4 * duration, len(shifts)))
    return windows.select(_clear(signals, windows))


def even_windows(signals: Signals, half: float) -> Windows:
    """Windows centred on the turning points, cut to reach no farther than the next ones and the ends of the log."""
    time, turning = signals.nodes.time, signals.motion.turning_times
    edges = np.concatenate([[time[0]], turning, [time[-1]]])
    reach = np.minimum(np.minimum(turning - edges[:-2], edges[2:] - turning), half)
    windows = Windows(turning, reach)
    return windows.select((reach > 0.6 * half) & _clear(signals, windows))


def _clear(signals: Signals, windows: Windows) -> Bools:
    """Return whether each window contains enough samples, no rest, no excluded part and no gap longer than a quarter of
    it.
    """
    time = signals.nodes.stamps
    clear: Bools = np.ones(len(windows), dtype=bool)
    if 2 * windows.half.min(initial=np.inf) < (FEWEST_SAMPLES + 2) * signals.longest_step:
        first = np.searchsorted(time, windows.centres - windows.half)
        last = np.searchsorted(time, windows.centres + windows.half)
        clear = (last - first) >= FEWEST_SAMPLES
    for begin, end in signals.gaps(0.25 * windows.half.min(initial=np.inf)):
        covered = (windows.centres - windows.half < end) & (windows.centres + windows.half > begin)
        clear &= ~(covered & (end - begin > 0.25 * windows.half))
    for begin, end in (*signals.motion.rests, *signals.source[0].left_out):
        clear &= (windows.centres + windows.half <= begin) | (windows.centres - windows.half >= end)
    return clear
