"""Motion under a held command: from one instant to another, through every stop, release and reversal.

Steps are as long as their error estimate allows (a Stribeck peak passes in a fraction of a millisecond,
LuGre bristles settle faster still), and end exactly where a mode ends. Nothing is smoothed.

What is noted of the steps, where a caller wants it, is what sensitivities follow along (`methods.output_error.motion`).

Guard against chattering: should a held interval hold more than `MANY_EVENTS` mode changes, then steps that
end in one are no longer shortened below `GUARD` seconds; what passed zero in them is stopped. Speeds err by
one such step's change at most, the motion goes on, and the count of guarded steps is reported.
"""

from __future__ import annotations

from collections.abc import Callable

from swingid.model.integrator import (
    FIRST,
    LAST,
    NEW,
    NOW,
    Q1,
    Q2,
    STATES,
    STEP_KERNEL,
    V1,
    V2,
    Mode,
    Step,
    Z,
    quintic,
)
from swingid.model.sticking import BEGIN_KERNEL, Begin, first_dip, locate, margin, stop_reversed
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import FLOAT, INTS, MATRIX, VECTOR, KernelPointer, njit, njit_inlined

LONGEST = 1e-3  # s: no step is longer, so that two reversals seldom fall into one
STRETCH = 1.0 + 1e-6
EASY = 0.9**5 / 5.0**5  # an error ratio that allows steps five times as long
SHORTEST = 1e-12  # s: a step this short is taken whatever its error estimate
MANY_EVENTS, GUARD = 64, 1e-6
# Places in `counts`.
STEPS, EVENTS, GUARDED, PROBES, NOTES, COUNTS = 0, 1, 2, 3, 4, 5

STEP, COMMAND, SIDE1, SIDE2, BRANCH, ANGLE, SPEED, TURN, WHEEL, RATE1, RATE2, END1, END2, PASSED, FLAG, KICK = range(16)
FIELDS = KICK + 1
"""Columns of `nodes`: length (s) of the step from here, voltage and mode in it; (q1, q1', q2, q2') here; (q1'', q2'')
here and at the step's end; which speed has passed zero here (1 the axis', 2 the wheel's, 0 none); what is read here; by
how much a kick has changed q1' here. The last two are for who notes the motion."""

DIVERGED, FULL = 0.0, -1.0
"""What `advance` returns in the place of a length: a motion that is noted diverges, or has more steps than rows."""

MOST_STEPS, FASTEST = 5_000, 1e6
"""Steps of a held interval, and rad/s, beyond which a motion that is noted counts as divergent."""


@njit_inlined
def fill_probes(
    t: float,
    h: float,
    until: float,
    work: Array,
    instants: Array,
    seen: Array,
    counts: Ints,
) -> None:
    """State at all of the sorted `instants` up to `until` (s), in the step of h from row NOW at t to row NEW."""
    i = counts[PROBES]
    while i < len(instants) and instants[i] <= until:
        x = (instants[i] - t) / h
        start, end = (work[NOW, Q1], work[NOW, V1], work[FIRST, V1]), (work[NEW, Q1], work[NEW, V1], work[LAST, V1])
        seen[i, Q1], seen[i, V1] = quintic(x, h, start, end)
        start, end = (work[NOW, Q2], work[NOW, V2], work[FIRST, V2]), (work[NEW, Q2], work[NEW, V2], work[LAST, V2])
        seen[i, Q2], seen[i, V2] = quintic(x, h, start, end)
        rise = work[NEW, Z] - work[NOW, Z]
        d0, d1 = h * work[FIRST, Z] - rise, rise - h * work[LAST, Z]
        seen[i, Z] = work[NOW, Z] + x * (rise + (1.0 - x) * ((1.0 - x) * d0 + x * d1))
        i += 1
    counts[PROBES] = i


@njit_inlined
def try_step(
    step: Step, length: float, tried: float, work: Array, mode: Mode, u: float, p: Array
) -> tuple[float, float]:
    """Step from row NOW that its error estimate allows, at most `length` (s); the length tried first is `tried`.

    `step` is `integrator.step`, or its pointer. Returns the length of the step and the one to try next.
    """
    # A rest of rounding size is not worth a step of its own.
    h = length if length <= tried * STRETCH else tried
    while True:
        error = step(work, h, mode, u, p)
        factor = 5.0 if error < EASY else max(0.2, 0.9 * error ** (-0.2))
        if error <= 1.0 or h <= SHORTEST:
            following = h * factor
            if h >= length and factor >= 1.0:
                following = max(following, tried)
            return h, min(following, LONGEST)
        h *= min(factor, 0.9)


