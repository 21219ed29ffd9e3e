"""The energy method on logs whose inertia and friction are known in closed form: both variants, all drives."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from closed_form_logs import (
    INERTIA,
    LAWS,
    ONE_TONE,
    SMOOTH_MOTOR,
    TIME,
    TWO_TONES,
    Sines,
    direct_log,
    direct_rig,
    encoded,
    exact_rig,
    filmed_log,
    free_log,
    free_rig,
    motor_log,
)
from long_cases import long, quick_first
from refusals import coded
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.recording.recording import Recording

FOREIGN = {
    "cubic": lambda v: 2e-4 * v + 6e-5 * v**3,
    "Stribeck": lambda v: 2e-4 * v + np.sign(v) * (2e-3 + 2e-3 * np.exp(-((v / 0.3) ** 2))),
    "rising with the square root": lambda v: np.sign(v) * 3e-3 * np.sqrt(np.abs(v)),
}
"""Laws outside of it."""


def error(result):
    return result.inertia.value / INERTIA - 1


def deviation(parameter, truth):
    """In standard uncertainties."""
    return abs(parameter.value - truth) / parameter.standard_uncertainty


# better variant, reaction wheel


@pytest.mark.parametrize("law", ["none", "viscous", "eight times viscous", "quadratic"])
@pytest.mark.parametrize("motion", quick_first(1, [ONE_TONE, TWO_TONES]))
def test_smooth_motion_and_friction_within_the_basis_are_exact(law, motion):
    rig = exact_rig(**SMOOTH_MOTOR)
    result = identify(motor_log(rig, motion, LAWS[law], TIME), rig, "energy")
    assert abs(error(result)) < 2e-6
    assert result.status == "ok"


@pytest.mark.parametrize("law", quick_first(2, LAWS))
def test_a_motor_with_dry_friction_and_dead_zone(law):
    rig = exact_rig()
    result = identify(motor_log(rig, ONE_TONE, LAWS[law], TIME, spin=160.0), rig, "energy")
    assert abs(error(result)) < 3e-4
    assert result.status == "ok"


@pytest.mark.parametrize("law", FOREIGN)
def test_the_inertia_hardly_feels_a_law_that_the_basis_does_not_hold(law):
    rig = exact_rig(**SMOOTH_MOTOR)
    result = identify(motor_log(rig, ONE_TONE, FOREIGN[law], TIME), rig, "energy")
    assert abs(error(result)) < 2e-4


def test_friction_of_the_basis_is_found_with_the_inertia():
    rig = exact_rig(**SMOOTH_MOTOR)
    found = identify(motor_log(rig, TWO_TONES, LAWS["quadratic"], TIME), rig, "energy").parameters
    assert found["viscous"].value == pytest.approx(2e-4, rel=5e-3)
    assert found["quadratic"].value == pytest.approx(3e-4, rel=1e-3)
    assert abs(found["coulomb"].value) < 2e-6
    assert [p.unit for p in found.values()] == ["kg m^2", "N m", "N m s", "N m s^2"]


def test_friction_that_depends_on_the_direction_is_told_apart():
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["direction-dependent"], TIME)
    found = identify(log, rig, "energy").parameters
    assert found["viscous_positive"].value == pytest.approx(1.7e-3, rel=0.01)
    assert found["viscous_negative"].value == pytest.approx(0.6e-3, rel=0.01)
    assert "viscous" not in found


def test_gravity_is_found_from_two_tones_and_refused_from_slow_swings():
    rig = exact_rig(**SMOOTH_MOTOR, **{"axis.gravity_torque": "unknown"})
    found = identify(motor_log(rig, TWO_TONES, LAWS["viscous"], TIME), rig, "energy").parameters
    assert found["gravity_torque"].value == pytest.approx(78e-3, rel=1e-5)
    assert found["inertia"].value == pytest.approx(INERTIA, rel=1e-5)
    slow = encoded(motor_log(rig, Sines((0.3, 2.0, 0.0)), LAWS["viscous"], TIME))
    with pytest.raises(UnanswerableError) as caught:
        identify(slow, rig, "energy")
    assert caught.value.code == "not-identifiable"


@pytest.mark.long
def test_encoders_cost_what_the_uncertainty_says():
    rig, deviations = exact_rig(**SMOOTH_MOTOR), []
    log = motor_log(rig, TWO_TONES, LAWS["Coulomb"], TIME)
    for seed in range(25):
        shift = np.random.default_rng(seed).normal(0, 3e-4, (2, len(TIME)))
        noisy = replace(log, angle=log.angle + shift[0], wheel_angle=log.wheel_angle + shift[1])
        result = identify(noisy, rig, "energy")
        assert abs(error(result)) < 1e-3
        deviations.append(error(result) * INERTIA / result.inertia.standard_uncertainty)
    assert 0.5 < np.sqrt(np.mean(np.square(deviations))) < 1.5


def test_irregular_and_missing_rows():
    rig = exact_rig(**SMOOTH_MOTOR)
    keep = np.random.default_rng(5).random(len(TIME)) > 0.05
    time = TIME + np.random.default_rng(6).uniform(-2e-4, 2e-4, len(TIME))
    assert abs(error(identify(motor_log(rig, ONE_TONE, LAWS["viscous"], time[keep]), rig, "energy"))) < 1e-5


# type B


def sensitivity(result, source):
    (entry,) = [e for e in result.budget if e.source == source and e.parameter == "inertia"]
    return entry.sensitivity


CONSTANTS = {
    "drive.wheel.inertia": 11.34e-5,
    "drive.motor.rotor_inertia": 0.21e-5,
    "drive.motor.gear_ratio": 4.4,
    "drive.motor.torque_per_volt": 52.04e-4,
    "drive.motor.back_emf": 3.697e-6,
    "drive.motor.viscous": 3.687e-5,
    "drive.motor.coulomb": 302.02e-5,
    "drive.motor.efficiency": 0.9,
    "axis.gravity_torque": 78e-3,
}


@pytest.fixture(scope="module")
def uncertain():
    """A log, its rig with every constant uncertain by 0.1 %, and the answer."""
    rig = exact_rig(**{key: {"value": value, "std": 1e-3 * value} for key, value in CONSTANTS.items()})
    log = motor_log(rig, TWO_TONES, LAWS["viscous"], TIME)
    return rig, log, identify(log, rig, "energy")


@pytest.mark.parametrize("key", quick_first(3, CONSTANTS))
def test_sensitivities_are_what_a_second_identification_finds(uncertain, key):
    rig, log, result = uncertain
    step = 2e-4 * CONSTANTS[key]
    up, down = (
        identify(log, rig.changed({key: {"value": CONSTANTS[key] + sign * step, "std": step}}), "energy").inertia.value
        for sign in (1, -1)
    )
    found = (up - down) / (2 * step)
    scale = 1e-4 * INERTIA / CONSTANTS[key]
    assert sensitivity(result, key) == pytest.approx(found, rel=0.01, abs=scale)
    (entry,) = [e for e in result.budget if e.source == key and e.parameter == "inertia"]
    assert entry.shared_id == key
    assert entry.standard_uncertainty == pytest.approx(abs(found) * 1e-3 * CONSTANTS[key], rel=0.01, abs=1e-3 * scale)


@pytest.mark.parametrize(
    ("source", "table", "of_angle", "of_wheel"),
    [
        ("angle encoder nonlinearity (cosine)", "sensors.nonlinearity", np.cos, None),
        long(("angle encoder nonlinearity (sine)", "sensors.nonlinearity", np.sin, None)),
        long(("wheel encoder nonlinearity (cosine)", "sensors.nonlinearity", None, np.cos)),
        ("wheel encoder nonlinearity (sine)", "sensors.nonlinearity", None, np.sin),
    ],
)
def test_sensitivity_to_a_bent_encoder(source, table, of_angle, of_wheel):
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, TWO_TONES, LAWS["viscous"], TIME)
    result = identify(log, rig.changed({table: 1e-3}), "energy")
    size = 3e-4
    values = []
    for sign in (size, -size):
        angle = log.angle + (0.0 if of_angle is None else sign * of_angle(log.angle))
        wheel = log.wheel_angle + (0.0 if of_wheel is None else sign * of_wheel(log.wheel_angle))
        values.append(identify(replace(log, angle=angle, wheel_angle=wheel), rig, "energy").inertia.value)
    found = (values[0] - values[1]) / (2 * size)
    assert sensitivity(result, source) == pytest.approx(found, rel=0.03, abs=1e-3 * INERTIA)


@pytest.mark.parametrize("channel", quick_first(1, ["angle", "wheel"]))
def test_sensitivity_to_a_late_encoder(channel):
    rig = exact_rig(**SMOOTH_MOTOR)
    made = {late: motor_log(rig, TWO_TONES, LAWS["viscous"], late=late) for late in (0.0, 1e-4, -1e-4)}
    log = made[0.0]
    name = "angle" if channel == "angle" else "wheel_angle"
    up, down = (
        identify(replace(log, **{name: getattr(made[late], name)}), rig, "energy").inertia.value
        for late in (1e-4, -1e-4)
    )
    stated = {"sensors.latency": {"value": 0.0, "std": 1e-4}}
    result = identify(log, rig.changed(stated), "energy")
    assert sensitivity(result, f"{channel} latency") == pytest.approx((up - down) / 2e-4, rel=0.03)


def test_a_declared_latency_is_taken_off():
    rig = exact_rig(**SMOOTH_MOTOR)
    late = motor_log(rig, TWO_TONES, LAWS["viscous"], late=2e-3)
    log = replace(motor_log(rig, TWO_TONES, LAWS["viscous"], TIME), angle=late.angle, wheel_angle=late.wheel_angle)
    assert abs(error(identify(log, rig, "energy"))) > 1e-3
    assert abs(error(identify(log, rig.changed({"sensors.latency": 2e-3}), "energy"))) < 2e-5


def test_the_note_says_how_hard_the_answer_leans_on_the_motor(uncertain):
    _, log, result = uncertain
    share = sensitivity(result, "drive.motor.torque_per_volt") * CONSTANTS["drive.motor.torque_per_volt"] / INERTIA
    assert share > 3
    (note,) = [note.message for note in result.notes if note.code == "leans-on-the-motor"]
    assert f"drive.motor.torque_per_volt by {share:+.2g} %" in note
    exact = identify(log, exact_rig(), "energy")
    (note,) = [note.message for note in exact.notes if note.code == "exact-constants"]
    assert all(key in note for key in CONSTANTS)


# direct drive and free decay


@pytest.mark.parametrize("linear", quick_first(1, [False, True]))
@pytest.mark.parametrize("law", LAWS)
def test_direct_drive(linear, law):
    log = direct_log(TWO_TONES, LAWS[law], TIME, b=0.0 if linear else 78e-3)
    result = identify(log, direct_rig(linear), "energy")
    assert abs(error(result)) < 1e-4
    assert result.inertia.unit == ("kg" if linear else "kg m^2")
    assert result.status == "ok"


def held_log() -> Recording:
    """A free, frictionless mass under a torque that is constant from row to row: speed and angle by hand."""
    time = np.arange(4001) / 100
    torque = 0.1 * np.sin(2 * time + 0.4)
    speed = np.concatenate([[0.0], np.cumsum(torque[:-1] * 0.01)]) / INERTIA
    angle = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * 0.01)])
    return Recording(time=time, angle=angle - np.polyval(np.polyfit(time, angle, 1), time), torque=torque)


HALF_A_ROW_LATE = -INERTIA * 2.0**2 * 0.005
"""Viscous friction that a torque seems to overcome which acts half a row (5 ms) later than it is taken to."""


def test_a_held_torque_is_taken_as_held():
    log = held_log()
    held = identify(log, direct_rig(True), "energy")
    assert abs(error(held)) < 1e-4
    assert abs(held.parameters["viscous"].value) < 0.01 * abs(HALF_A_ROW_LATE)
    measured = identify(replace(log, drive_held=False), direct_rig(True), "energy")
    assert measured.parameters["viscous"].value == pytest.approx(HALF_A_ROW_LATE, rel=0.02)


@pytest.mark.parametrize("law", ["none", "viscous", "quadratic"])
def test_free_decay_scales_with_gravity(law):
    log = free_log(LAWS[law], TIME)
    result = identify(log, free_rig(), "energy")
    assert abs(error(result)) < 2e-5
    double = identify(log, free_rig(**{"axis.gravity_torque": 0.156}), "energy")
    assert double.inertia.value == pytest.approx(2 * result.inertia.value, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_the_speeds_does_not_attenuate_a_free_decay(seed):
    result = identify(filmed_log(LAWS["viscous"], (3.0, 12.0), seed), free_rig(), "energy")
    assert "instruments" in {note.code for note in result.notes}  # least squares is 12 to 15 % low
    assert abs(error(result)) < 0.05
    low, high = result.inertia.interval95
    assert low <= INERTIA <= high


def test_free_decay_without_gravity_torque_has_no_scale():
    with pytest.raises(UnanswerableError) as caught:
        identify(free_log(LAWS["viscous"], TIME), free_rig(**{"axis.gravity_torque": 0.0}), "energy")
    assert caught.value.code == "no-scale"


# printed variant


def test_printed_formulas_are_exact_where_both_passes_lose_the_same():
    """Without friction B1 = B2 = 0; with it, a symmetric motion makes them equal."""
    rig = exact_rig(**SMOOTH_MOTOR)
    for law, friction in (("none", 0.0), ("viscous", 1.144e-3)):
        result = identify(motor_log(rig, ONE_TONE, LAWS[law], TIME), rig, "energy", variant="printed")
        assert abs(error(result)) < 1e-5
        assert result.parameters["viscous"].value == pytest.approx(friction, abs=1e-6)
        assert len(result.details.swings.values) == len(result.details.turning_times) - 2


def test_printed_formulas_take_the_nodes_given():
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["viscous"], TIME)
    top = np.pi / 2 / 8.5 + 2 * np.pi / 8.5 * np.array([2, 3])
    nodes = [tuple(t + np.array([-0.17, -0.02, 0.02, 0.17])) for t in top]
    both = identify(log, rig, "energy", variant="printed", nodes=nodes)
    assert abs(error(both)) < 1e-5
    assert both.parameters["viscous"].value == pytest.approx(1.144e-3, rel=1e-4)
    one = identify(log, rig, "energy", variant="printed", nodes=nodes[0])
    assert one.inertia.value == pytest.approx(both.details.swings.values[0], rel=1e-12)
    assert one.inertia.standard_uncertainty is None
    assert any(note.code == "no-uncertainty-inertia" for note in one.notes)
    assert one.provenance["options"]["nodes"] == [pytest.approx(nodes[0])]


def test_passes_from_turning_point_to_turning_point_are_refused():
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["viscous"], TIME)
    turn = np.pi / 2 / 8.5
    nodes = tuple(turn + np.pi / 8.5 * np.array([6, 7, 7.001, 8.001]))
    with pytest.raises(UnanswerableError) as caught:
        identify(log, rig, "energy", variant="printed", nodes=nodes)
    assert caught.value.code == "singular-passes"


def test_the_trapezoid_takes_a_held_torque_half_a_row_late():
    log = held_log()
    held = identify(log, direct_rig(True), "energy", variant="printed")
    sampled = identify(log, direct_rig(True), "energy", variant="printed", work="trapezoid")
    assert abs(error(held)) < 1e-4
    assert sampled.parameters["viscous"].value - held.parameters["viscous"].value == pytest.approx(
        HALF_A_ROW_LATE, rel=0.05
    )
    assert any(note.code == "trapezoid-work" for note in sampled.notes)


# options, missing channels, wrong signs


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"variant": "best"}, "no-variant"),
        ({"variant": "printed", "work": "simpson"}, "no-work-rule"),
        ({"nodes": (1.0, 2.0, 3.0, 4.0)}, "printed-only"),
        ({"variant": "printed", "nodes": (1.0, 2.0, 3.0)}, "bad-nodes"),
        ({"variant": "printed", "nodes": "late"}, "bad-nodes"),
        ({"variant": "printed", "nodes": (1.0, 3.0, 2.0, 4.0)}, "bad-nodes"),
        ({"variant": "printed", "nodes": (1.0, 2.0, 3.0, 40.0)}, "bad-nodes"),
    ],
)
def test_options_that_do_not_exist(options, code):
    rig = exact_rig(**SMOOTH_MOTOR)
    with pytest.raises(UsageError) as caught:
        identify(motor_log(rig, ONE_TONE, LAWS["viscous"], TIME), rig, "energy", **options)
    assert caught.value.code == code


def test_what_the_motor_needs_is_asked_for():
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["viscous"], TIME)
    with pytest.raises(InputError, check=coded("missing-voltage", "momentum")):
        identify(replace(log, voltage=None), rig, "energy")
    with pytest.raises(UnanswerableError, match=r"torque_per_volt.*momentum") as unknown:
        identify(log, rig.changed({"drive.motor.torque_per_volt": None}), "energy")
    assert unknown.value.code == "no-motor-constants"


@pytest.mark.parametrize("channel", ["wheel_angle", "voltage"])
def test_wrong_signs_are_named(channel):
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["viscous"], TIME)
    with pytest.raises(InputError, match=f"{channel}.*wrong sign") as caught:
        identify(replace(log, **{channel: -getattr(log, channel)}), rig, "energy")
    assert caught.value.code == "wrong-sign"


@pytest.mark.parametrize("variant", ["better", "printed"])
def test_motor_constants_that_are_off_are_a_warning(variant):
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["viscous"], TIME)
    off = identify(log, rig.changed({"drive.motor.torque_per_volt": 1.01 * 52.04e-4}), "energy", variant=variant)
    assert abs(error(off)) > 0.03
    assert off.status == "warning"
    assert "disagrees-with-momentum" in [warning.code for warning in off.warnings]


def test_too_few_swings_are_refused():
    rig = exact_rig(**SMOOTH_MOTOR)
    log = motor_log(rig, ONE_TONE, LAWS["viscous"], TIME).segment(0.0, 1.6)
    with pytest.raises(UnanswerableError) as caught:
        identify(log, rig, "energy")
    assert caught.value.code == "too-short"


# the result


@pytest.mark.parametrize("variant", ["better", "printed"])
def test_result_as_json_and_text(uncertain, variant):
    rig, log, _ = uncertain
    result = identify(log, rig, "energy", variant=variant)
    data = json.loads(result.to_json())
    assert data["method"] == "energy"
    assert data["provenance"]["options"]["variant"] == variant
    assert data["parameters"]["inertia"]["value"] == result.inertia.value
    assert {entry["type"] for entry in data["budget"]} == {"A", "B"}
    assert "inertia:" in result.summary()
    squares = sum(e.standard_uncertainty**2 for e in result.budget if e.parameter == "inertia")
    assert result.inertia.standard_uncertainty == pytest.approx(np.sqrt(squares))
    low, high = result.inertia.interval95
    assert low < result.inertia.value < high
