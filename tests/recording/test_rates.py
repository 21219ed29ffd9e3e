"""Logs with the rate of the axis (gyroscope) in the place of its angle, or beside it.

The twin's gyroscope has 16 bits over ±2000°/s, noise of 0.05°/s at 200 rows per second and a bias of some 0.5°/s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from long_cases import quick_first
from refusals import coded
from swingid.errors import InputError, UnanswerableError
from swingid.numerics.test_functions import SLOPE_POWER, neighbour_overlaps, rate_overlaps
from swingid.preparation.rate import Level, levelled, spins
from swingid.recording.rate_checks import saturated
from swingid.recording.rates import integral, rate_of
from swingid.units import Quantity

J, B = 0.01, 0.5
GYRO = """
name = "gyro"
[axis]
gravity_torque = 0.5
inertia = 0.01
model_uncertainty = 0
tilt = 0
friction = {viscous = 4e-4, coulomb = 3e-4}
[drive]
kind = "none"
[sensors.angle_speed]
noise = "0.05 deg/s"
resolution = "0.0610352 deg/s"
bias = "0 ± 0.5 deg/s"
[log]
angle_speed = "gz"
clock = "0 ± 0 ppm"
"""


def rig(kind: str = "none", **keys: object) -> sw.Rig:
    text = GYRO.replace('"none"', f'"{kind}"')
    return sw.Rig.from_text(text).changed({key.replace("__", "."): value for key, value in keys.items()})


def run(kind: str = "none", seed: int = 1, duration: float = 30.0, **keys: object) -> tuple[sw.Recording, sw.Rig]:
    own, t = rig(kind, **keys), np.arange(int(duration * 200) + 1) / 200
    if kind == "direct":
        torque = 0.15 * np.sin(9.3 * t + 1) + 0.1 * np.sin(13 * t)
        return sw.simulate(own, duration=duration, rate=200, seed=seed, drive=torque), own
    return sw.simulate(own, duration=duration, rate=200, seed=seed, initial_angle=0.6), own


@pytest.mark.parametrize("rate_is", ["instant", "mean", "held"])
def test_an_integral_gives_the_angle_of_its_rate(rate_is):
    t = np.sort(np.random.default_rng(1).uniform(0, 5, 2000))
    q = 0.7 * np.sin(6 * t) + 0.2
    rate = 4.2 * np.cos(6 * t) if rate_is == "instant" else rate_of(t, q, rate_is)
    assert integral(t, rate, rate_is) == pytest.approx(q - q[0], abs=1e-5 if rate_is == "instant" else 1e-12)
    assert integral(t, rate_of(t, q, rate_is), rate_is) == pytest.approx(q - q[0], abs=1e-5)


def test_noise_of_a_rate_in_a_window_is_that_of_its_modulated_integral():
    """∫φ'² of one window, and −∫φ''φ of overlapping ones: by quadrature on a fine grid."""
    s = np.linspace(-1, 3, 40001)

    def slope(at):
        return np.where(np.abs(s - at) < 1, -6 * (s - at) * (1 - (s - at) ** 2) ** 2, 0.0)

    both = np.trapezoid((2 * slope(0.0) - slope(0.6)) ** 2, s)
    assert np.trapezoid(slope(0.0) ** 2, s) == pytest.approx(SLOPE_POWER, rel=1e-6)
    found, _ = rate_overlaps(np.array([2.0, -1.0]), neighbour_overlaps(np.array([0.0, 0.6]), np.ones(2), 8), 4)
    assert found == pytest.approx(both, rel=1e-5)


def test_the_parts_of_a_random_walk_have_its_variance():
    level = Level(Quantity(0.0), 0.0, 20.0, 0.0, 0.0, walk=0.3, parts=4000)
    for t in (5.0, 20.0):
        parts = level.unknowns(np.array([t])).values()
        variance = sum(float((one.std * one.shape[0]) ** 2) for one in parts)
        assert variance == pytest.approx(0.3**2 * t, rel=1e-2)


@pytest.mark.parametrize("kind", quick_first(1, ["none", "direct"]))
@pytest.mark.parametrize("rate_is", quick_first(1, ["instant", "mean", "held"]))
def test_inertia_friction_and_bias_from_a_gyroscope(kind, rate_is):
    log, own = run(kind, log__angle_speed_is=rate_is)
    result = sw.identify(log, own)
    assert result.inertia.value == pytest.approx(J, rel=1e-4)  # 0.1 % is asked
    assert result.inertia.interval95[0] < J < result.inertia.interval95[1]
    assert result.inertia.standard_uncertainty < 1e-4 * J
    bias, true = result.parameters["angle_speed_bias"], log.metadata["truth"]["angle_speed_bias"]
    assert abs(bias.value - true) < 4 * bias.standard_uncertainty
    assert bias.standard_uncertainty < 3e-4  # of the bias of 9e-3 rad/s that the rig file allows
    assert not [w.code for w in result.warnings]