@njit_inlined
def next_step(
    step: Step,
    length: float,
    tried: float,
    work: Array,
    mode: Mode,
    u: float,
    p: Array,
    events: int,
    counts: Ints,
) -> tuple[float, float, bool]:
    """Step from row NOW into row NEW, at most `length` (s), which ends where `mode` does.

    Returns its length, the length to try next, and whether the mode has ended; `events` is how many did before in
    this held interval. Should the mode end, row NEW lies just beyond its end.
    """
    h, tried = try_step(step, length, tried, work, mode, u, p)
    ended = margin(work, NEW, LAST, mode, u, p) < 0.0
    if not ended:
        low = first_dip(work, h, mode)
        if low < h:
            step(work, low, mode, u, p)
            ended = margin(work, NEW, LAST, mode, u, p) < 0.0
            h = low
    if ended:
        floor = min(h, GUARD) if events >= MANY_EVENTS else 0.0
        h = locate(step, work, h, mode, u, p)
        if h < floor:
            h = floor
            step(work, h, mode, u, p)
            counts[GUARDED] += 1
    return h, tried, ended


@njit_inlined
def note(nodes: Array, row: int, work: Array, mode: Mode, u: float, passed: float) -> None:
    """Row NOW of `work` and what holds from it on into a row of `nodes`, with a step of no length."""
    nodes[row, STEP], nodes[row, COMMAND], nodes[row, PASSED] = 0.0, u, passed
    nodes[row, FLAG], nodes[row, KICK] = 0.0, 0.0
    nodes[row, SIDE1], nodes[row, SIDE2], nodes[row, BRANCH] = mode[0], mode[1], mode[2]
    nodes[row, ANGLE], nodes[row, SPEED] = work[NOW, Q1], work[NOW, V1]
    nodes[row, TURN], nodes[row, WHEEL] = work[NOW, Q2], work[NOW, V2]
    nodes[row, RATE1], nodes[row, RATE2] = work[FIRST, V1], work[FIRST, V2]
    nodes[row, END1], nodes[row, END2] = work[FIRST, V1], work[FIRST, V2]


@njit
def advance(
    step: Step,
    begin: Begin,
    t: float,
    t_end: float,
    u: float,
    work: Array,
    tried: float,
    p: Array,
    instants: Array,
    seen: Array,
    nodes: Array,
    counts: Ints,
) -> float:
    """Move row NOW of `work` from t to t_end (s) under the held command u (V; direct drive N m), in place.

    `step` and `begin`: `STEP_KERNEL`, `BEGIN_KERNEL`, or such as those of `output_error.axis_motion`. `tried` is the
    length of the first step (s), and the length to try in the next call is returned. `seen` (n, 5) receives the state
    at the sorted `instants` (n,) passed on the way, `nodes` (m, FIELDS), unless it has no rows, a row for each step and
    for the state after an event at t_end; `counts` (COUNTS,) sums up steps, mode changes, guarded steps, instants
    passed and rows noted.
    """
    ended, events, passed, most = True, -1, 0.0, counts[STEPS] + MOST_STEPS
    noting = len(nodes) > 0
    while t < t_end or (noting and ended):
        if ended:
            mode = begin(work, u, p)
            events += 1
        if noting:
            if counts[NOTES] == len(nodes):
                return FULL
            note(nodes, counts[NOTES], work, mode, u, passed)
            counts[NOTES] += 1
            if t >= t_end:
                break
        h, tried, ended = next_step(step, t_end - t, tried, work, mode, u, p, events, counts)
        until = t_end if not ended and h >= t_end - t else t + h
        fill_probes(t, h, until, work, instants, seen, counts)
        counts[STEPS] += 1
        t, passed = until, 0.0
        if noting:
            nodes[counts[NOTES] - 1, STEP] = h
            nodes[counts[NOTES] - 1, END1], nodes[counts[NOTES] - 1, END2] = work[LAST, V1], work[LAST, V2]
        for i in range(STATES):
            work[NOW, i], work[FIRST, i] = work[NEW, i], work[LAST, i]
        if ended:
            counts[EVENTS] += 1
            passed = stop_reversed(work, mode)
        if noting and (counts[STEPS] > most or not abs(work[NOW, V1]) + abs(work[NOW, V2]) < FASTEST):
            return DIVERGED
    return tried


advanced = njit_inlined(getattr(advance, "py_func", advance))
"""The same inside a kernel that calls it very often: a call by its address passes on six arrays, which takes 40 ns."""

Advance = Callable[..., float]
ADVANCE_KERNEL = KernelPointer(
    advance,
    FLOAT(STEP_KERNEL.type, BEGIN_KERNEL.type, *[FLOAT] * 3, MATRIX, FLOAT, VECTOR, VECTOR, MATRIX, MATRIX, INTS),
)
