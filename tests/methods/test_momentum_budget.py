"""Type B uncertainties: every sensitivity of the budget against a second identification with that constant changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from closed_form_logs import (
    INERTIA,
    ONE_TONE,
    TWO_TONES,
    Sines,
    direct_log,
    direct_rig,
    encoded,
    exact_rig,
    free_log,
    free_rig,
    wheel_log,
)
from long_cases import quick_first
from swingid.balance.covariance import with_excess
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from twin_logs import without

TIME = np.arange(20_001) / 1000
CONSTANTS = {
    "axis.gravity_torque": (78e-3, 2e-4),
    "drive.wheel.inertia": (11.34e-5, 3e-7),
    "drive.motor.rotor_inertia": (0.21e-5, 1e-8),
    "drive.motor.gear_ratio": (4.4, 0.01),
}
UNCERTAIN = Rig.builtin("paper").changed({key: {"value": v, "std": std} for key, (v, std) in CONSTANTS.items()})


def friction(v):
    return 5e-4 * v + 3e-3 * np.sign(v)


def type_b(result, parameter="inertia"):
    return {entry.source: entry for entry in result.budget if entry.parameter == parameter and entry.type == "B"}


@pytest.fixture(scope="module", params=[ONE_TONE, TWO_TONES], ids=["one tone", "two tones"])
def log(request):
    return encoded(wheel_log(exact_rig(), request.param, friction, TIME))


@pytest.mark.parametrize("key", quick_first(6, CONSTANTS))
@pytest.mark.parametrize(
    "sensors", quick_first(1, [{}, {"sensors.nonlinearity": "0.1 deg"}]), ids=["", "nonlinear encoders"]
)
def test_constants(log, key, sensors):
    rig = UNCERTAIN.changed(sensors)
    result = identify(log, rig)
    entry = type_b(result)[key]
    value, std = CONSTANTS[key]
    step = 1e-4 * value
    shifted = [identify(log, rig.changed({key: {"value": value + s, "std": std}})).inertia.value for s in (step, -step)]
    assert entry.sensitivity == pytest.approx((shifted[0] - shifted[1]) / (2 * step), rel=2e-3)
    assert entry.standard_uncertainty == pytest.approx(abs(entry.sensitivity) * std, rel=1e-9)
    assert entry.shared_id == key


@pytest.mark.parametrize("key", quick_first(3, CONSTANTS))
def test_constants_and_friction(log, key):
    result = identify(log, UNCERTAIN)
    value, std = CONSTANTS[key]
    step = 1e-4 * value
    rigs = [UNCERTAIN.changed({key: {"value": value + s, "std": std}}) for s in (step, -step)]
    shifted = [identify(log, rig).parameters for rig in rigs]
    for name in ("viscous", "coulomb"):
        slope = (shifted[0][name].value - shifted[1][name].value) / (2 * step)
        assert type_b(result, name)[key].sensitivity == pytest.approx(slope, rel=0.02)


@pytest.mark.parametrize("left_out", ["drive.motor.rotor_inertia", "drive.motor"])
def test_a_rotor_of_which_nothing_is_stated_is_uncertain(log, left_out):
    """The paper's rotor, geared 4.4, has 8 % of the coupling: the interval holds the inertia, and the key is named."""
    found = identify(log, exact_rig().changed({left_out: None}))
    low, high = found.inertia.interval95
    assert low < INERTIA < high
    largest = max((one for one in found.budget if one.parameter == "inertia"), key=lambda one: one.standard_uncertainty)
    assert largest.source == "drive.motor.rotor_inertia"
    assert any("drive.motor.rotor_inertia" in note.message for note in found.notes if note.code == "defaults-taken")
    stated = identify(log, exact_rig().changed({"drive.motor.rotor_inertia": 0.0}))
    assert not any(one.source == largest.source for one in stated.budget)


def test_theory_of_the_wheel_inertia_and_of_gravity(log):
    # Row (I) is homogeneous: a11, b and F follow a12 in proportion.
    found = type_b(identify(log, UNCERTAIN))
    a12, carried = UNCERTAIN.drive.a12, 11.34e-5 + 0.21e-5
    scale = found["drive.wheel.inertia"].sensitivity + 1.0  # of a11
    gravity = found["axis.gravity_torque"].sensitivity
    assert scale * a12 + gravity * 78e-3 == pytest.approx(INERTIA + carried, rel=1e-4)
    rotor, gear = found["drive.motor.rotor_inertia"].sensitivity, found["drive.motor.gear_ratio"].sensitivity
    assert rotor + 1.0 == pytest.approx(4.4 * scale, rel=1e-6)
    assert gear == pytest.approx(0.21e-5 * scale, rel=1e-6)


