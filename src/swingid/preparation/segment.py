"""The part of a log to use: the steady motion of a driven axis, the free decay of a released one."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from swingid.errors import UnanswerableError
from swingid.numerics.arrays import Array, Bools
from swingid.preparation.motion import Motion
from swingid.recording.recording import Recording
from swingid.result.result import Message

FEWEST_TURNS = 4

LEAST_LEFT = 0.1
"""Share of a log that a spin-down has at least: less is the end of a log of something else."""


def usable_part(
    motion: Motion, drive: str, start: float, stop: float, left_out: Iterable[Iterable[float]] = ()
) -> tuple[float, float, Message]:
    """Start and stop (s) of the part to use, and a note that names it.

    left_out: excluded parts (s), of a push; the transient after them is not that at the beginning.
    Raises UnanswerableError where fewer than four turning points are found.
    """
    if len(motion.turning_times) < FEWEST_TURNS:
        found = len(motion.turning_times)
        raise UnanswerableError(
            f"the angle shows {found} turning point{'' if found == 1 else 's'} from {start:.6g} to {stop:.6g} s, "
            f"at least {FEWEST_TURNS} are needed; record a motion that swings to and fro.",
            code="no-turning-points",
        )
    if drive == "motor":  # equation (I) with the motor's constants holds from the first row on
        return start, stop, Message("segment", f"used the whole log from {start:.4g} to {stop:.4g} s.")
    used = _decay(motion, start, stop) if drive == "none" else _steady(motion, start, stop, left_out)
    text = f"used the part from {used[0]:.4g} to {used[1]:.4g} s of a log from {start:.4g} to {stop:.4g} s"
    reason = "the free decay" if drive == "none" else "after the transient"
    whole = used[1] - used[0] > 0.98 * (stop - start)
    return *used, Message("segment", f"{text}." if whole else f"{text}: {reason}.")


def part_of(log: Recording, motion: Motion, drive: str) -> tuple[float, float, Message]:
    """`usable_part` of a log and its excluded parts."""
    return usable_part(motion, drive, float(log.time[0]), float(log.time[-1]), log.left_out)


def longest_run(log: Recording) -> Recording:
    """The longest run of rows between excluded parts, for methods that proceed from row to row."""
    if len(log.left_out) == 0:
        return log
    edges = np.concatenate([log.time[:1], log.left_out.ravel(), log.time[-1:]]).reshape(-1, 2)
    start, stop = max(edges, key=lambda run: float(run[1] - run[0]))
    return log.segment(float(start), float(stop))


def _steady(motion: Motion, start: float, stop: float, left_out: Iterable[Iterable[float]]) -> tuple[float, float]:
    """From the first swing after which the sizes of swings keep within the range of the log's second half.

    With excluded parts, from where the first of the runs before, between and after them is steady, within the range of
    the second half of the longest. The whole log where too few swings remain: a motion that only grows has no steady
    part and is as informative.
    """
    sizes, times = motion.swing_sizes, motion.turning_times
    runs = _runs(motion, left_out)
    first, last = max(runs, key=lambda run: run[1] - run[0])
    settled = sizes[(first + last) // 2 : last] if last > first else sizes
    low, high = settled.min(), settled.max()
    margin = 0.05 * high
    outside = (sizes < low - margin) | (sizes > high + margin)
    for first, last in runs:
        unsettled = first + np.flatnonzero(outside[first:last]) + 1
        begin = int(unsettled[-1]) if len(unsettled) else first
        if last - begin >= FEWEST_TURNS - 1:
            return (float(times[begin]) if begin > 0 else start), stop
    return start, stop


def _runs(motion: Motion, left_out: Iterable[Iterable[float]]) -> list[tuple[int, int]]:
    """First swing and swing after the last of each run before, between and after the excluded parts."""
    first, runs = 0, []
    for begin, end in left_out:
        runs.append((first, max(int(np.searchsorted(motion.turning_times, begin)) - 1, first)))
        first = int(np.searchsorted(motion.turning_times, end))
    return [*runs, (first, max(len(motion.swing_sizes), first))]


RELEASES = 2
"""Growing swings of a log in which a body is lifted and let go; more are jitter of the angle, or a hand that drives."""

CHANCE = 0.05
"""Expected number of runs as long as the one taken, where swings grow and shrink at random. Of random amplitudes that
a hand may drive, an answer get 0.5 % where each swing is another, 0 to 2 % where they are correlated over 4 swings, up
to a third where they vary smoothly over 16; of 43 real free decays, which jitter has grow at up to every third swing,
none is refused."""

LONGEST = 8
"""Swings of a push that count at most: beyond, hardly more random amplitudes are refused, and a decay of 50 swings
before someone makes the body swing again would be."""


def _decay(motion: Motion, start: float, stop: float) -> tuple[float, float]:
    """From the turning point after the release to the end of the swings or to another excitation of the axis.

    In a free decay each swing is smaller than the one before; the run of that kind with the most motion is taken, of
    those too long for a body that is driven by hand. At its first turning point the body may still be held, so the part
    starts in the middle of the first swing. Raises UnanswerableError where there is none.
    """
    sizes, times = motion.swing_sizes, motion.turning_times
    shrinks = sizes[1:] < 1.002 * sizes[:-1]
    shrinking = np.concatenate([[False], shrinks, [False]])
    edges = np.nonzero(~shrinking[1:] | ~shrinking[:-1])[0]
    runs = [(int(begin), min(int(end), len(sizes) - 1)) for begin, end in pairwise(edges)]
    runs = [run for run in runs if run[1] - run[0] + 2 >= FEWEST_TURNS]
    if not runs:
        raise UnanswerableError(
            "no free decay of three shrinking swings or more was found; release the body and do not touch it.",
            code="no-free-decay",
        )
    runs = [run for run in runs if _is_free(sizes, shrinks, run)]
    if not runs:
        grow = int(np.count_nonzero(~shrinks))
        raise UnanswerableError(
            f"{grow} of {len(sizes)} swings are larger than the one before, though nothing drives the axis, and no run "
            "of shrinking ones is long enough for a free decay; release the body and do not touch it, or state what "
            "drives it as [drive].",
            code="driven-by-hand",
        )
    begin, end = max(runs, key=lambda run: float(sizes[run[0] : run[1]].sum()))
    released = (times[begin] + times[begin + 1]) / 2
    return max(start, float(released)), min(stop, float(times[end + 1]))


def _is_free(sizes: Array, shrinks: Bools, run: tuple[int, int]) -> bool:
    """Whether a run of shrinking swings is not one of those that a hand makes, which drives the body now and then.

    Swings that grow and shrink at random hold a run of n shrinking ones after one in 2ⁿ pushes; where a push lasts
    several swings, that many count as one. The last run is also free where it decays to half of what was before.
    """
    begin, end = run
    grow = int(np.count_nonzero(~shrinks))
    if grow <= RELEASES:
        return True
    pushes = int(np.count_nonzero(np.diff(np.concatenate([[True], shrinks]).astype(np.int8)) < 0))
    if (end - begin) / min(grow / pushes, LONGEST) >= np.log2((pushes + 1) / CHANCE):
        return True
    return bool(end == len(sizes) - 1 and sizes[end] < 0.5 * np.median(sizes[: begin + 1]))


def spin_down(motion: Motion, start: float, stop: float) -> tuple[float, float, Message]:
    """Start and stop (s) of a body that turns freely, from its fastest instant to its rest or the end of the log.

    Until then a hand, a string or a motor may act. It starts two half-widths of the smoothed speed later, which is
    still that of the drive at the maximum. Raises UnanswerableError where too little of the log is left.
    """
    grid, speed = motion.speed.grid, np.abs(motion.speed.speed)
    fastest = int(np.argmax(speed))
    begin = float(grid[fastest]) + 2 * motion.speed.half_width if fastest > 0 else start
    end = next((float(rest[0]) for rest in motion.rests if rest[0] > begin), stop)
    if not end - begin > LEAST_LEFT * (stop - start):
        raise UnanswerableError(
            f"the body is fastest at {grid[fastest]:.4g} s of a log from {start:.4g} to {stop:.4g} s, so it hardly "
            "turns freely in it; log until it has slowed down, or give the part to use (--part).",
            code="no-coast-down",
        )
    text = f"used the part from {begin:.4g} to {end:.4g} s of a log from {start:.4g} to {stop:.4g} s"
    whole = end - begin > 0.98 * (stop - start)
    return begin, end, Message("segment", f"{text}." if whole else f"{text}: from the greatest speed on.")
