"""Workbooks and archives of phones (phyphox, Sensor Logger), and what `inspect` finds in columns of gyroscopes."""

from __future__ import annotations

import numpy as np
import pytest

import swingid as sw
from phone_files import archive, text, workbook
from refusals import coded
from swingid.cli import main
from swingid.errors import InputError
from swingid.recording.formats import read_table
from swingid.recording.inspect import describe, guess_roles

T = np.arange(600) / 100 + 0.0206
W = {axis: size * np.cos(5 * T) * np.exp(-T / 30) for axis, size in (("x", 0.1), ("y", 0.2), ("z", 2.5))}


GYROSCOPE = text("Time (s)|Gyroscope x (rad/s)|Gyroscope y (rad/s)|Gyroscope z (rad/s)", T, *W.values())
ACCELERATION = text("Time (s)|Acceleration x (m/s^2)|Acceleration z (m/s^2)", T[:300] * 2, W["x"][:300], W["y"][:300])


def role(content: bytes, name: str) -> tuple[str, str]:
    """Column and unit that are guessed as the rate."""
    found = guess_roles(describe(read_table(content, name))).found
    assert "angle" not in found
    return found["angle_speed"].column, found["angle_speed"].unit


def test_an_archive_of_phyphox_reads_by_its_gyroscope():
    content = archive(Accelerometer=ACCELERATION, Gyroscope=GYROSCOPE, meta__device="property,value\nversion,1\n" * 20)
    table = read_table(content, "log.zip")
    assert len(table.columns["Gyroscope z (rad/s)"]) == 600
    assert len(table.columns["Accelerometer.Acceleration x (m/s^2)"]) == 300
    assert not any("device" in name for name in table.columns)
    assert role(content, "log.zip") == ("Gyroscope z (rad/s)", "rad/s")


def test_an_archive_of_sensor_logger_reads_by_its_gyroscope():
    stamps = 1.7e18 + 1e9 * T
    own = text("time|seconds_elapsed|z|y|x", stamps, T, W["z"], W["y"], W["x"])
    other = text("time|seconds_elapsed|z|y|x", stamps, T, *3 * [9.81 + W["x"]])
    content = archive(
        TotalAcceleration=other, Gravity=other, Gyroscope=own, GyroscopeUncalibrated=other, Metadata="a,b\n1,2\n"
    )
    assert role(content, "log.zip") == ("z", "rad/s")
    assert read_table(content, "log.zip").numbers("z")[0] == pytest.approx(W["z"], abs=1e-8)


NUMBERS = [[float(cell) for cell in row] for row in zip(T, *W.values(), strict=True)]
HEADER: list[object] = ["Time (s)", "Gyroscope x (rad/s)", "Gyroscope y (rad/s)", "Gyroscope z (rad/s)"]
META: list[list[object]] = [["property", "value"], ["version", "1.2.0"], ["build", "1"]]


@pytest.fixture(scope="module", autouse=True)
def _calamine():
    pytest.importorskip("python_calamine")


def test_a_workbook_reads_by_the_sheet_of_its_gyroscope():
    other: list[list[object]] = [["Time (s)", "Acceleration x (m/s^2)"], *([2 * t, 1.0 + t] for t in T.tolist() * 2)]
    content = workbook({"Accelerometer": other, "Gyroscope": [HEADER, *NUMBERS], "Empty": [], "Metadata Device": META})
    table = read_table(content, "log.xlsx")
    assert table.numbers("Gyroscope z (rad/s)")[0] == pytest.approx(W["z"], rel=1e-15)  # all digits
    assert "Accelerometer.Time (s)" in table.columns
    assert role(content, "log.xlsx") == ("Gyroscope z (rad/s)", "rad/s")


def test_a_header_of_merged_cells_and_a_line_of_units():
    rows: list[list[object]] = [["Gyroscope of my phone", None, None, None], ["Time", "x", "y", "rate"]]
    content = workbook({"Raw": [*rows, ["s", "rad/s", "rad/s", "rad/s"], *NUMBERS]}, merged=("A1:D1",))
    table = read_table(content, "log.xlsx")
    assert table.numbers("rate")[0] == pytest.approx(W["z"])
    assert table.unit("rate") == "rad/s"


