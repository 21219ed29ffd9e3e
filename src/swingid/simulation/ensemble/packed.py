"""Blocks of runs that the lanes take together: which go together, what they are made with, and where they end."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from swingid.control.backstepping import Backstepping
from swingid.model.integrator import NOW, STATES, STEP_KERNEL, V1, V2
from swingid.model.integrator import Q1 as ANGLE
from swingid.model.integrator import Q2 as WHEEL_ANGLE
from swingid.model.motion import COUNTS, FIELDS, LONGEST, advance
from swingid.model.parameters import CUBIC, QUADRATIC, STRIBECK_SPEED
from swingid.model.sensors import ALPHA, BETA, RESOLUTION, ZERO
from swingid.model.sticking import BEGIN_KERNEL
from swingid.simulation.draws import CHANNELS, draw_delays, draw_noise, draw_nonlinearity
from swingid.simulation.ensemble import lanes
from swingid.simulation.ensemble.block import PLACES, ROW, STEP, TOGETHER, run_block
from swingid.simulation.ensemble.lanes import CHAIN_MOST, LANES, OTHERS
from swingid.simulation.ensemble.runs import constants_of
from swingid.simulation.twin import own_limit

if TYPE_CHECKING:
    from collections.abc import Callable

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array, Ints
    from swingid.simulation.ensemble.readings import Late
    from swingid.simulation.ensemble.runs import Run


Thing = TypeVar("Thing")

Found = TypeVar("Found")

ROUNDING = 1e-6
"""Of a step: more than the rounding of an instant, which so never lies outside the steps in which it is expected."""


class Kind(NamedTuple):
    """What all runs of a block have in common, since the kernel is compiled for it.

    control: "open", "compensator", "chain" or "backstepping"; order: of a chain. rich: friction with Stribeck's peak, a
    quadratic or a cubic term. late, bent, noisy: some encoder is not read on time, not linear, has noise.
    """

    control: str
    order: int
    rich: bool
    late: bool
    bent: bool
    noisy: bool


@dataclass(frozen=True)
class Block:
    """Up to LANES runs that go together, by their places `members` in the ensemble; p (members, SIZE): their constants.

    inputs (instants, references), which (members,): references or commands, and each run's column of them. after (rows
    or 1, 2, members): how many samples after their rows the encoders are read; empty where all are on time.
    """

    members: list[int]
    runs: list[Run]
    kind: Kind
    p: Array
    inputs: Array
    which: Ints
    after: Array


def of_each(things: list[Thing], function: Callable[[Thing], Found]) -> list[Found]:
    """What a function finds of each thing; once where several are the same one."""
    known = {key: function(thing) for key, thing in {id(thing): thing for thing in things}.items()}
    return [known[id(thing)] for thing in things]


def flaws_of(rig: Rig) -> tuple[bool, bool, bool]:
    """Return whether some encoder of a rig is not read on time, not linear, has noise."""
    sensors = [rig.sensors.of(name) for name in CHANNELS]
    late = any(s.jitter or s.latency.value or s.latency.std for s in sensors)
    bent = any(part.value or part.std for s in sensors for part in s.drawn)
    return late, bent, any(s.noise for s in sensors)


def steps_of(rig: Rig) -> list[float]:
    """Resolutions (rad) of a rig's encoders."""
    return [rig.sensors.of(name).resolution for name in CHANNELS]


def control_of(run: Run) -> tuple[str, int]:
    """Kind of control of a run, and the order of its chain."""
    if run.controller is None:
        return "open", 0
    if isinstance(run.controller, Backstepping):
        return "backstepping", 0
    order = len(run.controller.k)
    return ("compensator" if order == 1 else "chain"), order


def blocks_of(runs: list[Run], rows: int) -> tuple[list[Block], list[int]]:
    """Blocks of the runs that the lanes can take, and the places of those they can't. Errors as `simulate`."""
    constants = constants_of(runs)
    fit = ~np.any(constants[:, OTHERS], axis=1)
    rich = (constants[:, STRIBECK_SPEED] > 0.0) | np.any(constants[:, [QUADRATIC, CUBIC]], axis=1)
    kinds: dict[Kind, list[int]] = {}
    alone: list[int] = []
    for k, (run, flaws) in enumerate(zip(runs, of_each([run.rig for run in runs], flaws_of), strict=True)):
        kind = Kind(*control_of(run), bool(rich[k]), *flaws)
        if fit[k] and kind.order <= CHAIN_MOST:
            kinds.setdefault(kind, []).append(k)
        else:
            alone.append(k)
    blocks = []
    for kind, members in kinds.items():
        for first in range(0, len(members), LANES):
            part = members[first : first + LANES]
            blocks.append(_block(part, [runs[k] for k in part], kind, constants[part], rows))
    return _sharing_inputs(blocks), alone


