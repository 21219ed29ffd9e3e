"""Text as spreadsheets, LabVIEW and ROS write it: what is read is what was measured."""

from __future__ import annotations

import io
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

import swingid as sw
from recording_cases import rig_with, swing
from swingid.errors import InputError
from swingid.recording import Recording
from swingid.recording.formats import read_table
from swingid.recording.formats.cells import is_stamp, plain_cells, seconds_of
from swingid.recording.formats.table import Table
from swingid.recording.inspect import describe, guess_roles

LOG = swing(rate=100.0)
START = datetime(2024, 3, 5, 23, 59, 58, 500_000)  # two days in one log


def german(x, digits=6):
    return f"{x:,.{digits}f}".translate(str.maketrans(",.", ".,"))


def rows_of(time, angle=LOG.angle, wheel=LOG.wheel_angle, voltage=LOG.voltage, mark=","):
    cells = (
        [t, *(x if isinstance(x, str) else f"{x:.9g}" for x in row)]
        for t, *row in zip(time, angle, wheel, voltage, strict=True)
    )
    return "\n".join(mark.join(row) for row in cells) + "\n"


def read(text, name="log.csv", **log):
    """The log in a text by a rig of these columns, and its path-less findings."""
    from swingid.recording import Recording
    from swingid.recording.recording import Source

    return Recording.from_table(
        read_table(text if isinstance(text, bytes) else text.encode(), name), rig_with(**log), Source(name)
    )


def stamped(form):
    return [form(START + timedelta(seconds=float(t))) for t in LOG.time]


@pytest.mark.parametrize(
    "form",
    [
        lambda at: at.isoformat(),
        lambda at: at.isoformat() + "Z",
        lambda at: at.isoformat(sep=" ", timespec="milliseconds") + "+01:00",
        lambda at: at.strftime("%H:%M:%S.%f"),
        lambda at: at.strftime("%d.%m.%Y %H:%M:%S.%f")[:-3],
        lambda at: at.strftime("%m/%d/%Y %I:%M:%S.%f %p"),
        lambda at: at.strftime("%M:%S.%f")[:-5] if at.microsecond % 100_000 == 0 else at.strftime("%M:%S.%f"),
    ],
)
def test_times_of_day_and_dates_are_seconds_also_over_midnight(form):
    cells = stamped(form)
    if cells[0].startswith("59:"):  # minutes and seconds only, as Excel saves them: no hour tells where they go on
        cells = [cell.replace("00:", "60:", 1) for cell in cells]
    log = read("t,q1,q2,u\n" + rows_of(cells))
    np.testing.assert_allclose(np.diff(log.time), np.diff(LOG.time), atol=1e-6)
    np.testing.assert_allclose(log.angle, LOG.angle, atol=1e-8)


def test_a_german_spreadsheet():
    head = "Zeit;Winkel;Schwungrad;Spannung;;\r\n[ms];[°];[°];[V];;\r\n"
    rows = (
        f"{german(1e3 * t, 0)};{german(np.degrees(q))};{german(np.degrees(w))};{german(u)};;\r\n"
        for t, q, w, u in zip(LOG.time, LOG.angle, LOG.wheel_angle, LOG.voltage, strict=True)
    )
    log = read(
        b"\xef\xbb\xbf" + (head + "".join(rows)).encode(),
        time="Zeit",
        angle="Winkel",
        wheel_angle="Schwungrad",
        voltage="Spannung",
    )
    np.testing.assert_allclose(log.time, LOG.time, atol=1e-12)
    np.testing.assert_allclose(log.angle, LOG.angle, atol=1e-8)
    np.testing.assert_allclose(log.wheel_angle, LOG.wheel_angle, atol=1e-8)


def test_marks_between_thousands_in_quotes():
    cells = [f'"{1e3 * t:,.1f}"' if t >= 1 else f"{1e3 * t:.1f}" for t in LOG.time]
    log = read("t [ms],q1,q2,u\n" + rows_of(cells))
    np.testing.assert_allclose(log.time, LOG.time, atol=1e-12)


def test_a_word_among_decimal_commas_costs_its_row_only():
    lines = [f"{german(t)};{german(q)};{german(w)};{german(u)}" for t, q, w, u in zip(*columns(), strict=True)]
    lines[7] = lines[7].rpartition(";")[0] + ";#NV"
    log = read("t;q1;q2;u\n" + "\n".join(lines) + "\n")
    assert len(log) == len(LOG) - 1
    assert [finding.code for finding in log.findings] == ["rows-without-numbers", "gaps"]


def columns():
    return LOG.time, LOG.angle, LOG.wheel_angle, LOG.voltage