@pytest.mark.parametrize(
    ("content", "name", "says"),
    [
        (workbook({"Empty": [], "Metadata Device": META}), "a.xlsx", "no sheet with 10 rows of numbers below a header"),
        (workbook({"Raw": [HEADER, *NUMBERS]})[:4000], "a.xlsx", "export it again"),
        (b"\xd0\xcf\x11\xe0" + bytes(2000), "a.xls", "is not a whole workbook"),
        (archive(Metadata="a,b\n1,2\n"), "a.zip", "no file with 10 rows of numbers"),
        (archive(Gyroscope=GYROSCOPE)[:5000], "a.zip", "not a whole zip archive or Excel workbook"),
        (archive(meta__device=GYROSCOPE), "a.zip", "without a .csv or .txt file"),
    ],
)
def test_what_holds_no_log_is_refused_in_one_sentence(content, name, says):
    with pytest.raises(InputError) as problem:
        read_table(content, name)
    assert says in problem.value.message
    assert "\n" not in problem.value.message


def test_damaged_exports_end_in_a_table_or_a_sentence():
    rng = np.random.default_rng(3)
    good = [
        (archive(Gyroscope=GYROSCOPE, Accelerometer=ACCELERATION), "a.zip"),
        (workbook({"Raw": [HEADER, *NUMBERS[:50]]}), "a.xlsx"),
    ]
    for content, name in good * 15:
        damaged = bytearray(content)
        for at in rng.integers(0, len(damaged), 12):
            damaged[at] = rng.integers(256)
        try:
            read_table(bytes(damaged), name)
        except InputError as problem:
            assert name in problem.message


def test_a_wrong_sheet_is_named():
    content = archive(Accelerometer=ACCELERATION, Gyroscope=GYROSCOPE)
    rig = sw.Rig.from_text(
        'name = "phone"\n[axis]\ngravity_torque = 0.1\n[drive]\nkind = "none"\n'
        '[log]\ntime = "Time (s)"\nangle_speed = "Accelerometer.Acceleration x (m/s^2)"\n'
    )
    with pytest.raises(InputError, check=coded("unit-conflict")):
        sw.Recording.from_table(read_table(content, "a.zip"), rig)
    with pytest.raises(InputError, check=coded("missing-column", "'Gyro'")):
        sw.Recording.from_table(read_table(content, "a.zip"), rig.changed({"log.angle_speed": "Gyro"}))


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("t", "gyro_x", "gyro_y", "gyro_z"), "gyro_z"),
        (("timestamp", "gx [deg/s]", "gy [deg/s]", "gz [deg/s]"), "gz [deg/s]"),
        (
            ("time", "imu.angular_velocity.x", "imu.angular_velocity.y", "imu.angular_velocity.z"),
            "imu.angular_velocity.z",
        ),
        (("Time", "xGyro", "yGyro", "ZGyro"), "ZGyro"),
        (("ms", "gx", "gy", "gz"), "gz"),  # as sketches for the MPU-6050 print them
        (("t", "imu.wx", "imu.wy", "imu.wz"), "imu.wz"),
        (("t", "omega_x", "omega_y", "omega_z"), "omega_z"),
    ],
)
def test_gyroscopes_are_found_by_name_and_unit(names, expected):
    accelerations = {"linear_acceleration.x": W["x"], "accX": W["y"], "az (m/s^2)": W["z"], "ay": 9.8 + W["x"]}
    columns = dict(zip(names, (T, *W.values()), strict=True)) | accelerations
    content = text("|".join(columns), *columns.values()).encode()
    found = guess_roles(describe(read_table(content, "a.csv")))
    assert (
        found.found["angle_speed"].column == expected.partition(" [")[0]
        or found.found["angle_speed"].column == expected
    )
    assert "angle" not in found.found
    assert {name for name, what in found.others.items() if "accelerometer" in what} >= {
        *("accX", "linear_acceleration.x", "ay")
    }


def test_accelerometers_alone_have_no_role():
    found = guess_roles(describe(read_table(ACCELERATION.encode(), "a.csv"))).found
    assert set(found) == {"time"}


