"""Large logs in MCAP and HDF5: the same rows as in the whole file, in bounded memory, and one sentence about damage."""

from __future__ import annotations

import io
import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import swingid as sw
from large_logs import GIVEN, make_parts_small, write_large_log
from long_cases import quick_first
from refusals import coded
from swingid.cli import main
from swingid.errors import InputError
from swingid.recording.formats import hdf5, mcap, read_table
from swingid.recording.formats.mcap_parts import _messages
from swingid.recording.large import LargeLog, is_large, log

pytest.importorskip("h5py")
pytest.importorskip("mcap")

ROWS = 150_000
NAMES = ["t", "q1", "q2", "u"]


@pytest.fixture
def small_parts(monkeypatch):
    make_parts_small(monkeypatch, 40_000, 6_000)


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> dict[str, Path]:
    """15 s at 10 kHz in three formats."""
    folder = tmp_path_factory.mktemp("large")
    parquet = write_large_log(folder / "log.parquet", ROWS, row_group=ROWS)
    columns = {name: column.to_numpy() for name, column in zip(NAMES, pq.read_table(parquet).columns, strict=True)}
    (folder / "log.h5").write_bytes(hdf5.write(columns, {}))
    (folder / "log.mcap").write_bytes(mcap.write(columns, {}))
    return {ending: folder / f"log.{ending}" for ending in ("parquet", "h5", "mcap")}


def whole(path: Path | str) -> dict[str, np.ndarray]:
    """All columns of a file, read at once."""
    table = read_table(Path(path).read_bytes(), str(path))
    return {name: table.numbers(name)[0] for name in table.columns}


def in_pieces(path: Path | str, rows: int = 40_000, names: list[str] | None = None) -> dict[str, np.ndarray]:
    """The columns of a file, read some rows at a time."""
    file = log._file(path)
    tables = list(file.pieces(rows, names or file.together()))
    lengths = [len(next(iter(table.columns.values()))) for table in tables]
    assert set(lengths[:-1]) <= {rows}
    return {name: np.concatenate([table.columns[name] for table in tables]) for name in tables[0].columns}


@pytest.mark.parametrize("ending", ["h5", "mcap"])
def test_a_log_gives_the_result_that_parquet_gives(small_parts, logs, ending):
    assert is_large(logs[ending])
    found, known = (sw.identify(LargeLog(str(logs[e]), GIVEN), GIVEN) for e in (ending, "parquet"))
    assert found.inertia == known.inertia
    assert found.parameters == known.parameters
    assert len(found.provenance["parts"]) >= 2
    assert found.provenance["log_sha256"] != known.provenance["log_sha256"]


@pytest.mark.parametrize("ending", quick_first(1, ["h5", "mcap"]))
def test_pieces_hold_what_the_whole_file_holds(small_parts, logs, ending):
    once, found = whole(logs[ending]), in_pieces(logs[ending])
    assert list(found) == NAMES
    assert all(np.array_equal(once[name], found[name]) for name in NAMES)
    assert list(in_pieces(logs[ending], names=["u", "t"])) == ["u", "t"]


@pytest.mark.parametrize("ending", quick_first(1, ["h5", "mcap"]))
def test_commands_take_them(small_parts, logs, ending, tmp_path, capfd):
    rig = tmp_path / "rig.toml"
    rig.write_text(GIVEN.text)
    target = tmp_path / "result.json"
    assert main(["identify", str(logs[ending]), "--rig", str(rig), "--json", str(target)]) == 0
    assert "read-in-parts" in {note["code"] for note in json.loads(target.read_text())["notes"]}
    assert main(["identify", str(logs[ending]), "--rig", str(rig), "--part", "2:9", "--method", "equation-error"]) == 0
    assert main(["inspect", str(logs[ending])]) == 0
    assert main(["convert", str(logs[ending]), str(tmp_path / "back.parquet")]) == 0
    back = pq.read_table(tmp_path / "back.parquet")
    assert all(np.array_equal(back[name].to_numpy(), whole(logs["parquet"])[name]) for name in NAMES)
    capfd.readouterr()


@pytest.mark.parametrize("ending", ["h5", "mcap"])
def test_damage_is_said_in_one_sentence(small_parts, logs, ending, tmp_path):
    content = bytearray(logs[ending].read_bytes())
    at = 700_000  # behind the first chunk, which is looked at before
    content[at : at + 20_000] = bytes(20_000)
    path = tmp_path / f"damaged.{ending}"
    path.write_bytes(content)
    with pytest.raises(InputError, check=coded("not-a-table")):
        sw.identify(LargeLog(str(path), GIVEN), GIVEN)


