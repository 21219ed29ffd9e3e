"""Many logs at once: the weights on closed forms, the lanes' functions, and inertias that are known."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from refusals import coded
from swingid.batch import energy_batch, momentum_batch, plan_batch
from swingid.batch.kernels import kinked, signs, slopes, smoothing, window_weights
from swingid.errors import InputError, UnanswerableError
from swingid.model.rig import Rig
from swingid.numerics.vectors import decay, sine_cosine
from swingid.simulation.ensemble import simulate_ensemble
from twin_logs import given


@numba.njit
def in_lanes(x, sine, cosine, falling):
    for i in range(len(x)):
        sine[i], cosine[i] = sine_cosine(x[i])
        falling[i] = decay(abs(x[i]))


def test_sine_cosine_and_decay_of_the_lanes_are_exact_to_rounding():
    rng = np.random.default_rng(1)
    x = rng.uniform(-1, 1, 200_000) * 10 ** rng.uniform(-6, 5, 200_000)
    sine, cosine, falling = np.empty((3, len(x)))
    in_lanes(x, sine, cosine, falling)
    assert np.abs(sine - np.sin(x)).max() < 1e-15
    assert np.abs(cosine - np.cos(x)).max() < 1e-15
    inside = np.abs(x) < 700.0
    assert np.abs(falling[inside] / np.exp(-np.abs(x[inside])) - 1.0).max() < 1e-15


@pytest.mark.parametrize("reach", [10, 40])
def test_windows_integrate_powers(reach):
    half, step = 0.4, 0.4 / reach
    weights = window_weights(reach, step)
    t = step * np.arange(-reach, reach + 1)
    order = (step / half) ** 4
    assert abs(weights[2] @ t**2 / (64 / 35 * half) - 1.0) < 20 * order
    assert abs(weights[2] @ t**4 / (12 * 32 / 315 * half**3) - 1.0) < 20 * order
    assert abs(weights[1] @ t / (-32 / 35 * half) - 1.0) < 20 * order
    assert abs(weights[0].sum() / (32 / 35 * half) - 1.0) < 20 * order


@numba.njit(error_model="numpy")
def speeds_of(angle, weights, result):
    slopes(angle, weights, result)


@numba.njit(error_model="numpy")
def signs_of(angle, speed, weights, where, sign, late):
    signs(angle, speed, weights, where, sign, late)


def test_speeds_are_exact_for_cubics():
    step, weights = 1e-3, smoothing(0.0105, 1e-3)
    t = step * np.arange(100)
    speeds = np.empty(100)
    speeds_of(1.0 + 2.0 * t - 3.0 * t**2 + 40.0 * t**3, weights[1], speeds)
    assert np.allclose(speeds[20:80], (2.0 - 6.0 * t + 120.0 * t**2)[20:80], rtol=1e-11)


def test_reversals_are_in_their_place_though_the_acceleration_jumps_there():
    """Speed 58 rad/s^2 times the time from a reversal, 60 after it: the plain cubic is 0.07 ms off."""
    step, width, at = 1e-3, 0.0255, 0.10037
    t = step * np.arange(200) - at
    angle = np.where(t < 0, 29.0, 30.0) * t**2
    speed, (sign, late) = np.empty(200), np.empty((2, 200))
    speeds_of(angle, smoothing(width, step)[1], speed)
    found = np.interp(0.0, speed[80:120], t[80:120])
    assert found == pytest.approx(-7e-5, abs=1e-5)
    signs_of(angle, speed, kinked(width, step), np.empty(200, np.int64), sign, late)
    inside = slice(50, 150)
    assert np.allclose(sign[inside], np.clip(2.0 * t[inside] / step, -1.0, 1.0), atol=0.01)
    assert np.sum(late[inside]) == pytest.approx(0.0, abs=1e-9)  # one reversal has no scatter


@pytest.mark.long
@pytest.mark.parametrize(
    "friction", [{"coulomb": 3e-3}, {"coulomb": 1e-2}, {"coulomb_positive": 2e-3, "coulomb_negative": 4e-3}]
)
def test_dry_friction_does_not_move_the_inertia(friction):
    """Reversals that a smoothed speed finds late would move it by six to fourteen of its uncertainties."""
    rig = Rig.builtin("paper").changed({f"axis.friction.{key}": value for key, value in friction.items()})
    zeros = rig.sensors.of("angle").resolution * np.random.default_rng(2).random((32, 2))
    runs = simulate_ensemble(
        rig, lambda t: 0.8 * np.sin(8.5 * t), duration=15.0, seeds=range(32), encoder_zero=zeros, record="all"
    )
    plan = plan_batch([runs.recording(k) for k in (0, 31)], given(rig))
    found = momentum_batch(runs.channel("angle"), runs.channel("wheel_angle"), 1000.0, given(rig), plan)
    z = (found.inertia - 302.2e-5) / found.u
    assert np.sqrt(np.mean(z**2)) < 2.0
    assert np.abs(found.inertia / 302.2e-5 - 1.0).max() < 8e-5


@pytest.fixture(scope="module")
def many():
    """Rig, inertias, an ensemble of 64 runs and the plan from three of its logs."""
    rig = Rig.builtin("paper").changed({"axis.friction.coulomb": 1e-3})
    inertias = 302.2e-5 * np.linspace(0.85, 1.2, 64)
    runs = simulate_ensemble(
        rig, lambda t: 0.8 * np.sin(8.5 * t), duration=20.0, values={"axis.inertia": inertias}, seeds=range(64)
    )
    plan = plan_batch([runs.recording(k) for k in (0, 30, 63)], given(rig))
    return rig, inertias, runs, plan


def test_momentum_of_many_logs_finds_their_inertias(many):
    rig, inertias, runs, plan = many
    found = momentum_batch(runs.channel("angle"), runs.channel("wheel_angle"), 1000.0, given(rig), plan)
    z = (found.inertia - inertias) / found.u
    assert abs(np.mean(z)) < 1.0
    assert np.abs(found.inertia / inertias - 1.0).max() < 3e-5
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4
    one = momentum_batch(
        runs.channel("angle")[:1], runs.channel("wheel_angle")[:1], 1000.0, given(rig), plan, threads=1
    )
    assert one.inertia[0] == pytest.approx(found.inertia[0], rel=1e-9)


def test_energy_of_many_logs_finds_their_inertias(many):
    rig, inertias, runs, plan = many
    channels = [runs.channel(name) for name in ("angle", "wheel_angle", "command")]
    found = energy_batch(*channels, 1000.0, given(rig), plan)
    z = (found.inertia - inertias) / found.u
    assert abs(np.mean(found.inertia / inertias - 1.0)) < 1e-4
    assert np.abs(found.inertia / inertias - 1.0).max() < 1.5e-3
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.5


def test_what_many_logs_at_once_cannot_answer_is_refused(many):
    rig, _, runs, plan = many
    angle, wheel = runs.channel("angle"), runs.channel("wheel_angle")
    with pytest.raises(InputError) as caught:
        momentum_batch(angle, wheel, 1000.0, given(rig).changed({"axis.gravity_torque": "unknown"}), plan)
    assert caught.value.code == "not-for-batches"
    with pytest.raises(InputError, check=coded("missing-voltage")):
        energy_batch(angle, wheel, None, 1000.0, given(rig), plan)
    with pytest.raises(InputError, check=coded("missing-channel", "wheel_angle")):
        momentum_batch(angle, None, 1000.0, given(rig), plan)
    for one, other in ((angle, wheel[:, :-1]), (angle[:-1], wheel), (angle[0], wheel[0])):
        with pytest.raises(InputError) as caught:
            momentum_batch(one, other, 1000.0, given(rig), plan)
        assert caught.value.code == "unequal-length"
        with pytest.raises(InputError) as caught:
            energy_batch(one, other, wheel, 1000.0, given(rig), plan)
        assert caught.value.code == "unequal-length"
    with pytest.raises(UnanswerableError) as caught:
        momentum_batch(angle[:, :6500], wheel[:, :6500], 1000.0, given(rig), plan)
    assert caught.value.code == "too-short"
