"""The scale of the angle from the shape of gravity: found where it is wrong, and nothing else taken for it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from closed_form_logs import INERTIA, TWO_TONES, direct_log, direct_rig, exact_rig, free_log, free_rig, wheel_log
from long_cases import quick_first
from swingid.balance.choice import choose
from swingid.balance.rows import Signals
from swingid.checks.angle import scale_at, scale_off, search_scale
from swingid.checks.hypothesis import Evidence, Judged
from swingid.errors import UnanswerableError
from swingid.identification import identify
from swingid.numerics.gauss_newton import solve
from swingid.numerics.shooting import Prediction, Shooting
from swingid.preparation.prepared import prepare
from swingid.recording.recording import Recording

TIME = np.arange(12_001) / 1000
NOISE = 3e-4
METHODS = ("momentum", "equation-error", "output-error")


def friction(v):
    return 5e-4 * v + 2e-4 * np.sign(v)


def with_noise(log: Recording) -> Recording:
    rng = np.random.default_rng(4)
    return replace(log, angle=log.angle + rng.normal(0, NOISE, len(log)))


@pytest.fixture(scope="module")
def logs():
    return {
        "wheel": (with_noise(wheel_log(exact_rig(), TWO_TONES, friction, TIME)), exact_rig()),
        "direct": (with_noise(direct_log(TWO_TONES, friction, TIME)), direct_rig()),
        "free": (with_noise(free_log(friction, TIME)), free_rig()),
    }


def scaled(log: Recording, factor: float) -> Recording:
    return replace(log, angle=factor * log.angle)


def warnings(result) -> dict[str, str]:
    return {one.code: one.message for one in result.warnings}


def said(log, rig) -> str:
    """The warning of the scale, or the refusal that names it where the contradiction leaves no answer."""
    try:
        return warnings(identify(log, rig))["angle-scale"]
    except UnanswerableError as error:
        assert error.code == "contradiction"
        return error.message


def fits_of(log, rig):
    prepared = prepare(log, rig)
    part = prepared.part(reread=True)
    signals = Signals.of(part.log, rig, part.motion, part.encoders)
    return choose(signals, rig, prepared.equation, part.noise)


@pytest.mark.parametrize("kind", ["wheel", "direct", "free"])
@pytest.mark.parametrize("factor", quick_first(2, [4096 / 4000, np.pi / 180, 2.0, 0.5, 4.0]))
def test_a_wrong_scale_is_named_with_its_value(logs, kind, factor):
    log, rig = logs[kind]
    message = said(scaled(log, factor), rig)
    found = re.search(r"sine of \(?([\d.]+)(?: ± [\d.]+\))?(e-3)? ?(?:± [\d.]+ )?times", message)
    assert found is not None, message
    value = float(found[1]) * (1e-3 if found[2] else 1.0)
    assert value == pytest.approx(1 / factor, rel=0.01)
    inertia = float(re.search(r"inertia would be ([\d.]+)e-3 kg", message)[1]) * 1e-3
    assert inertia == pytest.approx(INERTIA, rel=5e-3)


@pytest.mark.parametrize("method", quick_first(1, METHODS))
@pytest.mark.parametrize("kind", ["wheel", "direct", "free"])
def test_a_right_scale_is_none(logs, kind, method):
    assert "angle-scale" not in warnings(identify(*logs[kind], method))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_names_it(logs, method):
    log, rig = logs["direct"]
    try:
        assert "angle-scale" in warnings(identify(scaled(log, 2.0), rig, method))
    except UnanswerableError as error:  # where the other's inertia is none, the refusal names it
        assert error.code == "contradiction"
        assert "counts_per_turn is stated at half" in error.message


@pytest.mark.parametrize("kind", ["wheel", "direct", "free"])
def test_the_scale_is_within_its_uncertainty(logs, kind):
    choice = fits_of(*logs[kind])
    searched = [(fit, search_scale(fit, choice.signals)) for fit in choice.tried.values()]
    every = [scale_at(fit, choice.signals, *one) for fit, one in searched if one is not None]
    found = [one for one in every if one is not None]
    best = min(found, key=lambda one: one.relative)
    assert abs(best.value - 1) < 4 * best.u
    assert best.u < 3e-3


def test_a_wrong_scale_of_drive_or_gravity_is_no_scale_of_the_angle(logs):
    log, rig = logs["wheel"]
    for changes in ({"drive.wheel.inertia": 11.34e-5 * 1.1}, {"axis.gravity_torque": 78e-3 * 1.1}):
        found = warnings(identify(log, rig.changed(changes)))
        assert "gravity-torque-disagrees" in found
        assert "angle-scale" not in found


def test_small_swings_determine_no_scale():
    small = with_noise(free_log(lambda v: 5e-4 * v, TIME, initial_angle=0.03))
    choice = fits_of(small, free_rig())
    judged = Judged(choice.law.inertia, choice.law.a11, {"angle": choice.law.total})
    assert not scale_off(Evidence(choice, prepare(small, free_rig()).part()), judged)


def test_magnets_that_a_scale_does_not_describe_are_none(logs):
    """A torque with sin 3q; one with sin 2q has the shape of another scale, and the message names both."""
    log, rig = logs["direct"]
    found = warnings(identify(replace(log, torque=log.torque + 2e-3 * np.sin(3 * log.angle)), rig))
    assert found
    assert "angle-scale" not in found
    message = warnings(identify(replace(log, torque=log.torque + 2e-3 * np.sin(2 * log.angle)), rig))["angle-scale"]
    assert "or a torque that depends on the angle" in message


def test_sensitivities_whose_squares_overflow_are_a_motion_that_diverges():
    """As of degrees that are stated for radians; they were no system of equations that can be solved."""
    slopes, none = np.full((8, 3), 1e200), np.zeros(8)
    prediction, bounds, states = Prediction(none, slopes), (np.full(2, -1.0), np.full(2, 1.0)), np.zeros((1, 1))
    shooting = Shooting(
        none + 1,
        none + 1,
        np.array([0, 8]),
        states,
        lambda *_: prediction,
        bounds,
        np.zeros(2),
        lambda values, _: values,
    )
    found = solve(shooting, np.zeros(2), states)
    assert not np.isfinite(found.cost)
    assert not found.converged
