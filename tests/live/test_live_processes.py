"""A run in real time, in processes: link, recorder and view, each of which is killed; the ring between them.

The rig is the firmware's process with the twin's motion, stepped by a thread at the rate of real time. How long after a
death the motor still gets a voltage is counted in the device's samples, not by a clock of this machine; and where a
loaded machine keeps the link's process waiting, the rig waits, too.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from live_host import RIG
from refusals import coded
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError, InputError, NotIdentifiableError, SwingidError
from swingid.identification import identify
from swingid.live import native
from swingid.live.codes import FaultCode, State, StopMode
from swingid.live.devices.table import open_device
from swingid.live.emulator import NativeRig, emulated
from swingid.live.experiment import Done, Order, require_usable
from swingid.live.processes import Patience, ProcessConductor
from swingid.live.progress import Progress
from swingid.live.ring import ROOM, Kind, Reader, Ring, memory
from swingid.live.session import End, Reason, Session
from swingid.live.worker import Job, link, recorder
from swingid.recording.recording import Recording

needs_native = pytest.mark.skipif(native.obstacle() is not None, reason=f"the firmware's process: {native.obstacle()}")
pytestmark = pytest.mark.real_time

MOTION = parse_reference("sine 0.8 rad 8.5 rad/s")


def test_a_ring_gives_its_records_in_order_over_its_end() -> None:
    ring = Ring()
    try:
        other = Ring(ring.handle)
        reader, sent = Reader(other), []
        for k in range(400):
            data = bytes([k % 256]) * (1 + 997 * k % 200_000)
            ring.write(Kind.DEVICE, float(k), data)
            sent.append(data)
            if k % 7 == 0:
                found = reader.read()
                assert [record.data for record in found] == sent
                sent.clear()
        assert sum(len(record.data) for record in reader.read()) == sum(map(len, sent))
        assert ring.head > ROOM
        assert reader.lost == 0
    finally:
        ring.close()
    assert not list(Path(memory()).glob("swingid-ring-*"))


def test_a_reader_that_is_too_slow_loses_the_oldest_and_goes_on() -> None:
    ring = Ring()
    try:
        reader = Reader(ring)
        for _ in range(3 * ROOM // 100_000):
            ring.write(Kind.HOST, 0.0, bytes(100_000))
        assert reader.read() == []
        assert reader.lost == ring.head
        ring.write(Kind.SAY, 1.0, b"on")
        assert [record.data for record in reader.read()] == [b"on"]
    finally:
        ring.close()


def test_a_reader_that_is_too_slow_still_gets_how_the_run_ended() -> None:
    ring = Ring()
    try:
        reader = Reader(ring)
        for _ in range(3 * ROOM // 100_000):
            ring.write(Kind.DEVICE, 0.0, bytes(100_000))
        begin = ring.head
        ring.write(Kind.DONE, 1.0, b"how")
        assert [(record.kind, record.data) for record in reader.read()] == [(Kind.DONE, b"how")]
        assert reader.lost == begin
        assert reader.read() == []
    finally:
        ring.close()


def test_records_that_are_written_over_while_they_are_read_are_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    ring = Ring()
    try:
        reader, read = Reader(ring), Reader._bytes
        for _ in range(10):
            ring.write(Kind.SAY, 0.0, b"old")

        def overtaken(self: Reader, start: int, length: int) -> bytes:
            if self.lost == 0 and start:
                for _ in range(ROOM // 100_000):
                    ring.write(Kind.DEVICE, 0.0, b"\xff" * 100_000)
            return read(self, start, length)

        monkeypatch.setattr(Reader, "_bytes", overtaken)
        assert all(record.data == b"old" for record in reader.read())
        assert reader.lost > 0
    finally:
        ring.close()


class Bench:
    """The firmware's process, stepped in real time; `applied` holds the voltage of every sample."""

    def __init__(self) -> None:
        rig = emulated(RIG, native=True, tcp=0)
        assert isinstance(rig, NativeRig)
        self.rig, self.applied = rig, []  # type: ignore[var-annotated]
        exchange = rig._process.exchange

        def noted(now: int, readings: object) -> float:
            voltage = exchange(now, readings)  # type: ignore[arg-type]
            self.applied.append(voltage)
            return voltage

        rig._process.exchange = noted  # type: ignore[method-assign, assignment]
        self.over, self.free = threading.Event(), threading.Event()
        self.ring: Ring | None = None
        self.thread = threading.Thread(target=self._go, daemon=True)
        self.thread.start()

    def _go(self) -> None:
        due = time.perf_counter()
        while not self.over.is_set():
            if self._host_waits():
                time.sleep(1e-3)
                continue
            self.rig.step()
            due += 1e-3
            left = due - time.perf_counter()
            if left > 0:
                time.sleep(left)
            elif left < -0.05:
                due -= left  # samples that this machine could not make are left out

    def _host_waits(self) -> bool:
        try:
            return self.ring is not None and not self.free.is_set() and self.ring.silence > 0.03
        except ValueError:  # the run is over and its ring closed
            return False

    def close(self) -> None:
        self.over.set()
        self.thread.join()
        self.rig.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()


