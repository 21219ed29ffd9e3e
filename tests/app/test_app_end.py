"""How the page ends: Ctrl-C in every step, a key that is held, a server that is killed; and what is said and left."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_app_live import SLOW, click, go_to, journals, ready_to_run, whole

from browser import browser, served
from long_cases import quick_first
from page_server import free_port
from swingid import Recording, Rig, parse_reference, simulate

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")]


def interrupted(server: subprocess.Popen[str], times: int = 1, number: int = signal.SIGINT) -> tuple[float, str]:
    """How long the server lives on after Ctrl-C (s), and all that it has said; times: of a key that is held."""
    began = time.monotonic()
    for _ in range(times):
        if server.poll() is None:
            server.send_signal(number)
            time.sleep(0.03)
    said = server.communicate(timeout=60)[0]
    return time.monotonic() - began, said


def ended_well(server: subprocess.Popen[str], took: float, said: str, *words: str) -> None:
    """Exit code 0 within 2 s (and what a busy machine takes), one sentence with these words, no traceback."""
    assert server.returncode == 0, said
    lines = said.splitlines()
    assert lines[1] == "Ctrl-C ends it"
    assert len(lines) == 3, said
    assert lines[2].startswith("the page has ended; ")
    for word in words:
        assert word in lines[2], said
    assert took < 3.5
    print(f"ended {took:.2f} s after Ctrl-C: {lines[2]}")


def below(pid: int) -> list[int]:
    """All processes that were started by this one, and theirs."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += [int(child), *below(int(child))]
    return found


def lives(pid: int) -> bool:
    """Whether a process lives, and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(
    ("number", "times"), quick_first(1, [(signal.SIGINT, 1), (signal.SIGINT, 12), (signal.SIGTERM, 1)])
)
def test_ctrl_c_without_a_run(tmp_path, times, number):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (_, server):
        took, said = interrupted(server, times, number)
        ended_well(server, took, said, "no run was recorded")


def test_ctrl_c_before_the_page_is_served(tmp_path):
    command = [sys.executable, "-m", "swingid", "dashboard", "--rig", "paper", "--folder", str(tmp_path)]
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "NICEGUI"))}
    server = subprocess.Popen(
        [*command, "--port", str(free_port()), "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=own | {"PYTHONUNBUFFERED": "1"},
    )
    assert server.stdout.readline().startswith("the page is http://127.0.0.1:")
    took, said = interrupted(server, 10)
    assert server.returncode == 0, said
    assert said.splitlines()[-1] == "the page has ended; no run was recorded"
    assert took < 3.5


@pytest.mark.long
def test_ctrl_c_beside_a_log(tmp_path):
    log = tmp_path / "run.parquet"
    simulate(Rig.load("paper"), parse_reference("sine 0.8 rad 8.5 rad/s"), duration=8.0).save(log)
    with served("--log", str(log), "--rig", "paper") as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        page.get_by_text("reading the log").or_(page.get_by_text("turning points")).first.wait_for(timeout=SLOW)
        took, said = interrupted(server, 3)
        ended_well(server, took, said, "the log and the rig file are as they were")


@pytest.mark.long
@pytest.mark.parametrize("step", ["Connect", "Check", "Rehearse"])
def test_ctrl_c_in_a_step(tmp_path, step):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        if step != "Connect":
            ready_to_run(page, 5)
            go_to(page, step)
        if step == "Rehearse":
            page.get_by_label("duration, s").fill("3500")
        click(page, "Rehearse on the twin" if step == "Rehearse" else step)
        page.get_by_text(re.compile("(connecting|checking|rehearsing) …")).wait_for(timeout=SLOW)
        page.wait_for_timeout(500 if step == "Check" else 1500 if step == "Rehearse" else 0)
        processes = below(server.pid)
        assert processes
        took, said = interrupted(server)
        ended_well(server, took, said, "no run was recorded")
        time.sleep(1.0)
        assert not [pid for pid in processes if lives(pid)]


@pytest.mark.long
@pytest.mark.parametrize("times", [1, 10])
def test_ctrl_c_after_a_run_and_in_one_says_what_is_kept(tmp_path, times):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 120)
        for _ in range(2):
            go_to(page, "Run")
            page.locator("button:not(.disabled)", has_text="Run").last.wait_for(timeout=SLOW)
            click(page, "Run")
            page.get_by_text(re.compile(r"running · ([5-9]|\d\d)\.\d s")).wait_for(timeout=SLOW)
            if len(journals(tmp_path)) == 1:
                page.keyboard.press("Escape")
                page.get_by_text("at rest, 0 V").wait_for(timeout=SLOW)
        first, second = journals(tmp_path)
        processes = below(server.pid)
        took, said = interrupted(server, times)
        ended_well(server, took, said, str(first), str(second))
        assert whole(first)
        began = time.monotonic()
        while not whole(second) and time.monotonic() - began < 30:
            time.sleep(0.1)
        for journal in (first, second):
            assert Recording.load(journal, Rig.load("paper")).duration < 100
        time.sleep(1)
        assert not [pid for pid in processes if lives(pid)]


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are counted in /proc")
def test_no_process_outlives_a_killed_server(tmp_path):
    log = tmp_path / "run.parquet"
    simulate(Rig.load("paper"), parse_reference("sine 0.8 rad 8.5 rad/s"), duration=8.0).save(log)
    with served("--log", str(log), "--rig", "paper") as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        page.get_by_role("button", name="Answer", exact=True).last.click(timeout=SLOW)
        page.get_by_text("momentum").first.wait_for(timeout=SLOW)
        processes = below(server.pid)
        assert len(processes) >= 2
        server.kill()
        began = time.monotonic()
        while [pid for pid in processes if lives(pid)] and time.monotonic() - began < 20:
            time.sleep(0.1)
        assert not [pid for pid in processes if lives(pid)]


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are counted in /proc")
def test_only_the_run_goes_on_where_the_server_is_killed(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 90)
        click(page, "Run")
        page.get_by_text(re.compile(r"running · [1-9]\d?\.\d s")).wait_for(timeout=SLOW)
        processes = below(server.pid)
        server.kill()
        time.sleep(2)
        left = [pid for pid in processes if lives(pid)]
        assert len(left) == 1  # that of the run, which on the twin needs no other
        began = time.monotonic()
        while lives(left[0]) and time.monotonic() - began < 120:
            time.sleep(0.2)
        assert not lives(left[0])
        (journal,) = journals(tmp_path)
        assert Recording.load(journal, Rig.load("paper")).duration == pytest.approx(90, abs=0.01)
