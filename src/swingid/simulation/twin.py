"""The digital twin: from a rig, a controller or a list of commands, and a seed, to what would be logged."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.control.backstepping import Backstepping
from swingid.control.compensator import Compensator
from swingid.control.references.base import require_axis
from swingid.control.references.parse import reference_for
from swingid.errors import UsageError, require_rig
from swingid.model.integrator import Q1, Q2, STATES, STEP_KERNEL, V1, V2, Z
from swingid.model.motion import ADVANCE_KERNEL, EVENTS, GUARDED, STEPS
from swingid.model.parameters import vector
from swingid.model.sticking import BEGIN_KERNEL
from swingid.model.terms import is_spring, rig_terms
from swingid.progress import watched
from swingid.recording.recording import Recording
from swingid.simulation import draws
from swingid.simulation.loop import BACKSTEPPING, COMPENSATOR, OPEN_LOOP, closed_loop
from swingid.simulation.rates import with_rates
from swingid.units import Quantity

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array, Ints

Reference = Callable[["Array"], "Array"]
Controller = Compensator | Backstepping


@dataclass(frozen=True)
class Truth:
    """The true motion behind a recording, for tests and plots only: no method is given it.

    time (n,) (s): instants of all rows, lost ones too, or `truth_times`; angle, speed, wheel_angle,
    wheel_speed (rad, rad/s), bristle (rad). command (rows,): held from row to row (V; direct drive N m).
    parameters: the vector of `swingid.model.parameters`. draws: what the seed drew. steps, mode_changes,
    guarded_steps: counts of the integration.
    """

    time: Array
    angle: Array
    speed: Array
    wheel_angle: Array
    wheel_speed: Array
    bristle: Array
    command: Array
    parameters: Array
    draws: draws.Draws
    steps: int
    mode_changes: int
    guarded_steps: int


@dataclass(frozen=True)
class Run:
    """A recording and the true motion behind it; log (rows, 4): angle, wheel angle, command, gain, lost rows too."""

    recording: Recording
    truth: Truth
    log: Array


@dataclass(frozen=True, eq=False)
class Setup:
    """One run: the arguments of `simulate`."""

    rig: Rig
    reference: Reference | str | None = None
    controller: Controller | None = None
    _: KW_ONLY
    duration: float
    rate: float = 1000.0
    seed: int = 0
    initial_angle: float = 0.0
    initial_speed: float = 0.0
    drive: ArrayLike | None = None
    push: ArrayLike | None = None
    draw: bool = False
    encoder_zero: tuple[float, float] = (0.0, 0.0)

    def row_count(self) -> int:
        """Number of rows; UsageError unless duration and rate are positive numbers and give at least two."""
        for name in ("duration", "rate"):
            if not 0.0 < getattr(self, name) < math.inf:
                text = f"{name} must be a positive number, and is {getattr(self, name)}"
                raise UsageError(text, code="bad-duration")
        rows = math.floor(self.duration * self.rate + 1e-9) + 1
        if rows < 2:
            text = f"{self.duration:g} s at {self.rate:g} rows per second is less than two rows; simulate longer"
            raise UsageError(text, code="too-short")
        return rows

    def inputs(self, times: Array, rows: int) -> tuple[Array, bool]:
        """(reference or commands at `times`, whether the loop is open); UsageError where they contradict."""
        rig, reference = self.rig, self.reference
        if rig.drive.channel is None and (reference is not None or self.drive is not None):
            raise UsageError(f"rig {rig.name!r} has no drive, so it can't follow anything", code="no-drive")
        if self.drive is not None:
            if reference is not None or self.controller is not None:
                raise UsageError("give either drive or reference and controller, not both", code="two-drives")
            return _per_row("drive", self.drive, len(times), rows), True
        if reference is None:
            if self.controller is not None:
                raise UsageError("a controller needs a reference to follow; give one", code="no-reference")
            return np.zeros(len(times)), True
        follow: object = reference_for(reference, rig) if isinstance(reference, str) else reference
        if not callable(follow):
            text = 'the reference must be a function of times, or words such as "sine 0.8 rad 8.5 rad/s"'
            raise UsageError(text, code="bad-reference")
        require_axis(follow, rig.axis.kind)
        wanted = np.asarray(follow(times), dtype=np.float64)
        if wanted.shape != times.shape or not np.isfinite(wanted).all():
            raise UsageError("the reference must give one finite number per instant", code="bad-reference")
        return wanted, False

    def pushes(self, count: int, rows: int) -> Array:
        """Torque from outside at so many instants, of which the log has `rows`; empty where there is none."""
        return np.empty(0) if self.push is None else _per_row("push", self.push, count, rows)

    def recording(
        self, controller: Controller | None, times: Array, inputs: Array, log: Array, made: draws.Draws
    ) -> Recording:
        """The rows that were not lost of a log (rows, 4), in the model's conventions; controller None: open loop.

        Raises UsageError where the motion runs away.
        """
        if not np.isfinite(log).all():
            first = times[int(np.argmin(np.isfinite(log).all(axis=1)))]
            text = f"the motion runs away to infinity after {first:g} s; choose smaller gains, a smaller reference or "
            text += "a smaller voltage or torque"
            raise UsageError(text, code="runs-away")
        arguments: dict[str, object] = {
            "duration": self.duration,
            "rate": self.rate,
            "seed": self.seed,
            "drawn": self.draw,
            "initial_angle": self.initial_angle,
            "initial_speed": self.initial_speed,
            "encoder_zero": list(self.encoder_zero),
        }
        pushes = self.pushes(len(inputs), len(log))
        if pushes.size:
            arguments["push"] = {"largest": float(np.max(np.abs(pushes))), "rows": int(np.count_nonzero(pushes))}
        kept, drive, closed = np.flatnonzero(made.kept), self.rig.drive, controller is not None
        return Recording(
            time=times[kept],
            angle=log[kept, 0],
            wheel_angle=log[kept, 1] if drive.wheel is not None else None,
            voltage=log[kept, 2] if drive.motor is not None else None,
            torque=log[kept, 2] if drive.channel == "torque" else None,
            reference=inputs[kept] if closed else None,
            adaptive_gain=log[kept, 3] if closed else None,
            metadata=draws.metadata(self.rig, made, controller, self.reference, **arguments),
        )


def simulate(
    rig: Rig,
    reference: Reference | str | None = None,
    controller: Controller | None = None,
    *,
    duration: float,
    rate: float = 1000.0,
    seed: int = 0,
    initial_angle: float = 0.0,
    initial_speed: float = 0.0,
    drive: ArrayLike | None = None,
    push: ArrayLike | None = None,
    draw: bool = False,
    encoder_zero: tuple[float, float] = (0.0, 0.0),
) -> Recording:
    """Simulate what the rig would log.

    Without `reference` and `drive` it is a free decay. The encoders of `rig.sensors` always apply, drawn by `seed`. The
    true values are in `Recording.truth`; no method reads them. `simulate_run` gives the true motion, too.

    Parameters
    ----------
    rig : Rig
        With its inertia.
    reference : function of times (s) to rad, or words such as "sine 0.8 rad 8.5 rad/s"
        What the controller moves the rig after.
    controller
        By default the compensator with the gains of the paper's experiment.
    duration, rate : float, s and 1/s
        Rows at 0, 1/rate, ..., duration.
    seed : int
        Of everything that is drawn.
    initial_angle, initial_speed : float, rad and rad/s (m and m/s)
        At the first row.
    drive : (rows,), V; of a direct drive N m
        Open loop: one command per row.
    push : (rows,), N m or N
        Torque on the axis from outside, as of a hand, held to the next row.
    draw : bool
        Draw all constants with a stated uncertainty too, so that the rig is one of those its file allows.
    encoder_zero : (2,), rad
        What the encoders of axis and wheel read at angle 0.

    Raises
    ------
    UsageError
        Contradicting arguments; a motion that runs away to infinity.
    InputError
        A rig without inertia or gravity torque.

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper")
    >>> log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=5, rate=500)
    >>> len(log), log.truth["inertia"]
    (2501, 0.003022)
    """
    return run_of(Setup(**locals())).recording


def simulate_run(*arguments: Any, truth_times: ArrayLike | None = None, **options: Any) -> Run:
    """Simulate as `simulate`, with the true motion beside the recording, at the rows or at `truth_times` (s, rising).

    For tests and plots: identification is given `Run.recording`, never `Run.truth`. Errors as `simulate`.
    """
    return run_of(Setup(*arguments, **options), truth_times)


FASTEST = 1e4
"""Natural frequency (rad per row) beyond which nothing is simulated: the integrator takes some ten steps per radian."""


def run_of(setup: Setup, truth_times: ArrayLike | None = None) -> Run:
    """See `simulate_run`."""
    require_rig(setup.rig)
    rig, rate, rows = setup.rig, setup.rate, setup.row_count()
    _check_start(setup)
    made = draws.draw(rig, rows, setup.seed, constants_too=setup.draw, encoder_zero=setup.encoder_zero)
    wanted = np.arange(rows) / rate if truth_times is None else np.asarray(truth_times, dtype=np.float64)
    instants, places = _instants(np.arange(rows) / rate + made.delays, wanted)
    times = np.arange(max(rows, math.ceil(instants[-1] * rate)) + 1) / rate
    inputs, open_loop = setup.inputs(times[:-1], rows)
    controller = None if open_loop else setup.controller or Compensator.paper(rig)
    control, state, gains = OPEN_LOOP, np.zeros(1), np.zeros(1)
    if controller is not None:
        control = BACKSTEPPING if isinstance(controller, Backstepping) else COMPENSATOR
        state, gains = controller.initial_state(setup.initial_angle), controller.parameters(1.0 / rate)
    noise = np.zeros((2, len(inputs)))
    noise[:, :rows] = made.noise
    p = vector(made.values, rig.drive.channel)
    seen, log = np.zeros((len(instants), STATES)), np.zeros((rows, 4))
    log[:, 2] = np.nan  # a command, which the loop writes row by row
    loop = partial(
        closed_loop,
        STEP_KERNEL,
        BEGIN_KERNEL,
        ADVANCE_KERNEL,
        control,
        times,
        inputs,
        setup.pushes(len(inputs), rows),
        state,
        gains,
        own_limit(rig),
        np.array([setup.initial_angle, setup.initial_speed, 0.0, 0.0, 0.0]),
        p,
        np.array([encoder.array() for encoder in made.encoders]),
        noise,
        instants,
        places[: 2 * rows].reshape(2, rows),
        seen,
        log,
    )
    counts = watched(loop, partial(_rows_done, log), rows)
    recording = setup.recording(controller, times, inputs, log, made)
    recording = with_rates(recording, rig, setup.seed, seen, places, made.kept)
    return Run(recording, _truth(wanted, seen[places[2 * rows :]], log[:, 2], p, made, counts), log)


def _rows_done(log: Array) -> int:
    """The rows of a log whose command is written."""
    return bisect_left(range(len(log)), True, key=lambda row: bool(np.isnan(log[row, 2])))


def _instants(reads: Array, wanted: Array) -> tuple[Array, Ints]:
    """Sorted instants of all readings (2, rows) and of the wanted true states, and each one's place among them."""
    if np.array_equal(reads[0], wanted) and np.array_equal(reads[1], wanted):
        return wanted, np.tile(np.arange(len(wanted)), 3)  # on time, as most rigs are: nothing to sort
    instants, places = np.unique(np.concatenate([reads[0], reads[1], wanted]), return_inverse=True)
    return instants, places


