"""The part of a log to use: the steady motion of a driven axis, the free decay of a released one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from swingid.errors import UnanswerableError
from swingid.preparation.decays import FEWEST_TURNS, decays
from swingid.preparation.motion import Motion
from swingid.recording.recording import Finding, Recording
from swingid.result.result import Message

SWINGS_OFF = 2.0
"""Swings at an end of a selected part that may differ from what would be used: the first may be held by a hand, the
last is not complete."""

LEAST_LEFT = 0.1
"""Share of a log that a spin-down has at least: less is the end of a log of something else."""


def usable_part(
    motion: Motion, channel: str | None, start: float, stop: float, left_out: Iterable[Iterable[float]] = ()
) -> tuple[float, float, Message]:
    """Start and stop (s) of the part to use, and a note that names it.

    left_out: excluded parts (s), of a push; the transient after them is not that at the beginning.
    Raises UnanswerableError where fewer than four turning points are found.
    """
    _require_turns(motion, channel, start, stop)
    if channel == "voltage":  # equation (I) with the motor's constants holds from the first row on
        return start, stop, Message("segment", f"used the whole log from {start:.4g} to {stop:.4g} s.")
    used = _decay(motion, start, stop) if channel is None else _steady(motion, start, stop, left_out)
    text = f"used the part from {used[0]:.4g} to {used[1]:.4g} s of a log from {start:.4g} to {stop:.4g} s"
    reason = "the free decay" if channel is None else "after the transient"
    whole = used[1] - used[0] > 0.98 * (stop - start)
    return *used, Message("segment", f"{text}." if whole else f"{text}: {reason}.")


def _require_turns(motion: Motion, channel: str | None, start: float, stop: float) -> None:
    """Raise UnanswerableError where fewer than four turning points are found."""
    if len(motion.turning_times) < FEWEST_TURNS:
        count = len(motion.turning_times)
        # momentum needs none with a direct drive, as in a spin-up
        other = ", or identify one in one direction with the method momentum" if channel == "torque" else ""
        raise UnanswerableError(
            f"the angle shows {count} turning point{'' if count == 1 else 's'} from {start:.6g} to {stop:.6g} s, "
            f"at least {FEWEST_TURNS} are needed; record a motion that swings back and forth{other}.",
            code="no-turning-points",
        )


def part_of(log: Recording, motion: Motion, channel: str | None) -> tuple[float, float, Message]:
    """`usable_part` of a log and its excluded parts; all of one that a user selected."""
    start, stop = float(log.time[0]), float(log.time[-1])
    if log.selected:
        _require_turns(motion, channel, start, stop)
        return start, stop, Message("segment", f"used all of the selected part from {start:.4g} to {stop:.4g} s.")
    return usable_part(motion, channel, start, stop, log.left_out)


def of_selected(log: Recording, motion: Motion, channel: str | None) -> Finding | None:
    """What of a part that a user selected would have been left out; None where nothing worth a swing.

    A warning of a free decay, in which something else acts then, and a note else: the equation holds in a transient.
    """
    start, stop = float(log.time[0]), float(log.time[-1])
    if channel == "voltage" or len(motion.turning_times) < FEWEST_TURNS:
        return None
    try:
        begin, end, _ = usable_part(motion, channel, start, stop, log.left_out)
    except UnanswerableError as error:
        text = f"the selected part from {start:.4g} to {stop:.4g} s was used, although by its swings {error.message}"
        return Finding("selected-part", text, "warning")
    swing = SWINGS_OFF * motion.half_period
    late, early = begin - start > swing, stop - end > swing
    if not (late or early):
        return None
    text = (
        f"all of the selected part from {start:.4g} to {stop:.4g} s was used; only from {begin:.4g} to {end:.4g} s it "
    )
    text += (
        "looks like a free decay: select that where more than friction acts in the rest."
        if channel is None
        else "looks steady."
    )
    # behind the last turning point the body rests, which is no other cause
    at_rest = not late and not np.any(motion.turning_times > end)
    return Finding("selected-part", text, "note" if channel is not None or at_rest else "warning")


def longest_run(log: Recording) -> Recording:
    """The longest run of rows between excluded parts, for methods that proceed from row to row."""
    if len(log.left_out) == 0:
        return log
    edges = np.concatenate([log.time[:1], log.left_out.ravel(), log.time[-1:]]).reshape(-1, 2)
    start, stop = max(edges, key=lambda run: float(run[1] - run[0]))
    return log.segment(float(start), float(stop))


def _steady(motion: Motion, start: float, stop: float, left_out: Iterable[Iterable[float]]) -> tuple[float, float]:
    """Return the part from the first swing after which the sizes of swings keep within the range of the log's second
    half.

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


def free_decays(motion: Motion, start: float, stop: float) -> list[tuple[float, float]]:
    """Parts (s) of a log from `start` to `stop` in which its body decays freely, in the order of time.

    At its first turning point the body may still be held, so a part starts in the middle of the first swing. Raises
    UnanswerableError where there is none.
    """
    times, runs = motion.turning_times, decays(motion)
    if not runs:
        raise UnanswerableError(
            "no free decay of three shrinking swings or more was found; release the body and do not touch it.",
            code="no-free-decay",
        )
    free = [run for run in runs if run.free]
    if not free:
        sizes = motion.swing_sizes
        raise UnanswerableError(
            f"{int(np.count_nonzero(sizes[1:] > sizes[:-1]))} of {len(sizes)} swings are larger than the one before, "
            "though nothing drives the axis, and no run of shrinking ones is long enough for a free decay; release the "
            "body and do not touch it, or state what drives it as [drive].",
            code="driven-by-hand",
        )
    begins = [(times[run.first] + times[run.first + 1]) / 2 for run in free]
    ends = [times[run.last + 1] for run in free]
    return [(max(start, float(begin)), min(stop, float(end))) for begin, end in zip(begins, ends, strict=True)]


def _decay(motion: Motion, start: float, stop: float) -> tuple[float, float]:
    """The free decay with the most motion."""
    parts = free_decays(motion, start, stop)
    return max(parts, key=lambda part: float(motion.within(*part).swing_sizes.sum()))


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
