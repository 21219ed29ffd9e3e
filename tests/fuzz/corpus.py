"""Valid files of every format, small ones, in the dialects and variants that people have."""

from __future__ import annotations

import io
import json
import random
import warnings
from functools import cache
from pathlib import Path

import numpy as np

from fuzz.exports import archive_files, further_rigs, workbook_files
from swingid.model.rig import Rig

ROWS = 90
TIME = np.arange(ROWS) / 50.0
COLUMNS = {
    "t": TIME,
    "q1": 0.8 * np.sin(8.5 * TIME),
    "q2": -20 * np.sin(8.5 * TIME) + TIME,
    "u": 5 * np.cos(8.5 * TIME),
}
METADATA = {"metadata": {"name": "Pendel 3"}, "drive": "none", "log": {"drive_held": True}, "findings": []}

FREE = 'name = "arm"\n[axis]\ngravity_torque = 0.2\n[drive]\nkind = "none"\n[sensors]\ncounts_per_turn = 4096\n[log]\n'


@cache
def rigs() -> tuple[Rig, ...]:
    """Rigs to read the logs with: a free arm, the same in degrees, a reaction wheel, a linear axis, a rate."""
    return (
        Rig.from_text(FREE, "arm.toml"),
        Rig.from_text(FREE + 'angle_unit = "deg"\nangle_zero = "up"\nangle_sign = -1\n', "deg.toml"),
        Rig.from_text(FREE + 'angle_unit = "counts"\nrate = 50\n', "counts.toml"),
        Rig.builtin("paper"),
        Rig.builtin("paper").changed({"log.wheel_angle_is": "absolute", "log.wheel_angle_unit": "turns"}),
        Rig.from_text(
            'name = "slide"\n[axis]\nkind = "linear"\n[drive]\nkind = "direct"\n[log]\ntorque = "u"\n', "slide.toml"
        ),
        *(
            Rig.from_text(FREE + f'time = "{time}"\nangle = "{angle}"\n', "named.toml")
            for time, angle in (
                *(("run.t", "run.q1"), ("data(:,1)", "data(:,2)"), ("timestamp", "position"), ("time", "q1")),
                *(("time", "arm.position"), ("column1", "column2")),
            )
        ),
        *(
            Rig.from_text(FREE.replace("counts_per_turn = 4096\n", "") + log, "rate.toml")
            for log in (
                'time = "Time (s)"\nangle_speed = "Gyroscope z"\n',
                'time_unit = "ns"\ntime = "time"\nangle_speed = "z"\n',
            )
        ),
    )


def rig_for(columns: object, draw: random.Random) -> Rig:
    """A rig, most often one whose columns are there."""
    axis = {rig: rig.log.angle_speed or rig.log.angle for rig in rigs()}
    fits = [rig for rig in rigs() if axis[rig] in columns and (rig.log.time in columns or rig.log.rate)]
    return draw.choice(fits if fits and draw.random() < 0.9 else rigs())


@cache
def motions() -> tuple[tuple[dict[str, np.ndarray], tuple[str, ...]], ...]:
    """Columns of motions that can be identified, each with the text of rigs that fit it."""
    from closed_form_logs import ONE_TONE, TWO_TONES, direct_log, free_log, wheel_log

    time = np.arange(500) / 100.0
    wheel = wheel_log(Rig.builtin("paper"), TWO_TONES, lambda v: 1e-3 * v, time)
    direct = direct_log(ONE_TONE, lambda v: 1e-3 * v + 2e-3 * np.sign(v), time)
    free = free_log(lambda v: 3e-4 * v, time)
    given = Rig.builtin("paper").changed({"axis.inertia": None, "axis.friction": None})
    unknown = given.changed({"axis.gravity_torque": "unknown", "sensors.nonlinearity": "0.1 deg"})
    late = given.changed({"sensors.latency": "0 ± 1 ms", "sensors.noise": 1e-4})
    driven = 'name = "driven"\n[axis]\ngravity_torque = {b}\n[drive]\nkind = "{kind}"\n'
    return (
        (
            {"t": time, "q1": wheel.angle, "q2": wheel.wheel_angle, "u": 3 * np.cos(8.5 * time)},
            (given.text, unknown.text, late.text),
        ),
        (
            {"t": time, "q1": direct.angle, "tau": direct.torque},
            (driven.format(b=78e-3, kind="direct"), driven.format(b='"unknown"', kind="direct")),
        ),
        ({"t": time, "q1": free.angle}, (driven.format(b=78e-3, kind="none"),)),
    )


def _text(
    separator: str = ",", decimal: str = ".", header: str = "t,q1,q2,u\n", newline: str = "\n", clock: str = "{:.6g}"
) -> bytes:
    forms = (clock, *["{:.6g}"] * 3)
    cells = (
        [form.format(x).replace(".", decimal) for form, x in zip(forms, row, strict=True)]
        for row in zip(*COLUMNS.values(), strict=True)
    )
    rows = [separator.join(row) for row in cells]
    return (header.replace(",", separator) + newline.join(rows) + newline).encode()


