"""A motor on the axis: its constants in rig.toml, and inertia, friction and motor constants from one log or several."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import swingid as sw
from refusals import coded
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.uncertainty.budget import Parameter

TEXT = """
name = "servo"
[axis]
gravity_torque = {gravity}
inertia = "5e-3 kg*m^2"
model_uncertainty = 0
tilt = 0
[axis.friction]
coulomb = 0.009
viscous = 0.0037
[drive]
kind = "motor"
[drive.motor]
{motor}
[sensors]
nonlinearity = 0
latency = 0
counts_per_turn = 4096
[log]
clock = 0
{log}
"""

B, J, K, E, FC, FV = 0.4807, 5e-3, 0.0963, 0.0372, 0.009, 0.0037
"""The servo of the tests: about a Dynamixel XL330 with 0.49 kg at 0.1 m by Better Actuator Models' own fits."""


def servo(motor: str = "", gravity: object = B, log: str = "") -> sw.Rig:
    """The rig of the tests with other lines."""
    gravity = json.dumps(gravity)
    return sw.Rig.from_text(TEXT.format(motor=motor, gravity=gravity, log=log))


TRUE = servo(f"torque_per_volt = {K}\nback_emf = {E}")


def voltage(seed: int, rows: int, rate: float = 200.0) -> np.ndarray:
    """Three sines of drawn phases (V)."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) / rate
    parts = ((3.0, 0.4 + rng.uniform(0, 0.2)), (2.5, 1.4 + rng.uniform(0, 0.6)), (1.2, 3.1))
    return sum(a * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for a, f in parts)


def twin_log(seed: int, rig: sw.Rig = TRUE, seconds: float = 6.0) -> sw.Recording:
    """What the twin logs under these voltages, 200 rows per second."""
    rows = int(200 * seconds) + 1
    return sw.simulate(rig, drive=voltage(seed, rows), duration=seconds, rate=200.0, seed=seed)


def covers(parameter: Parameter, true: float) -> bool:
    """Whether the interval contains the true value."""
    assert parameter.interval95 is not None
    return parameter.interval95[0] <= true <= parameter.interval95[1]


def own_motion(
    seed: int, *, opens: float, added: float = 0.0, gravity: float = B, seconds: float = 8.0
) -> dict[str, np.ndarray]:
    """The servo integrated here, not by the twin; its bridge opens at `opens` s; columns of a log."""
    rate, rows = 200.0, int(200 * seconds) + 1
    t, u = np.arange(rows) / rate, voltage(seed, rows)

    def motion(at: float, y: np.ndarray) -> list[float]:
        closed = at < opens
        friction = FC * np.tanh(y[1] / 1e-3) + FV * y[1]
        drive = K * u[min(int(at * rate + 1e-9), rows - 1)] - E * y[1] if closed else 0.0
        return [y[1], (drive - gravity * np.sin(y[0]) - friction) / (J + added)]

    found = solve_ivp(motion, (0, t[-1]), [0.0, 0.0], t_eval=t, max_step=1 / rate, rtol=1e-7, atol=1e-9)
    step = 2 * np.pi / 4096
    return {"t": t, "q1": np.round(found.y[0] / step) * step, "u": u, "on": (t < opens).astype(float)}


def test_the_twin_obeys_the_equation_of_the_motor() -> None:
    """Held at a constant voltage a balanced servo runs at u K / (E + viscous), less what Coulomb friction takes."""
    rig = servo(f"torque_per_volt = {K}\nback_emf = {E}", gravity=0)
    log = sw.simulate(rig, drive=np.full(1001, 3.0), duration=5.0, rate=200.0)
    assert log.voltage is not None
    assert log.torque is None
    speed = (log.angle[-1] - log.angle[-101]) / 0.5
    assert speed == pytest.approx((3.0 * K - FC) / (E + FV), rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_inertia_friction_and_torque_per_volt_from_one_log_where_gravity_sets_the_scale(seed: int) -> None:
    result = sw.identify(twin_log(seed), servo(f"back_emf = {E}"))
    assert result.status == "ok"
    assert result.inertia.value == pytest.approx(J, rel=5e-4)
    assert result.parameters["torque_per_volt"].value == pytest.approx(K, rel=2e-3)
    for name, true in (("coulomb", FC), ("viscous", FV)):
        assert abs(result.parameters[name].value - true) < 4 * (result.parameters[name].standard_uncertainty or 0.0)


@pytest.mark.long
def test_the_intervals_of_a_servo_cover() -> None:
    """100 logs of 6 s at 200 rows per second and 4096 counts: inertia within 0.03 %, 93 % and more covered."""
    unknown, errors, covered = servo(f"back_emf = {E}"), [], []
    for seed in range(100):
        found = sw.identify(twin_log(seed), unknown).parameters
        errors.append(found["inertia"].value / J - 1)
        covered.append([covers(found["inertia"], J), covers(found["torque_per_volt"], K), covers(found["viscous"], FV)])
    assert np.max(np.abs(errors)) < 3e-4
    assert np.all(np.mean(covered, axis=0) >= 0.93)


def test_without_a_stated_back_emf_viscous_is_the_sum_and_the_result_says_so() -> None:
    result = sw.identify(twin_log(1), servo())
    assert covers(result.parameters["viscous"], FV + E)
    assert "back_emf" not in result.parameters
    assert any(note.code == "back-emf-in-viscous" and "bridge is open" in note.message for note in result.notes)


def test_an_open_bridge_separates_back_emf_from_viscous_friction() -> None:
    rig = servo(log='bridge = "on"')
    log = sw.Recording.from_columns(own_motion(3, opens=5.0), rig)
    assert log.bridge is not None
    result = sw.identify(log, rig)
    assert result.inertia.value == pytest.approx(J, rel=5e-3)
    assert covers(result.parameters["back_emf"], E)
    assert covers(result.parameters["viscous"], FV)
    assert not any(note.code == "back-emf-in-viscous" for note in result.notes)
    windings = next(note.message for note in result.notes if note.code == "motor-windings")
    assert "k = 0.38" in windings or "k = 0.39" in windings


def test_logs_with_and_without_a_known_body_set_the_scale_of_a_balanced_servo() -> None:
    rig = servo(f"back_emf = {E}", gravity=0)
    logs = [sw.Recording.from_columns(own_motion(5 + k, opens=99.0, added=a, gravity=0.0), rig)
            for k, a in enumerate((0.0, 4e-3))]  # fmt: skip
    result = sw.identify(logs, rig, added=[0, "4e-3 ± 4e-6 kg*m^2"])
    assert result.inertia.value == pytest.approx(J, rel=1e-2)
    assert covers(result.inertia, J)
    assert covers(result.parameters["torque_per_volt"], K)
    body = [entry for entry in result.budget if entry.source.startswith("added body")]
    assert {entry.type for entry in body} == {"B"}
    share = next(e.standard_uncertainty for e in body if e.parameter == "inertia")
    assert share == pytest.approx(1e-3 * result.inertia.value, rel=0.05)  # inertia is proportional to the body's


@pytest.mark.parametrize("seed", range(3))
def test_a_balanced_servo_without_any_scale_has_ratios(seed: int) -> None:
    result = sw.identify(twin_log(seed, servo(f"torque_per_volt = {K}", gravity=0)), servo(gravity=0))
    assert result.ratios
    assert result.leading == "torque_per_volt/inertia"
    for name, true, unit in (
        ("torque_per_volt/inertia", K / J, "rad/s^2/V"),
        ("coulomb/inertia", FC / J, "rad/s^2"),
        ("viscous/inertia", FV / J, "1/s"),
        ("time_constant", J / FV, "s"),
    ):
        assert covers(result.parameters[name], true), name
        assert result.parameters[name].value == pytest.approx(true, rel=0.02)
        assert result.parameters[name].unit == unit
    (note,) = (one.message for one in result.notes if one.code == "no-scale")
    assert "drive.motor.torque_per_volt is unknown" in note
    assert "--added" in note


def test_parts_of_a_log_of_a_motor_are_one_fit_and_each_has_its_value() -> None:
    rig = servo(gravity=0)
    log = twin_log(0, servo(f"torque_per_volt = {K}", gravity=0), seconds=12.0)
    result = sw.identify(log, rig, part=[(0, 5.5), (6, 12)])
    assert covers(result.main, K / J)
    assert [one.value for one in result.per_part] == [pytest.approx(K / J, rel=1e-3)] * 2


def test_torque_constant_resistance_and_gear_give_torque_per_volt_and_back_emf() -> None:
    rig = servo('torque_constant = "0.01 ± 1 % N*m/A"\nresistance = "2 ohm"\ngear_ratio = 10')
    motor = rig.drive.motor
    assert motor is not None
    assert motor.torque_per_volt.value == pytest.approx(10 * 0.01 / 2)
    assert motor.torque_per_volt.std == pytest.approx(0.01 * 10 * 0.01 / 2)
    assert motor.back_emf.value == pytest.approx(100 * 0.01**2 / 2)
    assert motor.back_emf.std == pytest.approx(0.02 * 100 * 0.01**2 / 2)


def test_a_known_torque_per_volt_sets_the_scale_of_a_balanced_servo() -> None:
    balanced = servo(f"torque_per_volt = {K}\nback_emf = {E}", gravity=0)
    stated = servo(f'torque_per_volt = "{K} ± 0.5 %"\nback_emf = {E}', gravity=0)
    result = sw.identify(twin_log(4, balanced), stated)
    assert covers(result.inertia, J)
    entry = next(e for e in result.budget if e.source == "drive.motor.torque_per_volt" and e.parameter == "inertia")
    assert entry.standard_uncertainty == pytest.approx(5e-3 * J, rel=0.02)


def test_the_rotor_is_not_part_of_the_inertia() -> None:
    """Jr behind a gear of N adds N² Jr to the axis, which is subtracted with its uncertainty."""
    constants = f"torque_per_volt = {K}\nback_emf = {E}\ngear_ratio = 10\n"
    log = twin_log(2, servo(constants + "rotor_inertia = 1e-5"))
    result = sw.identify(log, servo(constants + 'rotor_inertia = "1e-5 ± 2 % kg*m^2"'))
    assert covers(result.inertia, J)
    entry = next(e for e in result.budget if e.source == "drive.motor.rotor_inertia" and e.parameter == "inertia")
    assert entry.standard_uncertainty == pytest.approx(100 * 2e-7)
    whole = sw.identify(log, servo(constants))
    assert whole.inertia.value == pytest.approx(result.inertia.value + 1e-3, rel=1e-9)


def test_a_duty_is_a_voltage_by_the_logged_supply(tmp_path: Path) -> None:
    log = twin_log(6)
    assert log.voltage is not None
    supply = 7.4 + 0.3 * np.sin(log.time)
    columns = {"t": log.time, "q1": log.angle, "duty": log.voltage / supply, "supply": supply}
    rig = servo(f"back_emf = {E}", log='voltage = "duty"\nsupply = "supply"')
    read = sw.Recording.from_columns(columns, rig)
    assert read.voltage == pytest.approx(log.voltage, rel=1e-12)
    saved = read.save(tmp_path / "log.csv", rig)
    assert sw.Recording.load(saved, rig).voltage == pytest.approx(log.voltage, rel=1e-12)


def test_a_voltage_of_the_wrong_sign_is_named() -> None:
    log = twin_log(0)
    assert log.voltage is not None
    columns = {"t": log.time, "q1": log.angle, "u": -log.voltage}
    with pytest.raises(InputError, match="voltage_sign = -1") as caught:
        sw.identify(sw.Recording.from_columns(columns, servo()), servo())
    assert caught.value.code == "wrong-sign"


@pytest.mark.parametrize("method", ["energy", "equation-error", "output-error", "backstepping"])
def test_other_methods_refuse_a_motor_on_the_axis_by_name(method: str) -> None:
    with pytest.raises(UnanswerableError, match=f"the method {method} does not have") as caught:
        sw.identify(twin_log(0), TRUE, method=method)
    assert caught.value.code == "unknown-drive"


@pytest.mark.parametrize(
    ("motor", "log", "problem"),
    [
        ("viscous = 1e-3", "", "drive.motor.viscous is given, but a motor on the axis has no friction apart"),
        ("torque_constant = 0.3", "", "drive.motor.resistance is missing beside torque_constant"),
        ("torque_constant = 0.3\nresistance = 2\nback_emf = 0.01", "", "drive.motor.back_emf is given beside"),
        ("", 'torque = "tau"', "log.torque belongs to drive.kind = 'direct'"),
        ("", 'bridge = "u"', "is 'u', which is also the column of"),
        ('gear_friction = "0.1"', "", "drive.motor.gear_friction must be 'unknown'"),
    ],
)
def test_contradictions_in_the_rig_file_are_named(motor: str, log: str, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        servo(motor, log=log)
    assert problem in caught.value.message


@pytest.mark.parametrize(
    "added", [[0], "1e-3", [0, "-1e-3 kg*m^2"], [0, "1 kg"], [0, 0, 0]], ids=["few", "text", "negative", "unit", "many"]
)
def test_added_bodies_that_are_none_are_a_wrong_usage(added: object) -> None:
    with pytest.raises(UsageError) as caught:
        sw.identify([twin_log(0), twin_log(1)], TRUE, added=added)
    assert caught.value.code == "bad-added"


def test_the_scale_of_the_voltage_reaches_the_torque_per_volt_it_was_found_with() -> None:
    log, rig = twin_log(7), servo(f"back_emf = {E}", log='voltage_scale = "12 ± 0.06 V / 255"')
    assert log.voltage is not None
    columns = {"t": log.time, "q1": log.angle, "u": log.voltage / (12 / 255)}
    result = sw.identify(sw.Recording.from_columns(columns, rig), rig)
    found = {e.parameter: e.standard_uncertainty for e in result.budget if e.source == "log.voltage_scale"}
    assert found["torque_per_volt"] == pytest.approx(5e-3 * K, rel=0.01)
    assert found["inertia"] < 1e-6 * J  # gravity sets the scale


def test_calibrate_says_that_identify_finds_the_constants_of_a_motor_on_the_axis():
    with pytest.raises(InputError, check=coded("no-wheel")):
        sw.calibrate(twin_log(1), TRUE)


def test_a_voltage_that_was_not_logged():
    """As in 20 real logs of servos (benchmarks/strangers, sts3250-motor): the load was not read, 0 in all rows."""
    log = twin_log(1)
    lost = replace(log, voltage=np.zeros(len(log)))
    with pytest.raises(InputError, check=coded("constant-drive")):
        sw.identify(lost, servo())
    with pytest.raises(InputError, check=coded("constant-drive")):
        sw.identify({"whole": log, "lost": lost}, servo())
