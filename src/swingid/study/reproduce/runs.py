"""Runs of the twin as section 5 describes them, and the ways from such a log to J1 that are compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TypeVar

import numpy as np

from swingid.balance.energies import of_energy
from swingid.control.backstepping import Backstepping
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.control.references.base import Reference
from swingid.errors import InputError, UnanswerableError
from swingid.identification import identify
from swingid.methods.energy.balance import Course, PassRows
from swingid.methods.energy.passes import mirrored_passes
from swingid.methods.energy.printed import (
    DEPTHS,
    Nodes,
    chosen_nodes,
    given_nodes,
    printed_fit,
    with_trapezoid_work,
)
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.preparation.scale import equation_of
from swingid.recording.recording import Recording
from swingid.result.result import Result
from swingid.simulation.twin import Run, simulate_run
from swingid.study.changes import changed
from swingid.study.experiment import through_file, without_truth
from swingid.study.reproduce import published

HIDDEN: Mapping[str, object] = {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3}
"""Friction beside the paper's viscous one that no method has in its model (Stribeck; N m, rad/s)."""

LENGTHS = {"plain": 25.0, "body": 25.0, "balanced": 40.0}

SPANS = {"plain": published.SERIES, "body": published.SERIES, "balanced": (15.0, 40.0)}
"""Parts that are identified, s. In 7 s at 2 rad/s there are only four swings, so the balanced pendulum has 25 s."""

Answer = dict[str, object]

T = TypeVar("T", float, Array)


@dataclass(frozen=True)
class Log:
    """A log as a lab would have it: what was written and read back, and the rig without inertia and friction.

    truth: the inertia of the twin, kg m^2, for comparison only.
    """

    recording: Recording
    rig: Rig
    truth: float

    def first(self, length: float) -> Log:
        """The log's first `length` seconds."""
        return replace(self, recording=self.recording.segment(0.0, length))

    def error(self, inertia: T) -> T:
        """Error of one or several inertias in per cent of the twin's."""
        return 100 * (inertia / self.truth - 1)


def motion(case: str) -> Sine:
    """Program motion y_m1 ("plain"), y_m2 ("body") or y_m3 ("balanced")."""
    return Sine(published.AMPLITUDE, published.FREQUENCIES[case])


@cache
def rig_of(case: str) -> Rig:
    """The paper's rig: "plain", with the "body" at the motor, or "balanced" by it."""
    if case == "plain":
        return Rig.builtin("paper")
    body = Rig.builtin("paper-body")
    return body if case == "body" else body.changed({"name": "paper-2020-balanced", "axis.gravity_torque": 0.0})


def with_friction(rig: Rig, friction: Mapping[str, object]) -> Rig:
    """The rig with these keys of axis.friction replaced, as `study.changes` reads them."""
    return changed(rig, {f"axis.friction.{key}": value for key, value in friction.items()})


def run_of(
    twin: Rig,
    reference: Reference,
    controller: Compensator | Backstepping | None = None,
    *,
    duration: float = 25.0,
    rate: float = 1000.0,
    seed: int = 0,
) -> Run:
    """A run with the gains of the experiment unless a controller is given; the seed lays the encoders' grids too."""
    place = np.random.default_rng([seed, 1]).random(2)
    steps = (twin.sensors.of("angle").resolution, twin.sensors.of("wheel").resolution)
    zero = (float(place[0] * steps[0]), float(place[1] * steps[1]))
    gains = controller or Compensator.paper(twin)
    return simulate_run(twin, reference, gains, duration=duration, rate=rate, seed=seed, encoder_zero=zero)


def read_back(run: Run, twin: Rig, *, stated: Rig | None = None, span: tuple[float, float] | None = None) -> Log:
    """The part `span` (s) of a run's log, through a file. stated: the rig file the lab has, if not the twin's."""
    known = without_truth(stated or twin)
    log = through_file(run.recording, known)
    assert twin.axis.inertia is not None
    return Log(log if span is None else log.segment(*span), known, twin.axis.inertia.value)


def experiment_run(case: str, twin: Rig, seed: int) -> Run:
    """The experiment of section 5 on a twin: its motion, the gains of the experiment, 1 kHz."""
    return run_of(twin, motion(case), duration=LENGTHS[case], seed=seed)


def experiment_log(case: str, twin: Rig, seed: int, stated: Rig | None = None) -> Log:
    """The log of `experiment_run`, the part that is identified."""
    return read_back(experiment_run(case, twin, seed), twin, stated=stated, span=SPANS[case])


@cache
def simulation_run() -> Run:
    """The ideal simulation of Fig. 7: 10 kHz, ideal angles, its gains; 0.8 sin 8.5 t is inferred from its times."""
    twin = ideal_rig()
    return run_of(twin, motion("plain"), Compensator.paper_simulation(twin), duration=12.0, rate=1e4)


