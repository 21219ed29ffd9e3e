"""`swingid stop` and Ctrl-C on real processes: once, twice, a key that is held, in every phase of a command."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_live_run import order

import live_host
from refusals import coded
from swingid.cli.app import run as swingid
from swingid.errors import DeviceError
from swingid.live import native, registry
from swingid.live.codes import StopMode
from swingid.live.devices.twin import twin_of
from swingid.live.emulator import emulated, keep_pace
from swingid.live.experiment import Conductor, Order
from swingid.live.registry import announced, runs
from swingid.recording.recording import Recording

RIG = live_host.RIG
REFERENCE = "sine 0.8 rad 8.5 rad/s"
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(os.name != "posix", reason="sends signals to groups of processes"),
]
needs_native = pytest.mark.skipif(native.obstacle() is not None, reason=f"the firmware's process: {native.obstacle()}")


@pytest.fixture(autouse=True)
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A registry of this test alone."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "swingid"


class Emulated:
    """A device in real time; `applied` holds what the motor got."""

    def __init__(self) -> None:
        self.rig = emulated(RIG, native=True, tcp=0)
        self.applied: list[float] = []
        exchange = self.rig._process.exchange  # type: ignore[union-attr]

        def noted(now: int, readings: object) -> float:
            self.applied.append(exchange(now, readings))  # type: ignore[arg-type]
            return self.applied[-1]

        self.rig._process.exchange = noted  # type: ignore[method-assign, assignment, union-attr]
        self.over = threading.Event()
        self.thread = threading.Thread(
            target=keep_pace, args=(self.rig.step, 1000.0), kwargs={"over": self.over.is_set}, daemon=True
        )
        self.thread.start()

    @property
    def moves(self) -> bool:
        return any(self.applied[-20:])

    def close(self) -> None:
        self.over.set()
        self.thread.join()
        self.rig.close()


@pytest.fixture
def device() -> Iterator[Emulated]:
    device = Emulated()
    yield device
    device.close()


def command(*words: object) -> subprocess.Popen[str]:
    """A command in a group of its own, as a terminal starts it."""
    return subprocess.Popen(
        [sys.executable, "-m", "swingid", *map(str, words)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def run_command(device: Emulated, out: Path, duration: float = 60.0) -> subprocess.Popen[str]:
    options = ["--reference", REFERENCE, "--duration", duration, "--out", out]
    return command("run", "--rig", "paper", "--device", device.rig.address, *options)


def wait_until(true: object, seconds: float = 30.0) -> None:
    until = time.monotonic() + seconds
    while not true():  # type: ignore[operator]
        assert time.monotonic() < until
        time.sleep(0.01)


def press(process: subprocess.Popen[str], times: int, every: float = 0.03) -> None:
    for _ in range(times):
        if process.poll() is not None:
            return
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(every)


def last(err: str) -> str:
    return err.strip().splitlines()[-1]


def is_zero(device: Emulated) -> bool:
    time.sleep(0.3)
    return not any(device.applied[-50:])


@needs_native
@pytest.mark.parametrize(
    ("times", "every", "after"),
    [
        (3, 0.03, 2.0),
        *(
            pytest.param(times, every, after, marks=pytest.mark.long)
            for times in (2, 3, 10)
            for every in (0.005, 0.03, 0.3)
            for after in (0.2, 2.0)
            if (times, every) != (2, 0.005)  # both can be one signal on a busy machine, which is a soft stop
        ),
    ],
)
def test_ctrl_c_held_down_in_a_run_is_one_true_sentence(
    times: int, every: float, after: float, device: Emulated, tmp_path: Path
) -> None:
    out = tmp_path / "run.mcap"
    process = run_command(device, out)
    wait_until(lambda: device.moves)
    time.sleep(after)
    press(process, times, every)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 5, err
    assert "Traceback" not in err
    assert str(out) in last(err)
    assert "nothing was written" not in err
    assert sum("Ctrl-C" in line for line in err.splitlines()) == 1
    assert is_zero(device)
    if after > 1.5:
        assert "cut-off" not in [finding.code for finding in Recording.load(out, RIG).findings]


@needs_native
@pytest.mark.parametrize("times", [1, pytest.param(10, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "after", [0.0, *(pytest.param(x, marks=pytest.mark.long) for x in (0.3, 0.6, 0.9, 1.2, 1.5, 2.0))]
)
def test_ctrl_c_before_the_run_moves_nothing(times: int, after: float, device: Emulated, tmp_path: Path) -> None:
    """From the start of the processes on; what had come before is no live run yet."""
    process = run_command(device, tmp_path / "run.mcap")
    wait_until(lambda: (tmp_path / "run.mcap").exists())
    time.sleep(after)
    press(process, times)
    _, err = process.communicate(timeout=60)
    assert process.returncode in ((5,) if times > 1 else (4, 5)), err  # 4: a soft stop of a run that has just begun
    assert "Traceback" not in err
    assert "bug" not in err
    if not any(device.applied):
        assert process.returncode == 5
        assert re.search("by Ctrl-C( twice)?, before the run began; nothing has moved", last(err))
    assert is_zero(device)


@pytest.mark.long
@pytest.mark.parametrize("times", [3, 1, 10])
def test_ctrl_c_after_the_run_says_where_it_is(times: int, tmp_path: Path) -> None:
    """On the emulator the run is over in a second; output error takes its time."""
    out = tmp_path / "run.mcap"
    options = ["--reference", REFERENCE, "--duration", "25", "--out", out, "--method", "output-error"]
    process = command("run", "--rig", "paper", *options)
    assert process.stderr is not None
    lines: list[str] = []
    while "wrote" not in (lines[-1] if lines else ""):
        lines.append(process.stderr.readline())
        assert lines[-1], lines
    press(process, times)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 5, err
    assert (
        err.strip()
        == f"swingid: interrupted by Ctrl-C after the run; {out} holds it: identify it with swingid identify {out}."
    )
    assert len(Recording.load(out, RIG)) == 25_000


@pytest.mark.long
@pytest.mark.parametrize("times", [1, 3])
def test_ctrl_c_ends_a_long_rehearsal(times: int, tmp_path: Path) -> None:
    options = ["--reference", REFERENCE, "--duration", "3600", "--out", tmp_path / "run.mcap"]
    process = command("run", "--rig", "paper", *options)
    assert process.stderr is not None
    while "firmware" not in process.stderr.readline():
        assert process.poll() is None
    time.sleep(1.0)
    began = time.monotonic()
    press(process, times)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 5, err
    assert last(err).startswith("swingid: stopped by Ctrl-C")
    assert "before the run began; nothing has moved" in last(err)
    assert time.monotonic() - began < 15.0  # of some 6 s on an idle machine, which a busy one makes three times as long


@needs_native
def test_ctrl_c_in_a_pulse_of_commission_is_0_volts(device: Emulated, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG.text)
    process = command("commission", "--rig", rig, "--device", device.rig.address)
    wait_until(lambda: device.moves)
    press(process, 3)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 5, err
    assert last(err) == f"swingid: stopped by Ctrl-C: 0 V at once; {rig} stays as it was."
    assert is_zero(device)
    assert rig.read_text() == RIG.text


def test_ctrl_c_at_enter_says_what_is_kept(tmp_path: Path) -> None:
    options = [
        "--loaded",
        "paper-body",
        "--reference",
        REFERENCE,
        "--out",
        tmp_path / "x",
        "--device",
        "tcp://127.0.0.1:1",
    ]
    process = command("weigh", "--rig", "paper", *options)
    assert process.stderr is not None
    while "press Enter" not in process.stderr.readline():
        assert process.poll() is None
    press(process, 3, 0.01)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip() == "swingid: interrupted; nothing has moved, so start again."


@needs_native
@pytest.mark.parametrize(
    ("words", "code", "end"),
    [
        pytest.param([], 0, "stopped by swingid stop: 0 V", marks=pytest.mark.long),
        (["--hard"], 5, "stopped by swingid stop --hard: 0 V"),
    ],
)
def test_stop_ends_the_run_and_says_how(
    words: list[str], code: int, end: str, device: Emulated, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.mcap"
    process = run_command(device, out)
    wait_until(lambda: device.moves)
    time.sleep(4.0 if not words else 1.0)
    assert swingid(["stop", "--device", "tcp://elsewhere:1"]) == 5
    assert "nothing is running on tcp://elsewhere:1" in capsys.readouterr().err
    assert swingid(["stop", "--device", device.rig.address, *words]) == 0
    said = capsys.readouterr().out.strip()
    assert said.startswith(f"the run on {device.rig.address} ({out}, process ")
    assert said.endswith(end)
    assert is_zero(device)
    _, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert "stopped by swingid stop" in err
    assert not list((tmp_path / "swingid").iterdir())


@pytest.mark.long
@needs_native
def test_stop_ends_a_run_whose_command_was_killed(
    device: Emulated, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.mcap"
    process = run_command(device, out)
    wait_until(lambda: device.moves)
    process.kill()
    process.communicate()
    time.sleep(2.0)
    assert device.moves
    assert swingid(["stop"]) == 0
    assert "stopped by swingid stop: 0 V" in capsys.readouterr().out
    assert is_zero(device)
    wait_until(lambda: not list((tmp_path / "swingid").iterdir()))
    time.sleep(0.5)
    assert Recording.load(out, RIG).duration > 0.8


@needs_native
@pytest.mark.long
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_the_link_takes_signals_as_stops(name: str, device: Emulated, tmp_path: Path) -> None:
    process = run_command(device, tmp_path / "run.mcap")
    wait_until(lambda: device.moves)
    time.sleep(1.0)
    (found,) = runs()
    for _ in range(2):
        os.kill(found.entry.pid, signal.Signals[name])
        time.sleep(0.1)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 5, err
    assert f"stopped by {name}: 0 V at once" in last(err)
    assert is_zero(device)


@needs_native
@pytest.mark.long
def test_stop_hard_ends_a_link_that_hangs_and_has_no_view(
    device: Emulated, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process = run_command(device, tmp_path / "run.mcap")
    wait_until(lambda: device.moves)
    (found,) = runs()
    os.kill(found.entry.pid, signal.SIGSTOP)
    process.kill()
    process.communicate()
    assert swingid(["stop", "--hard"]) == 0
    assert "process" in capsys.readouterr().out
    assert not runs()


def test_nothing_is_running(capsys: pytest.CaptureFixture[str], own: Path) -> None:
    assert swingid(["stop"]) == 5
    said = capsys.readouterr().err
    assert said.startswith("swingid: nothing is running that this user has started on this machine")
    assert own.stat().st_mode & 0o777 == 0o700


def test_a_folder_of_others_is_not_used(capsys: pytest.CaptureFixture[str], own: Path, tmp_path: Path) -> None:
    own.mkdir()
    own.chmod(0o777)
    assert swingid(["stop"]) == 3
    assert "is not this user's alone" in capsys.readouterr().err
    with announced("twin://paper", "x.mcap", duration=1.0, fade=0.1) as run:  # the run goes on
        assert run.asked() is None
    assert not list(own.iterdir())


def test_what_a_dead_process_has_left_is_swept(own: Path) -> None:
    """Whatever process has its number now."""
    own.mkdir(mode=0o700)
    dead = own / f"run-{os.getpid()}-0000.json"
    dead.write_text(json.dumps({"pid": os.getpid()}))
    dead.with_suffix(".lock").touch()
    dead.with_suffix(".stop").write_text("soft")
    half = own / "run-1-0001.lock"
    half.touch()
    os.utime(half, (0, 0))
    (own / "run-1-0002.json").write_text("no entry")
    assert runs() == []
    assert list(own.iterdir()) == []


def test_a_request_is_seen_and_answered(own: Path) -> None:
    with announced("twin://paper", "x.mcap", duration=1.0, fade=0.1) as run:
        assert run.asked() is None
        (found,) = runs()
        assert found.alive
        assert found.is_on("twin://paper")
        assert not found.is_on("paper")
        found.ask(hard=False)
        run._looked = -1e9
        assert run.asked() == (StopMode.SOFT, "stopped by swingid stop")
        found.ask(hard=True)
        run._looked = -1e9
        assert run.asked() == (StopMode.HARD, "stopped by swingid stop --hard")
        run.ended = "it is over"
    assert not found.alive
    assert found.last_words() == "it is over"
    assert list(own.iterdir()) == []


@pytest.mark.parametrize("asked", ["/dev/ttyACM0", "serial:///dev/ttyACM0", "serial:///dev/ttyACM0?baud=9600"])
def test_a_port_is_known_by_all_its_names(asked: str) -> None:
    with announced("serial:///dev/ttyACM0?baud=9600", "x.mcap", duration=1.0, fade=0.1):
        (found,) = runs()
        assert found.is_on(asked)
        assert not found.is_on("/dev/ttyACM1")


def test_a_run_in_virtual_time_is_stopped_too(tmp_path: Path) -> None:
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        for found in runs():
            found.ask(hard=False)
        time.sleep(2 * registry.LOOK)

    with pytest.raises(DeviceError, check=coded("stopped", "swingid stop")):
        Conductor(RIG, twin_of(RIG), say=say).run(order(duration=2.0), tmp_path / "run.mcap")
    assert isinstance(order(), Order)


def test_the_folder_does_not_depend_on_a_variable_where_the_system_has_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    uid = os.getuid()
    system = Path(f"/run/user/{uid}")
    assert registry.folder() == (system / "swingid" if system.is_dir() else tmp_path / f"swingid-{uid}")
