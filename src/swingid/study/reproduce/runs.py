"""Runs of the twin as section 5 describes them; what identification gets of one is the file that was written."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from swingid.control.backstepping import Backstepping
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.control.references.base import Reference
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation.twin import Run, simulate_run
from swingid.study.reproduce import published

HIDDEN: Mapping[str, object] = {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3}
"""Friction beside the paper's viscous one that no method is told of (Stribeck; N m, rad/s)."""

LENGTHS = {"plain": 25.0, "body": 25.0, "balanced": 40.0}
SPANS = {"plain": published.SERIES, "body": published.SERIES, "balanced": (15.0, 40.0)}
"""Parts that are identified, s. In 7 s at 2 rad/s there are only four swings, so the balanced pendulum has 25 s."""


@dataclass(frozen=True)
class Log:
    """A log as a lab would have it: what was written and read back, and the rig without inertia and friction.

    truth: the inertia of the twin, kg m^2, for comparison only.
    """

    recording: Recording
    rig: Rig
    truth: float


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
    """The rig with these keys of axis.friction replaced."""
    return rig.changed({f"axis.friction.{key}": value for key, value in friction.items()})


def told(rig: Rig) -> Rig:
    """What identification is told of a rig: neither inertia nor friction."""
    return rig.changed({"axis.inertia": None, "axis.friction": None})


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
    known = told(stated or twin)
    with tempfile.TemporaryDirectory() as folder:
        log = Recording.load(run.recording.save(Path(folder) / "run.parquet", known), known)
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
