"""`swingid run` and `sw.live.connect` on the emulator: the paper's experiment, its ends, what is refused before it."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import live_host
import swingid as sw
from long_cases import long
from refusals import coded
from swingid.cli.app import run as swingid
from swingid.errors import DeviceError, InputError, UsageError
from swingid.live.api import LiveRig
from swingid.live.codes import State, StopMode
from swingid.live.devices.twin import TwinDevice, twin_of
from swingid.live.experiment import Conductor, Order
from swingid.live.interrupt import stopping
from swingid.live.plant import Plant
from swingid.live.preflight import Rehearsed, energy_limit, expected
from swingid.live.progress import Progress
from swingid.live.session import Reason
from swingid.live.watch import energy_of
from swingid.recording.recording import Recording

RIG = live_host.RIG
REFERENCE = "sine 0.8 rad 8.5 rad/s"
INERTIA = {"paper": 3.022e-3, "paper-body": sw.Rig.load("paper-body").axis.inertia.value}  # type: ignore[union-attr]


def order(**changes: object) -> Order:
    known = {"motion": sw.parse_reference(REFERENCE), "controller": sw.Compensator.paper(RIG), "duration": 6.0}
    return Order(**{**known, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["paper", pytest.param("paper-body", marks=pytest.mark.long)])
def test_the_papers_experiment_on_the_emulator(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, found = tmp_path / "run.mcap", tmp_path / "result.json"
    report = tmp_path / "report.html"
    command = ["run", "--rig", name, "--reference", REFERENCE, "--out", str(out), "--json", str(found)]
    assert swingid([*command, *(["--report", str(report)] if name == "paper" else [])]) == 0
    printed = capsys.readouterr()
    assert "emulator" in printed.err
    assert "on the twin" in printed.err
    assert "swing" in printed.err
    assert "Identification" in printed.out
    result = json.loads(found.read_text())
    inertia = result["parameters"]["inertia"]
    assert abs(inertia["value"] / INERTIA[name] - 1) < 2e-4
    assert inertia["interval95"][0] <= INERTIA[name] <= inertia["interval95"][1]
    assert result["status"] == "ok"
    assert swingid(["identify", str(out), "--rig", name]) == 0
    assert "no --device" not in capsys.readouterr().err
    assert name != "paper" or report.stat().st_size > 10_000


def test_the_wanted_uncertainty_ends_the_run_and_the_rest_is_faded(tmp_path: Path) -> None:
    seen: list[Progress] = []
    done = Conductor(RIG, twin_of(RIG), show=seen.append).run(order(duration=25.0, until=5e-4), tmp_path / "run.mcap")
    assert (done.end.reason, done.progress is not None) == (Reason.STOPPED, True)
    assert "0.00063 %" in done.end.sentence
    log = Recording.load(tmp_path / "run.mcap", RIG)
    assert 3.0 < log.duration < 8.0
    assert sw.identify(log, RIG).inertia.value == pytest.approx(3.022e-3, rel=5e-4)


def test_python_gives_the_log_and_leaves_nothing(tmp_path: Path) -> None:
    with sw.live.connect("twin://paper?seed=3") as rig:
        assert isinstance(rig, LiveRig)
        log = rig.run(REFERENCE, duration=5.0)
        again = rig.run(REFERENCE, duration=5.0, out=tmp_path / "kept.mcap")
    np.testing.assert_array_equal(log.angle, again.angle)
    assert sw.identify(log, rig.rig).inertia.value == pytest.approx(3.022e-3, rel=5e-4)
    assert [path.name for path in tmp_path.iterdir()] == ["kept.mcap"]
    assert rig.last is not None
    assert rig.last.end.reason is Reason.FINISHED


def test_the_same_seed_gives_the_same_file(tmp_path: Path) -> None:
    for name in "ab":
        Conductor(RIG, twin_of(RIG, seed=4, draw=True)).run(order(duration=2.0), tmp_path / f"{name}.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--reference", "sine 1.6 rad 3 rad/s"], 2, "rehearsal on the twin passes the limits of the guard: the angle"),
        (["--reference", "circle"], 2, "circle"),
        (["--reference", REFERENCE, "--until", "much"], 2, "0.05%"),
        (["--reference", REFERENCE, "--until", "200%"], 2, "0.05%"),
        (["--reference", REFERENCE, "--duration", "-3"], 2, "duration"),
        long((["--reference", REFERENCE, "--duration", "3", "--device", "warp://9"], 2, "warp")),
        (["--reference", REFERENCE, "--device", "twin://paper?rate=3"], 2, "rate"),
        (["--reference", REFERENCE, "--duration", "3", "--device", "tcp://127.0.0.1:1"], 5, "127.0.0.1"),
        long((["--reference", REFERENCE, "--duration", "3", "--device", "serial:///dev/none"], 5, "/dev/none")),
    ],
)
def test_what_is_refused_before_the_rig_moves(
    options: list[str], code: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert swingid(["run", "--rig", "paper", "--out", str(tmp_path / "run.mcap"), *options]) == code
    printed = capsys.readouterr().err
    assert words in printed
    assert "Traceback" not in printed


@pytest.mark.parametrize("out", ["run.csv", "none/run.mcap"])
def test_a_journal_that_cannot_be_written_is_refused_first(out: str, tmp_path: Path) -> None:
    code = swingid(["run", "--rig", "paper", "--reference", REFERENCE, "--out", str(tmp_path / out)])
    assert code == (2 if out.endswith("csv") else 3)


class Pressed(TwinDevice):
    """A device in whose 4300th sample somebody presses Ctrl-C, once or twice."""

    times = 1

    def step(self) -> None:
        super().step()
        if self.plant.row in (4300, 4400)[: self.times]:
            os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.skipif(os.name == "nt", reason="os.kill ends a process on Windows")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_the_end_that_the_system_asks_for_is_a_soft_stop_and_then_a_hard_one(name: str) -> None:
    number, asked = signal.Signals[name], []
    with handled(number, signal.SIG_DFL):
        with stopping(lambda mode, why: asked.append((mode, why))):
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), number)
        assert asked == [(StopMode.SOFT, f"stopped by {name}"), (StopMode.HARD, f"stopped by {name}")]
        assert signal.getsignal(number) is signal.SIG_DFL


@pytest.mark.skipif(os.name == "nt", reason="SIGHUP is a signal of POSIX")
def test_what_was_started_to_outlive_its_terminal_does_so() -> None:
    asked = []
    with handled(signal.SIGHUP, signal.SIG_IGN), stopping(lambda mode, why: asked.append((mode, why))):
        os.kill(os.getpid(), signal.SIGHUP)
    assert asked == []


@contextmanager
def handled(number: signal.Signals, handler: signal.Handlers) -> Iterator[None]:
    """A signal as a process finds it at its start, however the tests were started."""
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("seconds", [1.0, 2.0])
def test_a_short_run_whose_motion_still_grows_passes_the_hosts_guard(seconds: float, tmp_path: Path) -> None:
    done = Conductor(RIG, twin_of(RIG)).run(order(duration=seconds), tmp_path / "run.mcap")
    assert done.end.reason is Reason.FINISHED
    assert done.rehearsed is not None


def test_a_run_shorter_than_the_guards_speeds_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, check=coded("out-of-range", "1 samples")):
        Conductor(RIG, twin_of(RIG)).run(order(duration=0.001), tmp_path / "run.mcap")


def test_the_guard_allows_the_energy_of_a_small_angle() -> None:
    inertia, gravity = expected(RIG)
    tiny = Rehearsed(angle=0.0, speed=0.0, wheel_speed=0.0, voltage=0.0, saturated=0.0, energy=0.0, tracking=0.0)
    assert energy_limit(tiny, RIG) == energy_of(0.1, 0.0, inertia, gravity)
    assert energy_limit(replace(tiny, energy=1.0), RIG) == 2.0


@pytest.mark.skipif(os.name == "nt", reason="os.kill with SIGINT ends a process on Windows")
@pytest.mark.parametrize(("times", "code", "state"), [(1, 0, State.STOPPING), (2, 5, State.IDLE)])
def test_ctrl_c_once_is_a_soft_stop_and_twice_a_hard_one(
    times: int,
    code: int,
    state: State,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    twin = twin_of(RIG)
    device = Pressed(twin.plant, twin.board)
    device.times = times
    monkeypatch.setattr("swingid.live.processes.opened", lambda address, rig: device)
    out = str(tmp_path / "run.mcap")
    assert swingid(["run", "--rig", "paper", "--reference", REFERENCE, "--out", out, "--duration", "12"]) == code
    assert "Ctrl-C" in capsys.readouterr().err
    faded = 500 if state is State.STOPPING else 100
    assert device.plant.row == pytest.approx(4300 + faded, abs=60)
    assert device.machine.state is State.IDLE  # type: ignore[attr-defined]
    assert device.machine.voltage == 0.0  # type: ignore[attr-defined]
    assert len(Recording.load(out, RIG)) > 2000


def test_a_body_that_swings_is_not_at_rest() -> None:
    device = TwinDevice(Plant(RIG, initial_speed=0.5), twin_of(RIG).board)
    with pytest.raises(DeviceError, check=coded("not-still")):
        Conductor(RIG, device).run(order(wait=0.0), Path(os.devnull))


def test_a_body_that_comes_to_rest_is_waited_for(tmp_path: Path) -> None:
    said: list[str] = []
    device = TwinDevice(Plant(RIG, initial_speed=0.5), twin_of(RIG).board)
    done = Conductor(RIG, device, say=said.append).run(order(), tmp_path / "run.mcap")
    assert done.end.reason is Reason.FINISHED
    assert any("waiting until the body hangs still" in line for line in said)
    assert sw.identify(Recording.load(tmp_path / "run.mcap", RIG), RIG).inertia.value == pytest.approx(
        3.022e-3, rel=1e-3
    )


def test_a_stop_before_the_run_is_no_run(tmp_path: Path) -> None:
    device = twin_of(RIG)
    conductor = Conductor(RIG, device, say=lambda line: conductor.stop(StopMode.SOFT, "enough"))
    with pytest.raises(DeviceError, check=coded("stopped")):
        conductor.run(order(), tmp_path / "run.mcap")
    assert device.plant.row < 200


def test_a_stop_between_arm_and_run_is_no_run(tmp_path: Path) -> None:
    device = twin_of(RIG)
    conductor = Conductor(RIG, device)
    receive = device.machine.receive

    def stopped(data: bytes) -> None:
        receive(data)
        if device.machine.state is State.ARMED and conductor.session is not None:  # type: ignore[attr-defined]
            conductor.stop(StopMode.SOFT, "enough")

    device.machine.receive = stopped  # type: ignore[method-assign]
    with pytest.raises(DeviceError, check=coded("stopped")):
        conductor.run(order(), tmp_path / "run.mcap")


def test_the_twin_of_a_rig_file_has_the_signs_of_the_model(tmp_path: Path) -> None:
    turned = RIG.changed({"device.axis_sign": -1, "device.wheel_sign": -1, "device.voltage_sign": -1})
    done = Conductor(turned, twin_of(turned)).run(order(duration=4.0), tmp_path / "run.mcap")
    assert done.end.reason is Reason.FINISHED


def test_a_device_with_other_encoders_than_the_rig_file_is_refused(tmp_path: Path) -> None:
    other = sw.Rig.load("paper").changed({"sensors.counts_per_turn": 4096})
    with pytest.raises(InputError, check=coded("other-counts")):
        Conductor(RIG, twin_of(other)).run(order(), tmp_path / "run.mcap")


def test_a_device_without_a_rig_file_is_refused() -> None:
    with pytest.raises(UsageError, match=r"rig\.toml"):
        sw.live.connect("/dev/ttyACM0", None)


def test_recover_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run.mcap"
    Conductor(RIG, twin_of(RIG)).run(order(duration=4.0), out)
    assert swingid(["recover", str(out)]) == 0
    assert "is whole" in capsys.readouterr().out
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(out.read_bytes()[: out.stat().st_size * 9 // 10])
    assert swingid(["recover", str(cut), "--out", str(tmp_path / "new.mcap")]) == 0
    assert len(Recording.load(tmp_path / "new.mcap", RIG)) > 3000
    assert swingid(["recover", str(tmp_path / "none.mcap")]) == 3


def test_an_older_journal_is_not_overwritten(tmp_path: Path) -> None:
    """Also where the run is refused later: the file of a measurement stays as it is."""
    older = tmp_path / "run.mcap"
    older.write_bytes(b"a measurement")
    with pytest.raises(InputError, check=coded("file-exists")):
        sw.live.connect("twin://paper").run("sine 0.8 rad 8.5 rad/s", duration=2.0, out=older)
    assert older.read_bytes() == b"a measurement"
