"""What rig.toml is unsure of, and what each constant and imperfection does to a fit: dθ = −K dy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from swingid.balance.imperfections import imperfections
from swingid.checks.consistency import Consistency
from swingid.methods.output_error.constants import SCALE, TORQUES, Places, constant_places, constant_value, is_felt
from swingid.methods.output_error.problem import Problem, problem_of
from swingid.methods.output_error.readings import as_read
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.solver import inverse_of
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.recording.recording import Recording
from swingid.uncertainty.budget import Declared, stated


def declared_effects(
    searched: Searched,
    problem: Problem,
    influence: Array,
    log: Recording,
    rig: Rig,
    scale: Scale,
    noise: Noise,
) -> tuple[Declared, ...]:
    """What every constant of the rig and every imperfection of its sensors does to the unknowns (m,) of a fit."""
    return (
        *_constants(searched, problem, influence, rig, scale),
        *_encoders(searched, problem, influence, log, rig, noise),
        *_latencies(problem, searched.fit.prediction.rates, influence),
    )


def constants_found(searched: Searched, rig: Rig) -> dict[str, float]:
    """Where the fit found the constants that rig.toml states with an uncertainty, by their keys."""
    pairs = zip(searched.unknowns.items, searched.fit.values, strict=True)
    moved = {item.name: float(value) for item, value in pairs if item.places and not item.is_sought}
    scale = moved.pop(SCALE, 0.0)
    found = {key: constant_value(rig, key)[0] + value for key, value in moved.items()}
    if rig.drive.motor is not None and scale:
        low, high = rig.drive.motor.dead_zone
        stated = {key: constant_value(rig, key)[0] for key in TORQUES}
        stated |= {"drive.motor.dead_zone.negative": low, "drive.motor.dead_zone.positive": high}
        found |= {key: found.get(key, value) + scale * value for key, value in stated.items()}
    return found


def shift_of_momentum(consistency: Consistency, searched: Searched, rig: Rig, scale: Scale) -> float:
    """What the inertia of the momentum balance owes to constants and sensors that are not as stated, but as found."""
    assert consistency.windows is not None
    windows, found = consistency.windows, dict(zip(searched.unknowns.names, searched.fit.values, strict=True))
    b = windows.value("gravity_torque") if scale.b is None else scale.b
    shift = 0.0
    for item in imperfections(rig, consistency.signals, windows.rows, windows.a11, b):
        # what is stated of a constant should have been more, the angles less by what the sensors added
        sign = 1.0 if item.constant else -1.0
        effect = float(windows.fit.influence[0] @ item.rows) + item.direct
        shift += sign * effect * float(found.get(item.shared_id or "", 0.0))
    return shift


def _constants(searched: Searched, problem: Problem, influence: Array, rig: Rig, scale: Scale) -> Iterator[Declared]:
    """dθ/dc of what is stated of a constant c: −K ∂y/∂c where it is taken as exact (implicit function theorem).

    What is stated of an uncertain one is a reading of it, of influence N⁻¹/std² with N the normal equations' matrix.
    """
    unknowns, fit = searched.unknowns, searched.fit
    inverse = inverse_of(fit.reduced)
    for k, item in enumerate(unknowns.items):
        if item.places and not item.is_sought and item.name != SCALE:
            yield _constant(item.name, item.std, inverse[:, k] * unknowns.power[k])
    sought = {item.places for item in unknowns.items if item.places}
    places: dict[str, Places] = {
        key: own
        for key, own in constant_places(rig, scale).items()
        if own not in sought and is_felt(key, problem.input)
    }
    if not places:
        return
    entries = unknowns.entries(problem.states, list(places.values()))
    columns = len(unknowns) + len(places)
    slopes = problem.predict(unknowns.vector(fit.values), entries, fit.states, columns).slopes
    own = slopes[:, problem.states + len(unknowns) :] / problem.sigma[:, None]
    shifts = -influence @ own
    for key, shift in zip(places, shifts.T, strict=True):
        yield _constant(key, constant_value(rig, key)[1], shift)


def _constant(key: str, std: float | None, shifts: Array) -> Declared:
    return Declared(stated(key, key), std or 0.0, shifts, constant=True)


def _encoders(
    searched: Searched, problem: Problem, influence: Array, log: Recording, rig: Rig, noise: Noise
) -> Iterator[Declared]:
    """Once-per-turn nonlinearity of each encoder, measured = q + α cos q + β sin q."""
    if rig.axis.kind == "linear":
        return
    shapes = (("cosine", np.cos), ("sine", np.sin))
    for channel, prefix, here in (("angle", "", ~problem.wheel), ("wheel", "wheel.", problem.wheel)):
        sensor = problem.encoders.angle if channel == "angle" else problem.encoders.wheel
        if channel == "wheel" and problem.input not in ("voltage", "wheel"):
            continue
        for name, shape in shapes:
            std = sensor.parts[name].std
            if not std:
                continue
            if channel == "wheel" and problem.input == "wheel":
                assert log.wheel_angle is not None
                effect = -_other_input(searched, problem, log, noise, std * shape(log.wheel_angle)) / std
            else:
                effect = np.where(here, shape(problem.measured), 0.0)
            source = stated(f"{channel} encoder nonlinearity ({name})", f"sensors.{prefix}nonlinearity.{name}")
            yield Declared(source, std, influence @ (effect / problem.sigma))


def _other_input(searched: Searched, problem: Problem, log: Recording, noise: Noise, error: Array) -> Array:
    """Change of the predicted readings when the measured wheel, which is the input, is off by `error` (rows,)."""
    assert log.wheel_angle is not None
    other = replace(log, wheel_angle=log.wheel_angle + error)
    length = float(np.max(np.diff(problem.knots[np.append(problem.bounds[:-1], problem.bounds[-1] - 1)])))
    again = problem_of(other, problem.encoders, noise, "wheel", length, np.inf)
    if len(again.measured) != len(problem.measured):
        return np.zeros(len(problem.measured))
    fit, unknowns = searched.fit, searched.unknowns
    entries = unknowns.entries(problem.states)
    p = unknowns.vector(fit.values)
    prediction = again.predict(p, entries, fit.states, len(unknowns))
    prediction = as_read(prediction, problem, unknowns.names, fit.values)
    return prediction.outputs - fit.prediction.outputs


def _latencies(problem: Problem, rates: Array, influence: Array) -> Iterator[Declared]:
    """A channel read δ later than stated shows q + q' δ; as the input, a late wheel is an early angle."""
    late = influence @ (np.where(problem.wheel, 0.0, rates) / problem.sigma)
    std = problem.encoders.angle.latency.std
    if std and problem.input != "none":
        yield Declared(stated("angle latency", "sensors.latency"), std, late)
    std = problem.encoders.wheel.latency.std
    if std and problem.input in ("voltage", "wheel"):
        turning = influence @ (np.where(problem.wheel, rates, 0.0) / problem.sigma)
        source = stated("wheel latency", "sensors.wheel.latency")
        yield Declared(source, std, turning if problem.input == "voltage" else -late)