def test_a_reaction_wheel_with_a_gyroscope_on_the_axis_is_answered() -> None:
    """An encoder's nonlinearity that is looked for where none is stated is none of an angle that no encoder read."""
    text = """
[axis]
gravity_torque = 78e-3
[drive]
kind = "reaction-wheel"
wheel = {inertia = 11.34e-5}
[drive.motor]
rotor_inertia = 0.21e-5
gear_ratio = 4.4
torque_per_volt = 52.04e-4
back_emf = 3.697e-6
viscous = 3.687e-5
coulomb = 302.02e-5
voltage_limit = 10
[sensors]
angle_speed = {noise = "0.05 deg/s", bias = "0 ± 0.5 deg/s"}
[sensors.wheel]
counts_per_turn = 16384
[log]
angle_speed = "gz"
wheel_angle = "q2"
voltage = "u"
"""
    told = sw.Rig.from_text(text, "gyro-wheel.toml")
    twin = told.changed({"axis.inertia": 3.022e-3, "axis.friction.coulomb": 3e-3, "axis.friction.viscous": 5e-4})
    motion = sw.parse_reference("multisine 0.5 rad 8.5 rad/s + 0.4 rad 5.3 rad/s 1 rad")
    result = sw.identify(sw.simulate(twin, motion, duration=15.0, seed=1), told)
    inertia = result.parameters["inertia"]
    assert inertia.standard_uncertainty is not None
    assert inertia.standard_uncertainty < 1e-3 * inertia.value
    assert abs(inertia.value - 3.022e-3) < 3 * inertia.standard_uncertainty


@pytest.mark.parametrize("method", ["equation-error", "energy", "output-error"])
def test_other_methods_get_the_angle_at_its_level(method):
    log, own = run("direct", duration=20.0)
    inertia = sw.identify(log, own, method=method).inertia
    assert inertia.value == pytest.approx(J, rel=2e-4)
    assert inertia.interval95[0] < J < inertia.interval95[1]


def test_a_file_with_a_rate_reads_and_saves_as_its_recording(tmp_path):
    log, own = run(duration=10.0)
    path = log.save(tmp_path / "log.csv", own)
    again = sw.Recording.load(path, own)
    assert again.angle_speed == pytest.approx(log.angle_speed)
    assert again.angle == pytest.approx(log.angle, abs=1e-9)
    assert "angle" not in path.read_text().splitlines()[1]
    assert sw.identify(again, own).inertia.value == pytest.approx(J, rel=1e-4)


def test_scale_of_a_gyroscope_reaches_the_budget():
    log, own = run("direct", axis__gravity_torque=0)
    result = sw.identify(log, own.changed({"log.angle_speed_scale": "1 ± 0.01"}))
    share = {e.source: e.sensitivity for e in result.budget if e.parameter == "inertia"}
    assert share["log.angle_speed_scale"] / result.inertia.value == pytest.approx(-1.0, abs=1e-3)
    degrees = own.changed({"log.angle_speed_unit": "deg/s"})
    columns = {"t": log.time, "gz": np.degrees(log.angle_speed), "tau": log.torque}
    assert sw.Recording.from_columns(columns, degrees).angle_speed == pytest.approx(log.angle_speed)


def test_a_spring_needs_no_gravity():
    log, own = run(axis__gravity_torque=0, axis__stiffness=0.5, duration=20.0)
    result = sw.identify(log, own)
    assert result.inertia.value == pytest.approx(J, rel=1e-4)
    assert result.inertia.interval95[0] < J < result.inertia.interval95[1]


def test_a_rate_beside_an_angle_is_used_where_it_is_better():
    coarse, own = run(log__angle="q1", sensors__noise=5e-3)
    result = sw.identify(coarse, own)
    plain = sw.identify(
        replace(coarse, angle_speed=None), own.changed({"log.angle_speed": None, "sensors.angle_speed": None})
    )
    assert result.inertia.interval95[0] < J < result.inertia.interval95[1]
    assert result.inertia.standard_uncertainty < 0.5 * plain.inertia.standard_uncertainty
    fine, own = run(log__angle="q1", sensors__noise=1e-6)
    assert sw.identify(fine, own).inertia.standard_uncertainty < 0.5 * result.inertia.standard_uncertainty


def test_a_rate_that_is_not_that_of_the_angle_is_refused():
    log, own = run(log__angle="q1", sensors__noise=1e-4, duration=10.0)
    columns = {"t": log.time, "q1": log.angle, "gz": np.degrees(log.angle_speed)}
    with pytest.raises(InputError, match="angle_speed_unit") as problem:
        sw.Recording.from_columns(columns, own)
    assert problem.value.code == "rate-conflict"


def test_a_saturated_gyroscope_is_detected_and_what_follows_is_used():
    log, own = run(duration=40.0)
    peak = float(np.max(np.abs(log.angle_speed)))
    columns = {"t": log.time, "gz": np.clip(log.angle_speed, -0.6 * peak, 0.6 * peak)}
    cut = sw.Recording.from_columns(columns, own)
    finding = next(one for one in cut.findings if one.code == "saturated-rate")
    assert finding.level == "warning"
    assert np.max(np.abs(cut.angle_speed)) < 0.6 * peak
    assert sw.identify(cut, own).inertia.value == pytest.approx(J, rel=1e-3)
    with pytest.raises(InputError, check=coded("saturated-rate")):
        sw.Recording.from_columns({"t": log.time, "gz": np.clip(log.angle_speed, -0.05, 0.05)}, own)