def _check_start(setup: Setup) -> None:
    for name in ("initial_angle", "initial_speed"):
        if not math.isfinite(getattr(setup, name)):
            raise UsageError(f"{name} must be a finite number, and is {getattr(setup, name)}", code="bad-start")
    seed = setup.seed
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise UsageError(f"seed must be a whole number that is not negative, and is {seed}", code="bad-seed")
    _check_stiffness(setup.rig, setup.rate)


def _check_stiffness(rig: Rig, rate: float) -> None:
    """Raise UsageError where the body swings so often from row to row that a single row takes seconds."""
    if rig.axis.inertia is None:
        return
    values = [rig.axis.gravity_torque, *(term.value for term in rig_terms(rig) if is_spring(term.term))]
    stiffness = sum(value.value for value in values if isinstance(value, Quantity))
    natural = math.sqrt(stiffness / rig.axis.inertia.value)
    if natural > FASTEST * rate:
        text = f"the body of rig {rig.name} would swing {natural / (2 * math.pi * rate):.2g} times from row to row; "
        text += "check axis.inertia, axis.gravity_torque and axis.stiffness, or take a higher rate"
        raise UsageError(text, code="too-stiff")


def _per_row(name: str, values: ArrayLike, count: int, rows: int) -> Array:
    """One value for each of `count` instants, the last one going on; UsageError unless one per row is finite."""
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 1 or len(given) < rows - 1 or not np.isfinite(given).all():
        text = f"{name} must hold one finite number per row, {rows}, and has shape {given.shape}"
        raise UsageError(text, code=f"bad-{name}")
    return given[np.minimum(np.arange(count), len(given) - 1)]


def own_limit(rig: Rig) -> float:
    """The rig's voltage limit (V), infinite where it has none."""
    motor = rig.drive.motor
    return math.inf if motor is None or motor.voltage_limit is None else float(motor.voltage_limit)


def _truth(wanted: Array, true: Array, commands: Array, p: Array, made: draws.Draws, counts: Ints) -> Truth:
    return Truth(
        time=wanted,
        angle=true[:, Q1],
        speed=true[:, V1],
        wheel_angle=true[:, Q2],
        wheel_speed=true[:, V2],
        bristle=true[:, Z],
        command=commands,
        parameters=p,
        draws=made,
        steps=int(counts[STEPS]),
        mode_changes=int(counts[EVENTS]),
        guarded_steps=int(counts[GUARDED]),
    )