def _labview() -> bytes:
    """A measurement file of LabVIEW."""
    head = "LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\n\n"
    segment = "Channels\t3\nY_Unit_Label\trad\trad\tV\nX0\t0\nDelta_X\t0.02\n***End_of_Header***\n"
    return (head + segment).encode() + _text("\t", ".", "X_Value,q1,q2,u,Comment\n")


@cache
def csv_files() -> tuple[bytes, ...]:
    """Text tables in many dialects."""
    from swingid.recording.formats import csv

    plain = _text()
    return (
        plain,
        csv.write(COLUMNS, METADATA),
        _text(";", ",", 't [s],"q1 [deg]",q2 (rad),u [V]\n'),
        _text("\t", ".", "t,q1,q2,u\ns,rad,rad,V\n", "\r\n"),
        _text(" ", ".", "# t,q1,q2,u\n"),
        _text("|", ".", "Measurement 7\nOperator: A\n\nt,q1,q2,u\n"),
        _text(header=""),
        b"\xef\xbb\xbf" + plain,
        plain.decode().encode("utf-16"),
        _text(header="t,q1 [°],q2,u\n").decode().encode("latin-1"),
        plain.replace(b"0.1", b"nan").replace(b"0.4", b""),
        _text(";", ",", "t,q1,q2,u\n", "\r\n", clock="14:02:{:06.3f}"),
        _text(header="t,q1,q2,u\n", clock="2024-03-05T23:59:{:09.6f}Z"),
        _labview(),
    )


@cache
def parquet_files() -> tuple[bytes, ...]:
    """Parquet of swingid, and with other codecs, types, pages and row groups."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from swingid.recording.formats import parquet

    def made(table: pa.Table, **options: object) -> bytes:
        sink = io.BytesIO()
        pq.write_table(table, sink, **options)
        return sink.getvalue()

    table = pa.table(COLUMNS)
    counts = pa.table({"t": COLUMNS["t"], "q1": (COLUMNS["q1"] * 1000).astype(np.int32)})
    texts = pa.table({"t": [str(x) for x in COLUMNS["t"]], "q1": COLUMNS["q1"].astype(np.float32)})
    return (
        parquet.write(COLUMNS, METADATA),
        made(table, compression="none", use_dictionary=False, row_group_size=30),
        made(table, compression="snappy", data_page_version="2.0"),
        made(counts, compression="gzip"),
        made(texts, compression="lz4"),
        made(table, column_encoding="BYTE_STREAM_SPLIT", use_dictionary=False),
    )


@cache
def mat_files() -> tuple[bytes, ...]:
    """MATLAB v5: vectors, structs, a matrix, compressed and not."""
    import scipy.io

    from swingid.recording.formats import matlab

    def made(variables: dict[str, object], **options: object) -> bytes:
        sink = io.BytesIO()
        scipy.io.savemat(sink, variables, **options)
        return sink.getvalue()

    columns = {name: values.reshape(-1, 1) for name, values in COLUMNS.items()}
    return (
        matlab.write(COLUMNS, METADATA),
        made(columns),
        made({"run": columns, "note": "on Monday"}, do_compression=True),
        made({"data": np.column_stack(list(COLUMNS.values()))}),
        made({"q1": COLUMNS["q1"].astype(np.int16), "t": COLUMNS["t"].astype(np.float32)}),
    )


@cache
def hdf5_files() -> tuple[bytes, ...]:
    """HDF5 of swingid, MATLAB's v7.3 with its head of 512 bytes, groups."""
    import h5py

    from swingid.recording.formats import hdf5

    def made(userblock: int = 0, **options: object) -> bytes:
        sink = io.BytesIO()
        with h5py.File(sink, "w", userblock_size=userblock) as file:
            group = file.create_group("run")
            for name, values in COLUMNS.items():
                group.create_dataset(name, data=values.reshape(1, -1), **options)
            file.create_dataset("note", data="on Monday")
        return sink.getvalue()

    matlab = bytearray(made(512))
    matlab[:20] = b"MATLAB 7.3 MAT-file,"
    return hdf5.write(COLUMNS, METADATA), made(), bytes(matlab), made(chunks=(1, 30), compression="gzip", shuffle=True)


@cache
def mcap_files() -> tuple[bytes, ...]:
    """MCAP: JSON, and ROS 2 joint states."""
    from swingid.recording.formats import mcap

    return mcap.write(COLUMNS, METADATA), _joint_states(), _unchunked()


