"""`swingid emulate`: a device behind a port, in Python and as the firmware's process."""

from __future__ import annotations

import contextlib
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from test_live_twin import recording_of

from live_host import PARAMETERS, RIG, experiment
from refusals import coded
from swingid import identify
from swingid.cli import main
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError
from swingid.live import native
from swingid.live.codes import State
from swingid.live.devices.stream import Stream
from swingid.live.devices.table import open_device
from swingid.live.emulator import BINS, Held, NativeRig, PythonRig, emulated, keep_pace
from swingid.live.frames import Decoder, Frame, encode
from swingid.live.guard import Board, Limits, parameters_of
from swingid.live.ports import TcpPort
from swingid.model.rig import Rig

needs_native = pytest.mark.skipif(native.obstacle() is not None, reason=f"the firmware's process: {native.obstacle()}")
posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")
REFERENCE = parse_reference("sine 0.8 rad 8.5 rad/s")(np.arange(1500) / 1000.0)


class Stepped:
    """A connection to an emulated rig that makes its samples while the host reads, whatever the real time."""

    def __init__(self, rig: PythonRig | NativeRig, stream: Stream) -> None:
        self.rig, self.stream = rig, stream

    def write(self, data: bytes) -> None:
        self.stream.write(data)

    def read(self, timeout: float = 0.0) -> bytes:
        data = b""
        for _ in range(round(timeout * 1000)):
            self.rig.step()
            data += self.stream.read(0.0)
        return data


@contextlib.contextmanager
def connected(kind: str, tcp: int | None, rig_file: Rig = RIG) -> Iterator[Stepped]:
    rig = emulated(rig_file, native=kind == "native", tcp=tcp)
    try:
        stream = open_device(rig.address)
        yield Stepped(rig, stream)
        stream.close()
    finally:
        rig.close()


def telemetry(kind: str, tcp: int | None) -> list[Frame]:
    with connected(kind, tcp) as device:
        frames, _ = experiment(device, PARAMETERS, REFERENCE)
    assert frames[0].name == "Hello"
    return [frame for frame in frames if frame.name != "Hello"]


@pytest.mark.parametrize(
    ("kind", "tcp"),
    [
        ("python", 0),
        pytest.param("python", None, marks=posix),
        pytest.param("native", 0, marks=needs_native),
        pytest.param("native", None, marks=needs_native),
    ],
)
def test_a_run_over_the_port_is_that_of_the_twin(kind: str, tcp: int | None) -> None:
    if tcp is None:
        pytest.importorskip("serialx")
    frames = telemetry(kind, tcp)
    running = [frame for frame in frames if frame.name == "Sample" and frame.state == State.RUNNING]
    assert len(running) == len(REFERENCE)
    assert np.ptp([frame.axis for frame in running]) * 2 * np.pi / 16384 > 0.05  # rad
    samples = [frame.values for frame in frames if frame.name == "Sample"]
    assert [sample["sequence"] for sample in samples] == list(
        range(samples[0]["sequence"], samples[-1]["sequence"] + 1)
    )
    expected = [frame.values for frame in telemetry("python", 0) if frame.name == "Sample"]
    assert [repr(sample) for sample in samples] == [repr(sample) for sample in expected]


@pytest.mark.long
@pytest.mark.parametrize("name", ["paper", "paper-body"])
@pytest.mark.parametrize("tcp", [0, pytest.param(None, marks=posix)])
@pytest.mark.parametrize("kind", ["python", pytest.param("native", marks=needs_native)])
def test_the_papers_experiment_over_the_port_gives_the_twins_inertia(kind: str, tcp: int | None, name: str) -> None:
    rig = Rig.load(name)
    assert rig.axis.inertia is not None
    with connected(kind, tcp, rig) as device:
        reference = parse_reference("sine 0.8 rad 8.5 rad/s")(np.arange(25_000) / 1000.0)
        frames, _ = experiment(device, parameters_of(Compensator.paper(rig), Board(), Limits.of(rig)), reference)
    inertia = identify(recording_of(frames, 25.0), rig).parameters["inertia"]
    low, high = inertia.interval95
    assert low <= rig.axis.inertia.value <= high
    assert abs(inertia.value / rig.axis.inertia.value - 1) < 2e-4