def test_a_rate_that_is_named_as_the_angle():
    rig = sw.Rig.from_text(
        'name = "r"\n[axis]\ngravity_torque = 0.1\n[drive]\nkind = "none"\n[log]\nangle = "gyro_z"\n'
    )
    with pytest.raises(InputError, check=coded("rate-as-angle", "angle_speed")):
        sw.Recording.from_columns({"t": T, "gyro_z [rad/s]": W["z"]}, rig)
    log = sw.Recording.from_columns({"t": T, "gyro_z": W["z"]}, rig)
    assert [one.code for one in log.findings if one.level == "warning"] == ["rate-as-angle"]


@pytest.mark.parametrize("name", ["phyphox.zip", "Gyroscope.csv", "imu.csv"])
def test_init_writes_a_rig_file_for_a_rate_which_reads_the_log(name, tmp_path, monkeypatch):
    """Sensor Logger's file alone has columns x, y, z: its name states what they are; boards print gx, ay."""
    stamps = [1_700_000_000_000_000_000 + round(1e9 * t) for t in T]
    rows = (f"{stamp},{t},{z},{y},{x}" for stamp, t, z, y, x in zip(stamps, T, W["z"], W["y"], W["x"], strict=True))
    logger = "\n".join(["time,seconds_elapsed,z,y,x", *rows]).encode()
    board = text("ms|ax|ay|az|gx|gy|gz", 1000 * T, *3 * [9.8 + W["x"]], *(57.3 * W[axis] for axis in "xyz")).encode()
    phone = archive(Accelerometer=ACCELERATION, Gyroscope=GYROSCOPE)
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes({"p": phone, "G": logger, "i": board}[name[0]])
    assert main(["init", "--from", name, "rig"]) == 0
    rig = sw.Rig.load("rig/rig.toml")
    assert rig.log.angle_speed == {"p": "Gyroscope z (rad/s)", "G": "z", "i": "gz"}[name[0]]
    assert rig.log.angle_speed_unit == ("deg/s" if name == "imu.csv" else "rad/s")
    log = sw.Recording.load(name, rig)
    assert np.ptp(log.angle) == pytest.approx(2 * 2.5 / 5, rel=0.05)


@pytest.mark.parametrize(("column", "kind"), [("pwm", "motor"), ("duty", "motor"), ("speed", "none")])
def test_a_voltage_without_a_wheel_is_that_of_a_motor(column, kind):
    columns = {"t": T, "angle": 0.8 * np.sin(5 * T), column: np.round(100 * np.cos(5 * T + 1))}
    found = guess_roles(describe(read_table(text("|".join(columns), *columns.values()).encode(), "a.csv")))
    assert found.drive == kind


def test_a_header_of_two_merged_cells_says_how_to_split_them():
    rows: list[list[object]] = [["Gyro", None, "Gyro", None], *NUMBERS]
    with pytest.raises(InputError, check=coded("not-a-table", "'Raw'", "'Gyro'")):
        read_table(workbook({"Raw": rows}, merged=("A1:B1", "C1:D1")), "a.xlsx")


def test_a_potentiometer_in_volts_needs_a_scale():
    text_of_rig = 'name = "p"\n[axis]\ngravity_torque = 0.1\n[drive]\nkind = "none"\n[log]\nangle = "pot"\n'
    columns = {"t": T, "pot [V]": 2.5 + W["z"]}
    with pytest.raises(InputError, check=coded("unit-conflict", "angle_scale")):
        sw.Recording.from_columns(columns, sw.Rig.from_text(text_of_rig))
    scaled = sw.Rig.from_text(text_of_rig + 'angle_scale = "20 ± 0.2 deg"\nangle_offset = "-50 deg"\n')
    log = sw.Recording.from_columns(columns, scaled)
    assert log.angle == pytest.approx(np.deg2rad(20) * W["z"], abs=1e-3)


def test_a_label_merged_down_the_rows_is_left_out():
    rows: list[list[object]] = [["run", *HEADER]]
    rows += [["run 1" if k == 0 else "", *numbers] for k, numbers in enumerate(NUMBERS)]
    table = read_table(workbook({"Sheet": rows}, merged=(f"A2:A{len(rows)}",)), "log.xlsx")
    assert list(table.columns) == HEADER
    assert table.numbers("Gyroscope z (rad/s)")[0] == pytest.approx(W["z"])
