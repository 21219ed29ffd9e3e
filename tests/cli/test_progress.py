"""The progress of long work: a bar on a terminal, plain lines elsewhere, never in standard output."""

from __future__ import annotations

import json
import sys
import threading
import time
import types
from collections.abc import Callable

import numpy as np
import pytest

import swingid as sw
from long_cases import quick_first
from motor_logs import BLANK, clamped, given
from swingid.calibration.encoders import calibrate_encoders
from swingid.calibration.motor import calibrate
from swingid.cli import main, output, progress
from swingid.cli.compile import Bar
from swingid.cli.output import say
from swingid.cli.progress import Progress, Steps, bar
from swingid.control.references import Sine
from swingid.progress import advanced, shown, stepped, stepwise, tracked, watched
from swingid.simulation import simulate
from swingid.study.design import design

BIT14 = {"counts_per_turn": 16384}


@pytest.fixture
def now(monkeypatch) -> list[float]:
    """The clock, in s."""
    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    return clock


@pytest.fixture
def terminal(monkeypatch, capsys):
    """Standard error counts as a terminal of 100 columns."""
    monkeypatch.setattr("swingid.cli.output.on_terminal", lambda: True)
    monkeypatch.setenv("COLUMNS", "100")
    return lambda: [line.rstrip() for line in capsys.readouterr().err.split("\r")[1:]]


def test_loops_report_and_loops_inside_them_do_not():
    seen: list[tuple[int, int]] = []
    assert list(tracked("ab")) == ["a", "b"]
    with shown(lambda done, total: seen.append((done, total))):
        for _ in tracked("abc"):
            list(tracked("de"))
            advanced(1, 9)
        assert list(tracked("x")) == ["x"]
        advanced(4, 9)
    list(tracked("ab"))
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3), (4, 9)]


def test_steps_of_no_single_loop_are_counted_by_who_does_them():
    seen: list[tuple[int, int]] = []
    stepped()
    with shown(lambda done, total: seen.append((done, total))):
        with stepwise(5):
            stepped()
            with stepwise(100):
                stepped(2)
            list(tracked("ab"))
            advanced(1, 9)
        list(tracked("ab"))
        with stepwise(2):
            stepped(3)
    with stepwise(4):
        stepped()
    first = [(0, 5), (1, 5), (3, 5), (5, 5)]
    assert seen == [*first, (0, 2), (1, 2), (2, 2), (0, 2), (2, 2), (2, 2)]