def _block(members: list[int], runs: list[Run], kind: Kind, p: Array, rows: int) -> Block:
    """A block without its inputs, as many instants as it takes until the last row has been read."""
    after, total = np.empty((0, 2, len(runs))), rows
    if kind.late:
        drawn = [draw_delays(run.rig, rows, run.seed) for run in runs]
        length = max(len(draws) for _, _, draws in drawn)
        units = np.zeros((len(runs), length))
        for i, (_, _, draws) in enumerate(drawn):
            units[i] = draws
        latencies, jitters = (np.array([each[part] for each in drawn]).T * runs[0].rate for part in (0, 1))
        after = np.ascontiguousarray(units.T)[:, None] * jitters
        after += latencies
        least, most = float(after.min()), float(after.max())
        ends = after[-min(length, int(most - least) + 2) :]  # earlier rows are all read before the last
        total = max(rows, int(np.ceil((np.arange(rows - len(ends), rows)[:, None, None] + ends).max())))
    return Block(members, runs, kind, p, np.empty((total, 0)), np.empty(0, np.int64), after)


def _sharing_inputs(blocks: list[Block]) -> list[Block]:
    """The blocks with their inputs; a reference is computed once."""
    by_key: dict[tuple[int, int, int], Array] = {}
    result = []
    for block in blocks:
        rows, total = block.runs[0].row_count(), len(block.inputs)
        columns: dict[tuple[int, int, int], int] = {}
        which = np.empty(len(block.runs), np.int64)
        for k, run in enumerate(block.runs):
            key = (id(run.reference), id(run.drive), total)
            if key not in by_key:
                by_key[key] = run.inputs(np.arange(total) / run.rate, rows)[0]
            which[k] = columns.setdefault(key, len(columns))
        inputs = np.ascontiguousarray(np.array([by_key[key] for key in columns]).T)
        result.append(replace(block, inputs=inputs, which=which))
    return result


def run_packed(block: Block, log: Array) -> Array:
    """Run a block, its log into `log` (channels, members, rows); returns the last states (members, 4) (rad, rad/s).

    Lanes without a run do the last member's once more.
    """
    kind, rows, count = block.kind, log.shape[2], len(block.members)
    sample = 1.0 / block.runs[0].rate
    steps = int(np.ceil(sample / LONGEST * (1.0 - 1e-9)))
    h = sample / steps
    filled = np.minimum(np.arange(LANES), count - 1)
    whole: Any = np.zeros(1, lanes.BLOCK)
    lane: Array = whole[0]["rows"]
    _pack(lane, block, filled, sample, h)
    late = _late(block, filled, steps)
    kinds = int(kind.control != "open"), int(kind.bent)
    place, which = np.zeros(PLACES, np.int64), block.which[filled]
    noise, kept = _noise(block, rows), np.empty((4, TOGETHER, LANES))
    variant = (
        1 if kind.rich else None,
        1 if kind.late else None,
        kind.order if kind.control == "chain" else None,
        1 if kind.control == "backstepping" else None,
    )
    while run_block(whole, block.inputs, which, place, kinds, steps, h, noise, log, kept, late, *variant):
        step = int(place[ROW]) * steps + int(place[STEP]) - 1
        for i in np.flatnonzero(lane[lanes.LEFT]):
            advance_run(lane, int(i), block.p[filled[i]], h, late, step, steps)
    end = lane[lanes.END : lanes.END + 4, :count].T
    result: Array = end * np.array([1.0, 1.0 / h, 1.0, 1.0 / h])
    return result


def _pack(lane: Array, block: Block, filled: Ints, sample: float, h: float) -> None:
    """What a block starts with into (ROWS, LANES); filled (LANES,): each column's member; sample, h: of a step (s)."""
    runs, kind = block.runs, block.kind
    lanes.pack_motion(lane, block.p[filled], h)
    lanes.pack_encoders(lane, _encoders(block)[filled])
    lane[lanes.RIG_LIMIT] = np.array(of_each([run.rig for run in runs], own_limit))[filled]
    lane[lanes.Q1] = np.array([run.initial_angle for run in runs])[filled]
    lane[lanes.U] = np.array([run.initial_speed for run in runs])[filled] * h
    if kind.control != "open":
        gains, states = _controllers(runs, sample)
        if kind.control == "backstepping":
            lanes.pack_backstepping(lane, gains[filled], states[filled])
        else:
            lanes.pack_compensator(lane, gains[filled], states[filled], sample)