@pytest.mark.parametrize(
    ("cells", "decimal", "numbers"),
    [
        (["999", "1,000", "1,234.5"], ".", [999, 1000, 1234.5]),
        (["999", "1.000", "1.234,5", "-12.345.678"], ",", [999, 1000, 1234.5, -12345678]),
        (["0.500", "1.000"], ",", [0.5, 1.0]),  # nobody writes thousands with a 0 in front
        (["0,5", "1,25"], ".", [0.5, 1.25]),
        (["1,5e3"], ",", [1500]),
    ],
)
def test_numerals(cells, decimal, numbers):
    assert [float(cell) for cell in plain_cells(cells, decimal)] == numbers


@given(st.text(max_size=30), st.sampled_from(".,"))
def test_any_text_is_a_cell(text, decimal):
    (cell,) = plain_cells([text], decimal)
    assert len(cell) <= len(text)
    if is_stamp(text):
        assert seconds_of([text]) is not None or ":" in text


@given(st.datetimes(datetime(1980, 1, 1), datetime(2050, 1, 1)))
def test_a_stamp_is_its_seconds_since_1970(at):
    (seconds,) = seconds_of([at.isoformat(sep=" ", timespec="microseconds")])
    assert abs(seconds - (at - datetime(1970, 1, 1)).total_seconds()) < 1e-6


def labview(x="One", decimal=".", segments=1):
    head = f"LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t{decimal}\nX_Columns\t{x}\n"
    text = head + "***End_of_Header***\t\n\t\n"
    number = german if decimal == "," else lambda value: f"{value:.6f}"
    for rows in np.array_split(np.arange(len(LOG)), segments):
        text += "Channels\t2\t\t\nY_Unit_Label\tdeg\tV\t\nX_Dimension\tTime\tTime\t\n"
        text += f"X0\t{number(0.0)}\t\nDelta_X\t{number(0.01)}\t\n***End_of_Header***\t\t\n"
        names = {"One": "X_Value\tq1\tu", "No": "X_Value\tq1\tu", "Multi": "X_Value\tq1\tX_Value\tu"}
        text += names[x] + "\tComment\n"
        for k in rows:
            t, q, u = number(LOG.time[k]), number(np.degrees(LOG.angle[k])), number(LOG.voltage[k])
            text += {"One": f"{t}\t{q}\t{u}\n", "No": f"\t{q}\t{u}\n", "Multi": f"{t}\t{q}\t{t}\t{u}\n"}[x]
    return text


@pytest.mark.parametrize("x", ["One", "No", "Multi"])
@pytest.mark.parametrize(("decimal", "segments"), [(".", 1), (",", 1), (".", 3)])
def test_labview_writes_tables(x, decimal, segments):
    log = read(labview(x, decimal, segments), "run.lvm", kind="none", time="X_Value")
    np.testing.assert_allclose(log.time, LOG.time, atol=1e-9)
    np.testing.assert_allclose(log.angle, LOG.angle, atol=1e-7)


def test_labview_that_was_cut_off_is_one_sentence():
    whole = labview()
    for size in (10, 60, 150, whole.index("X_Value"), len(whole) - 40):
        try:
            read_table(whole[:size].encode(), "run.lvm")
        except InputError as error:
            assert error.message.count("\n") == 0


@pytest.mark.parametrize(
    ("head", "kind", "instead"),
    [
        (b"TDSm\x0e\0\0\0", "LabVIEW TDMS", "CSV"),
        (b"#ROSBAG V2.0\n", "bag of ROS 1", "MCAP"),
        (b"SQLite format 3\0", "bag of ROS 2", "MCAP"),
        (b"MDF     4.10", "MDF", "CSV"),
    ],
)
def test_what_is_no_table_is_named(head, kind, instead):
    with pytest.raises(InputError, match=kind) as caught:
        read_table(head + bytes(100), "log.dat")
    assert instead in caught.value.message


def test_a_log_from_an_epoch_counts_from_its_first_row():
    stamps = [str(1_700_000_000_123_456_789 + round(1e9 * t)) for t in LOG.time]
    log = read("t,q1,q2,u\n" + rows_of(stamps), time_unit="ns")
    np.testing.assert_allclose(log.time, LOG.time, atol=3e-7)
    assert [finding.code for finding in log.findings] == ["from-epoch"]
    assert isinstance(log, Recording)


def test_rows_with_text_below_a_commented_header():
    head = "%time,field.header.seq,field.name0,field.position0,field.position1\n"
    rows = "".join(
        f"{round(1.7e18 + 1e9 * t)},{k},arm,{q:.9g},{w:.9g}\n"
        for k, (t, q, w) in enumerate(zip(LOG.time, LOG.angle, LOG.wheel_angle, strict=True))
    )
    table = read_table((head + rows).encode(), "rostopic.csv")
    assert list(table.columns) == ["time", "field.header.seq", "field.name0", "field.position0", "field.position1"]
    assert len(table.columns["time"]) == len(LOG)
    assert guess_roles(describe(table)).column("angle") == "field.position0"