def _unchunked() -> bytes:
    """JSON messages without chunks, compression and checksums, so that a flipped bit reaches the messages."""
    from mcap.writer import CompressionType, Writer

    sink = io.BytesIO()
    writer = Writer(sink, compression=CompressionType.NONE, use_chunking=False, enable_crcs=False)
    writer.start()
    channel = writer.register_channel("/arm", "json", writer.register_schema("row", "jsonschema", b"{}"))
    for k, row in enumerate(zip(*(values.tolist() for values in COLUMNS.values()), strict=True)):
        writer.add_message(channel, k, json.dumps(dict(zip(COLUMNS, row, strict=True))).encode(), k)
    writer.finish()
    return sink.getvalue()


def _joint_states() -> bytes:
    from mcap_ros2.writer import Writer

    schema = (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        + "=" * 80
        + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        + "=" * 80
        + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    sink = io.BytesIO()
    writer = Writer(sink)
    kind = writer.register_msgdef("sensor_msgs/msg/JointState", schema)
    for k in range(ROWS):
        stamp = {"sec": 5, "nanosec": int(k * 2e7) % 10**9}
        message = {
            "header": {"stamp": stamp, "frame_id": ""},
            "name": ["arm"],
            "position": [float(COLUMNS["q1"][k])],
            "velocity": [0.0],
            "effort": [],
        }
        writer.write_message(topic="/joint_states", schema=kind, message=message, log_time=k, publish_time=k)
    writer.finish()
    return sink.getvalue()


@cache
def json_files() -> tuple[bytes, ...]:
    """JSON lines, lists of rows, objects of arrays, BAM's."""
    from swingid.recording.formats import json_rows

    rows = [dict(zip(COLUMNS, row, strict=True)) for row in zip(*(c.tolist() for c in COLUMNS.values()), strict=True)]
    entries = [
        {"position": row["q1"], "timestamp": row["t"], "load": 65000 if k % 2 else 300, "input_volts": 7.4, "speed": 0}
        for k, row in enumerate(rows)
    ]
    return (
        json_rows.write(COLUMNS, METADATA),
        json.dumps(rows).encode(),
        json.dumps({name: values.tolist() for name, values in COLUMNS.items()}).encode(),
        json.dumps({"mass": 0.1, "motor": "xl330", "trajectory": "sin", "entries": entries}).encode(),
        json.dumps([{"run": {"t": row["t"], "q1": row["q1"]}, "ok": True} for row in rows]).encode(),
    )


@cache
def object_files() -> tuple[bytes, ...]:
    """MATLAB files with time series inside objects."""
    import tempfile

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import matio
        from matio.utils.matclass import MatlabOpaque

    def series(name: str) -> MatlabOpaque:
        values = {"Time_": COLUMNS["t"].reshape(-1, 1), "Data_": COLUMNS[name].reshape(-1, 1), "Name": name}
        return MatlabOpaque(values, classname="timeseries")

    found = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "o.mat"
        for compressed in (True, False):
            matio.save_to_mat(str(path), {"q1": series("q1"), "q2": series("q2")}, "v7", do_compression=compressed)
            found.append(path.read_bytes())
    return tuple(found)


@cache
def result_files() -> tuple[bytes, ...]:
    """Result files, as `difference` and `validate` read them."""
    parameter = {"value": 3e-3, "standard_uncertainty": 1e-6, "interval95": [2.998e-3, 3.002e-3], "unit": "kg m^2"}
    entry = {"source": "scatter", "type": "A", "parameter": "inertia", "standard_uncertainty": 1e-6}
    result = {
        "schema": "swingid.result/1",
        "method": "momentum",
        "status": "ok",
        "parameters": {"inertia": parameter},
        "warnings": [{"code": "gaps", "message": "3 gaps."}],
        "notes": [],
        "budget": [entry | {"sensitivity": None, "shared_id": None}],
        "provenance": {"log": "a.csv", "rig": "paper-2020", "constants": {"axis.gravity_torque": {"value": 0.078}}},
        "error": None,
    }
    refused = result | {"parameters": {}, "status": "refused"}
    return json.dumps(result, indent=1).encode(), json.dumps(refused).encode()


@cache
def rig_files() -> tuple[bytes, ...]:
    """Rig files: the built-in ones, the examples, the template that `init` writes."""
    root = Path(__file__).resolve().parents[2]
    folders = (root / "src/swingid/model/rig/builtin", root / "examples/rigs", root / "src/swingid/cli")
    found = [path.read_bytes() for folder in folders for path in sorted(folder.glob("*.toml"))]
    return (*found, FREE.encode(), *further_rigs())


FILES = {
    "csv": (csv_files, ".csv"),
    "parquet": (parquet_files, ".parquet"),
    "mat": (mat_files, ".mat"),
    "hdf5": (hdf5_files, ".h5"),
    "mcap": (mcap_files, ".mcap"),
    "json": (json_files, ".jsonl"),
    "objects": (object_files, ".mat"),
    "archive": (archive_files, ".zip"),
    "workbook": (workbook_files, ".xlsx"),
}
"""Formats of logs: their valid files, and the ending."""
