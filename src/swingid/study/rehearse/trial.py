"""One rehearsal: the twin draws a rig within its stated uncertainties, logs a run to a file, and methods read it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError, UnanswerableError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation import simulate

if TYPE_CHECKING:
    from swingid.control.backstepping import Backstepping
    from swingid.control.compensator import Compensator
    from swingid.numerics.arrays import Array


@dataclass(frozen=True)
class Plan:
    """The experiment: rig file as text, motion, controller, length (s), rate (1/s), initial angle, methods and options.

    Everything in it can be sent to another process.
    """

    rig_text: str
    rig_source: str
    reference: Callable[[Array], Array] | None
    controller: Compensator | Backstepping | None
    duration: float
    rate: float
    initial_angle: float
    methods: tuple[tuple[str, Mapping[str, object]], ...]


@dataclass(frozen=True)
class Outcome:
    """What one method said of one run: relative error of the inertia, relative half-width of its 95 % interval.

    Both are NaN where the method refused, the half-width also where the uncertainty is unknown; then `reason` is the
    code of the refusal. warnings: codes.
    """

    method: str
    error: float
    half_width: float
    reason: str = ""
    warnings: tuple[str, ...] = ()


def run_once(plan: Plan, seed: int) -> tuple[Outcome, ...]:
    """Simulate with everything drawn by `seed`, write the log, read it as a lab would, and identify it."""
    rig = Rig.from_text(plan.rig_text, plan.rig_source)
    log = drawn_log(
        rig,
        plan.reference,
        plan.controller,
        duration=plan.duration,
        rate=plan.rate,
        initial_angle=plan.initial_angle,
        seed=seed,
    )
    truth = log.metadata["truth"]
    assert isinstance(truth, dict)
    # what a method may know: neither inertia nor friction, and nothing that is not in the file
    told = rig.changed({"axis.inertia": None, "axis.friction": None})
    try:
        read = through_file(log, told)
    except (UnanswerableError, InputError) as error:
        return tuple(Outcome(method, np.nan, np.nan, error.code) for method, _ in plan.methods)
    inertia = float(truth["inertia"])
    return tuple(_outcome(read, told, method, options, inertia) for method, options in plan.methods)


def drawn_log(
    rig: Rig,
    reference: Callable[[Array], Array] | None,
    controller: Compensator | Backstepping | None,
    *,
    duration: float,
    rate: float,
    initial_angle: float,
    seed: int,
    draw: bool = True,
) -> Recording:
    """A run of the twin with the places of its encoders' grids drawn, and with `draw` its constants too."""
    return simulate(
        rig,
        reference,
        controller,
        duration=duration,
        rate=rate,
        seed=seed,
        initial_angle=initial_angle,
        draw=draw,
        encoder_zero=encoder_places(rig, seed),
    )


def encoder_places(rig: Rig, seed: int) -> tuple[float, float]:
    """What the encoders of axis and wheel read at angle 0, within half a step of 0 (rad).

    Where the grid of an encoder lies is chance, and decides what its rounding does to a motion that repeats.
    """
    place = np.random.default_rng([seed, 1]).random(2) - 0.5
    steps = (rig.sensors.of("angle").resolution, rig.sensors.of("wheel").resolution)
    return float(place[0] * steps[0]), float(place[1] * steps[1])


def through_file(log: Recording, rig: Rig) -> Recording:
    """What a lab with `rig` reads from the file that is written of a log."""
    with tempfile.TemporaryDirectory() as folder:
        return Recording.load(log.save(Path(folder) / "run.parquet", rig), rig)


def _outcome(log: Recording, rig: Rig, method: str, options: Mapping[str, object], truth: float) -> Outcome:
    try:
        result = identify(log, rig, method, **options)
    except (UnanswerableError, InputError) as error:
        return Outcome(method, np.nan, np.nan, error.code)
    inertia = result.inertia
    low, high = inertia.interval95 or (np.nan, np.nan)
    warnings = tuple(warning.code for warning in result.warnings)
    return Outcome(method, inertia.value / truth - 1, (high - low) / 2 / truth, warnings=warnings)
