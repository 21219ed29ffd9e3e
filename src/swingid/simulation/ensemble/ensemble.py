"""Ensembles: many runs of the twin side by side, in the processor's vector units and on all cores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.errors import UsageError
from swingid.recording.recording import Recording
from swingid.simulation.draws import draw as drawn
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.pack import Block, blocks_of, run_packed
from swingid.simulation.ensemble.runs import Run, runs_of
from swingid.simulation.provenance import how_made, metadata
from swingid.simulation.twin import Controller, Reference, loop_inputs, recording_of, row_count, simulate_run
from swingid.system import cores

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array, Bools

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
        how = how_made(
            duration=self.duration,
            rate=self.rate,
            seed=run.seed,
            drawn=run.draw,
            initial_angle=run.initial_angle,
            initial_speed=run.initial_speed,
            encoder_zero=run.encoder_zero,
            controller=run.controller,
            reference=run.reference,
        )
        return recording_of(rig, self.time, inputs, open_loop, self.log[:, k].T, made, metadata(rig, how, made))


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

    The lanes know viscous, Coulomb, Stribeck, quadratic, offset and one-sided friction, the compensator of relative
    degree 2 or an open loop, and sensors with resolution, noise and dropouts; all else is done run by run, as is said
    by `Ensemble.alone`. Memory: channels x n x rows x 8 bytes; see `ensemble_chunks`.

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
