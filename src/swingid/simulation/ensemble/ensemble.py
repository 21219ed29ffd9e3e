"""Ensembles: many runs of the twin side by side, in the processor's vector units and on all cores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.errors import UsageError
from swingid.model.motion import LONGEST
from swingid.model.parameters import STRIBECK_SPEED
from swingid.numerics.arrays import Array, Ints
from swingid.recording.recording import Recording
from swingid.simulation.draws import draw as drawn
from swingid.simulation.draws import metadata
from swingid.simulation.ensemble import lanes
from swingid.simulation.ensemble.block import run_block
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.runs import Run, runs_of
from swingid.simulation.twin import Controller, Reference, loop_inputs, own_limit, recording_of, row_count, simulate_run
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
    rate: float


def blocks_of(runs: list[Run], time: Array, rate: float) -> tuple[list[Block], list[int]]:
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
            blocks.append(Block(own, [runs[k] for k in own], p, inputs, part, closed, rate))
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
            found.append(loop_inputs(run.rig, run.reference, run.controller, run.drive, time, len(time))[0])
        which[k] = columns[key]
    return np.ascontiguousarray(np.array(found).T), which


def run_packed(block: Block, log: Array) -> Array:
    """Run a block, its log into `log` (channels, members, rows); returns the last states (members, 4) (rad, rad/s).

    Lanes without a run do the last member's once more.
    """
    rows, count = len(block.inputs), len(block.members)
    sample = 1.0 / block.rate
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
    duration: float
    rate: float

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
        run = self.runs[k]
        rig, rows = run.own_rig, len(self.time)
        made = drawn(rig, rows, run.seed, constants_too=run.draw)
        inputs, open_loop = loop_inputs(rig, run.reference, run.controller, run.drive, self.time, rows)
        arguments = {
            "duration": self.duration,
            "rate": self.rate,
            "seed": run.seed,
            "drawn": run.draw,
            "initial_angle": run.initial_angle,
            "initial_speed": run.initial_speed,
            "encoder_zero": list(run.encoder_zero),
        }
        data = metadata(rig, made, run.controller, run.reference, **arguments)
        return recording_of(rig, self.time, inputs, open_loop, self.log[:, k].T, made, data)


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
    runs = runs_of(
        rigs, reference, controller, values or {}, drive, seeds, initial_angle, initial_speed, draw, encoder_zero
    )
    return _simulated(runs, duration, rate, record, threads)


def ensemble_chunks(
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
    chunk: int = 8 * LANES,
) -> Iterator[Ensemble]:
    """As `simulate_ensemble`, in pieces of at most `chunk` runs in their order, so that memory does not grow with n."""
    runs = runs_of(
        rigs, reference, controller, values or {}, drive, seeds, initial_angle, initial_speed, draw, encoder_zero
    )
    for first in range(0, len(runs), chunk):
        yield _simulated(runs[first : first + chunk], duration, rate, record, threads)


def _simulated(runs: list[Run], duration: float, rate: float, record: Record, threads: int | None) -> Ensemble:
    if record not in CHANNELS:
        raise UsageError(f"record must be one of {', '.join(CHANNELS)}, not {record!r}", code="bad-record")
    rows = row_count(duration, rate)
    time = np.arange(rows) / rate
    log = np.empty((CHANNELS[record], len(runs), rows))
    state = np.empty((len(runs), 4))
    blocks, left = blocks_of(runs, time, rate)

    def made(block: Block) -> None:
        first, last = block.members[0], block.members[-1] + 1
        whole = last - first == len(block.members)
        part = log[:, first:last] if whole else np.empty((len(log), len(block.members), rows))
        state[block.members] = run_packed(block, part)
        if not whole:
            log[:, block.members] = part

    def made_alone(k: int) -> None:
        log[:, k], state[k] = _alone(runs[k], duration, rate, len(log))

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
    return Ensemble(time, log, state, alone, tuple(runs), duration, rate)


def _alone(run: Run, duration: float, rate: float, channels: int) -> tuple[Array, Array]:
    """Log (channels, rows) and last state (4,) of a run by the kernel of single runs."""
    arguments: dict[str, Any] = {
        "duration": duration,
        "rate": rate,
        "seed": run.seed,
        "initial_angle": run.initial_angle,
        "initial_speed": run.initial_speed,
        "drive": run.drive,
        "draw": run.draw,
        "encoder_zero": run.encoder_zero,
    }
    run_made = simulate_run(run.own_rig, run.reference, run.controller, **arguments)
    truth = run_made.truth
    last = np.array([truth.angle[-1], truth.speed[-1], truth.wheel_angle[-1], truth.wheel_speed[-1]])
    return run_made.log.T[:channels], last