def simulink(form):
    """What Simulink's blocks To Workspace and To File leave behind."""
    t, q, w = LOG.time.reshape(-1, 1), LOG.angle.reshape(-1, 1), LOG.wheel_angle.reshape(-1, 1)
    signals = np.zeros((1, 2), dtype=[("values", object), ("label", object)])
    signals[0, 0], signals[0, 1] = (q, "angle"), (w, "wheel")
    return {
        "structure": {"out": {"time": t, "signals": signals, "blockName": "model/scope"}},
        "one signal": {"tout": t, "yout": {"time": t, "signals": {"values": np.hstack([q, w]), "label": "x"}}},
        "array": {"tout": t, "yout": np.hstack([q, w])},
        "file": {"ans": np.hstack([t, q, w]).T},
    }[form]


@pytest.mark.parametrize("form", ["structure", "one signal", "array", "file"])
def test_simulink_exports_are_columns_whose_roles_are_guessed(form):
    sink = io.BytesIO()
    savemat(sink, simulink(form))
    table = read_table(sink.getvalue(), "sim.mat")
    roles = guess_roles(describe(table))
    for role, values in ("time", LOG.time), ("angle", LOG.angle), ("wheel_angle", LOG.wheel_angle):
        np.testing.assert_array_equal(table.numbers(roles.column(role))[0], values)


@pytest.mark.parametrize(
    ("names", "roles"),
    [
        (
            ("__time", "/joint_states/header/stamp", "/joint_states/pendulum/position", "/joint_states/wheel/position"),
            ("__time", "/joint_states/pendulum/position", "/joint_states/wheel/position"),
        ),
        (
            ("time", "/joint_states/header/seq", "/joint_states/position_0", "/joint_states/position_1"),
            ("time", "/joint_states/position_0", "/joint_states/position_1"),
        ),
        (("Unnamed: 0", "t", "theta", "wheel_angle"), ("t", "theta", "wheel_angle")),
        (("millis", "row", "enc1", "enc2"), ("millis", "enc1", "enc2")),
        (("column1", "column2", "column3", "column4"), ("column2", "column3", "column4")),
    ],
)
def test_headings_of_ros_pandas_and_loggers(names, roles):
    count, rows = 2 * np.pi / 4096, np.arange(float(len(LOG)))
    angles = [np.round(values / count) for values in (LOG.angle, LOG.wheel_angle)]
    clock = 1e9 * LOG.time if names[0] == "time" else 1e3 * LOG.time if names[0] == "millis" else LOG.time
    first = {names[0]: rows, names[1]: clock} if roles[0] == names[1] else {names[0]: clock, names[1]: rows}
    if "stamp" in names[1]:
        first[names[1]] = clock
    found = guess_roles(describe(Table({**first, names[2]: angles[0], names[3]: angles[1]})))
    assert [found.column(role) for role in ("time", "angle", "wheel_angle")] == list(roles)


def test_a_voltage_of_the_motor_is_no_wheel():
    columns = {"t": LOG.time, "theta": LOG.angle, "motor_voltage": LOG.voltage}
    assert guess_roles(describe(Table(columns))).column("wheel_angle") is None


@pytest.mark.parametrize("kind", ["instants", "durations"])
def test_instants_and_durations_of_numpy(kind):
    since = (LOG.time * 1e9).round().astype("timedelta64[ns]")
    time = since if kind == "durations" else np.datetime64("2024-03-05T12:00") + since
    columns = {"t": time, "q1": LOG.angle, "q2": LOG.wheel_angle, "u": LOG.voltage}
    np.testing.assert_allclose(Recording.from_columns(columns, rig_with()).time, LOG.time, atol=3e-7)


@pytest.mark.parametrize("decimal", [".", ","])
@given(
    seed=st.integers(0, 10**6),
    scale=st.sampled_from([1.0, 300.0, 5000.0]),
    digits=st.integers(0, 4),
    grouped=st.booleans(),
)
def test_what_is_written_in_any_dialect_is_read(decimal, seed, scale, digits, grouped):
    """Fixed decimals, with and without marks between thousands, and as few digits as the numbers need."""
    rng = np.random.default_rng(seed)
    time, values = np.arange(90) * 0.125, np.round(rng.normal(0, scale, 90), digits)
    mark = ";" if decimal == "," else rng.choice([";", "\t", "|"])
    swap = str.maketrans(",.", ".,") if decimal == "," else {}

    def written(x):
        return (f"{x:,.{digits}f}" if grouped else f"{x:.10g}").translate(swap)

    text = "".join(f"{t:.3f}".translate(swap) + mark + written(x) + "\n" for t, x in zip(time, values, strict=True))
    table = read_table(f"t{mark}x\n{text}".encode(), "log.csv")
    np.testing.assert_allclose(table.numbers("t")[0], time, atol=1e-12)
    np.testing.assert_allclose(table.numbers("x")[0], values, atol=1e-12)