def test_one_host_at_a_time_and_the_next_after_it() -> None:
    with connected("python", 0) as device:
        device.write(encode("Who"))
        assert Decoder().feed(device.read(0.005))[0].name == "Hello"
        second = open_device(device.rig.address)
        device.read(0.005)
        with pytest.raises(DeviceError, check=coded("gone")):
            second.read(5.0)
        device.stream.close()
        device.rig.step()
        device.stream = open_device(device.rig.address)
        device.rig.step()
        device.write(encode("Who"))
        assert "Hello" in [frame.name for frame in Decoder().feed(device.read(0.005))]


def test_a_port_in_use_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
        for kind in ("python", *(["native"] if native.obstacle() is None else [])):
            assert main(["emulate", "--rig", "paper", "--tcp", port, "--firmware", kind]) == 5
            assert "give another" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--tcp", "0", "--pty"], "exclude each other"),
        (["--rate", "1"], "20 to 10000"),
        (["--firmware", "rust"], "'rust'"),
        (["--tcp", "70000"], "65535"),
    ],
)
def test_wrong_options(options: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["emulate", "--rig", "paper", *options]) == 2
    assert words in capsys.readouterr().err


def test_without_a_compiler_it_is_python_and_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "compiler", lambda: None)
    assert main(["emulate", "--rig", "paper", "--tcp", "0", "--duration", "0.05"]) == 0
    out = capsys.readouterr().out
    assert "the firmware in Python (" in out
    assert re.search(r"swingid run --device tcp://localhost:\d+ --rig paper", out)
    assert re.search(r"50 samples, [\d.]+ of 1000 per second", out)
    assert main(["emulate", "--rig", "paper", "--firmware", "native"]) == 2
    assert "use --firmware python" in capsys.readouterr().err


def drain(device: Stream) -> None:
    """Read whatever is left."""
    while True:
        device.read(1.0)


@posix
def test_ctrl_c_ends_it_cleanly() -> None:
    command = [sys.executable, "-m", "swingid", "emulate", "--rig", "paper", "--tcp", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stdout.readline().partition(": ")[0]
        process.stdout.readline()
        device = open_device(address)
        device.write(encode("Who"))
        assert device.read(30.0)
        process.send_signal(signal.SIGINT)
        rest, errors = process.stdout.read(), process.stderr.read()
        assert process.wait(30) == 0
        assert (errors, " per second; late by at most" in rest) == ("", True)
        with pytest.raises(DeviceError, match="gone"):
            drain(device)


def test_what_a_delay_leaves_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock of the test: the third sample takes a second, of which 20 ms are made up for."""
    now = [0.0]
    monkeypatch.setattr("swingid.live.emulator.time.perf_counter", lambda: now[0])
    monkeypatch.setattr("swingid.live.emulator.time.sleep", lambda s: now.__setitem__(0, now[0] + s))
    taken = iter([0.0, 0.0, 1.0] + [0.0] * 97)

    def step() -> None:
        now[0] += next(taken)

    pace = keep_pace(step, 1000.0, seconds=0.1)
    assert pace.samples == 100
    assert pace.left_out == pytest.approx(1.0 - 0.001 - 0.02)
    assert "too slow for 0.98 s" in pace.words(1000.0)
    assert pace.seconds == pytest.approx(0.099 + pace.left_out, abs=1e-9)


def test_percentiles_of_the_lateness() -> None:
    pace = Held(samples=1000, seconds=1.0)
    pace.late[int(np.searchsorted(BINS, 0.9e-4))] = 990
    pace.late[int(np.searchsorted(BINS, 0.9e-2))] = 10
    assert [pace.percentile(share) for share in (0.5, 0.99, 0.999)] == pytest.approx([1e-4, 1e-4, 1e-2])


def test_tcp_port_numbers_are_bounded() -> None:
    with pytest.raises(DeviceError, check=coded("busy")):
        TcpPort(70000)