def order(seconds: float, **changes: object) -> Order:
    return Order(MOTION, Compensator.paper(RIG), seconds, **changes)  # type: ignore[arg-type]


class At:
    """A view that does something once, when the run has come to a time (s)."""

    def __init__(self, time: float, act: object) -> None:
        self.time, self.act, self.done = time, act, False

    def __call__(self, progress: Progress) -> None:
        if progress.time >= self.time and not self.done:
            self.done = True
            self.act()  # type: ignore[operator]


def run(bench: Bench, out: Path, seconds: float, time: float = 1e9, act: object = None) -> tuple[Done, list[str]]:
    said: list[str] = []
    conductor = ProcessConductor(RIG, bench.rig.address, say=said.append)
    at = At(time, lambda: act(conductor))  # type: ignore[operator]

    def show(progress: Progress) -> None:
        bench.ring = conductor._ring
        at(progress)

    conductor._show = show
    try:
        return conductor.run(order(seconds), out), said
    finally:
        bench.free.set()


@needs_native
def test_a_run_in_processes_is_a_run(bench: Bench, tmp_path: Path) -> None:
    done, said = run(bench, tmp_path / "run.mcap", 6.0)
    require_usable(done, tmp_path / "run.mcap")
    assert done.end.reason is Reason.FINISHED
    assert any("host's loop" in line and "late by at most" in line for line in said)
    log = Recording.load(tmp_path / "run.mcap", RIG)
    assert len(log) + done.lost == 6000
    assert identify(log, RIG).parameters["inertia"].value == pytest.approx(3.022e-3, rel=2e-3)
    assert bench.applied[-1] == 0.0


@pytest.mark.long
@needs_native
@pytest.mark.parametrize(("mode", "reason"), [(StopMode.SOFT, Reason.STOPPED), (StopMode.HARD, Reason.HALTED)])
def test_a_stop_from_the_view(mode: StopMode, reason: Reason, bench: Bench, tmp_path: Path) -> None:
    done, _ = run(bench, tmp_path / "run.mcap", 20.0, 1.0, lambda conductor: conductor.stop(mode, "asked"))
    assert done.end.reason is reason
    assert bench.applied[-1] == 0.0


@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_the_link_killed_is_0_volts_in_100_ms_and_the_journal_is_whole(bench: Bench, tmp_path: Path) -> None:
    at: list[int] = []

    def kill(conductor: ProcessConductor) -> None:
        os.kill(conductor.pids["link"], signal.SIGKILL)
        bench.free.set()
        at.append(len(bench.applied))

    with pytest.raises(DeviceError, check=coded("host-died")):
        run(bench, tmp_path / "run.mcap", 20.0, 1.5, kill)
    time.sleep(0.3)
    driven = np.flatnonzero(bench.applied)[-1]
    assert driven - at[0] <= 100 + 50  # and what was on its way when it died
    log = Recording.load(tmp_path / "run.mcap", RIG)
    assert "cut-off" not in [finding.code for finding in log.findings]
    assert log.duration > 1.0
    with Session(open_device(bench.rig.address)) as session:
        session.connect()
        assert session.hello is not None
        assert (session.hello.state, session.hello.fault) == (State.FAULT, FaultCode.HEARTBEAT)


