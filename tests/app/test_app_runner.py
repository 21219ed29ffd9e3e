"""The steps of a live page in their processes: each can be stopped, none outlives its server but a run."""

from __future__ import annotations

import os
import pickle
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from long_cases import quick_if
from swingid import Recording, Rig
from swingid.app import live_steps as steps
from swingid.app.order import WrongFieldError, order_of, share_of
from swingid.app.runner import Runner
from swingid.app.task import Halt, StoppedError, Task, View
from swingid.live.codes import State, StopMode
from swingid.live.ring import Kind, Reader, Ring, Role, started

for package in ("cantools", "cobs", "fastcrc", "mcap"):
    pytest.importorskip(package, reason=f"{package} is not installed: pip install 'swingid[live]'")

SINE = "sine 0.8 rad 8.5 rad/s"


def until(true, seconds: float, runner: Runner | None = None) -> float:
    """Wait for what must become true; how long it took (s)."""
    began = time.monotonic()
    while not true():
        assert time.monotonic() - began < seconds, "it did not become true"
        if runner is not None:
            runner.poll()
        time.sleep(0.02)
    return time.monotonic() - began


@pytest.fixture
def runner():
    one = Runner()
    yield one
    one.stop(hard=True)
    one.finish(20)
    one.close()


def test_stop_ends_a_rehearsal_at_once(runner):
    runner.start(Task("rehearse", "", "paper", SINE, 3500.0))
    until(lambda: runner.seen.lines, 60, runner)
    time.sleep(0.5)
    runner.stop()
    assert until(lambda: not runner.busy, 10, runner) < 1.0
    assert runner.seen.ended == "stopped"
    assert runner.seen.lines[-1] == "stopped"
    assert "rehearse" not in runner.passed


def test_stop_ends_a_connection_to_what_does_not_answer(runner):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        runner.start(Task("connect", f"tcp://127.0.0.1:{silent.getsockname()[1]}", "paper"))
        time.sleep(0.3)
        runner.stop()
        assert until(lambda: not runner.busy, 10, runner) < 1.0
    assert runner.seen.ended == "stopped"


def test_stop_before_a_run_has_begun_moves_nothing(runner, tmp_path):
    out = tmp_path / "run.mcap"
    runner.start(Task("run", "", "paper", SINE, 600.0, out=str(out)))
    runner.stop()
    until(lambda: not runner.busy, 60, runner)
    assert runner.seen.count == 0
    assert runner.seen.ended in ("stopped", "failed")
    assert runner.journals == []
    assert runner.words_at_end() == "the page has ended; no run was recorded"


@pytest.mark.long
def test_a_second_stop_is_a_hard_one(runner, tmp_path):
    out = tmp_path / "run.mcap"
    runner.start(Task("run", "", "paper", SINE, 300.0, out=str(out)))
    until(lambda: runner.seen.count > 2000, 120, runner)
    runner.stop()
    runner.stop()
    until(lambda: not runner.busy, 60, runner)
    assert "0 V" in runner.seen.lines[-1]
    log = Recording.load(out, Rig.load("paper"))
    assert 2 < log.duration < 299
    assert runner.journals == [str(out)]
    assert runner.words_at_end() == f"the page has ended; kept: {out}"


@pytest.mark.skipif(os.name != "posix", reason="kill -9 is POSIX")
def test_a_run_of_the_twin_ends_with_its_process(runner, tmp_path):
    runner.start(Task("run", "", "paper", SINE, 300.0, out=str(tmp_path / "run.mcap")))
    until(lambda: runner.seen.count > 1000, 120, runner)
    runner._process.kill()
    until(lambda: not runner.busy, 20, runner)
    assert runner.elsewhere is None
    assert "has died" in runner.seen.lines[-1]


def test_a_step_without_room_for_its_ring_is_one_sentence(runner, tmp_path, monkeypatch):
    monkeypatch.setenv("SWINGID_MEMORY", str(tmp_path / "missing"))
    runner.start(Task("connect", "", "paper"))
    assert not runner.busy
    assert runner.seen.ended == "failed"
    assert "name another folder by $SWINGID_MEMORY" in runner.seen.lines[-1]


def test_a_step_opens_after_others_that_stand_before_it():
    names = [step.name for step in steps.STEPS]
    assert list(steps.ON_RIG) == names[: len(steps.ON_RIG)]
    for number, step in enumerate(steps.STEPS):
        assert all(names.index(before) < number for before in step.after)
        assert (step.do is None) == (step.doing == "")


ELSEWHERE = """
import sys, time
from swingid.live.registry import announced
with announced("tcp://bench:1", sys.argv[1], duration=60.0, fade=0.5) as run:
    print("runs", flush=True)
    asked = []
    while (found := run.asked()) is None or found[0].name != sys.argv[2]:
        time.sleep(0.05)
"""


@pytest.mark.parametrize("presses", [1, 2])
def test_a_run_that_no_process_here_shows_is_seen_and_stopped(runner, tmp_path, presses):
    """Its page was killed, or another program began it: STOP still reaches it, and it is not said to be at rest."""
    runner.device = "tcp://bench:1"
    mode = "HARD" if presses > 1 else "SOFT"
    command = [sys.executable, "-c", ELSEWHERE, str(tmp_path / "run.mcap"), mode]
    other = subprocess.Popen(command, stdout=subprocess.PIPE)
    try:
        other.stdout.readline()
        until(lambda: runner.elsewhere is not None, 5, runner)
        assert "the run goes on in" in runner.words_at_end()
        assert "swingid stop" in runner.words_at_end()
        for _ in range(presses):
            runner.stop()
        other.wait(10)
        until(lambda: runner.elsewhere is None, 5, runner)
    finally:
        other.kill()
        other.wait()
        other.stdout.close()