def test_the_torque_gain_scales_everything():
    rig = direct_rig(**{"log.torque_gain": {"value": 2.0, "std": 0.01}, "axis.gravity_torque": "unknown"})
    log = direct_log(TWO_TONES, friction, TIME)
    found = type_b(identify(log, rig))
    assert found["log.torque_gain"].sensitivity == pytest.approx(INERTIA / 2.0, rel=1e-4)
    assert found["log.torque_gain"].standard_uncertainty == pytest.approx(0.005 * INERTIA, rel=1e-4)


def test_unknown_gravity_feels_the_wheel():
    rig = UNCERTAIN.changed({"axis.gravity_torque": "unknown"})
    result = identify(encoded(wheel_log(exact_rig(), TWO_TONES, friction, TIME)), rig)
    assert "axis.gravity_torque" not in type_b(result)
    slope = type_b(result, "gravity_torque")["drive.wheel.inertia"].sensitivity
    assert slope == pytest.approx(78e-3 / rig.drive.a12, rel=1e-3)


NONLINEAR = UNCERTAIN.changed({"sensors.nonlinearity": "0.1 deg"})


@pytest.mark.parametrize("channel", ["angle", "wheel_angle"])
@pytest.mark.parametrize(("part", "shape"), [("cosine", np.cos), ("sine", np.sin)])
def test_nonlinear_encoders(log, channel, part, shape):
    # Compared by what the entry is for: its part of the whole uncertainty.
    result = identify(log, NONLINEAR)
    entry = type_b(result)[f"{channel.removesuffix('_angle')} encoder nonlinearity ({part})"]
    amplitude, std = 1e-4, np.deg2rad(0.1)
    q = getattr(log, channel)
    distorted = identify(replace(log, **{channel: q + amplitude * shape(q)}), NONLINEAR)
    slope = (distorted.inertia.value - result.inertia.value) / amplitude
    tolerance = 0.02 * result.inertia.standard_uncertainty
    assert entry.sensitivity * std == pytest.approx(slope * std, rel=0.3, abs=tolerance)
    assert entry.standard_uncertainty == pytest.approx(abs(entry.sensitivity) * std, rel=1e-9)


def test_declared_nonlinearity_is_calibrated():
    # THEORY 4: two motions tell the nonlinearity of the pendulum's encoder from a change of scale.
    plain = encoded(wheel_log(exact_rig(), TWO_TONES, friction, TIME))
    alpha, beta = np.deg2rad(0.1), np.deg2rad(-0.12)
    bent = replace(plain, angle=plain.angle + alpha * np.cos(plain.angle) + beta * np.sin(plain.angle))
    told, untold = identify(bent, NONLINEAR), identify(bent, UNCERTAIN)
    assert abs(untold.inertia.value / INERTIA - 1) > 5e-4
    assert abs(told.inertia.value / INERTIA - 1) < 2e-4
    assert told.inertia.interval95[0] < INERTIA < told.inertia.interval95[1]


LATE = UNCERTAIN.changed({"sensors.latency": "0 ± 0.5 ms"})


@pytest.fixture(scope="module")
def smooth():
    """Viscous friction, eight times the paper's: what a late channel feels of friction shows."""
    return wheel_log(exact_rig(), ONE_TONE, lambda v: 9.152e-3 * v, TIME)


def late_wheel(log, delay):
    rate = CubicSpline(TIME, log.wheel_angle)
    return replace(log, wheel_angle=log.wheel_angle + delay * rate(TIME, 1) + delay**2 / 2 * rate(TIME, 2))


def slope(late, log, delay, rig):
    """Change of the inertia per second of delay."""
    return (identify(late, rig).inertia.value - identify(log, rig).inertia.value) / delay


def test_a_late_wheel(smooth):
    # friction that lags by δ looks like an inertia f δ
    delay = 1e-5
    assert slope(late_wheel(smooth, delay), smooth, delay, UNCERTAIN) == pytest.approx(9.152e-3, rel=1e-2)


def test_a_late_angle_is_an_early_wheel(smooth):
    delay = 1e-5
    late = replace(smooth, angle=ONE_TONE(TIME + delay))
    assert slope(late, smooth, delay, UNCERTAIN) == pytest.approx(-9.152e-3, rel=1e-2)