@pytest.mark.long
@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_the_recorder_killed_does_not_stop_the_loop_and_loses_half_a_second_at_most(
    bench: Bench, tmp_path: Path
) -> None:
    out = tmp_path / "run.mcap"
    killed_at: list[float] = []

    def kill(conductor: ProcessConductor) -> None:
        assert conductor._follower is not None
        os.kill(conductor.pids["recorder"], signal.SIGKILL)
        killed_at.append(conductor._follower.progress.time)

    done, _ = run(bench, out, 4.0, 2.0, kill)
    assert done.end.reason is Reason.FINISHED
    with pytest.raises(InputError, match=r"was killed by signal 9\); swingid identify .* takes the log up to there"):
        require_usable(done, out)
    log = Recording.load(out, RIG)
    assert "cut-off" in [finding.code for finding in log.findings]
    assert log.time[-1] > killed_at[0] - 0.5


@pytest.mark.long
@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGSTOP is POSIX")
def test_a_recorder_that_stands_still_for_a_second_loses_nothing(bench: Bench, tmp_path: Path) -> None:
    def pause(conductor: ProcessConductor) -> None:
        os.kill(conductor.pids["recorder"], signal.SIGSTOP)
        threading.Timer(1.0, os.kill, (conductor.pids["recorder"], signal.SIGCONT)).start()

    done, _ = run(bench, tmp_path / "run.mcap", 4.0, 1.0, pause)
    require_usable(done, tmp_path / "run.mcap")
    assert len(Recording.load(tmp_path / "run.mcap", RIG)) + done.lost == 4000


@pytest.mark.long
@needs_native
def test_a_view_that_sleeps_does_not_stop_the_loop(bench: Bench, tmp_path: Path) -> None:
    done, _ = run(bench, tmp_path / "run.mcap", 3.0, 1.0, lambda conductor: time.sleep(1.0))
    assert done.end.reason is Reason.FINISHED


@pytest.mark.long
@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGSTOP is POSIX")
def test_a_link_that_hangs_is_killed(bench: Bench, tmp_path: Path) -> None:
    def pause(conductor: ProcessConductor) -> None:
        os.kill(conductor.pids["link"], signal.SIGSTOP)
        bench.free.set()

    began = time.monotonic()
    with pytest.raises(DeviceError, check=coded("host-hung")):
        run(bench, tmp_path / "run.mcap", 30.0, 1.5, pause)
    assert time.monotonic() - began < 15.0
    time.sleep(0.3)
    assert bench.applied[-1] == 0.0
    assert Recording.load(tmp_path / "run.mcap", RIG).duration > 1.0


def test_what_the_view_waits_for() -> None:
    ring = Ring()
    try:
        patience = Patience(ring, order(5.0))
        assert patience.hangs() == ""
        patience.begin(-100.0)
        assert "planned end" in patience.hangs()
        patience.begin(5.0)
        ring.ask(StopMode.SOFT, "enough")
        assert patience.hangs() == ""
        ring.ask(StopMode.HARD, "x" * 1000)
        ring.ask(StopMode.SOFT, "late")
        assert ring.asked is not None
        assert ring.asked[0] is StopMode.HARD
        assert set(ring.asked[1]) == {"x"}
        assert patience.hangs() == ""
        patience._stopped -= 60.0
        assert "hard stop" in patience.hangs()
    finally:
        ring.close()


def job(address: str = "tcp://127.0.0.1:1") -> Job:
    return Job(RIG, address, "run.mcap", order(1.0), 0)


