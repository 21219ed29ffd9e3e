"""The momentum method on logs whose inertia, gravity torque and friction are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from closed_form_logs import (
    ENCODER,
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
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from twin_logs import without

TIME = np.arange(20_001) / 1000
PAPER = Rig.builtin("paper")

LAWS = {
    "none": lambda v: 0.0 * v,
    "viscous": lambda v: 1.144e-3 * v,
    "eight times viscous": lambda v: 9.152e-3 * v,
    "Coulomb": lambda v: 5e-4 * v + 3e-3 * np.sign(v),
    "quadratic": lambda v: 2e-4 * v + 3e-4 * v * np.abs(v),
    "direction-dependent": lambda v: np.where(v > 0, 1.7e-3, 0.6e-3) * v,
    "dry, direction-dependent": lambda v: np.where(v > 0, 1.7e-3 * v + 3e-3, 0.6e-3 * v - 2e-3),
    "offset": lambda v: 1e-3 * v + 2e-3,
}
"""Laws within the basis of the fit."""

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


# reaction wheel


@pytest.mark.parametrize("motion", quick_first(1, [ONE_TONE, TWO_TONES]), ids=["one tone", "two tones"])
@pytest.mark.parametrize("law", LAWS)
def test_inertia_from_perfect_angles(law, motion):
    result = identify(wheel_log(exact_rig(), motion, LAWS[law], TIME), exact_rig())
    assert abs(error(result)) < 1e-6
    assert result.status == "ok"


@pytest.mark.parametrize("law", [*LAWS, *FOREIGN])
def test_inertia_from_encoders(law):
    result = identify(encoded(wheel_log(exact_rig(), TWO_TONES, (LAWS | FOREIGN)[law], TIME)), PAPER)
    assert abs(error(result)) < 5e-5
    assert deviation(result.inertia, INERTIA) < 3
    assert result.inertia.standard_uncertainty < 2e-4 * INERTIA
    assert result.status == "ok"
    assert result.warnings == ()


def test_a_wheel_that_runs_away_and_a_bias_of_its_angle_do_not_matter():
    log = wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], TIME)
    moved = replace(log, wheel_angle=log.wheel_angle - 500.0 + 40.0 * TIME)
    assert identify(moved, exact_rig()).inertia.value == pytest.approx(INERTIA, rel=1e-7)


def test_a_balanced_pendulum():
    rig = exact_rig(**{"axis.gravity_torque": 0})
    result = identify(wheel_log(rig, Sines((0.8, 2.0, 0.0)), LAWS["viscous"], TIME), rig)
    assert abs(error(result)) < 1e-6
    assert result.status == "ok"


@pytest.mark.parametrize("law", ["viscous", "Coulomb", "offset"])
def test_two_tones_tell_inertia_and_gravity_apart(law):
    rig = exact_rig(**{"axis.gravity_torque": "unknown"})
    log = wheel_log(rig, TWO_TONES, LAWS[law], TIME)
    result = identify(log, rig)
    assert abs(error(result)) < 1e-6
    assert result.parameters["gravity_torque"].value == pytest.approx(78e-3, rel=1e-6)
    assert result.parameters["gravity_torque"].unit == "N m"
    read = identify(encoded(log), PAPER.changed({"axis.gravity_torque": "unknown"}))
    assert abs(error(read)) < 5e-5
    assert deviation(read.inertia, INERTIA) < 3
    assert deviation(read.parameters["gravity_torque"], 78e-3) < 3
    assert read.status == "ok"


# friction


def test_friction_within_its_uncertainty():
    def read(law):
        return identify(encoded(wheel_log(exact_rig(), TWO_TONES, LAWS[law], TIME)), PAPER).parameters

    found = read("viscous")
    assert set(found) == {"inertia", "viscous"}
    assert found["viscous"].value == pytest.approx(1.144e-3, rel=1e-3)
    found = read("Coulomb")
    assert set(found) == {"inertia", "coulomb", "viscous"}
    assert found["coulomb"].value == pytest.approx(3e-3, rel=2e-3)
    assert found["viscous"].value == pytest.approx(5e-4, rel=2e-3)
    found = read("quadratic")
    assert set(found) == {"inertia", "viscous", "quadratic"}
    assert found["viscous"].value == pytest.approx(2e-4, rel=2e-2)
    assert found["quadratic"].value == pytest.approx(3e-4, rel=2e-3)
    found = read("offset")
    assert found["offset"].value == pytest.approx(2e-3, rel=1e-3)
    assert {found[name].unit for name in ("offset", "viscous")} == {"N m", "N m s"}


def test_cubic_friction_is_reported():
    found = identify(encoded(wheel_log(exact_rig(), TWO_TONES, FOREIGN["cubic"], TIME)), PAPER).parameters
    assert set(found) == {"inertia", "viscous", "cubic"}
    assert found["cubic"].value == pytest.approx(6e-5, rel=5e-3)
    assert found["cubic"].unit == "N m s^3"


def test_friction_that_depends_on_the_direction_is_reported_by_direction():
    found = identify(encoded(wheel_log(exact_rig(), ONE_TONE, LAWS["dry, direction-dependent"], TIME)), PAPER)
    expected = {
        "viscous_positive": 1.7e-3,
        "viscous_negative": 0.6e-3,
        "coulomb_positive": 3e-3,
        "coulomb_negative": 2e-3,
    }
    assert set(found.parameters) == {"inertia", *expected}
    for name, value in expected.items():
        assert found.parameters[name].value == pytest.approx(value, rel=2e-2)
    assert found.details.friction.law == "coulomb + viscous, direction-dependent"


# other drives and axes


@pytest.mark.parametrize("law", LAWS)
def test_direct_drive(law):
    result = identify(direct_log(TWO_TONES, LAWS[law], TIME), direct_rig())
    # A sampled torque that jumps with dry friction is continued by a spline, which rings for some samples.
    assert abs(error(result)) < (2e-5 if "dry" in law or law == "Coulomb" else 1e-6)
    assert result.status == "ok"


def test_direct_drive_with_unknown_gravity():
    result = identify(direct_log(TWO_TONES, LAWS["viscous"], TIME), direct_rig(**{"axis.gravity_torque": "unknown"}))
    assert abs(error(result)) < 1e-6
    assert result.parameters["gravity_torque"].value == pytest.approx(78e-3, rel=1e-6)


def held_force_log(mass, viscous, rate, duration=20.0):
    """A linear axis under a force that is held from row to row: each step is solved exactly."""
    h, rows = 1 / rate, int(duration * rate)
    time = np.arange(rows) * h
    force = 60 * np.sin(2 * np.pi * 0.3 * time) + 40 * np.sin(2 * np.pi * 0.71 * time + 1)
    decay = np.exp(-viscous / mass * h)
    position, speed = np.zeros(rows), 0.0
    for k in range(rows - 1):
        last = force[k] / viscous
        position[k + 1] = position[k] + last * h + (speed - last) * (1 - decay) * mass / viscous
        speed = last + (speed - last) * decay
    return Recording(time=time, angle=position, torque=force, drive_held=True)


def test_a_held_force_on_a_linear_axis():
    rig = direct_rig(linear=True)
    result = identify(held_force_log(95.0, 200.0, 100.0), rig)
    assert result.inertia.value == pytest.approx(95.0, rel=1e-6)
    assert result.inertia.unit == "kg"
    assert result.parameters["viscous"].value == pytest.approx(200.0, rel=1e-3)
    assert result.parameters["viscous"].unit == "N s/m"
    measured = replace(held_force_log(95.0, 200.0, 100.0), drive_held=False)  # half a row late, then
    assert abs(identify(without(measured, "calibrate"), rig).inertia.value / 95.0 - 1) > 5e-3
    assert identify(measured, rig).inertia.value == pytest.approx(95.0, rel=1e-4)


def test_dry_friction_of_a_linear_axis():
    motion = Sines((0.12, 1.9, 0.0), (0.05, 4.5, 1.0))
    log = direct_log(motion, lambda v: 200 * v + 20 * np.sign(v) - 3, TIME, inertia=95.0, b=0.0)
    found = identify(log, direct_rig(linear=True)).parameters
    # the force jumps between two samples, which tell the instant to a millisecond
    assert found["inertia"].value == pytest.approx(95.0, rel=2e-4)
    expected = {"viscous": 200.0, "coulomb": 20.0, "offset": -3.0}
    for name, value in expected.items():
        assert found[name].value == pytest.approx(value, rel=2e-3)


@pytest.mark.parametrize("quadratic", [0.0, 3e-5])
def test_free_decay(quadratic):
    log = free_log(lambda v: 2e-4 * v + quadratic * v * np.abs(v), TIME)
    result = identify(log, free_rig())
    assert abs(error(result)) < 1e-6
    assert [note.code for note in result.notes].count("scale-from-gravity") == 1
    read = identify(encoded(log), free_rig(**{"sensors.counts_per_turn": 16384}))
    assert abs(error(read)) < 2e-5
    assert deviation(read.inertia, INERTIA) < 3
    assert read.parameters["viscous"].value == pytest.approx(2e-4, rel=5e-3)
    assert ("quadratic" in read.parameters) == (quadratic > 0)


def test_free_decay_scales_with_gravity():
    log = free_log(LAWS["viscous"], TIME)
    once, twice = (identify(log, free_rig(**{"axis.gravity_torque": b})) for b in (78e-3, 156e-3))
    assert twice.inertia.value == pytest.approx(2 * once.inertia.value, rel=1e-9)
    assert twice.parameters["viscous"].value == pytest.approx(2 * once.parameters["viscous"].value, rel=1e-6)


# what a log may look like


def test_irregular_stamps_and_missing_rows():
    rng = np.random.default_rng(11)
    time = np.sort(TIME + rng.uniform(-4e-4, 4e-4, len(TIME)))[rng.random(len(TIME)) > 0.05]
    result = identify(wheel_log(exact_rig(), TWO_TONES, LAWS["Coulomb"], time), exact_rig())
    assert abs(error(result)) < 1e-6
    read = identify(encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["Coulomb"], time)), PAPER)
    assert abs(error(read)) < 5e-5
    assert read.status == "ok"


def test_a_gap_in_the_log():
    time = TIME[(TIME < 7.0) | (TIME > 7.8)]
    result = identify(encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], time)), PAPER)
    assert abs(error(result)) < 5e-5
    assert deviation(result.inertia, INERTIA) < 3


@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_slow_logs(rate):
    time = np.arange(int(20 * rate)) / rate
    result = identify(encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], time)), PAPER)
    assert abs(error(result)) < 3e-4
    assert deviation(result.inertia, INERTIA) < 3


CONVENTIONS = {
    "counts": {
        "log.angle_unit": "counts",
        "log.wheel_angle_unit": "counts",
        "log.angle_sign": -1,
        "log.wheel_angle_sign": -1,
    },
    "degrees from the top": {"log.angle_unit": "deg", "log.wheel_angle_unit": "turns", "log.angle_zero": "up"},
    "absolute wheel, geared encoder": {"log.wheel_angle_is": "absolute", "log.wheel_scale": 0.25},
}


@pytest.mark.parametrize("conventions", CONVENTIONS)
@pytest.mark.parametrize("suffix", quick_first(1, ["csv", "parquet"]))
def test_the_conventions_of_a_log_do_not_matter(tmp_path, conventions, suffix):
    rig = PAPER.changed(CONVENTIONS[conventions])
    log = encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], TIME))
    if conventions.startswith("counts"):
        log = replace(log, angle=ENCODER * np.rint(log.angle / ENCODER))
    path = log.save(tmp_path / f"log.{suffix}", rig)
    result = identify(Recording.load(path, rig), rig)
    assert result.inertia.value == pytest.approx(identify(log, PAPER).inertia.value, rel=1e-5)
    assert abs(error(result)) < 5e-5


# the result


def test_the_result_as_data():
    data = identify(encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], TIME)), PAPER).to_dict()
    keys = {"schema", "method", "status", "parameters", "warnings", "notes", "budget", "provenance", "error"}
    assert keys <= set(data)
    assert (data["schema"], data["method"], data["status"], data["error"]) == (
        "swingid.result/1",
        "momentum",
        "ok",
        None,
    )
    for parameter in data["parameters"].values():
        extended = {"degrees_of_freedom", "coverage_factor"}
        assert set(parameter) == {"value", "standard_uncertainty", "interval95", "unit"} | extended
        freedom = parameter["degrees_of_freedom"] or np.inf
        assert parameter["coverage_factor"] == pytest.approx(student.ppf(0.975, freedom), rel=1e-6)
        reach = parameter["coverage_factor"] * parameter["standard_uncertainty"]
        assert parameter["interval95"] == pytest.approx([parameter["value"] - reach, parameter["value"] + reach])
    for entry in data["budget"]:
        stable = {"source", "type", "parameter", "standard_uncertainty", "sensitivity", "shared_id"}
        assert set(entry) == stable | {"degrees_of_freedom", "distribution", "averages_over_logs"}
    for name in data["parameters"]:
        parts = [e["standard_uncertainty"] for e in data["budget"] if e["parameter"] == name]
        assert np.sqrt(np.sum(np.square(parts))) == pytest.approx(data["parameters"][name]["standard_uncertainty"])
    exact = next(note["message"] for note in data["notes"] if note["code"] == "exact-constants")
    for constant in (
        "axis.gravity_torque",
        "drive.wheel.inertia",
        "drive.motor.rotor_inertia",
        "drive.motor.gear_ratio",
    ):
        assert constant in exact


def test_the_swings_scatter_about_the_answer():
    result = identify(encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], TIME)), PAPER)
    swings = result.details.swings
    assert len(swings.times) > 0.8 * len(result.details.turning_times)
    assert np.median(swings.values) == pytest.approx(INERTIA, rel=2e-4)
    off = np.abs(swings.values - INERTIA) / swings.uncertainties
    assert np.mean(off < 3) > 0.9
    assert set(swings.sides) == {-1.0, 1.0}


def test_nothing_but_the_angles_is_used():
    log = encoded(wheel_log(exact_rig(), TWO_TONES, LAWS["viscous"], TIME))
    other = PAPER.changed({"axis.inertia": 1e-3, "axis.friction": {"coulomb": 0.5}})
    misled = replace(log, reference=np.cos(TIME), adaptive_gain=TIME, metadata={"truth": {"inertia": 1.0}})
    assert identify(misled, other).inertia == identify(log, PAPER).inertia
