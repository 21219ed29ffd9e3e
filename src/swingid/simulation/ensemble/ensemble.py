"""Ensembles: many runs of the twin side by side, in the processor's vector units and on all cores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.errors import UsageError
from swingid.model.motion import LONGEST
from swingid.model.parameters import STRIBECK_SPEED
from swingid.numerics.arrays import Array, Ints
from swingid.recording.recording import Recording
from swingid.simulation.draws import draw as drawn
from swingid.simulation.ensemble import lanes
from swingid.simulation.ensemble.block import run_block
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.runs import Run, runs_of
from swingid.simulation.twin import Controller, Reference, own_limit, run_of
from swingid.system import cores

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Bools


@dataclass(frozen=True)
class Block:
    """Up to LANES runs that go together, by their places `members` in the ensemble; p (members, SIZE): their constants.

    inputs (rows, references), which (members,): references or commands, and each run's column of them.
    """

    members: list[int]
    runs: list[Run]
    p: Array
    inputs: Array
    which: Ints
    closed: bool


def blocks_of(runs: list[Run], time: Array) -> tuple[list[Block], list[int]]:
    """Blocks of the runs that the lanes can take, and the places of those they can't. Errors as `simulate`."""
    constants = [run.constants() for run in runs]
    kinds: dict[tuple[bool, bool], list[int]] = {}
    left: list[int] = []
    for k, run in enumerate(runs):
        if run.fits_lanes(constants[k]):
            peaked = bool(constants[k][STRIBECK_SPEED] > 0.0)
            kinds.setdefault((run.controller is not None, peaked), []).append(k)
        else:
            left.append(k)
    blocks = []
    for (closed, _), members in kinds.items():
        inputs, which = _distinct_inputs([runs[k] for k in members], time)
        for first in range(0, len(members), LANES):
            own = members[first : first + LANES]
            part = which[first : first + LANES]
            p = np.array([constants[k] for k in own])
            blocks.append(Block(own, [runs[k] for k in own], p, inputs, part, closed))
    return blocks, left


def _distinct_inputs(runs: list[Run], time: Array) -> tuple[Array, Ints]:
    """Distinct references or commands (rows, m), and each run's column; a reference is computed once."""
    columns: dict[tuple[int, int], int] = {}
    found: list[Array] = []
    which = np.empty(len(runs), np.int64)
    for k, run in enumerate(runs):
        key = (id(run.reference), id(run.drive))
        if key not in columns:
            columns[key] = len(found)
            found.append(run.inputs(time, len(time))[0])
        which[k] = columns[key]
    return np.ascontiguousarray(np.array(found).T), which


def run_packed(block: Block, log: Array) -> Array:
    """Run a block, its log into `log` (channels, members, rows); returns the last states (members, 4) (rad, rad/s).

    Lanes without a run do the last member's once more.
    """
    rows, count = len(block.inputs), len(block.members)
    sample = 1.0 / block.runs[0].rate
    steps = int(np.ceil(sample / LONGEST * (1.0 - 1e-9)))
    h = sample / steps
    lane = np.zeros((lanes.ROWS, LANES))
    filled = np.minimum(np.arange(LANES), count - 1)
    p = block.p[filled]
    lanes.pack_motion(lane, p, h)
    lanes.pack_encoders(lane, np.array([run.encoders() for run in block.runs])[filled])
    lane[lanes.RIG_LIMIT] = np.array([own_limit(run.rig) for run in block.runs])[filled]
    lane[lanes.Q1] = np.array([run.initial_angle for run in block.runs])[filled]
    lane[lanes.U] = np.array([run.initial_speed for run in block.runs])[filled] * h
    if block.closed:
        gains, states = _controllers(block.runs, sample)
        lanes.pack_controller(lane, gains[filled], sample)
        lane[lanes.K_TILDE : lanes.XI + 1] = states[filled].T
    noise = np.zeros((2, 1, LANES))
    if any(s.noise for run in block.runs for s in (run.rig.sensors.of("angle"), run.rig.sensors.of("wheel"))):
        noise = np.zeros((2, rows, LANES))
        for i, run in enumerate(block.runs):
            draws = run.noise(rows)
            if draws is not None:
                noise[:, :, i] = draws
    flat = lane.ravel()
    peaked = int(bool(np.any(lane[lanes.PEAK] > 0.0)))
    bends = lane[[lanes.ANGLE_COSINE, lanes.ANGLE_SINE, lanes.WHEEL_COSINE, lanes.WHEEL_SINE]]
    kinds = int(block.closed), peaked, int(bool(np.any(bends)))
    run_block(flat, p, block.inputs, block.which[filled], kinds, steps, h, noise, log)
    end = lane[[lanes.Q1, lanes.U, lanes.Q2, lanes.Y], :count].T
    result: Array = end * np.array([1.0, 1.0 / h, 1.0, 1.0 / h])
    return result


def _controllers(runs: list[Run], sample: float) -> tuple[Array, Array]:
    """Gains (runs, 18) and first states (runs, 5) of the compensators; equal ones are computed once."""
    gains: dict[int, Array] = {}
    states: dict[int, Array] = {}
    for run in runs:
        assert run.controller is not None
        key = id(run.controller)
        if key not in gains:
            gains[key] = run.controller.parameters(sample)
            states[key] = run.controller.initial_state(run.initial_angle)
    return np.array([gains[id(run.controller)] for run in runs]), np.array([states[id(run.controller)] for run in runs])


Record = Literal["nothing", "measured", "all"]
CHANNELS: dict[str, int] = {"nothing": 0, "measured": 3, "all": 4}


