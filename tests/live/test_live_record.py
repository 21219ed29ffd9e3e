"""`swingid record`: the columns that a sketch or a program prints, as a log."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import swingid as sw
from live_host import RIG
from refusals import coded
from swingid.cli import main
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError, InputError, UsageError
from swingid.live.devices.table import open_device
from swingid.live.record import Lines, fields_of, record


@pytest.mark.parametrize(
    ("line", "fields"),
    [
        ("1,2.5,-3e-4", ["1", "2.5", "-3e-4"]),
        ("1, 2 ,3,", ["1", "2", "3"]),
        ("1,5;2,25", ["1.5", "2.25"]),
        ("1\t2\t3", ["1", "2", "3"]),
        ("  1   2 3 ", ["1", "2", "3"]),
        ("", []),
    ],
)
def test_fields(line: str, fields: list[str]) -> None:
    assert fields_of(line) == fields


def read_in_pieces(text: bytes, size: int, *, cut: bool = False) -> tuple[list[list[str]], Lines]:
    lines = Lines(cut=cut)
    rows = [row for i in range(0, len(text), size) for row in lines.feed(text[i : i + size])]
    return rows + lines.finish(), lines


@pytest.mark.parametrize("size", [1, 2, 7, 1000])
@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_rows_header_and_what_is_no_row(size: int, end: bytes) -> None:
    printed = [b"Booting...", b"t,q1,u", b"0,1,2", b"0.1,1.5,2", b"0.2,x,2", b"0.3,1,2", b"", b"0.4,1"]
    printed += [b"0.5,1,2", b"0.6,nan,2", b"0.65,1_0,2", b"0.7,1,2", b"\xff\xfe,1,2", b"0.8,1,2"]
    rows, lines = read_in_pieces(end.join([*printed, b"0.9,1"]), size)
    assert [row[0] for row in rows] == ["0", "0.1", "0.3", "0.5", "0.7", "0.8"]
    assert lines.names == ["t", "q1", "u"]
    assert lines.bad == 5


def test_labels_of_the_plotter_name_the_columns() -> None:
    rows, lines = read_in_pieces(b"angle:0.1,wheel speed:3\n" * 3, 5)
    assert (rows, lines.names) == ([["0.1", "3"]] * 3, ["angle", "wheel speed"])


def test_the_first_line_of_a_port_is_left_out() -> None:
    assert read_in_pieces(b"3,1\n124,1\n125,1\n", 4, cut=True)[0] == [["124", "1"], ["125", "1"]]


def test_a_line_without_end_takes_no_memory() -> None:
    lines = Lines(cut=False)
    for _ in range(1000):
        lines.feed(b"1234567890" * 100)
    assert len(lines._rest) <= 4096


@given(st.lists(st.binary(max_size=60) | st.sampled_from([b"1,2\n", b"a,b\r\n", b"x:1\ty:2\n", b"\r"]), max_size=40))
def test_any_bytes_give_rows_of_numbers_of_one_width(pieces: list[bytes]) -> None:
    lines = Lines(cut=False)
    rows = [row for piece in pieces for row in lines.feed(piece)] + lines.finish()
    assert len({len(row) for row in rows}) <= 1
    assert all(np.isfinite(float(text)) for row in rows for text in row)
    whole = Lines(cut=False)
    assert whole.feed(b"".join(pieces)) + whole.finish() == rows


def printed_run(path: Path, *, header: bool) -> float:
    """A run of the paper's rig as a sketch prints it; its inertia."""
    log = sw.simulate(RIG, parse_reference("sine 0.8 rad 8.5 rad/s"), duration=12.0)
    assert log.wheel_angle is not None
    assert log.voltage is not None
    table = np.column_stack([log.time, log.angle, log.wheel_angle, log.voltage])
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header="t,q1,q2,u" if header else "", comments="")
    return float(sw.identify(log, RIG).parameters["inertia"].value)


