"""Every file format and text dialect: what goes in comes out, bit for bit, and what cannot be read is named."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from refusals import coded
from swingid.cli import main
from swingid.errors import InputError, UsageError
from swingid.model.rig import Rig
from swingid.recording.convert import convert
from swingid.recording.formats import WRITERS, read_table
from swingid.recording.formats.dialect import find_layout
from swingid.recording.formats.table import split_unit
from swingid.recording.recording import Recording

TIME = np.arange(2000) / 500
ANGLE = 0.8 * np.sin(8.5 * TIME)
ENDINGS = [ending for writer in WRITERS for ending in writer.ENDINGS if ending != ".json"]
numbers = arrays(np.float64, 12, elements=st.floats(allow_nan=False, allow_infinity=False, width=64))


def free_rig(**log):
    keys = "\n".join(f"{key} = {json.dumps(value)}" for key, value in log.items())
    tables = (
        'name = "arm"\n[axis]\ngravity_torque = 0.2\n[drive]\nkind = "none"\n[sensors]\ncounts_per_turn = 4096\n[log]\n'
    )
    return Rig.from_text(tables + keys, "arm.toml")


@settings(max_examples=15, deadline=None)
@given(x=numbers, y=numbers)
@pytest.mark.parametrize("writer", WRITERS, ids=lambda w: w.ENDINGS[0])
def test_every_format_reads_back_what_it_wrote(writer, x, y):
    metadata = {"metadata": {"name": "Pendel Nº 3"}, "drive": "none"}
    table = read_table(writer.write({"t": x, "theta": y}, metadata), f"run{writer.ENDINGS[0]}")
    np.testing.assert_array_equal(table.numbers("t")[0], x)
    np.testing.assert_array_equal(table.numbers("theta")[0], y)
    assert dict(table.metadata) == metadata


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_recording_survives_every_format(tmp_path, ending):
    rig = free_rig()
    log = Recording.from_columns({"t": TIME, "q1": ANGLE}, rig)
    again = Recording.load(log.save(tmp_path / f"run{ending}", rig), rig)
    np.testing.assert_array_equal(again.angle, log.angle)
    np.testing.assert_array_equal(again.time, log.time)


@pytest.mark.parametrize("first", ENDINGS)
def test_conversion_keeps_numbers_and_metadata(tmp_path, first):
    rig = free_rig()
    log = Recording.from_columns({"t": TIME, "q1": ANGLE}, rig)
    source = log.save(tmp_path / f"a{first}", rig)
    for second in (".parquet", ".csv", ".mcap"):
        rows, columns, dropped = convert(source, tmp_path / f"b{second}")
        assert (rows, columns, dropped) == (2000, ["t", "q1"], [])
        again = Recording.load(tmp_path / f"b{second}", rig)
        np.testing.assert_array_equal(again.angle, log.angle)


DIALECTS = {
    "comma": "t,q1\n{rows}",
    "units in the header": "t [s],q1 [rad]\n{rows}",
    "units in brackets": "t (s),q1 (rad)\n{rows}",
    "line of units": "t,q1\ns,rad\n{rows}",
    "quoted": '"t","q1"\n{rows}',
    "hash comments": "# made by a logger\n# on Monday, 12:30\nt,q1\n{rows}",
    "percent comments": "% a; b, c\n%\nt,q1\n{rows}",
    "slash comments": "// rig 3\nt,q1\n{rows}",
    "savetxt": "# t,q1\n{rows}",
    "title lines": "Measurement 7\nOperator: A. Person\n\nt,q1\n{rows}",
    "padded titles": "Measurement 7,\nDate: 3.5.2025,\n\nt,q1\n{rows}",
    "padded titles and units": "Measurement 7,\nt,q1\ns,rad\n{rows}",
    "empty lines": "\n\nt,q1\n\n{rows}\n\n",
    "windows": "t,q1\r\n{rows}",
}
SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "blank": " "}


def text(pattern, separator=",", decimal="."):
    rows = "\n".join(f"{t:.6f}{separator}{q:.9f}" for t, q in zip(TIME[:400], ANGLE[:400], strict=True))
    header, _, _ = pattern.partition("{rows}")
    shown = header.replace(",", separator) if separator != "," else header
    whole = shown + (rows.replace(".", decimal) if decimal != "." else rows) + "\n"
    return whole.replace("\r\n", "\n").replace("\n", "\r\n") if "\r" in pattern else whole


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_of_text(tmp_path, dialect):
    path = tmp_path / "log.csv"
    path.write_bytes(text(DIALECTS[dialect]).encode())
    log = Recording.load(path, free_rig())
    np.testing.assert_allclose(log.angle, ANGLE[:400], atol=1e-9)
    assert not [f for f in log.findings if f.level == "warning"]


@pytest.mark.parametrize(
    ("separator", "decimal"), [(s, d) for s in SEPARATORS for d in ".," if (s, d) != ("comma", ",")]
)
def test_separators_and_decimal_signs(tmp_path, separator, decimal):
    path = tmp_path / "log.txt"
    path.write_bytes(text("t,q1\n{rows}", SEPARATORS[separator], decimal).encode())
    np.testing.assert_allclose(Recording.load(path, free_rig()).angle, ANGLE[:400], atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_encodings(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_bytes(text("t,q1\n{rows}").encode(encoding))
    assert len(Recording.load(path, free_rig())) == 400


def test_a_table_without_header_has_numbered_columns(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text("{rows}"))
    np.testing.assert_allclose(
        Recording.load(path, free_rig(time="column1", angle="column2")).angle, ANGLE[:400], atol=1e-9
    )
    with pytest.raises(InputError, match="'column1', 'column2'; set \\[log\\] time"):
        Recording.load(path, free_rig())


def test_a_header_of_other_width_is_no_table(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2\n" + text("{rows}"))
    with pytest.raises(InputError, check=coded("not-a-table", "3 columns", "2 cells")):
        Recording.load(path, free_rig())


@pytest.mark.parametrize(
    ("column", "split"),
    [
        ("theta [deg]", ("theta", "deg")),
        ("U (V)", ("U", "V")),
        ("x(:,2)", ("x(:,2)", "")),
        ("theta_rad(up=0)", ("theta_rad(up=0)", "")),
        ("f(2)", ("f(2)", "")),
        ("plain", ("plain", "")),
        ("[deg]", ("[deg]", "")),
    ],
)
def test_units_of_header_cells(column, split):
    assert split_unit(column) == split


def in_degrees(header):
    rows = "\n".join(f"{1e3 * t:.3f},{np.degrees(q):.7f}" for t, q in zip(TIME, ANGLE, strict=True))
    return header + rows + "\n"


def test_units_of_the_header_are_taken_and_told(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(in_degrees("t [ms],q1 [deg]\n"))
    log = Recording.load(path, free_rig())
    np.testing.assert_allclose(log.angle, ANGLE, atol=1e-8)
    np.testing.assert_allclose(log.time, TIME, atol=1e-9)
    notes = [f.message for f in log.findings if f.code == "unit-of-header"]
    assert len(notes) == 2
    assert "deg" in notes[1]


def test_a_header_against_the_rig_is_an_error(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(in_degrees("t [ms],q1 [deg]\n"))
    with pytest.raises(InputError, check=coded("unit-conflict", '[log] angle_unit = "rad"')):
        Recording.load(path, free_rig(angle_unit="rad"))
    assert len(Recording.load(path, free_rig(angle_unit="deg"))) == 2000


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_have_a_layout_or_none(content):
    layout = find_layout(content)
    assert layout is None or 0 <= layout.rows <= len(content)


def test_json_as_people_write_it():
    rows = [{"t": 0.0, "arm": {"q1": 1}}, {"t": 0.5, "arm": {"q1": 2}}]
    forms = [
        "\n".join(map(json.dumps, rows)),
        json.dumps(rows),
        json.dumps({"rig": "a", "data": rows}),
    ]
    for form in forms:
        table = read_table(form.encode(), "log.json")
        assert table.numbers("arm.q1")[0].tolist() == [1.0, 2.0]
    table = read_table(json.dumps({"t": [0, 1, None], "q1": [1, 2, 3], "name": "x"}).encode(), "log.json")
    assert np.isnan(table.numbers("t")[0][2])


def test_bam_duty_is_unwrapped():
    entries = [
        {"position": 0.1, "load": 65536 - 885, "input_volts": 7.0},
        {"position": 0.2, "load": 885, "input_volts": 8},
    ]
    log = {"motor": "xl330", "trajectory": "x", "entries": entries}
    table = read_table(json.dumps(log).encode(), "log.json")
    assert table.numbers("duty")[0].tolist() == [-1.0, 1.0]
    assert table.numbers("bridge_volts")[0].tolist() == [-7.0, 8.0]


def test_integers_that_no_float_holds_cost_their_cell():
    entries = [{"position": 0.1 * k, "load": 885, "input_volts": 10**400 if k == 1 else 8} for k in range(3)]
    table = read_table(json.dumps({"motor": "m", "trajectory": "x", "entries": entries}).encode(), "log.json")
    np.testing.assert_array_equal(table.numbers("bridge_volts")[0], [8.0, np.nan, 8.0])
    np.testing.assert_array_equal(table.numbers("input_volts")[0], [8.0, np.nan, 8.0])


def test_a_result_is_no_log():
    content = json.dumps({"schema": "swingid.result/1", "warnings": [{"code": "a", "message": "b"}]}).encode()
    with pytest.raises(InputError) as caught:
        read_table(content, "result.json")
    assert caught.value.code == "not-a-log"


def test_joint_states_of_ros2():
    mcap_ros2 = pytest.importorskip("mcap_ros2.writer")
    import io

    definition = (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        "================================================================================\nMSG: std_msgs/Header\n"
        "builtin_interfaces/Time stamp\nstring frame_id\n"
        "================================================================================\n"
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    buffer = io.BytesIO()
    writer = mcap_ros2.Writer(buffer)
    schema = writer.register_msgdef("sensor_msgs/msg/JointState", definition)
    for k in range(3):
        header = {"stamp": {"sec": 7, "nanosec": k * 1_000_000}, "frame_id": ""}
        message = {
            "header": header,
            "name": ["arm", "wheel"],
            "position": [0.1 * k, -k],
            "velocity": [],
            "effort": [k, 0],
        }
        writer.write_message("/joint_states", schema, message, log_time=k)
    writer.finish()
    table = read_table(buffer.getvalue(), "run.mcap")
    np.testing.assert_allclose(table.numbers("time")[0], 7 + np.arange(3) / 1000)
    np.testing.assert_allclose(table.numbers("arm.position")[0], [0.0, 0.1, 0.2])
    np.testing.assert_allclose(table.numbers("wheel.position")[0], [0.0, -1.0, -2.0])
    assert "arm.velocity" not in table.columns


def test_matlab_v73_has_its_axes_back():
    h5py = pytest.importorskip("h5py")
    import io

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        for name, values in (("t", TIME[None, :]), ("x", np.stack([ANGLE, 2 * ANGLE]))):
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    content = b"MATLAB 7.3 MAT-file".ljust(512, b"\0") + buffer.getvalue()[512:]
    table = read_table(content, "log.mat")
    np.testing.assert_array_equal(table.numbers("t")[0], TIME)
    np.testing.assert_array_equal(table.numbers("x(:,2)")[0], 2 * ANGLE)


def test_simulink_dataset_of_a_real_rig(data_dir):
    pytest.importorskip("matio")
    raw = data_dir / "free_pendulum"
    table = read_table((raw / "SinglePendulumArm_RawData_1.mat").read_bytes(), "a.mat")
    other = read_table((raw / "free_swing.csv").read_bytes(), "a.csv")
    np.testing.assert_allclose(table.numbers("time")[0], other.numbers("t_s")[0], atol=1e-9)
    np.testing.assert_allclose(table.numbers("Add2:1")[0], other.numbers("theta_rad(up=0)")[0], atol=1e-6)


@pytest.mark.parametrize(
    ("module", "content", "name"),
    [
        ("h5py", b"\x89HDF\r\n\x1a\n", "a.h5"),
        ("mcap.reader", b"\x89MCAP0\r\n", "a.mcap"),
    ],
)
def test_a_missing_package_is_named_with_its_install_line(monkeypatch, module, content, name):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, check=coded("missing-package", "'swingid[formats]'")):
        read_table(content, name)


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (b"\x89HDF\r\n\x1a\n" + b"x" * 100, "a.h5"),
        (b"\x89MCAP0\r\n" + b"x" * 100, "a.mcap"),
        (b'{"a": ', "a.json"),
        (b"[" * 100_000, "a.json"),
        (b'{"a": 1}', "a.json"),
        (b"[]", "a.json"),
        (b"\xff{}", "a.jsonl"),
    ],
)
def test_damaged_files_are_refused(content, name):
    with pytest.raises(InputError, match=name.replace(".", r"\.")) as caught:
        read_table(content, name)
    assert caught.value.code == "not-a-table"


def test_tables_in_memory(tmp_path):
    import pyarrow as pa

    rig = free_rig()
    plain = Recording.from_columns({"t": TIME, "q1": ANGLE}, rig)
    arrow = Recording.from_columns(pa.table({"t": TIME, "q1": ANGLE}), rig)
    np.testing.assert_array_equal(plain.angle, arrow.angle)
    assert plain.source.path is None
    with pytest.raises(UsageError, check=coded("not-a-table")):
        Recording.from_columns([1, 2], rig)
    with pytest.raises(UsageError, match="2 dimensions"):
        Recording.from_columns({"t": TIME, "q1": np.zeros((2, 2))}, rig)


def test_convert_command(tmp_path, capsys):
    source = tmp_path / "log.csv"
    source.write_text(text(DIALECTS["line of units"]))
    assert main(["convert", str(source), str(tmp_path / "log.h5")]) == 0
    assert "400 rows of t [s], q1 [rad]" in capsys.readouterr().out
    assert len(Recording.load(tmp_path / "log.h5", free_rig())) == 400
    assert main(["convert", str(source), str(source)]) == 2
    assert main(["convert", str(source), str(tmp_path / "log.xls")]) == 3
    assert main(["convert", str(tmp_path / "none.csv"), str(tmp_path / "a.csv")]) == 3


def _matlab_v73(path, fill) -> bytes:
    """A MATLAB v7.3 file: HDF5 behind a block of 512 bytes, with what `fill` puts into it."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path / "log.mat", "w", userblock_size=512) as file:
        fill(h5py, file)
    return b"MATLAB 7.3 MAT-file".ljust(512, b"\0") + (path / "log.mat").read_bytes()[512:]