@dataclass(frozen=True)
class Ensemble:
    """Runs of one length and rate as a structure of arrays.

    time (rows,) (s). log (channels, n, rows): angle, wheel angle (rad), command (V; direct drive N m), adaptive gain,
    as many as were recorded; rows that a sensor loses are still there. state (n, 4): true angle, speed, wheel's angle
    and speed (rad, rad/s) at the last row. alone (n,): made by the kernel of single runs. runs: what made each.
    """

    time: Array
    log: Array
    state: Array
    alone: Bools
    runs: tuple[Run, ...]

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.runs)

    def channel(self, name: str) -> Array:
        """A channel of all runs (n, rows): angle, wheel_angle, command or adaptive_gain; UsageError if not recorded."""
        names = ("angle", "wheel_angle", "command", "adaptive_gain")
        if name not in names[: len(self.log)]:
            recorded = ", ".join(names[: len(self.log)]) or "nothing"
            raise UsageError(f"the ensemble recorded {recorded}, not {name!r}", code="not-recorded")
        values: Array = self.log[names.index(name)]
        return values

    def recording(self, k: int) -> Recording:
        """Run k as the Recording that `simulate` gives for it; UsageError unless record="all"."""
        if len(self.log) < CHANNELS["all"]:
            raise UsageError('simulate the ensemble with record="all" to have recordings', code="not-recorded")
        run, rows = self.runs[k], len(self.time)
        run = replace(run, rig=run.own_rig, changes={})
        made = drawn(run.rig, rows, run.seed, constants_too=run.draw)
        return run.recording(run.controller, self.time, run.inputs(self.time, rows)[0], self.log[:, k].T, made)


def simulate_ensemble(
    rigs: Rig | Sequence[Rig],
    reference: Reference | Sequence[Reference] | None = None,
    controller: Controller | Sequence[Controller] | None = None,
    *,
    duration: float,
    rate: float = 1000.0,
    seeds: int | Sequence[int] = 0,
    values: Mapping[str, ArrayLike] | None = None,
    initial_angle: ArrayLike = 0.0,
    initial_speed: ArrayLike = 0.0,
    drive: ArrayLike | None = None,
    draw: bool = False,
    encoder_zero: ArrayLike = (0.0, 0.0),
    record: Record = "all",
    threads: int | None = None,
) -> Ensemble:
    """Many runs of `simulate` at once, equal to it to 1e-9.

    What is given once holds for all runs; sequences give one entry per run, all of one length. `values`: arrays (n,)
    (SI) of rig.toml keys of axis, wheel and motor by which the runs' rigs differ from `rigs`, without a `Rig` for each.
    `drive`: (rows,) or (n, rows). `encoder_zero`: (2,) or (n, 2) (rad). record: "nothing", "measured" (angles and
    command) or "all" (what `recording` needs). threads: as many as there are cores by default; the result does not
    depend on it. Other arguments as `simulate`.

    The lanes compute viscous, Coulomb, Stribeck, quadratic, offset and one-sided friction, the compensator of relative
    degree 2 or an open loop, and sensors with resolution, noise and dropouts; all else is done run by run, see
    `Ensemble.alone`. Memory: channels x n x rows x 8 bytes; see `ensemble_chunks`.

    Raises as `simulate`, and UsageError where the lengths of the sequences differ.
    """
    return next(ensemble_chunks(**locals(), chunk=None))


def ensemble_chunks(
    *arguments: Any, record: Record = "all", threads: int | None = None, chunk: int | None = 8 * LANES, **options: Any
) -> Iterator[Ensemble]:
    """As `simulate_ensemble`, in pieces of at most `chunk` runs in their order, so that memory does not grow with n."""
    runs = runs_of(*arguments, **options)
    size = chunk or len(runs)
    for first in range(0, len(runs), size):
        yield _simulated(runs[first : first + size], record, threads)


def _simulated(runs: list[Run], record: Record, threads: int | None) -> Ensemble:
    if record not in CHANNELS:
        raise UsageError(f"record must be one of {', '.join(CHANNELS)}, not {record!r}", code="bad-record")
    rows = runs[0].row_count()
    time = np.arange(rows) / runs[0].rate
    log = np.empty((CHANNELS[record], len(runs), rows))
    state = np.empty((len(runs), 4))
    blocks, left = blocks_of(runs, time)

    def made(block: Block) -> None:
        first, last = block.members[0], block.members[-1] + 1
        whole = last - first == len(block.members)
        part = log[:, first:last] if whole else np.empty((len(log), len(block.members), rows))
        state[block.members] = run_packed(block, part)
        if not whole:
            log[:, block.members] = part

    def made_alone(k: int) -> None:
        log[:, k], state[k] = _alone(runs[k], len(log))

    workers = threads or cores()
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(made, blocks))
            list(pool.map(made_alone, left))
    else:  # in the caller's thread, whose time it is
        list(map(made, blocks))
        list(map(made_alone, left))
    alone = np.zeros(len(runs), np.bool_)
    alone[left] = True
    return Ensemble(time, log, state, alone, tuple(runs))


def _alone(run: Run, channels: int) -> tuple[Array, Array]:
    """Log (channels, rows) and last state (4,) of a run by the kernel of single runs."""
    made = run_of(replace(run, rig=run.own_rig, changes={}))
    true = made.truth
    last = np.array([true.angle[-1], true.speed[-1], true.wheel_angle[-1], true.wheel_speed[-1]])
    return made.log.T[:channels], last