@pytest.mark.parametrize(
    ("error", "kind", "words"),
    [
        (ValueError("odd"), SwingidError, "this is a bug of swingid in the process of the link"),
        (OSError(5, "Input/output error"), DeviceError, "the device has gone (Input/output error)"),
        (NotIdentifiableError("no motion"), NotIdentifiableError, "no motion"),
    ],
)
def test_any_error_in_the_link_reaches_the_view(
    error: Exception, kind: type[SwingidError], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise error

    monkeypatch.setattr("swingid.live.worker.opened", broken)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    ring = Ring()
    try:
        reader = Reader(ring)
        link(job(), ring)
        (record,) = reader.read()
        assert record.kind is Kind.FAILED
        found = pickle.loads(record.data)
        assert type(found) is kind
        assert words in found.message
        if kind is SwingidError:
            assert found.exit_code == 70
            assert "ValueError: odd" in Path(found.message.rpartition("file ")[2]).read_text()
    finally:
        ring.close()


@pytest.mark.parametrize(
    ("error", "words"),
    [(ValueError("odd"), "this is a bug of swingid"), (OSError(28, "No space left on device"), "No space left")],
)
def test_any_error_in_the_recorder_is_a_sentence(
    error: Exception, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("swingid.live.worker.Journal", broken)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {signal.Signals[name]: signal.getsignal(signal.Signals[name]) for name in names}
    ring = Ring()
    try:
        with pytest.raises(SystemExit, match=words):
            recorder(job(), ring)
    finally:
        ring.close()
        for number, was in before.items():
            signal.signal(number, was)


def test_what_the_recorder_lost_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    ring, out = Ring(), tmp_path / "run.mcap"
    end = End(Reason.FINISHED, "the reference has come to its end")
    try:
        for _ in range(2 * ROOM // 100_000):
            ring.write(Kind.DEVICE, 0.0, bytes(100_000))
        ring.write(Kind.DONE, 1.0, pickle.dumps(Done(end)))
        with pytest.raises(SystemExit, match="bytes came faster than they could be written") as error:
            recorder(replace(job(), out=str(out)), ring)
    finally:
        ring.close()
    done = Done(end, journal_error=str(error.value))
    with pytest.raises(InputError, check=coded("cannot-write", "run.mcap")):
        require_usable(done, out)
    done.end = End(Reason.GUARD, "the angle passed its limit")
    out.touch()
    with pytest.raises(DeviceError, check=coded("run-guard", "run.mcap")):
        require_usable(done, out)


LIMITED = """
import sys
from test_live_processes import RIG, order
from pathlib import Path
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
from swingid.live.processes import ProcessConductor
from swingid.errors import SwingidError
try:
    ProcessConductor(RIG, "tcp://127.0.0.1:1").run(order(3.0), Path(sys.argv[2]))
except SwingidError as error:
    print(error.exit_code, error.code, error.message)
"""


def python(code: str, *arguments: object, **environment: str) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": paths} | environment,
        text=True,
    )


@pytest.mark.skipif(os.name != "posix", reason="limits of a process are POSIX")
def test_a_ring_without_room_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, err = python(LIMITED, 1_000_000, tmp_path / "run.mcap").communicate(timeout=60)
    assert out.startswith("3 no-room a run needs 17 MB in "), err
    assert "ulimit -f" in out
    monkeypatch.setenv("SWINGID_MEMORY", str(tmp_path / "missing"))
    with pytest.raises(InputError, check=coded("no-room")) as raised:
        Ring()
    assert raised.value.message.endswith("(No such file or directory); name another folder by $SWINGID_MEMORY")


def test_a_ring_has_its_room_from_the_beginning(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delattr(os, "posix_fallocate", raising=False)  # as on macOS
    monkeypatch.setenv("SWINGID_MEMORY", str(tmp_path))
    ring = Ring()
    try:
        assert os.fstat(ring._file).st_blocks * 512 >= ROOM
        assert os.name != "posix" or not list(tmp_path.iterdir())
    finally:
        ring.close()
    assert not list(tmp_path.iterdir())


VIEW = """
import sys
from pathlib import Path
from test_live_processes import RIG, order
from swingid.live.processes import ProcessConductor
conductor = ProcessConductor(RIG, sys.argv[1])
conductor._show = lambda p: p.time > 1.0 and print(conductor.pids["link"], conductor.pids["recorder"], flush=True)
conductor.run(order(float(sys.argv[3])), Path(sys.argv[2]))
"""


EARLY = """
from swingid.live import processes
def noted(self, record, *others):
    if record.kind is processes.Kind.SAY:
        print(self.pids["link"], self.pids["recorder"], flush=True)
processes.ProcessConductor._see = noted
"""


def gone(pids: list[int], seconds: float) -> bool:
    until = time.monotonic() + seconds
    while any(alive(pid) for pid in pids) and time.monotonic() < until:
        time.sleep(0.05)
    return not any(alive(pid) for pid in pids)


@pytest.mark.long
@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_the_view_killed_leaves_a_whole_run_and_journal(bench: Bench, tmp_path: Path) -> None:
    out = tmp_path / "run.mcap"
    view = python(VIEW, bench.rig.address, out, 3.0)
    assert view.stdout is not None
    pids = [int(word) for word in view.stdout.readline().split()]
    view.kill()
    view.communicate()
    assert gone(pids, 20.0)
    log = Recording.load(out, RIG)
    assert len(log) > 2900
    assert "cut-off" not in [finding.code for finding in log.findings]
    assert bench.applied[-1] == 0.0


KILLED = [
    ("view", "link", "recorder"),
    ("link",),
    ("recorder",),
    ("view", "link"),
    ("view", "recorder"),
    ("link", "recorder"),
]


@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
@pytest.mark.parametrize(
    "names", [KILLED[0], *(pytest.param(names, marks=pytest.mark.long) for names in KILLED[1:])], ids="+".join
)
def test_no_file_and_no_process_stays_whoever_is_killed(names: list[str], bench: Bench, tmp_path: Path) -> None:
    memory = tmp_path / "memory"
    memory.mkdir()
    view = python(VIEW, bench.rig.address, tmp_path / "run.mcap", 4.0, SWINGID_MEMORY=str(memory))
    assert view.stdout is not None
    link, recorder = (int(word) for word in view.stdout.readline().split())
    pids = {"view": view.pid, "link": link, "recorder": recorder}
    for name in names:
        os.kill(pids[name], signal.SIGKILL)
    view.communicate(timeout=30)
    assert gone([link, recorder], 20.0)
    assert not list(memory.iterdir())
    time.sleep(0.3)
    assert bench.applied[-1] == 0.0


@pytest.mark.long
@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGSTOP is POSIX")
def test_a_link_that_hangs_does_not_outlive_its_view(bench: Bench, tmp_path: Path) -> None:
    view = python(VIEW, bench.rig.address, tmp_path / "run.mcap", 30.0)
    assert view.stdout is not None
    pids = [int(word) for word in view.stdout.readline().split()]
    os.kill(pids[0], signal.SIGSTOP)
    view.kill()
    view.communicate()
    assert gone(pids, 15.0)


@pytest.mark.long
@needs_native
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_a_run_whose_view_dies_before_it_begins_does_not_begin(bench: Bench, tmp_path: Path) -> None:
    view = python(EARLY + VIEW, bench.rig.address, tmp_path / "run.mcap", 30.0)
    assert view.stdout is not None
    pids = [int(word) for word in view.stdout.readline().split()]
    view.kill()
    view.communicate()
    assert gone(pids, 20.0)
    assert not any(bench.applied)


def alive(pid: int) -> bool:
    """Whether a process runs; one that nobody has waited for yet does not."""
    status = Path(f"/proc/{pid}/stat")
    if status.exists():
        return status.read_text().rpartition(")")[2].split()[0] != "Z"
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    return not sys.platform.startswith("linux")


@pytest.mark.long
def test_a_device_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"127\.0\.0\.1"):
        ProcessConductor(RIG, "tcp://127.0.0.1:1").run(order(1.0), tmp_path / "run.mcap")