@pytest.mark.parametrize("channel", ["angle", "wheel"])
def test_a_declared_latency_is_told_by_clean_data(smooth, channel):
    delay = 2e-4
    late = late_wheel(smooth, delay) if channel == "wheel" else replace(smooth, angle=ONE_TONE(TIME + delay))
    told, untold = identify(late, LATE), identify(late, UNCERTAIN)
    assert abs(untold.inertia.value / INERTIA - 1) > 5e-4
    assert told.inertia.value == pytest.approx(INERTIA, rel=2e-5)


@pytest.mark.parametrize("channel", ["angle", "wheel"])
def test_what_encoders_leave_of_a_declared_latency(smooth, channel):
    # Compared by what the entry is for: its part of the whole uncertainty.
    entry = type_b(identify(encoded(smooth), LATE))[f"{channel} latency"]
    delay, std = 5e-4, 5e-4
    late = late_wheel(smooth, delay) if channel == "wheel" else replace(smooth, angle=ONE_TONE(TIME + delay))
    change = slope(encoded(late), encoded(smooth), delay, LATE)
    assert entry.sensitivity * std == pytest.approx(change * std, rel=0.3)
    assert entry.standard_uncertainty == pytest.approx(abs(entry.sensitivity) * std, rel=1e-9)


def test_a_late_free_decay_is_a_free_decay():
    rig = free_rig(**{"sensors.latency": "0 ± 0.5 ms", "sensors.counts_per_turn": 16384})
    result = identify(encoded(free_log(lambda v: 1.144e-3 * v, TIME)), rig)
    assert sum(entry.standard_uncertainty for entry in type_b(result).values()) < 1e-6 * INERTIA


def test_a_log_that_is_late_as_a_whole_tells_the_same(smooth):
    later = replace(smooth, time=TIME + 0.37)
    assert identify(later, exact_rig()).inertia.value == pytest.approx(identify(smooth, exact_rig()).inertia.value)


def test_a_declared_latency_is_taken_off(smooth):
    rate = CubicSpline(TIME, smooth.wheel_angle)
    late = replace(smooth, wheel_angle=rate(TIME + 2e-3))
    rig = exact_rig(**{"sensors.wheel.latency": "2 ms"})
    assert abs(identify(late, exact_rig()).inertia.value / INERTIA - 1) > 5e-3
    assert identify(late, rig).inertia.value == pytest.approx(INERTIA, rel=1e-5)


def test_a_declared_latency_is_taken_off_a_measured_torque():
    log = replace(direct_log(TWO_TONES, lambda v: 9.152e-3 * v, TIME), angle=TWO_TONES(TIME + 2e-3))
    # what such a delay costs: friction that lags by 2 ms
    as_read = identify(without(log, "calibrate"), direct_rig())
    assert as_read.inertia.value == pytest.approx(INERTIA - 9.152e-3 * 2e-3, rel=1e-3)
    declared = identify(log, direct_rig(**{"sensors.latency": "2 ms"}))
    assert declared.inertia.value == pytest.approx(INERTIA, rel=1e-5)


@pytest.mark.parametrize("rate", [1000.0, 200.0])
def test_a_declared_latency_is_taken_off_a_held_torque(tmp_path, rate):
    # The twin reads its encoder at the true instants; 2 ms are 0.4 rows at 200 per second.
    rig = Rig.builtin("paper").changed(
        {
            "drive": {"kind": "direct"},
            "log": {"torque": "tau"},
            "sensors.latency": "2 ms",
            "axis.friction.coulomb": 2e-3,
        }
    )
    time = np.arange(int(15 * rate) + 1) / rate
    run = simulate(rig, duration=15.0, rate=rate, drive=0.12 * np.sin(8.5 * time) + 0.03 * np.sin(5.0 * time))
    told = rig.changed({"axis.inertia": None, "axis.friction": None})
    log = Recording.load(run.save(tmp_path / "late.csv", told), told)
    as_read = identify(without(log, "calibrate"), told.changed({"sensors.latency": 0}))
    assert abs(as_read.inertia.value / INERTIA - 1) > 1e-3
    for method in ("momentum", "energy"):
        result = identify(log, told, method=method)
        assert result.inertia.value == pytest.approx(INERTIA, rel=3e-4 if method == "energy" else 1e-4)
        assert result.status == "ok"