def mcap_of(messages, *, topics=("/log",), stamps=None) -> bytes:
    """An MCAP file of JSON texts, one after the other in the topics by turns, in small chunks."""
    from mcap.writer import Writer

    buffer = io.BytesIO()
    writer = Writer(buffer, chunk_size=2000)
    writer.start()
    schema = writer.register_schema("row", "jsonschema", b"{}")
    channels = [writer.register_channel(topic, "json", schema) for topic in topics]
    for k, message in enumerate(messages):
        stamp = k * 1_000_000 if stamps is None else stamps[k]
        writer.add_message(channels[k % len(channels)], log_time=stamp, publish_time=0, data=message.encode())
    writer.finish()
    return buffer.getvalue()


@pytest.mark.parametrize(
    "odd",
    [
        '{"a": {"b": 1, "c": null}, "d": 2}',  # no number in a cell
        '{"a": {"b": 1}, "d": true}',
        '{"a": {"b": 1, "c": "x"}, "d": 2}',
        '{\n"a": {"b": 1,\n"c": 3}, "d": 2}',
        '{"a": {"b": 1, "c": NaN}, "d": 9007199254740993}',
        '{"t": 5.5, "a": {"b": 1, "c": 2.5}, "d": 3}',  # a time of its own
        '{"e": "no number at all"}',
        "[1, 2]",
        '{"a": {"b": 1, "c": 2}, "d": 3, "more": {"x": 4}}',
        '{"d": 1e999, "a": {"c": -0.0, "b": 1}}',
    ],
)
def test_messages_unlike_the_others_are_read_as_in_the_whole_file(monkeypatch, tmp_path, odd):
    monkeypatch.setattr(log, "LARGE", 1000)
    usual = [json.dumps({"a": {"b": k, "c": k / 7}, "d": -k, "f": [1, 2], "g": "text"}) for k in range(900)]
    path = tmp_path / "log.mcap"
    path.write_bytes(mcap_of([*usual[:500], odd, *usual[500:]]))
    once, found = whole(path), in_pieces(path, 200)
    assert {"time", "a.b", "a.c", "d"} <= set(found)
    for name, values in found.items():
        np.testing.assert_array_equal(values, once[name])


def test_messages_are_in_the_order_of_their_times(monkeypatch, tmp_path):
    monkeypatch.setattr(log, "LARGE", 1000)
    stamps = np.arange(1000) * 1000
    stamps[10:20] = stamps[10:20][::-1]
    path = tmp_path / "log.mcap"
    path.write_bytes(mcap_of([json.dumps({"x": k}) for k in range(1000)], stamps=stamps.tolist()))
    found = in_pieces(path, 300)
    np.testing.assert_array_equal(found["x"], whole(path)["x"])
    assert found["x"][10] == 19
    assert (np.diff(found["time"]) > 0).all()


def test_the_log_is_one_topic_of_several(monkeypatch, tmp_path):
    monkeypatch.setattr(log, "LARGE", 1000)
    path = tmp_path / "log.mcap"
    path.write_bytes(mcap_of([json.dumps({"x": k}) for k in range(1000)], topics=("/one", "/two")))
    once, found = whole(path), in_pieces(path, 300, ["one.x", "one.time"])
    assert {"two.x"} <= set(log._file(path).header().columns)
    np.testing.assert_array_equal(found["one.x"], once["one.x"])
    with pytest.raises(InputError, check=coded("not-in-parts")):
        in_pieces(path, 300, ["one.x", "two.x"])


def record(opcode: int, content: bytes) -> bytes:
    """A record of MCAP."""
    return bytes([opcode]) + len(content).to_bytes(8, "little") + content


def message(channel: int, stamp: int, text: bytes) -> bytes:
    """A message of a channel."""
    return record(5, struct.pack("<HIQQ", channel, 0, stamp, 0) + text)


def test_messages_are_found_among_the_records_of_a_chunk():
    texts = [b"{}", b'{"x": 1}', b"", b'{"x": 12345}', b"[]"]
    parts = [record(4, b"a channel")]
    for k, text in enumerate(texts):
        parts.append(message(k % 2, 100 + k, text))
        parts += [record(3, b"a schema")] * (k == 2)
    data = b"".join(parts)
    found = _messages(data, frozenset((0, 1)))
    assert [entry[1:] for entry in found] == list(zip(range(100, 105), texts, strict=True))
    assert [entry[:2] for entry in _messages(data, frozenset((1,)))] == [(1, 101), (1, 103)]
    for damaged in (data[:-1], data[:-5], data + b"\xff" * 40):
        with pytest.raises(ValueError, match="longer than its chunk"):
            _messages(damaged, frozenset((0, 1)))
    with pytest.raises(ValueError, match="shorter than its head"):
        _messages(record(5, b"short"), frozenset((0, 1)))
    assert _messages(b"", frozenset((0, 1))) == []


