"""Constants and sensor imperfections that rig.toml states: their estimates, and their effect on a fit, dθ = −K dy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from swingid.balance.perturbations import (
    SHAPES,
    Perturbation,
    RowError,
    declared_with_deviations,
    of_channels,
    propagated,
)
from swingid.methods.output_error.constants import (
    SCALE,
    TORQUES,
    Places,
    constant_places,
    constant_value,
    is_felt,
    tilt_places,
)
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.segments import problem_of
from swingid.methods.output_error.setup import Setup
from swingid.methods.output_error.unknowns import entries_of
from swingid.model.equation import relative
from swingid.model.parameters import WHEEL_TILT
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.uncertainty.budget import Declared, stated


def declared_effects(setup: Setup, searched: Searched) -> tuple[Declared, ...]:
    """Change of the unknowns (m,) of a fit per unit of every constant of the rig and every imperfection declared."""
    influence = searched.fit.influence / searched.problem.sigma
    channels = (error for error in of_channels(setup.rig, searched.problem.encoders) if not error.of_noise)
    errors = (RowError(error, _error(setup, searched, error)) for error in channels)
    constants = declared_with_deviations(setup.rig, _constants(setup, searched, influence))
    return (*constants, *propagated(errors, influence))


def constants_found(searched: Searched, rig: Rig) -> dict[str, float]:
    """Estimates of the constants that rig.toml states with an uncertainty, by their keys."""
    pairs = zip(searched.unknowns.items, searched.fit.values, strict=True)
    moved = {item.name: float(value) for item, value in pairs if item.places and not item.is_sought}
    scale = moved.pop(SCALE, 0.0)
    constants = {key: constant_value(rig, key)[0] + value for key, value in moved.items()}
    if rig.drive.motor is not None and scale:
        low, high = rig.drive.motor.dead_zone
        stated = {key: constant_value(rig, key)[0] for key in TORQUES}
        stated |= {"drive.motor.dead_zone.negative": low, "drive.motor.dead_zone.positive": high}
        constants |= {key: constants.get(key, value) + scale * value for key, value in stated.items()}
    return constants


def _constants(setup: Setup, searched: Searched, influence: Array) -> Iterator[Declared]:
    """dθ/dc of the stated value of a constant c: −K ∂y/∂c where it is taken as exact (implicit function theorem).

    A stated value that is a prior has the influence N⁻¹/std², with N the matrix of the normal equations.
    """
    problem, unknowns, fit, rig = searched.problem, searched.unknowns, searched.fit, setup.rig
    for k, item in enumerate(unknowns.items):
        if item.places and not item.is_sought and item.name != SCALE:
            yield _constant(item.name, item.std, fit.inverse[:, k] * unknowns.power[k])
    sought = {item.places for item in unknowns.items if item.places}
    places: dict[str, Places] = {
        key: pairs
        for key, pairs in constant_places(rig, setup.equation).items()
        if pairs not in sought and is_felt(key, problem.input)
    }
    if "wheel" in setup.equation.coefficients:
        places[WHEEL_TILT] = tilt_places(setup.equation)
    if not places:
        return
    entries = entries_of(list(places.values()), problem.states)
    p = unknowns.vector(fit.values)
    slopes = problem.predict(p, entries, fit.states, len(places), same=fit.prediction).slopes
    for key, shift in zip(places, -(influence @ slopes[:, problem.states :]).T, strict=True):
        if key == WHEEL_TILT and rig.drive.wheel is not None:
            yield Declared(stated(key, key), relative(rig.drive.wheel.along), shift)
        else:
            yield _constant(key, constant_value(rig, key)[1], shift)


def _constant(key: str, std: float | None, shifts: Array) -> Declared:
    return Declared(stated(key, key), std or 0.0, shifts, constant=True)


def _error(setup: Setup, searched: Searched, perturbation: Perturbation) -> Array:
    """Change of the readings (r,) by an error of a channel, per unit.

    An error of the wheel as the input is equivalent to the change of the prediction with the opposite sign: a late one
    to an early angle.
    """
    problem, wheel, of_wheel = searched.problem, setup.part.log.wheel_angle, perturbation.channel == "wheel"
    here, is_input = problem.wheel if of_wheel else ~problem.wheel, of_wheel and problem.input == "wheel"
    if perturbation.shape == "latency":
        rates = searched.fit.prediction.rates
        return np.where(problem.wheel, 0.0, -rates) if is_input else np.where(here, rates, 0.0)
    shape = SHAPES[perturbation.shape]
    if is_input:
        assert wheel is not None
        return -_other_input(setup, searched, perturbation.std * shape(wheel)) / perturbation.std
    return np.where(here, shape(problem.measured), 0.0)


def _other_input(setup: Setup, searched: Searched, error: Array) -> Array:
    """Change of the predicted readings for an error (rows,) of the measured wheel, which is the input."""
    log, problem, fit = setup.part.log, searched.problem, searched.fit
    assert log.wheel_angle is not None
    other = replace(log, wheel_angle=log.wheel_angle + error)
    length = float(np.max(np.diff(problem.knots[np.append(problem.bounds[:-1], problem.bounds[-1] - 1)])))
    again = problem_of(other, problem.encoders, setup.part.noise, "wheel", length, np.inf)
    if len(again.measured) != len(problem.measured):
        return np.zeros(len(problem.measured))
    return again.moved(searched.unknowns, fit.values, fit.states).outputs - fit.prediction.outputs