def test_nothing_declared_nothing_of_type_b(log):
    assert type_b(identify(log, Rig.builtin("paper"))) == {}


# scatter and sensors


def test_scatter_counts_where_it_is_more_than_the_sensors_explain():
    assert with_excess(2.0, 2.6, 1.3, 60) == 2.0  # less than Newey and West's sum sees of the noise alone
    assert with_excess(2.0, 2.6, 2.6e4, 60) == pytest.approx(2.6e4, rel=1e-3)  # a misfit: the scatter
    few, many = with_excess(2.0, 2.6, 3.6, 60), with_excess(2.0, 2.6, 3.6, 60_000)
    assert few == pytest.approx(2.0 + 1 / (1 + 2.6**2 * (4 / 3) * 5 / 60))  # it may be by chance
    assert many == pytest.approx(3.0, rel=0.01)
    assert with_excess(0.0, 0.0, 0.0, 60) == 0.0
    both = with_excess(np.array([2.0, 2.0]), np.array([2.6, 2.6]), np.array([1.3, 3.6]), 60)
    np.testing.assert_allclose(both, [2.0, few])


@pytest.mark.long
def test_white_noise_is_told_as_the_sum_over_windows_that_it_is():
    """The standard uncertainty is that of 40 draws of the noise, within the 11 % that 40 draws tell.

    Of friction that is known to have no memory, which noise this large would hide.
    """
    rig = exact_rig()
    exact = wheel_log(rig, ONE_TONE, friction, np.arange(8001) / 1000)
    rng = np.random.default_rng(5)
    values, claimed = [], []
    for _ in range(40):
        noisy = replace(
            exact,
            angle=exact.angle + 1e-3 * rng.standard_normal(len(exact)),
            wheel_angle=exact.wheel_angle + 1e-3 * rng.standard_normal(len(exact)),
        )
        found = identify(noisy, rig, memory="off").inertia
        values.append(found.value)
        claimed.append(found.standard_uncertainty)
    assert np.median(claimed) == pytest.approx(np.std(values, ddof=1), rel=0.3)


def test_the_place_of_a_grid_counts_where_white_noise_does_not():
    """Many steps in a swing: the grid's errors are as good as white, and nothing is counted twice. Few: more."""

    def entry(step):
        log = wheel_log(exact_rig(), ONE_TONE, friction, np.arange(8001) / 1000)
        log = replace(log, angle=step * np.round(log.angle / step), wheel_angle=log.wheel_angle)
        budget = {
            e.source: e.standard_uncertainty for e in identify(log, exact_rig()).budget if e.parameter == "inertia"
        }
        return budget.get("place of the encoder's grid", 0.0) / budget["scatter of the windows and sensor noise"]

    assert entry(1e-4) < 1.0
    assert entry(5e-2) > 1.0


@pytest.mark.parametrize("samples", quick_first(1, [400, 401.3]))
def test_errors_of_an_encoder_that_come_again_are_known(samples):
    """So many rows in a period: where it is a whole number, each period meets the same places of the grid.

    Of friction that is known to have no memory.
    """
    step = 2 * np.pi / 16384
    exact = wheel_log(exact_rig(), ONE_TONE, friction, np.arange(10_000) * 2 * np.pi / 8.5 / samples)
    rng = np.random.default_rng(3)
    errors, claimed = [], []
    for shift in step * (rng.random(24) - 0.5):
        found = identify(
            replace(exact, angle=step * np.round((exact.angle + shift) / step) - shift), exact_rig(), memory="off"
        ).inertia
        errors.append(found.value - INERTIA)
        claimed.append(found.standard_uncertainty)
    assert 0.7 < np.median(claimed) / np.sqrt(np.mean(np.square(errors))) < 2.5


def test_half_a_step_of_an_encoder_is_left_open_in_its_zero():
    """A slow swing leans on gravity, and so on where the body hangs."""
    step = 2 * np.pi / 4096
    exact = wheel_log(exact_rig(), Sines((0.8, 5.5, 0.0), (0.2, 11.0, 1.0)), friction, np.arange(10_000) / 1000)
    scores = []
    for shift in step * (np.arange(16) / 16 - 0.5):
        found = identify(replace(exact, angle=step * np.round((exact.angle + shift) / step)), exact_rig()).inertia
        scores.append((found.value - INERTIA) / found.standard_uncertainty)
    assert 0.4 < np.sqrt(np.mean(np.square(scores))) < 1.1