def _encoders(block: Block) -> Array:
    """Arrays (members, 2, 4) of `model.sensors` for the encoders of axis and wheel."""
    encoders = np.zeros((len(block.runs), 2, 4))
    encoders[:, :, RESOLUTION] = of_each([run.rig for run in block.runs], steps_of)
    encoders[:, :, ZERO] = [run.encoder_zero for run in block.runs]
    if block.kind.bent:
        encoders[:, :, [ALPHA, BETA]] = [draw_nonlinearity(run.rig, run.seed) for run in block.runs]
    return encoders


def _noise(block: Block, rows: int) -> Array:
    """Noise (2, instants, LANES) (rad) of both encoders, (2, 0, LANES) where there is none."""
    if not block.kind.noisy:
        return np.zeros((2, 0, LANES))
    noise, draws = np.zeros((2, len(block.inputs), LANES)), np.zeros((len(block.runs), 2, rows))
    for i, run in enumerate(block.runs):
        draws[i] = draw_noise(run.rig, rows, run.seed)
    noise[:, :rows, : len(draws)] = draws.transpose(1, 2, 0)
    return noise


def _late(block: Block, filled: Ints, steps: int) -> Late:
    """What `readings` has of encoders that are not read on time; before the start the motion is uniform."""
    if not block.kind.late:
        return np.empty((0, 2, LANES)), np.empty((0, 2, LANES)), 0, 0
    rows, rate, total = block.runs[0].row_count(), block.runs[0].rate, len(block.inputs)
    after = block.after if len(block.runs) == LANES else block.after[:, :, filled]
    when = after + np.arange(rows, dtype=np.float64)[:, None, None]
    if steps > 1:
        when *= steps
    least, most = float(block.after.min()), float(block.after.max())
    ends = when[max(total - int(np.floor(most)) - 2, 0) :]
    np.minimum(ends, np.nextafter(float(total * steps), 0.0), out=ends)
    seen = np.full_like(when, np.nan)  # so that a reading that nothing fills is found
    early = slice(0, max(int(np.ceil(-least)), 0))
    angle, speed = (np.array([getattr(run, f"initial_{name}") for run in block.runs]) for name in ("angle", "speed"))
    uniform = angle[filled] + speed[filled] * when[early, 0] / (steps * rate)
    seen[early, 0] = np.where(when[early, 0] < 0.0, uniform, 0.0)
    seen[early, 1] = 0.0  # the wheel rests until the start
    return when, seen, int(np.floor(steps * least - ROUNDING)), int(np.floor(steps * most + ROUNDING))


def advance_run(lane: Array, i: int, p: Array, h: float, late: Late, step: int, steps: int) -> None:
    """Take what is left of a step of h (s) of run i by the kernel of single runs; the last: as of `readings.fill`."""
    remaining = h * float(lane[lanes.LEFT, i])
    work, counts = np.zeros((10, 5)), np.zeros(COUNTS, np.int64)
    work[NOW, [ANGLE, V1]] = lane[lanes.Q1, i], lane[lanes.U, i] / h
    work[NOW, [WHEEL_ANGLE, V2]] = lane[lanes.Q2, i], lane[lanes.Y, i] / h
    rows = slice(max((step - late[3]) // steps, 0), max((step - late[2]) // steps + 1, 0))
    when, seen = late[0][rows, :, i], late[1][rows, :, i]
    rest = (when - step) * h - (h - remaining)
    inside = np.argwhere((rest >= 0.0) & (when >= step) & (when < step + 1))
    instants = np.sort(rest[tuple(inside.T)])
    states = np.zeros((len(instants), STATES))
    command = float(lane[lanes.COMMAND, i])
    tried, noted = min(remaining, LONGEST), (instants, states, np.zeros((0, FIELDS)), counts)
    advance(STEP_KERNEL, BEGIN_KERNEL, 0.0, remaining, command, work, tried, p, *noted)
    for row, e in inside:
        seen[row, e] = states[np.searchsorted(instants, rest[row, e]), WHEEL_ANGLE if e else ANGLE]
    lane[lanes.Q1, i], lane[lanes.U, i] = work[NOW, ANGLE], work[NOW, V1] * h
    lane[lanes.Q2, i], lane[lanes.Y, i] = work[NOW, WHEEL_ANGLE], work[NOW, V2] * h
    lane[lanes.SINE, i], lane[lanes.COSINE, i] = np.sin(work[NOW, ANGLE]), np.cos(work[NOW, ANGLE])


def _controllers(runs: list[Run], sample: float) -> tuple[Array, Array]:
    """Gains and first states of the controllers (runs, ...); those of one controller are computed once."""
    controllers = [run.controller for run in runs if run.controller is not None]
    gains = of_each(controllers, lambda controller: controller.parameters(sample))
    return np.array(gains), np.array(of_each(controllers, lambda controller: controller.initial_state()))
