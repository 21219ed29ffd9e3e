"""Workbooks and archives of phones (phyphox, Sensor Logger), and what `inspect` finds in columns of gyroscopes."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

import swingid as sw
from swingid.errors import InputError
from swingid.recording.formats import read_table
from swingid.recording.inspect import describe, guess_roles

T = np.arange(600) / 100 + 0.0206
W = {axis: size * np.cos(5 * T) * np.exp(-T / 30) for axis, size in (("x", 0.1), ("y", 0.2), ("z", 2.5))}


def text(header: str, *columns: np.ndarray, mark: str = ",") -> str:
    rows = (mark.join(f"{cell:.9E}" for cell in row) for row in zip(*columns, strict=True))
    return "\n".join([mark.join(f'"{name}"' for name in header.split("|")), *rows]) + "\n"


GYROSCOPE = text("Time (s)|Gyroscope x (rad/s)|Gyroscope y (rad/s)|Gyroscope z (rad/s)", T, *W.values())
ACCELERATION = text("Time (s)|Acceleration x (m/s^2)|Acceleration z (m/s^2)", T[:300] * 2, W["x"][:300], W["y"][:300])


def archive(**files: str) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as zipped:
        for name, content in files.items():
            zipped.writestr(name.replace("__", "/") + ".csv", content)
    return sink.getvalue()


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


def workbook(sheets: dict[str, list[list[object]]], merged: tuple[str, ...] = ()) -> bytes:
    """An .xlsx file by its parts (ECMA-376): sheets of numbers and inline texts, with merged cells in the first."""
    sink, main = io.BytesIO(), "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package, kind = "http://schemas.openxmlformats.org/package/2006", "application/vnd.openxmlformats-officedocument"
    with zipfile.ZipFile(sink, "w") as zipped:
        overrides = "".join(
            f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{kind}.spreadsheetml.worksheet+xml"/>'
            for k in range(1, len(sheets) + 1)
        )
        zipped.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType='
            '"application/vnd.openxmlformats-package.relationships+xml"/><Override PartName="/xl/workbook.xml" '
            f'ContentType="{kind}.spreadsheetml.sheet.main+xml"/>{overrides}</Types>',
        )
        link = f'<Relationship Id="r1" Type="{office}/officeDocument" Target="xl/workbook.xml"/>'
        zipped.writestr("_rels/.rels", f'<Relationships xmlns="{package}/relationships">{link}</Relationships>')
        names = "".join(f'<sheet name="{n}" sheetId="{k}" r:id="r{k}"/>' for k, n in enumerate(sheets, start=1))
        zipped.writestr(
            "xl/workbook.xml", f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>{names}</sheets></workbook>'
        )
        links = "".join(
            f'<Relationship Id="r{k}" Type="{office}/worksheet" Target="worksheets/sheet{k}.xml"/>'
            for k in range(1, len(sheets) + 1)
        )
        zipped.writestr(
            "xl/_rels/workbook.xml.rels", f'<Relationships xmlns="{package}/relationships">{links}</Relationships>'
        )
        for k, rows in enumerate(sheets.values(), start=1):
            lines = "".join(f"<row>{''.join(map(_cell, row))}</row>" for row in rows)
            ranges = "".join(f'<mergeCell ref="{one}"/>' for one in merged if k == 1)
            more = f"<mergeCells>{ranges}</mergeCells>" if ranges else ""
            zipped.writestr(
                f"xl/worksheets/sheet{k}.xml",
                f'<worksheet xmlns="{main}"><sheetData>{lines}</sheetData>{more}</worksheet>',
            )
    return sink.getvalue()


def _cell(cell: object) -> str:
    if cell is None:
        return "<c/>"
    return f"<c><v>{cell!r}</v></c>" if isinstance(cell, float) else f'<c t="inlineStr"><is><t>{cell}</t></is></c>'


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
    with pytest.raises(InputError, match=r"300 values|has 600 values") as problem:
        sw.Recording.from_table(read_table(content, "a.zip"), rig)
    assert problem.value.code == "unequal-length"
    with pytest.raises(InputError, match="has no column 'Gyro'"):
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
    ],
)
def test_gyroscopes_are_found_by_name_and_unit(names, expected):
    accelerations = {"linear_acceleration.x": W["x"], "accX": W["y"], "az (m/s^2)": W["z"]}
    columns = dict(zip(names, (T, *W.values()), strict=True)) | accelerations
    content = text("|".join(columns), *columns.values()).encode()
    found = guess_roles(describe(read_table(content, "a.csv")))
    assert (
        found.found["angle_speed"].column == expected.partition(" [")[0]
        or found.found["angle_speed"].column == expected
    )
    assert "angle" not in found.found
    assert {name for name, what in found.others.items() if "accelerometer" in what} >= {"accX", "linear_acceleration.x"}


def test_accelerometers_alone_have_no_role():
    found = guess_roles(describe(read_table(ACCELERATION.encode(), "a.csv"))).found
    assert set(found) == {"time"}


def test_a_rate_that_is_named_as_the_angle():
    rig = sw.Rig.from_text(
        'name = "r"\n[axis]\ngravity_torque = 0.1\n[drive]\nkind = "none"\n[log]\nangle = "gyro_z"\n'
    )
    with pytest.raises(InputError, match="name it as angle_speed") as problem:
        sw.Recording.from_columns({"t": T, "gyro_z [rad/s]": W["z"]}, rig)
    assert problem.value.code == "rate-as-angle"
    log = sw.Recording.from_columns({"t": T, "gyro_z": W["z"]}, rig)
    assert [one.code for one in log.findings if one.level == "warning"] == ["rate-as-angle"]
