"""The page beside a live rig, in a real browser: every step, STOP, a dead server, two pages, a slow network.

The rig is the twin in virtual time, so that a busy machine does not make a heartbeat late.
"""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import pytest

from browser import browser, listen, picture, served
from swingid import Recording, Rig, identify

for package in ("cantools", "cobs", "fastcrc", "mcap"):
    pytest.importorskip(package, reason=f"{package} is not installed: pip install 'swingid[live]'")

SLOW = 120_000  # ms, with kernels that are compiled


def click(page, name: str, *, trial: bool = False) -> None:
    """Press a button of a step once it is enabled; with trial, only wait until it is."""
    page.locator("section").get_by_role("button", name=name, exact=True).last.click(timeout=SLOW, trial=trial)


def go_to(page, name: str) -> None:
    """Open a step, once it may be, from another one that is open."""
    step = page.locator(f"section[aria-label='{name}']")
    step.locator(".swingid-step-head[aria-disabled='false']").wait_for(timeout=SLOW)
    if step.locator(".swingid-step-head").get_attribute("aria-expanded") != "true":
        step.locator(".swingid-step-head").click()
    is_open(page, name)


def is_open(page, name: str) -> None:
    """Wait until the server has opened a step: a click on an open one would fold it."""
    page.locator(f"section[aria-label='{name}'] .swingid-step-head[aria-expanded='true']").wait_for(timeout=SLOW)


def waits(page, name: str):
    """A step that cannot be begun."""
    return page.locator(f"section.later[aria-label='{name}']")


def ready_to_run(page, duration: float, words: str = "sine 0.8 rad 8.5 rad/s") -> None:
    """Connect, Check, Rehearse."""
    click(page, "Connect")
    click(page, "Next: Check")
    is_open(page, "Check")
    click(page, "Check")
    page.get_by_text("signs: axis").first.wait_for(timeout=SLOW)
    page.get_by_text("Pulses of up to").wait_for(timeout=SLOW)
    click(page, "Next: Rehearse")
    is_open(page, "Rehearse")
    page.get_by_label("reference", exact=True).fill(words)
    page.get_by_label("duration, s").fill(f"{duration:g}")
    click(page, "Rehearse on the twin")
    page.get_by_text("within the limits of the guard").first.wait_for(timeout=SLOW)
    page.get_by_text("On the twin the body reaches").wait_for(timeout=SLOW)
    page.get_by_role("button", name="❚❚ Pause").wait_for(timeout=SLOW)  # the drawing plays the rehearsal
    click(page, "Next: Run")
    is_open(page, "Run")


def journals(folder: Path) -> list[Path]:
    return sorted(folder.glob("run-*.mcap"))


def whole(journal: Path) -> bool:
    """Whether a journal has its end, the magic of MCAP."""
    return journal.read_bytes()[-8:] == b"\x89MCAP0\r\n" and journal.stat().st_size > 100


@pytest.mark.long
def test_every_step_on_the_twin(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, _), browser() as chromium:
        page = chromium.new_page(viewport={"width": 1200, "height": 1200})
        errors = listen(page)
        page.goto(address)
        page.get_by_role("button", name="Connect", exact=True).wait_for(timeout=SLOW)
        # nothing can be run before it was checked
        for name in ("Check", "Rehearse", "Run", "Result", "Keep"):
            assert waits(page, name).count() == 1
        picture(page, "live-connect")
        ready_to_run(page, 20)
        picture(page, "live-ready")
        click(page, "Run")
        page.get_by_text("after swing").wait_for(timeout=SLOW)
        page.get_by_text(re.compile("wrote .*mcap")).wait_for(timeout=SLOW)
        page.get_by_text(re.compile("is recorded. Next: its result")).wait_for(timeout=SLOW)
        picture(page, "live-run")
        (journal,) = journals(tmp_path)
        truth = Rig.load("paper").axis.inertia.value
        found = identify(Recording.load(journal, Rig.load("paper")), Rig.load("paper"))
        assert found.status == "ok"
        assert found.inertia.value == pytest.approx(truth, rel=2e-4)
        go_to(page, "Result")
        page.locator(".swingid-large").wait_for(timeout=SLOW)
        picture(page, "live-result")
        # another motion must be rehearsed first
        go_to(page, "Rehearse")
        page.get_by_label("duration, s").fill("21")
        page.get_by_label("duration, s").press("Tab")
        go_to(page, "Run")
        page.locator("button.disabled", has_text="Run").wait_for(timeout=SLOW)
        # one that passes the limits is not run
        go_to(page, "Rehearse")
        page.get_by_label("reference", exact=True).fill("sine 2.5 rad 6 rad/s")
        click(page, "Rehearse on the twin")
        page.locator(".swingid-log", has_text="passes the limits of the guard").wait_for(timeout=SLOW)
        waits(page, "Run").wait_for(timeout=SLOW)
        assert not errors


@pytest.mark.long
def test_stop_two_pages_and_a_slow_network(tmp_path):
    arguments = ("--rig", "paper", "--folder", str(tmp_path))
    with served(*arguments) as (address, _), browser() as chromium:
        page, other = chromium.new_page(), chromium.new_page()
        page.goto(address)
        ready_to_run(page, 600)  # on the twin in its own time: some minutes, if nobody stops it
        other.goto(address)
        other.get_by_text("Another page controls this rig").wait_for(timeout=SLOW)
        assert other.get_by_role("button", name="Connect", exact=True).is_disabled()
        click(page, "Run")
        page.get_by_text(re.compile(r"running · [1-9]\d?\.\d s")).wait_for(timeout=SLOW)
        picture(page, "live-running")
        # a slow network: half a second each way, 20 kB/s
        slow = page.context.new_cdp_session(page)
        slow.send("Network.enable")
        slow.send(
            "Network.emulateNetworkConditions",
            {"offline": False, "latency": 500, "downloadThroughput": 20_000, "uploadThroughput": 20_000},
        )
        page.wait_for_timeout(1500)
        # who watches may stop, by the keyboard
        began = time.monotonic()
        other.keyboard.press("Escape")
        other.get_by_text("at rest, 0 V").wait_for(timeout=30_000)
        stopped = time.monotonic() - began
        (journal,) = journals(tmp_path)
        log = Recording.load(journal, Rig.load("paper"))
        assert log.duration < 500
        assert stopped < 20  # half a second of fading, then the end of the journal; on a busy machine


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="kill -9 is POSIX")
def test_a_run_goes_on_where_the_server_is_killed(tmp_path):
    arguments = ("--rig", "paper", "--folder", str(tmp_path))
    with served(*arguments) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 60)
        click(page, "Run")
        page.get_by_text(re.compile(r"running · [1-9]\d?\.\d s")).wait_for(timeout=SLOW)
        page.close()  # a page that is closed does not touch the rig either
        time.sleep(1)
        os.kill(server.pid, signal.SIGKILL)
        (journal,) = journals(tmp_path)
        until = time.monotonic() + 240
        while not whole(journal) and time.monotonic() < until:
            time.sleep(1)
        log = Recording.load(journal, Rig.load("paper"))
        assert log.duration == pytest.approx(60, abs=0.01)
        assert not [one for one in log.findings if "cut" in one.code]