def ideal_rig() -> Rig:
    """The paper's rig with encoders without steps."""
    return rig_of("plain").changed({"sensors.counts_per_turn": None})


@dataclass(frozen=True)
class Way:
    """An estimator from a log to J1: a method with options, and its name in words."""

    words: str
    method: str
    options: Mapping[str, object] = field(default_factory=dict)


WAYS = {name: Way(**stated) for name, stated in published.stated_in("cases")["way"].items()}
"""By name, in the order of the tables."""


def result_by(estimator: str, log: Log, **options: object) -> Result | str:
    """The result of an estimator on a log, or the code of its refusal."""
    chosen = WAYS[estimator]
    try:
        return identify(log.recording, log.rig, chosen.method, **(dict(chosen.options) | options))
    except (UnanswerableError, InputError) as error:
        return error.code


def inertia_by(estimator: str, log: Log, **options: object) -> float:
    """J1^ (kg m^2) of an estimator on a log, NaN where it refuses."""
    result = result_by(estimator, log, **options)
    return math.nan if isinstance(result, str) else result.inertia.value


def error_by(estimator: str, log: Log, **options: object) -> float:
    """Error of J1^ in per cent of the twin's inertia, NaN where the estimator refuses."""
    return log.error(inertia_by(estimator, log, **options))


def answer_of(inertia: float, viscous: float | None, log: Log) -> Answer:
    """J1^, its error in per cent, and f1 as the paper counts it. viscous: of the bearing (N m s), if any."""
    answer: Answer = {"inertia": inertia, "error": log.error(inertia)}
    if viscous is not None:
        motor = log.rig.drive.motor
        assert motor is not None
        answer["f1"] = viscous / motor.gear_ratio.value
    return answer


def by_letter(log: Log, nodes: Sequence[Nodes] | Nodes, work: str = "held") -> tuple[float, float]:
    """(J1^ (kg m^2), f1^ N (N m s)) by (6) and (7) letter by letter, mean over all nodes; NaN where (6) is singular.

    As printed, both passes have the potential energies of the first one's nodes, Pi_11 = Pi_22 and Pi_12 = Pi_21; the
    method "energy" gives each pass those of its own. They differ where the nodes' angles do. work: "held" or
    "trapezoid".
    """
    recording, rig, equation = log.recording, log.rig, of_energy(log.rig, equation_of(log.rig))
    noise = channel_noise(recording, rig)
    motion = find_motion(recording.time, recording.angle, noise.angle)
    course = Course.of(recording, rig, motion, noise, Encoders.of(rig))
    instants = given_nodes(nodes, recording)
    rows = PassRows.of(course, instants, equation)
    if work == "trapezoid":
        rows, equation = with_trapezoid_work(rows, recording, equation)
    height = rows.blocks(rows["gravity_torque"])[:, [0, 1, 1, 0]]
    try:
        fit, _ = printed_fit(rows.beside({"gravity_torque": height.ravel()}), equation)
    except UnanswerableError:
        return math.nan, math.nan
    return fit.inertia, fit.value("viscous")


def intervals(log: Log) -> list[Nodes]:
    """Nodes (t10, t11, t20, t21) of every two-step interval of a log, mirrored about the measured turning points."""
    recording = log.recording
    noise = channel_noise(recording, log.rig)
    motion = find_motion(recording.time, recording.angle, noise.angle)
    passes = mirrored_passes(motion, DEPTHS, recording.time, max(4.5 * noise.step, 0.05 * motion.half_period))
    return [(row[0], row[1], row[2], row[3]) for row in chosen_nodes(passes).tolist()]


def each_interval(log: Log, **options: object) -> tuple[Array, Array]:
    """(end of each two-step interval (s), J1^ (kg m^2) by (6) from it alone), for all intervals of a log."""
    nodes = intervals(log)
    result = identify(log.recording, log.rig, "energy", variant="printed", nodes=nodes, **options)
    assert result.details is not None
    assert result.details.swings is not None
    return np.array(nodes)[:, 3], result.details.swings.values


def interval_errors(log: Log, **options: object) -> tuple[Array, Array]:
    """(end of each two-step interval (s), error of its J1^ (per cent)), see `each_interval`."""
    ends, values = each_interval(log, **options)
    return ends, log.error(values)


def reference_nodes(reference: Sine, log: Log) -> list[Nodes]:
    """Nodes mirrored about the turning points of the reference instead of the measured ones, equally deep."""
    near, far = np.arccos(1 - 2 * DEPTHS) / reference.frequency
    start, stop = float(log.recording.time[0]), float(log.recording.time[-1])
    turning = reference.turning_points(stop)
    inside = turning[(turning - far >= start) & (turning + far <= stop)]
    return [(t - far, t - near, t + near, t + far) for t in inside.tolist()]