@pytest.mark.parametrize(
    ("titles", "columns"),
    [
        (("time", "time"), ("rec.Y(1).Data", "rec.Y(2).Data")),  # which do not tell them apart
        (("theta", "Model Root/u"), ("rec.Y.theta", "rec.Y.Model Root/u")),
    ],
)
def test_recorders_of_dspace_in_matlab_v73_are_read_through_their_references(tmp_path, titles, columns):
    def written(file, path, title):
        text = file.create_dataset(path, data=np.array([[ord(letter)] for letter in title], dtype="u2"))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        return text.ref

    def fill(h5py, file):
        time = file.create_dataset("rec/X/Data", data=TIME[:, None])
        time.attrs["MATLAB_class"] = np.bytes_("double")
        written(file, "rec/X/Name", "time")
        signals = [file.create_dataset(f"#refs#/{k}", data=k * ANGLE[:, None]).ref for k in (1, 2)]
        shape = (2, 1)
        data = np.array(signals, dtype=object).reshape(shape)
        file.create_dataset("rec/Y/Data", data=data, dtype=h5py.ref_dtype)
        texts = [written(file, f"#refs#/n{k}", title) for k, title in enumerate(titles)]
        names = np.array(texts, dtype=object).reshape(shape)
        file.create_dataset("rec/Y/Name", data=names, dtype=h5py.ref_dtype)

    table = read_table(_matlab_v73(tmp_path, fill), "log.mat")
    assert set(table.columns) == {"rec.X.Data", *columns}
    np.testing.assert_array_equal(table.numbers("rec.X.Data")[0], TIME)
    np.testing.assert_array_equal(table.numbers(columns[1])[0], 2 * ANGLE)


