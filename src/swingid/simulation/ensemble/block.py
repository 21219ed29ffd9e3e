"""The closed loops of one block of runs, sample by sample: read, control, move, and again what needs a closer look."""

from __future__ import annotations

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.vectors import njit_lane, njit_threads, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble.control import command_all, first_seen
from swingid.simulation.ensemble.events import all_sleep, redo
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.motion import afresh, move_all
from swingid.simulation.ensemble.readings import Late, fill, known, read_all

ROW, STEP, PLACES = range(3)
"""Where a block is: its row, and steps of the sample that have been taken."""

AFRESH = 256
"""Samples after which sine and cosine are computed from the angle."""

TOGETHER = 16
"""Rows that are kept before they are written to the log, so that a line of the memory is written at once."""


@njit_lane
def write(lane: Array, log: Array, kept: Array, k: int, channels: tuple[int, int]) -> None:
    """Row k of the channels of all runs into `kept` (4, TOGETHER, LANES), and from there into the log."""
    widest()
    at_row, rows = k % TOGETHER, log.shape[2]
    for channel in range(channels[0], channels[1]):
        row = at.ANGLE_READING + channel if channel < 3 else at.K_TILDE
        for i in range(LANES):
            kept[channel, at_row, i] = lane[row, i]
    if at_row < TOGETHER - 1 and k < rows - 1:
        return
    for channel in range(channels[0], channels[1]):
        for i in range(log.shape[1]):
            line = log[channel, i]
            for j in range(at_row + 1):
                line[k - at_row + j] = kept[channel, j, i]


@njit_lane
def refer(lane: Array, inputs: Array, which: Ints, k: int) -> tuple[bool, float]:
    """Return whether all runs have one reference or command, and its value at row k; else each run's into REFERENCE."""
    widest()
    shared = inputs.shape[1] == 1
    if not shared:
        for i in range(LANES):
            lane[at.REFERENCE, i] = inputs[k, which[i]]
    return shared, inputs[k, 0]


@njit_threads
def run_block(
    block: Array,
    inputs: Array,
    which: Ints,
    place: Ints,
    kinds: tuple[int, int],
    steps: int,
    h: float,
    noise: Array,
    log: Array,
    kept: Array,
    late: Late,
    rich: int | None,
    is_late: int | None,
    order: int | None,
    steps_back: int | None,
) -> bool:
    """Run a block from `place` on for all rows of `inputs`, moving its rows in place; whether `advance` must take over.

    Then it has to take what LEFT says of each run, and this is called again. block (1,): of `lanes.BLOCK`.
    inputs (rows, references): rad; V or N m where the loop is open. which (LANES,): each run's column of them. kinds:
    whether the loop is closed, some encoder is nonlinear. steps of a sample, each of h (s). noise (2, rows or none,
    LANES) (rad). log (channels, runs <= LANES, rows) receives angle, wheel angle, command and k tilde of every row, as
    many as it has channels; kept: as of `write`. late: instants and angles of encoders that are not read on time; the
    last four: as `move` and `command_all` say.
    """
    widest()
    lane, (closed, bent) = block[0]["rows"], kinds
    total, rows, rate = len(inputs), log.shape[2], 1.0 / (h * steps)
    fading, count = 1, 0
    while place[ROW] < total:
        k = place[ROW]
        if place[STEP] == 0:
            if k % AFRESH == 0:
                afresh(lane)
            wanted = refer(lane, inputs, which, k)
            if is_late is not None:
                known(lane, late, k, steps)
                read_all(lane, at.THERE, at.THERE + 1, bent, noise, k)
            else:
                read_all(lane, at.Q1, at.Q2, bent, noise, k)
            if k == 0 and closed:
                first_seen(lane)
            fading = command_all(lane, closed, rate, fading, wanted, order, steps_back)
            if k < rows:
                write(lane, log, kept, k, (0 if is_late is None else min(2, len(log)), len(log)))
            if k == rows - 1:
                for row in range(4):
                    for i in range(LANES):
                        lane[at.END + row, i] = lane[at.Q1 + row, i]
                if is_late is None:
                    break
        while place[STEP] < steps:
            if is_late is None and count == LANES and all_sleep(lane):
                place[STEP] += 1
                continue
            count = move_all(lane, rich, is_late)
            step = k * steps + place[STEP]
            place[STEP] += 1
            if is_late is not None:
                fill(lane, late, step, steps)
            if count > 0 and redo(block, late, step, steps, rich, is_late):
                return True
        place[ROW], place[STEP] = k + 1, 0
    if is_late is not None and len(log) > 0:
        for k in range(rows):
            for i in range(LANES):
                lane[at.THERE, i] = late[1][k, 0, i]
                lane[at.THERE + 1, i] = late[1][k, 1, i]
            read_all(lane, at.THERE, at.THERE + 1, bent, noise, k)
            write(lane, log, kept, k, (0, 2))
    return False