def test_a_growing_file_becomes_a_log_with_the_same_inertia(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole, growing, out = tmp_path / "whole.csv", tmp_path / "growing.txt", tmp_path / "log.csv"
    expected = printed_run(whole, header=True)
    content = whole.read_bytes()
    growing.write_bytes(content[:1001])

    def go_on() -> None:
        with growing.open("ab") as file:
            for i in range(1001, len(content), 50_001):
                file.write(content[i : i + 50_001])
                file.flush()

    thread = threading.Thread(target=go_on)
    thread.start()
    assert main(["record", "--device", f"csv://{growing}", "--out", str(out), "--idle", "2"]) == 0
    thread.join()
    assert "12001 rows of t, q1, q2, u" in capsys.readouterr().out
    assert sw.identify(sw.Recording.load(out, RIG), RIG).parameters["inertia"].value == pytest.approx(
        expected, rel=1e-7
    )


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")
def test_a_sketch_on_a_port_without_header_and_time(tmp_path: Path) -> None:
    pytest.importorskip("serialx")
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    port = open_device(f"csv://{os.ttyname(slave)}?baud=115200")
    os.write(master, b"7,0.25\n" + b"".join(b"%d,0.5\n" % k for k in range(100)) + b"100,0.")
    found = record(port, tmp_path / "log.csv", idle=0.2, names=["y", "u"], rate=200.0)
    assert (found.columns, found.rows, found.bad, found.named) == (("t", "y", "u"), 100, 0, True)
    lines = (tmp_path / "log.csv").read_text(encoding="utf-8").splitlines()
    assert lines[:3] == ["t,y,u", "0,0,0.5", "0.005,1,0.5"]
    os.write(master, b"cut\n" + b"1,2\n" * 10)
    os.close(slave)
    threading.Timer(0.3, os.close, [master]).start()
    found = record(port, tmp_path / "gone.csv")  # what came before the cable was pulled is kept
    assert found.rows == 10
    assert "has gone" in found.end
    assert not found.named
    port.close()
    with pytest.raises(UsageError) as caught:
        port.read()
    assert caught.value.code == "closed"


def test_what_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    noise, rows, out = tmp_path / "noise", tmp_path / "rows", tmp_path / "log.csv"
    noise.write_bytes(bytes(range(1, 256)) * 40)
    rows.write_text("1,2\n" * 10, encoding="utf-8")
    device = open_device(f"csv://{noise}")
    with pytest.raises(UsageError) as caught:
        device.write(b"x")
    assert caught.value.code == "passive"
    with pytest.raises(DeviceError, check=coded("no-columns")):
        record(device, out, idle=5.0)
    with pytest.raises(UsageError, check=coded("bad-columns", "2 columns", "3 names")):
        record(open_device(f"csv://{rows}"), out, idle=0.01, names=["a", "b", "c"], cut=False)
    with pytest.raises(UsageError) as caught:
        record(open_device(f"csv://{rows}"), out, idle=0.01, names=["a", "a"], cut=False)
    assert caught.value.code == "bad-columns"
    with pytest.raises(InputError) as caught:
        record(open_device(f"csv://{rows}"), tmp_path / "no" / "log.csv", idle=0.01)
    assert caught.value.code == "cannot-write"
    for arguments, code, words in (
        (["--device", "twin://paper", "--out", str(out)], 2, "does not only print"),
        (["--device", f"csv://{rows}", "--out", "x.parquet"], 2, "must end in .csv"),
        (["--device", f"csv://{tmp_path / 'none'}", "--out", str(out)], 5, "no such file or port"),
        (["--device", f"csv://{rows}", "--out", str(out), "--columns", "a,,b"], 2, "a name is empty"),
    ):
        assert main(["record", *arguments]) == code
        assert words in capsys.readouterr().err
    assert main(["record", "--device", f"csv://{rows}", "--out", str(out), "--idle", "0.01"]) == 0
    assert "give --columns" in capsys.readouterr().err