def test_cells_of_matlab_v73_are_read_and_lead_no_further_than_once(tmp_path):
    def fill(h5py, file):
        cells = file.create_dataset("c", (4, 1), dtype=h5py.ref_dtype)
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        inner = file.create_group("#refs#/s")
        inner.create_dataset("x", data=ANGLE)
        cells[0, 0] = file.create_dataset("#refs#/t", data=TIME).ref
        cells[1, 0] = inner.ref
        cells[2, 0] = cells.ref  # leads back; the fourth leads nowhere

    table = read_table(_matlab_v73(tmp_path, fill), "log.mat")
    assert set(table.columns) == {"c{1}", "c{2}.x"}
    np.testing.assert_array_equal(table.numbers("c{2}.x")[0], ANGLE)


def test_what_is_masked_is_missing():
    rig = free_rig()
    masked = np.ma.masked_array(ANGLE, mask=np.arange(len(ANGLE)) % 7 == 3)
    holed = np.where(masked.mask, np.nan, ANGLE)
    with_mask = Recording.from_columns({"t": TIME, "q1": masked}, rig)
    np.testing.assert_array_equal(with_mask.angle, Recording.from_columns({"t": TIME, "q1": holed}, rig).angle)
    assert len(with_mask) < len(ANGLE)


@pytest.mark.parametrize("place", ["first", "last"])
def test_a_quote_that_is_not_closed_loses_no_rows_in_silence(tmp_path, place):
    rows = [f"{t:.3f},{q:.6f}" for t, q in zip(TIME, ANGLE, strict=True)]
    middle = len(rows) // 2
    t, q = rows[middle].split(",")
    rows[middle] = f'"{t},{q}' if place == "first" else f'{t},"{q}'
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,q1", *rows]))
    with pytest.raises(InputError, check=coded("open-quote", t)):
        Recording.load(path, free_rig())


def test_a_minus_sign_of_typesetting_is_a_minus(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n" + "\n".join(f"{t!r},{q!r}" for t, q in zip(TIME.tolist(), ANGLE.tolist(), strict=True)))
    plain = Recording.load(path, free_rig())
    path.write_text(path.read_text().replace(",-", ",\u2212"), encoding="utf-8")
    assert "\u2212" in path.read_text(encoding="utf-8")
    np.testing.assert_array_equal(Recording.load(path, free_rig()).angle, plain.angle)