@pytest.mark.parametrize("damage", ["none", "zeros", "cut", "other"])
def test_a_chunk_s_index_is_not_believed(monkeypatch, tmp_path, damage):
    from mcap.reader import make_reader

    monkeypatch.setattr(log, "LARGE", 1000)
    content = bytearray(mcap_of([json.dumps({"x": k}) for k in range(1000)], topics=("/one", "/two")))
    for index in make_reader(io.BytesIO(content)).get_summary().chunk_indexes:
        for place in index.message_index_offsets.values():
            entries = slice(place + 15, place + 15 + 32)
            if damage == "zeros":
                content[place] = 0
            elif damage == "other":
                content[entries] = bytes(32)
            elif damage == "cut":
                content[place + 11 : place + 15] = (17).to_bytes(4, "little")
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    assert in_pieces(path, 300, ["one.x"])["one.x"].tolist() == list(range(0, 1000, 2))


def test_matrices_and_matlab_files_in_pieces(monkeypatch, tmp_path):
    import h5py

    monkeypatch.setattr(log, "LARGE", 1000)
    rng = np.random.default_rng(0)
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["flat"] = rng.normal(size=(1000, 3))
        file["group/wide"] = rng.normal(size=(2, 1000)).astype(np.float32)
        file["counts"] = np.arange(1000)[:, None]
        file["short"] = np.arange(5.0)
        matlab = file.create_dataset("m", data=rng.normal(size=(2, 1000)), chunks=(1, 128), compression="gzip")
        matlab.attrs["MATLAB_class"] = np.bytes_("double")
    once, found = whole(path), in_pieces(path, 300)
    assert set(found) == set(once) - {"short"}
    assert {"flat(:,3)", "group.wide(2,:)", "counts", "m(:,2)"} <= set(found)
    for name, values in found.items():
        np.testing.assert_array_equal(values, once[name])
    with pytest.raises(InputError, check=coded("unequal-length", "'short'", "5 values", "'counts'", "1000")):
        in_pieces(path, 300, ["counts", "short"])


def test_links_of_hdf5_lead_to_their_data_and_no_further(monkeypatch, tmp_path):
    """A link to nowhere, to another file that is missing, and to the group that it is in."""
    import h5py

    monkeypatch.setattr(log, "LARGE", 1000)
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["run/angle"] = np.random.default_rng(0).normal(size=4000)
        file["linked"] = h5py.SoftLink("/run/angle")
        file["nowhere"] = h5py.SoftLink("/no/such")
        file["missing"] = h5py.ExternalLink("missing.h5", "/x")
        file["run/back"] = h5py.SoftLink("/")
        file["run/same"] = file["run"]
    once, found = whole(path), in_pieces(path, 900)
    assert set(once) == set(found) == {"run.angle", "linked"}
    np.testing.assert_array_equal(found["linked"], once["run.angle"])


PEAK = """
import resource, sys
from swingid.recording.large import log
for table in log._file(sys.argv[1]).pieces(20_000, ["t", "q1", "q2", "u"]):
    pass
own = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
print(own * (1 if sys.platform == "darwin" else 1024))
"""


@pytest.mark.long
@pytest.mark.parametrize(("ending", "rows"), [("h5", 1_500_000), ("mcap", 1_500_000)])
@pytest.mark.skipif(sys.platform == "win32", reason="no resource module")
def test_memory_does_not_grow_with_the_log(tmp_path, ending, rows):
    """The peak of the process (of its helper, where that is larger) for a log and for one of a fifth of its rows."""
    peaks = []
    for count in (rows // 5, rows):
        time = np.arange(count) * 1e-4
        columns = {"t": time, "q1": np.sin(time), "q2": np.cos(time), "u": np.sin(3 * time)}
        path = tmp_path / f"log.{ending}"
        path.write_bytes((hdf5 if ending == "h5" else mcap).write(columns, {}))
        # through a shell, for a process begins with the peak of the one that started it
        command = ["sh", "-c", '"$0" "$@"; exit $?', sys.executable, "-c", PEAK, str(path)]
        runs = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(3)]
        peaks.append(min(int(peak) for peak in runs))  # what the allocator keeps differs by megabytes from run to run
    assert peaks[1] - peaks[0] < 0.4 * 32 * (rows - rows // 5)  # bytes of the columns, of which there are more