def orphan(task: Task) -> subprocess.Popen[bytes]:
    """A step whose server dies 1 s after it has said something: its lock of the ring ends."""
    ring = Ring()
    ring.hold(Role.VIEW)
    ring.write(Kind.JOB, 0.0, pickle.dumps(task))
    process, reader = started(ring, "swingid.app.live_steps"), Reader(ring)
    until(lambda: any(record.kind is Kind.SAY for record in reader.read()), 60)
    time.sleep(1.0)
    ring.close()
    return process


def test_a_rehearsal_ends_with_its_server():
    process = orphan(Task("rehearse", "", "paper", SINE, 3500.0))
    began = time.monotonic()
    process.wait(30)
    assert time.monotonic() - began < 15  # a loop that is compiled runs to its end, some seconds


@pytest.mark.long
def test_a_run_goes_on_without_its_server_to_its_end(tmp_path):
    out = tmp_path / "run.mcap"
    process = orphan(Task("run", "", "paper", SINE, 20.0, out=str(out)))
    assert process.wait(120) == 0
    assert Recording.load(out, Rig.load("paper")).duration == pytest.approx(20, abs=0.01)


def test_a_stop_just_before_its_server_dies_reaches_the_run():
    ring, asked = Ring(), []
    view = View(ring)
    ring.ask(StopMode.SOFT, "pressed")
    view.pass_stops_to(lambda *stop: asked.append(stop))
    view._watch(Halt.FADES)  # nobody holds the lock of the server
    ring.close()
    assert asked == [(StopMode.SOFT, "pressed")] * 2


class Asked(View):
    """A person who presses STOP at the n-th turn of the link."""

    def __init__(self, turn: int) -> None:
        super().__init__(Ring())
        self.turn, self.turns = turn, 0

    def require_wanted(self) -> None:
        self.turns += 1
        if self.turns >= self.turn:
            self.ring.ask(StopMode.HARD, "pressed")
        super().require_wanted()


@pytest.mark.parametrize(
    "turn", quick_if(lambda turn: turn in (1, 160, 400), [1, 2, 5, 100, 160, 180, 250, 400, 500, 660])
)
def test_stop_in_a_check_gives_0_v(turn, monkeypatch):
    """At any turn: while it connects, listens, pulses, tests the guard."""
    from swingid.live import experiment
    from swingid.live.devices.twin import twin_of

    rig = Rig.load("paper")
    device, view = twin_of(rig), Asked(turn)
    monkeypatch.setattr(experiment, "opened", lambda *_: device)
    with pytest.raises(StoppedError):
        steps._check(Task("check", "", "paper"), rig, view)
    assert device.machine.state is State.IDLE
    assert view.turns < turn + 10  # a Stop and its answer
    assert view.lines[-1] == "stopped: 0 V"


WRONG = [
    ("", 25, 0, "reference"),
    (None, 25, 0, "reference"),
    ("file /etc/passwd", 25, 0, "reference"),
    ("  file\t/etc/passwd", 25, 0, "reference"),
    ("file", 25, 0, "reference"),
    ("dance", 25, 0, "reference"),
    ("sine 0.8 rad", 25, 0, "reference"),
    ("sine 1e999 rad 8 rad/s", 25, 0, "reference"),
    ("sine 0.8 kg 8 rad/s", 25, 0, "reference"),
    ("multisine " + " + ".join(["0.1 rad 5 rad/s"] * 1000), 25, 0, "reference"),
    ("x" * 1_000_000, 25, 0, "reference"),
    (SINE, None, 0, "duration"),
    (SINE, "", 0, "duration"),
    (SINE, 1e9, 0, "duration"),
    (SINE, 0, 0, "duration"),
    (SINE, -5, 0, "duration"),
    (SINE, float("nan"), 0, "duration"),
    (SINE, float("inf"), 0, "duration"),
    (SINE, "25", 0, "duration"),
    (SINE, [25], 0, "duration"),
    (SINE, True, 0, "duration"),
    (SINE, 10**400, 0, "duration"),
    (SINE, 25, None, "until"),
    (SINE, 25, float("nan"), "until"),
    (SINE, 25, -0.01, "until"),
    (SINE, 25, 1.0, "until"),
    (SINE, 25, share_of(10**400), "until"),
]


@pytest.mark.parametrize(("motion", "duration", "share", "field"), WRONG)
def test_a_wrong_field_is_named_in_one_sentence_before_work_begins(motion, duration, share, field):
    with pytest.raises(WrongFieldError) as wrong:
        order_of(motion, duration, share, Rig.load("paper"))
    assert wrong.value.field == field
    assert 5 < len(wrong.value.message) < 300
    assert "--" not in wrong.value.message
    assert "\n" not in wrong.value.message


def test_no_file_of_the_server_is_opened_for_a_page(monkeypatch):
    opened = []
    monkeypatch.setattr(Path, "open", lambda path, *_, **__: opened.append(path))
    monkeypatch.setattr("builtins.open", lambda path, *_, **__: opened.append(path))
    for words in ("file /etc/passwd", "file\u00a0/etc/passwd", "file\n/etc/passwd", "FILE /etc/passwd"):
        with pytest.raises(WrongFieldError):
            order_of(words, 25, 0, None)
    assert opened == []


def test_what_a_page_may_ask_for():
    order = order_of(SINE, 25, 0.001, Rig.load("paper"), clear=True)
    assert (order.duration, order.until, order.clear) == (25.0, 0.001, True)