def test_a_spinning_body_keeps_its_speed():
    """A coast-down turns in one direction: its mean speed is no bias, which is taken as stated."""
    t = np.arange(2001) / 100
    own = rig(axis__gravity_torque=0)
    log = sw.Recording.from_columns({"t": t, "gz": 20 * np.exp(-t / 40)}, own)
    levelled_log, level = levelled(log, own)
    assert level is None
    assert levelled_log.angle == pytest.approx(800 * (1 - np.exp(-t / 40)), abs=1e-4)


@pytest.mark.parametrize("resolution", ["0.06 deg/s", "1 deg/s", "4 deg/s"])
def test_the_coarse_top_of_a_rate_is_no_saturation(resolution):
    log, _ = run(duration=20.0, sensors__angle_speed__resolution=resolution, sensors__angle_speed__noise=0)
    assert len(saturated(np.array(log.angle_speed))) == 0


@pytest.mark.parametrize("method", ["backstepping"])
def test_what_cannot_use_a_rate_refuses_it_by_name(method):
    log, own = run("direct", duration=10.0)
    with pytest.raises(UnanswerableError, check=coded("rate-alone", "log.angle_speed")):
        sw.identify(log, own, method=method)
    with pytest.raises(UnanswerableError, check=coded("rate-alone")):
        next(sw.online(log, own))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"log__angle_zero": 0.1}, "log.angle_zero belongs to a column of the angle, and angle_speed is a rate"),
        ({"log__angle_speed": None}, "sensors.angle_speed is given, but log.angle_speed names no column"),
        ({"sensors__noise": 1e-3}, "that of the rate is sensors.angle_speed.noise"),
        ({"log__angle_speed_unit": "m/s"}, "log.angle_speed_unit is 'm/s', but axis.kind is 'rotary'"),
        ({"log__angle_speed_unit": "counts/s"}, "sensors.counts_per_turn is missing"),
        ({"log__angle_speed": "t"}, "log.time is 't', which is also the column of log.angle_speed"),
    ],
)
def test_contradictions_of_a_rate_are_named(keys, says):
    with pytest.raises(InputError) as problem:
        rig(**keys)
    assert says in str(problem.value)


@pytest.mark.parametrize("drawn", quick_first(1, [{}, {"axis__gravity_torque": 0, "axis__stiffness": 0.5}]))
def test_a_bias_larger_than_the_swings_is_no_rotation(drawn):
    """As of a gyroscope in volts, about 1.36 V (browser-fork-gyro of benchmarks/strangers)."""
    log, own = run(**drawn)
    own = own.changed({"sensors.angle_speed.bias": None})
    result = sw.identify(replace(log, angle_speed=log.angle_speed + 20.0), own)
    plain = sw.identify(log, own)
    assert result.inertia.value == pytest.approx(plain.inertia.value, rel=1e-6)
    assert result.parameters["angle_speed_bias"].value == pytest.approx(20, abs=0.02)


def test_a_body_that_turns_over_spins():
    own = rig(axis__friction__coulomb=0, axis__friction__viscous=0)
    log = sw.simulate(own, duration=30.0, rate=200, seed=1, initial_speed=40.0)
    assert spins(log.angle_speed, own)
    slowed = sw.simulate(rig(), duration=6.0, rate=200, seed=1, initial_speed=40.0)
    assert spins(slowed.angle_speed, own)


def test_a_coast_down_that_rests_at_its_end_spins():
    free = rig(axis__gravity_torque=0)
    log = sw.simulate(free, duration=30.0, rate=200, seed=1, initial_speed=0.5)
    log = replace(log, angle_speed=log.angle_speed - log.metadata["truth"]["angle_speed_bias"])
    at_rest = np.abs(log.angle_speed) < 0.01
    assert np.mean(at_rest) > 0.1
    found = sw.identify(log, free).parameters["coulomb/inertia"]
    assert found.interval95[0] < 3e-4 / J < found.interval95[1]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["none", "direct"])
def test_intervals_from_a_gyroscope_cover(kind):
    inside = bias_inside = 0
    for seed in range(100):
        log, own = run(kind, seed)
        result = sw.identify(log, own)
        inside += result.inertia.interval95[0] < J < result.inertia.interval95[1]
        bias = result.parameters["angle_speed_bias"].interval95
        bias_inside += bias[0] < log.metadata["truth"]["angle_speed_bias"] < bias[1]
    assert inside >= 91  # 95 ± 2.2
    assert bias_inside >= 85


def test_a_result_of_a_rate_predicts_another_log():
    """Its bias is the sensor's of that log, and no term of the model."""
    first, own = run(seed=1)
    other, _ = run(seed=2)
    result = sw.identify(first, own)
    assert "angle_speed_bias" in result.parameters
    found = sw.validate(result, other, own)
    assert found.predictions[0].free_fit > 95