@pytest.mark.parametrize(
    "head",
    [
        "t,q1,q2,u\n{rows},\n",  # rows that end with a comma, as printf("%f,%f,%f,\n") leaves them
        "t,q1,q2,u,\n{rows}\n",
        "Run 7,,,,\nMonday,,,,\n,,,,\nt,q1,q2,u,\ns,Rad,Rad,Volt,\n{rows},\n",
    ],
)
def test_a_delimiter_at_the_end_of_header_or_rows(head):
    end = head.partition("{rows}")[2]
    rows = rows_of([f"{t:.9g}" for t in LOG.time]).rstrip("\n").replace("\n", end)
    log = read(head.replace("{rows}", rows), wheel_angle_unit="rad", angle_unit="rad")
    np.testing.assert_allclose(log.time, LOG.time, atol=1e-8)
    np.testing.assert_allclose(log.voltage, LOG.voltage, atol=1e-7)


PREAMBLE = """Logger v2.1, serial 1234
Operator: A. B., room 3
Date: 2024-03-05
Rate, 60

Samples 545, Channels: 3, Rate, 60
"""


@pytest.mark.parametrize("units", ["", "s,deg\n"])
def test_lines_about_the_log_are_no_header(units: str) -> None:
    body = "t,theta\n" + units + "".join(f"{k / 50},{k % 7}.5\n" for k in range(100))
    found = read_table((PREAMBLE + body).encode(), "log.csv")
    assert list(found.columns) == ["t", "theta"]
    assert len(found.numbers("theta")[0]) == 100
    assert found.unreadable_rows == 0


def test_a_line_of_two_words_above_names_with_units_is_no_header() -> None:
    body = "Operator,A. Person\nt (s),theta (deg)\n" + "".join(f"{k / 50},{k % 7}.5\n" for k in range(100))
    found = read_table(body.encode(), "log.csv")
    assert list(found.columns) == ["t (s)", "theta (deg)"]
    assert found.unreadable_rows == 0


@pytest.mark.parametrize(
    ("header", "mark", "names"),
    [
        ("#  Time (S)   angle  volts\n# \n", "  ", ["Time_(S)", "angle", "volts"]),
        ("# t   theta   u\n", "\t", ["t", "theta", "u"]),
        ("# t   theta   u\n", ",", ["t", "theta", "u"]),
        ("% t\tmotor angle\tu\n%-------\n", " ", ["t", "motor_angle", "u"]),
        ('# t,"angle, rad",u\n# ----\n', ",", ["t", "angle, rad", "u"]),
        ("# run 7 of the copper ring\n# length = 60 s\n", " ", ["column1", "column2", "column3"]),
    ],
)
def test_a_commented_header_may_be_parted_otherwise_than_its_rows(header, mark, names) -> None:
    rows = "\n".join(mark.join(f"{x:.4f}" for x in row) for row in zip(LOG.time, LOG.angle, LOG.angle, strict=True))
    table = read_table(f"# made on Monday\n{header}{rows}\n".encode(), "log.txt")
    assert list(table.columns) == names
    np.testing.assert_allclose(table.columns[names[1]], np.round(LOG.angle, 4))


def test_lines_that_the_rig_file_skips(tmp_path: Path) -> None:
    rig = sw.Rig.from_text(
        'name = "a"\n[axis]\ngravity_torque = 1\n[drive]\nkind = "none"\n'
        '[log]\ntime = "t"\nangle = "q"\nskip_rows = 3\ncomment = "!"\n'
    )
    rows = [f"{k / 50},{np.sin(k / 10):.5f}" for k in range(200)]
    rows.insert(50, "! paused, 0.1")
    path = tmp_path / "log.txt"
    path.write_text("a,b\n1,2\n3,4\nt,q\n" + "\n".join(rows) + "\n")
    log = sw.Recording.load(path, rig)
    assert len(log) == 200
    assert [one.code for one in log.findings] == []
    log.save(tmp_path / "again.csv", rig)
    assert len(sw.Recording.load(tmp_path / "again.csv", rig)) == 200


@pytest.mark.parametrize("header", ["a,a,b\nx,x\n", "a,a\nx,x,y,z\n", "a,b,a\nm,m,m,m,m\n", "q,q\nw\n"])
def test_rows_above_the_numbers_of_other_widths_are_read_or_refused_in_a_sentence(header: str) -> None:
    body = "".join(f"{k / 50},{k % 7}.5,{k % 3}\n" for k in range(20))
    try:
        found = read_table((header + body).encode(), "log.csv")
    except InputError as error:
        assert error.exit_code == 3
    else:
        assert len(found.columns) == 3
        assert len(found.numbers(next(iter(found.columns)))[0]) >= 20
