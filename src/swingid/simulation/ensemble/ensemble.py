"""Ensembles: many runs of the twin side by side, in the processor's vector units and on all cores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.errors import UsageError
from swingid.numerics.arrays import Array
from swingid.processes import cores
from swingid.recording.recording import Recording
from swingid.simulation.draws import draw as drawn
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.packed import Block, blocks_of, run_packed
from swingid.simulation.ensemble.runs import Run, runs_of
from swingid.simulation.twin import Controller, Reference, run_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Bools


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
        """Run k as the Recording that `simulate` gives; UsageError unless record="all", or if the rig logs a rate."""
        if len(self.log) < CHANNELS["all"]:
            raise UsageError('simulate the ensemble with record="all" to have recordings', code="not-recorded")
        run, rows = self.runs[k], len(self.time)
        if run.rig.log.angle_speed is not None or run.rig.sensors.wheel_speed is not None:
            text = f"rig {run.rig.name!r} logs a rate, which an ensemble does not; simulate its runs one by one"
            raise UsageError(text, code="not-recorded")
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

    The lanes compute all friction but LuGre's and that of further terms, all controllers (compensators up to relative
    degree 5) or an open loop, and all sensors; what else a rig has is done run by run, see `Ensemble.alone`. Memory:
    channels x n x rows x 8 bytes, half as much again per thread where encoders are read late; see `ensemble_chunks`.

    Raises as `simulate`, and UsageError where the lengths of the sequences differ.
    """
    return next(ensemble_chunks(**locals(), chunk=None))


def ensemble_chunks(
    *arguments: Any, record: Record = "all", threads: int | None = None, chunk: int | None = 8 * LANES, **options: Any
) -> Iterator[Ensemble]:
    """Simulate as `simulate_ensemble` in pieces of at most `chunk` runs, so that memory does not grow with n."""
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
    blocks, others = blocks_of(runs, rows)

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
            list(pool.map(made_alone, others))
    else:  # in the caller's thread, whose time it is
        list(map(made, blocks))
        list(map(made_alone, others))
    alone = np.zeros(len(runs), np.bool_)
    alone[others] = True
    return Ensemble(time, log, state, alone, tuple(runs))


def _alone(run: Run, channels: int) -> tuple[Array, Array]:
    """Log (channels, rows) and last state (4,) of a run by the kernel of single runs."""
    made = run_of(replace(run, rig=run.own_rig, changes={}))
    true = made.truth
    last = np.array([true.angle[-1], true.speed[-1], true.wheel_angle[-1], true.wheel_speed[-1]])
    return made.log.T[:channels], last
