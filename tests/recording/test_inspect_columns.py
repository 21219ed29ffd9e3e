"""What a file tells without a rig: grids, clocks, roles in many spellings, and the rig file made of them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recording_cases import write_columns
from refusals import coded
from swingid.cli import main
from swingid.errors import InputError, SwingidError
from swingid.model.rig import Rig
from swingid.recording import Recording
from swingid.recording.formats.table import Table
from swingid.recording.grid import TURN, grid_of, is_decimal
from swingid.recording.inspect import describe, guess_roles, log_table
from swingid.recording.inspect.candidates import unit_of
from swingid.recording.inspect.columns import unit_of_steps
from swingid.recording.inspect.rig_text import counts_of
from swingid.study.inspect import inspect_log, inspect_table

TIME = np.arange(6000) / 500
ANGLE = 0.6 * np.sin(6 * TIME)
WHEEL = -25 * np.sin(6 * TIME) + 0.5 * np.sin(18 * TIME)
SPEED = 3.6 * np.cos(6 * TIME)
VOLTAGE = np.round(4 * np.cos(6 * TIME + 0.3), 3)


def roles_of(columns: dict[str, np.ndarray], units: dict[str, str] | None = None):
    return guess_roles(describe(Table(columns, units=units or {})))


@given(step=st.floats(1e-7, 10), offset=st.floats(-5, 5), seed=st.integers(0, 99))
def test_step_of_a_grid_is_found(step, offset, seed) -> None:
    rng = np.random.default_rng(seed)
    smooth = 200 * np.sin(np.arange(2000) / 30) + rng.normal(0, 1, 2000)
    assert grid_of(np.round(smooth) * step + offset * step) == pytest.approx(step, rel=1e-6)


def test_no_grid_where_there_is_none() -> None:
    rng = np.random.default_rng(1)
    assert grid_of(rng.normal(0, 1, 5000)) == 0
    assert grid_of(np.sin(np.arange(5000) / 100)) == 0
    assert grid_of(np.ones(100)) == 0


def test_written_digits_are_told_from_an_encoder() -> None:
    assert is_decimal(1e-4)
    assert is_decimal(0.05)
    assert not is_decimal(2 * np.pi / 4096)
    assert not is_decimal(0.0)


@pytest.mark.parametrize(
    ("names", "units"),
    [
        (("t", "q1", "q2", "u", "ym"), {}),
        (("time", "theta", "wheel_angle", "voltage", "theta_ref"), {}),
        (("timestamp", "pendulum_pos", "flywheelPos", "motor voltage", "reference"), {}),
        (("Time [s]", "Pendulum angle [rad]", "Wheel angle [rad]", "u [V]", "setpoint [rad]"), {}),
        (("elapsed", "phi1", "phi2", "Spannung", "soll"), {}),
        (("t_s", "θ", "rotor", "Vin", "target"), {}),
        (("time", "pos", "rw", "volts", "desired_pos"), {"time": "s", "pos": "rad", "rw": "rad", "volts": "V"}),
    ],
)
def test_roles_by_name(names, units) -> None:
    reference = 0.6 * np.sin(6 * TIME + 0.03)
    roles = roles_of(dict(zip(names, (TIME, ANGLE, WHEEL, VOLTAGE, reference), strict=True)), units)
    wanted = dict(zip(("time", "angle", "wheel_angle", "voltage", "reference"), names, strict=True))
    assert {role: found.column for role, found in roles.found.items()} == wanted
    assert roles.drive == "reaction-wheel"


def test_roles_by_physics_where_names_say_nothing() -> None:
    noise = np.random.default_rng(1).normal(0, 1e-4, TIME.size)
    roles = roles_of({"column1": TIME, "column2": SPEED, "column3": ANGLE + noise, "column4": WHEEL})
    assert roles.column("time") == "column1"
    assert roles.column("angle") == "column3"
    assert roles.column("wheel_angle") == "column4"
    assert roles.others["column2"] == "speed of column3"
    assert not roles.found["wheel_angle"].sure


def test_a_speed_is_no_angle_and_a_temperature_no_channel() -> None:
    temperature = np.round(30 + TIME / 10)
    roles = roles_of({"t": TIME, "omega": SPEED, "theta": ANGLE, "temp": temperature, "on": np.ones(TIME.size)})
    assert roles.others == {"omega": "speed of theta", "temp": "not known", "on": "does not change"}
    assert roles.drive == "none"


def test_a_supply_is_no_command_beside_a_voltage_of_both_signs() -> None:
    supply = np.round(7.4 - 0.3 * np.abs(VOLTAGE), 1)
    roles = roles_of({"t": TIME, "position": ANGLE, "input_volts": supply, "bridge_volts": VOLTAGE})
    assert roles.column("voltage") == "bridge_volts"
    assert roles.drive == "motor"
    assert roles_of({"t": TIME, "position": ANGLE, "volts": 5 + VOLTAGE}).column("voltage") == "volts"


@pytest.mark.parametrize(("kind", "status"), [("torque", "ready"), ("volts", "ready"), ("nothing", "unusable")])
def test_few_turning_points_are_no_fault_where_a_drive_turns_the_axis(kind, status) -> None:
    turn = 0.5 * TIME**2
    columns = {"t": TIME, "theta": turn, kind: 0.5 + 0.1 * np.sin(3 * TIME)}
    verdict = inspect_table(Table(columns, units={})).verdict
    assert verdict.status == status


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("s", 1.0)])
def test_unit_of_an_unlabelled_clock_by_its_rate(unit, factor) -> None:
    columns = {"t": TIME * factor, "theta": ANGLE}
    roles = roles_of(columns)
    assert roles.found["time"].unit == unit
    assert (f'time_unit = "{unit}"' in log_table(roles)) == (unit != "s")


@pytest.mark.parametrize("counts", [1024, 4096, 16384, 2400])
@pytest.mark.parametrize("unit", ["rad", "deg", "turns"])
def test_unit_of_an_angle_by_the_steps_of_its_encoder(counts, unit) -> None:
    step = TURN[unit] / counts
    (column,) = describe(Table({"a": np.round(0.8 * np.sin(8.5 * TIME) * counts / 6.2832) * step}))
    assert unit_of_steps(column) == (unit, counts)


@pytest.mark.parametrize("size", [1e-320, 1e-12, 1e-3, 1.0])
def test_steps_of_no_encoder_tell_no_unit(size) -> None:
    (column,) = describe(Table({"a": np.random.default_rng(1).normal(0, 1, TIME.size) * size}))
    assert unit_of_steps(column) == ("", 0)


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        (np.degrees(ANGLE), "deg"),
        (30.0 * np.sign(ANGLE) * np.linspace(0.8, 1.2, TIME.size), "deg"),
        (ANGLE, "rad"),
        (np.round(ANGLE * 4096 / 6.2832), "counts"),
    ],
)
def test_unit_of_an_unlabelled_angle_by_its_size(values, unit) -> None:
    assert roles_of({"t": TIME, "theta": values}).found["angle"].unit == unit


def test_zero_by_where_the_body_hangs() -> None:
    assert roles_of({"t": TIME, "theta": ANGLE}).zero_up is False
    assert roles_of({"t": TIME, "theta": ANGLE + np.pi}).zero_up is True
    swung_up = np.where(TIME < 1, 0.0, np.pi * np.tanh(TIME - 1)) + 0.01 * ANGLE * (TIME > 1)
    assert roles_of({"t": TIME, "theta": swung_up}).zero_up is False


@pytest.mark.parametrize(
    ("name", "unit"),
    [("theta_rad", "rad"), ("pos_deg", "deg"), ("t_ms", "ms"), ("w_rad_s", "rad/s"), ("rpm", "rpm"), ("q1", "")],
)
def test_unit_at_the_end_of_a_name(name, unit) -> None:
    assert unit_of(name, "") == unit


@given(
    st.dictionaries(
        st.text(max_size=12),
        st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=60),
        max_size=5,
    )
)
def test_any_table_is_inspected_without_an_error(columns) -> None:
    found = inspect_table(Table({name: np.array(values) for name, values in columns.items()}))
    assert found.to_json()
    assert found.summary()


@pytest.mark.parametrize("kind", ["reaction-wheel", "direct", "motor", "none"])
def test_init_from_a_log_writes_a_rig_that_reads_it(tmp_path, kind) -> None:
    columns = {"zeit": TIME, "theta [deg]": np.degrees(ANGLE) + 180.0}
    columns |= {
        "reaction-wheel": {"wheel": np.degrees(WHEEL), "u": VOLTAGE},
        "direct": {"tau": VOLTAGE},
        "motor": {"u": VOLTAGE},
        "none": {},
    }[kind]
    log = write_columns(tmp_path / "log.csv", columns)
    assert main(["init", "--from", str(log), str(tmp_path / "rig")]) == 0
    path = tmp_path / "rig" / "rig.toml"
    if kind == "reaction-wheel":  # whose inertia no log tells
        with pytest.raises(InputError, check=coded("missing-key", "drive.wheel.inertia")):
            Rig.load(path)
        path.write_text(path.read_text().replace('# inertia = "1134', 'inertia = "1134'))
    if kind == "motor":
        path.write_text(path.read_text().replace("# [drive.motor]", "[drive.motor]").replace("# gear_f", "gear_f"))
    rig = Rig.load(path)
    assert rig.drive.kind == kind
    assert rig.axis.gravity_torque == "unknown"  # nothing of another rig passes for known
    assert rig.axis.inertia is None
    assert rig.drive.motor is None or rig.drive.motor.rotor_inertia.value == 0
    recording = Recording.load(log, rig)
    assert recording.angle == pytest.approx(ANGLE, abs=1e-9)
    if kind == "reaction-wheel":
        assert recording.wheel_angle == pytest.approx(WHEEL, abs=1e-9)
        assert recording.voltage == pytest.approx(VOLTAGE)
    if kind == "direct":
        assert recording.torque == pytest.approx(VOLTAGE)


def test_init_from_a_log_states_the_encoder(tmp_path) -> None:
    count = 2 * np.pi / 4096
    log = write_columns(tmp_path / "log.csv", {"t": TIME, "theta": np.round(ANGLE / count) * count})
    assert main(["init", "--from", str(log), str(tmp_path)]) == 0
    assert Rig.load(tmp_path / "rig.toml").sensors.counts_per_turn == 4096


def test_init_from_counts_asks_for_the_counts_per_turn(tmp_path) -> None:
    log = write_columns(tmp_path / "log.csv", {"millis": np.round(1e3 * TIME), "enc": np.round(ANGLE * 700)})
    assert main(["init", "--from", str(log), str(tmp_path)]) == 0
    path = tmp_path / "rig.toml"
    with pytest.raises(InputError, check=coded("missing-key", "sensors.counts_per_turn")):
        Rig.load(path)
    path.write_text(re.sub(r"# counts_per_turn = \d+", "counts_per_turn = 4398", path.read_text()))
    recording = Recording.load(log, Rig.load(path))
    assert recording.time == pytest.approx(np.round(1e3 * TIME) / 1e3)
    assert recording.angle == pytest.approx(ANGLE, abs=1e-3)


def test_init_from_a_log_without_an_angle_is_refused(tmp_path, capfd) -> None:
    log = write_columns(tmp_path / "log.csv", {"a": np.random.default_rng(1).normal(0, 1, 99)})
    assert main(["init", "--from", str(log), str(tmp_path)]) == 3
    assert "looks like the angle" in capfd.readouterr().err
    assert not (tmp_path / "rig.toml").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("log", "rig", "status"),
    [
        ("emps/DATA_EMPS.mat", "emps", "ready"),
        ("free_pendulum/free_swing.csv", "free_pendulum", "ready"),
        ("free_pendulum/SinglePendulumArm_RawData_1.mat", "free_pendulum_simulink", "ready"),
        ("bam_xl330/2026-01-15_10h28m42.json", "bam_xl330", "unusable"),  # no free decay
        ("bam_xl330/2026-01-15_10h28m49.json", "bam_xl330", "ready"),
        ("bam_xl330/2026-01-15_10h28m57.json", "bam_xl330", "unusable"),
        ("bam_xl330/2026-01-15_10h29m04.json", "bam_xl330", "unusable"),
        ("dfki_pendulum/sac.csv", "dfki_pendulum", "repairs"),
    ],
)
def test_real_logs_against_their_rigs(data_dir, log, rig, status) -> None:
    from test_docs import ROOT

    found = inspect_log(data_dir / log, Rig.load(ROOT / "examples" / "rigs" / f"{rig}.toml"))
    assert found.verdict.status == status, found.summary()
    doubts = {"gravity-torque-disagrees", "balance"} & {c.code for c in found.checks if c.level == "repair"}
    assert bool(doubts) == (rig == "dfki_pendulum")


@pytest.mark.long
def test_real_logs_without_a_rig(data_dir) -> None:
    emps = inspect_log(data_dir / "emps" / "DATA_EMPS.mat")
    columns = {role: found.column for role, found in emps.roles.found.items()}
    assert columns == {"time": "t", "angle": "qm", "reference": "qg", "torque": "vir"}
    assert emps.check("angle").values["step"] == pytest.approx(5e-8)
    swing = inspect_log(data_dir / "free_pendulum" / "free_swing.csv")
    assert swing.roles.zero_up is True
    assert 4.8 < swing.check("motion").values["start"] < 5.6  # let go at 4.85 s
    servo = inspect_log(data_dir / "bam_xl330" / "2026-01-15_10h28m42.json")
    assert servo.check("angle").values["counts_per_turn"] == pytest.approx(4096)
    assert servo.roles.column("reference") == "goal_position"
    for path in sorted((data_dir / "dfki_pendulum").glob("*.csv")):
        found = inspect_log(path)
        assert found.roles.zero_up is False
        assert found.roles.others == {"velocity": "speed of position"}
    answer = inspect_log(data_dir / "free_pendulum" / "EstimatedParameters_SinglePendulum.mat")
    assert answer.verdict.status == "unusable"


def test_exit_code_is_0_for_any_verdict_and_3_for_no_file(tmp_path, capfd) -> None:
    log = write_columns(tmp_path / "log.csv", {"t": TIME, "theta": 0 * TIME})
    page, data = tmp_path / "page.html", tmp_path / "data.json"
    assert main(["inspect", str(log), "--json", str(data), "--report", str(page)]) == 0
    assert "not usable" in capfd.readouterr().out
    assert "not usable" in page.read_text()
    assert '"status": "unusable"' in data.read_text()
    assert main(["inspect", str(tmp_path / "none.csv")]) == 3
    assert main(["inspect", str(log), "--rig", "nosuch"]) == 2
    assert main(["inspect", str(log), "--report", str(log)]) == 2


def test_page_has_the_picture_and_every_check(tmp_path) -> None:
    log = write_columns(tmp_path / "log.csv", {"t": TIME, "theta": ANGLE, "tau": VOLTAGE})
    page = tmp_path / "page.html"
    assert main(["inspect", str(log), "--report", str(page)]) == 0
    text = page.read_text()
    assert text.count("<svg") == 1
    for check in inspect_log(log).checks:
        assert check.title in text
    assert "mathdefault" not in text


def test_error_of_reading_is_a_fault_and_no_exception() -> None:
    found = inspect_table(Table({"t": TIME[::-1].copy(), "theta": ANGLE}))
    assert found.verdict.status == "unusable"
    assert not isinstance(found, SwingidError)


def test_counts_over_a_range_without_end_are_those_of_a_counter() -> None:
    assert [counts_of(span) for span in (0.0, 4095.0, 4096.0, np.inf)] == [4, 4096, 8192, 2**32]