def test_a_kernel_is_watched_from_outside():
    seen: list[tuple[int, int]] = []
    looks = iter(range(100, 10_000))

    def kernel() -> str:
        time.sleep(1.0)
        return "done"

    assert watched(lambda: threading.current_thread(), lambda: 0, 9) is threading.main_thread()
    with shown(lambda done, total: seen.append((done, total))):
        assert watched(lambda: "quick", lambda: 0, 9) == "quick"
        assert seen == []
        assert watched(kernel, lambda: next(looks), 1000) == "done"
        with pytest.raises(ZeroDivisionError):
            watched(lambda: 1 // 0, lambda: 0, 9)
    assert seen[0] == (100, 1000)
    assert seen[-1] == (1000, 1000)
    assert seen == sorted(seen)


@pytest.mark.parametrize("command", quick_first(2, ["calibrate", "swing", "design", "encoders"]))
def test_commands_of_several_stages_end_with_their_last_step(command):
    """And say something of what they do in between."""
    seen: list[tuple[int, int]] = []
    work = {"design": _design, "calibrate": _motor, "swing": _swing, "encoders": _encoders}[command]()
    with shown(lambda done, total: seen.append((done, total))):
        work()
    total = seen[0][1]
    assert seen[0] == (0, total)
    assert seen[-1] == (total, total)
    assert seen == sorted(seen)
    assert len({done for done, _ in seen}) > min(total, 5)


def _design() -> Callable[[], object]:
    return lambda: design(sw.Rig.load("paper"), "0.1 %", duration=30.0, check=False)


def _motor() -> Callable[[], object]:
    logs = [clamped(seed=k, sensors=BIT14) for k in range(2)]
    return lambda: calibrate(logs, given(BIT14, **BLANK))


def _swing() -> Callable[[], object]:
    rig = sw.Rig.load("paper").changed({"sensors.noise": 1e-4})
    logs = [simulate(rig, duration=15.0, initial_angle=0.5 + 0.1 * k, seed=k) for k in range(3)]
    return lambda: calibrate(logs, rig)


def _encoders() -> Callable[[], object]:
    rig = sw.Rig.load("paper").changed({"sensors.noise": 1e-4})
    logs = [simulate(rig, Sine(0.8, speed), duration=20.0, seed=k) for k, speed in enumerate((5.0, 8.5))]
    return lambda: calibrate_encoders(logs, rig)


def test_a_simulation_says_how_many_rows_it_has(monkeypatch):
    seen: list[tuple[int, int]] = []
    monkeypatch.setattr("swingid.progress.LOOK", 0.0)
    rig = sw.Rig.load("paper")
    alone = simulate(rig, Sine(0.8, 8.5), duration=400.0)
    with shown(lambda done, total: seen.append((done, total))):
        watched_one = simulate(rig, Sine(0.8, 8.5), duration=400.0)
    assert np.array_equal(alone.voltage, watched_one.voltage)
    assert np.array_equal(alone.angle, watched_one.angle)
    assert {total for _, total in seen} == {400_001}
    assert seen == sorted(seen)
    assert any(0 < done < 400_001 for done, _ in seen)
    assert seen[-1] == (400_001, 400_001)


def left_halfway() -> None:
    """A loop with an error in its first round."""
    for _ in tracked("abc"):
        next(iter(()))


def test_a_loop_that_is_left_does_not_silence_the_next():
    seen: list[tuple[int, int]] = []
    with shown(lambda done, total: seen.append((done, total))):
        with pytest.raises(StopIteration):
            left_halfway()
        list(tracked("de"))
    assert seen[-1] == (2, 2)


def test_a_bar_on_a_terminal(now, terminal):
    show = Progress("runs")
    for second, done in ((0.0, 0), (30.0, 1), (31.0, 2), (34.0, 5), (39.0, 10)):
        now[0] = second
        show(done, 10)
    assert terminal() == [
        "[....................] 0 of 10 runs",
        "[##..................] 1 of 10 runs",
        "[####................] 2 of 10 runs, 8 s left",
        "[##########..........] 5 of 10 runs, 5 s left",
        "[####################] 10 of 10 runs",
    ]


def test_short_work_says_nothing_where_there_is_no_terminal(now, capsys):
    show = Progress("logs")
    for second in range(9):
        now[0] = float(second)
        show(second, 8)
    assert capsys.readouterr().err == ""


def test_steps_with_the_time_left(now, terminal):
    show = Steps(3)
    for second, words in ((0.0, "one"), (20.0, "two"), (24.0, "three")):
        now[0] = second
        show(words)
    assert terminal() == [
        "[....................] one, step 1 of 3",
        "[######..............] two, step 2 of 3",
        "[#############.......] three, step 3 of 3, 4 s left",
    ]


def test_a_line_fits_the_terminal(terminal, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    Steps(2)("words " * 20)
    assert [len(line) for line in terminal()] == [28]  # 29 with the blank in the end


def test_a_sentence_begins_a_line_of_its_own(now, terminal, capsys):
    Progress("runs")(1, 10)
    say("interrupted")
    say("again")
    err = capsys.readouterr().err
    assert err.split("\n")[1:] == ["swingid: interrupted.", "swingid: again.", ""]


def test_compiling_is_shown_like_other_work(now, monkeypatch, capsys):
    show = Bar()
    for second, part in ((0.0, 0.0), (5.0, 0.25), (11.0, 0.5), (15.0, 0.75), (22.0, 1.0)):
        now[0] = second
        show(part, second)
    assert capsys.readouterr().err == "swingid: 50 % of the kernels, 11 s left.\n"
    monkeypatch.setattr("swingid.cli.output.on_terminal", lambda: True)
    monkeypatch.setenv("COLUMNS", "60")
    show(0.75, 15.0)
    assert capsys.readouterr().err.rstrip() == "\r[###############.....] 75 % of the kernels, 5 s left"


def test_a_dumb_terminal_gets_plain_lines(monkeypatch):
    monkeypatch.setattr(sys, "stderr", types.SimpleNamespace(isatty=lambda: True))
    monkeypatch.setenv("TERM", "xterm")
    assert output.on_terminal()
    monkeypatch.setenv("TERM", "dumb")
    assert not output.on_terminal()


def test_a_bar_is_as_long_as_its_share():
    assert [bar(done, 40).count("#") for done in (0, 1, 2, 39, 40, 41)] == [0, 0, 1, 19, 20, 20]
    assert bar(0, 0).count("#") == 0


def test_json_on_standard_output_is_json_alone(now, terminal, tmp_path, capsys):
    path = tmp_path / "log.parquet"
    words = ["--reference", "sine 0.8 rad 8.5 rad/s", "--duration", "15"]
    assert main(["simulate", "--rig", "paper", *words, "--out", str(path)]) == 0
    capsys.readouterr()
    methods = ["--method", "momentum", "--method", "energy"]
    assert main(["compare", str(path), "--rig", "paper", *methods, "--json", "-"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["schema"] == "swingid.compare/1"
    assert "[##########..........] 1 of 2 results" in err


def test_every_step_of_the_paper_is_counted(monkeypatch):
    """Nothing is computed: each part only says what comes next."""
    from swingid.study.reproduce import reproduction, steps
    from swingid.study.reproduce.runs import WAYS

    said: list[str] = []
    for name in ("experiment", "simulation", "imperfection_rows", "claim_rows"):
        monkeypatch.setattr(reproduction, name, _announcing(name, reproduction, WAYS))
    monkeypatch.setattr(reproduction, "Reproduction", lambda *_: None)
    monkeypatch.setattr(reproduction, "plain_data", lambda value: value)
    for quick in (True, False):
        said.clear()
        reproduction.reproduce(quick=quick, progress=said.append)
        assert len(said) == steps(quick=quick)


def _announcing(name, module, ways):
    """A part of the reproduction that only announces its steps, as often as the code that it stands for."""

    def run(*arguments):
        report = arguments[-1]
        count = {
            "experiment": len(ways),
            "simulation": module.SIMULATION_STEPS,
            "imperfection_rows": len(module.imperfections()),
            "claim_rows": len(module.TESTS),
        }[name]
        for k in range(count):
            report(f"{name} {k}")
        return types.SimpleNamespace(answers={})

    return run
