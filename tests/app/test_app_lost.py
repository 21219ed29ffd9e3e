"""The page where it loses its server: it says so, greys STOP, lets nothing be pressed, and comes back."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time

import pytest
from test_app_live import SLOW, click, go_to, ready_to_run, waits

from browser import browser, listen, picture, served

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="signals of POSIX")]

LOST = "not connected: use the emergency stop"


def stop_button(page):
    return page.get_by_role("button", name="STOP (Esc)")


def started(page) -> None:
    """A run that goes on for a while."""
    click(page, "Run")
    page.get_by_text(re.compile(r"running · [1-9]\d?\.\d s")).wait_for(timeout=SLOW)


def test_a_server_that_is_killed(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        page.get_by_text("nothing is running").wait_for(timeout=SLOW)
        os.kill(server.pid, signal.SIGKILL)
        page.get_by_text(LOST).wait_for(timeout=5000)
        assert stop_button(page).is_disabled()
        picture(page, "lost")


@pytest.mark.long
def test_a_server_that_is_killed_in_a_run(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 300)
        started(page)
        assert stop_button(page).is_enabled()
        os.kill(server.pid, signal.SIGKILL)
        page.get_by_text(LOST).wait_for(timeout=5000)
        assert stop_button(page).is_disabled()
        assert page.get_by_text(re.compile("running ·")).count() == 0
        assert page.evaluate("document.querySelector('.q-page-container').inert") is True
        page.set_viewport_size({"width": 390, "height": 800})
        bar, button = page.locator(".swingid-bar").bounding_box(), stop_button(page).bounding_box()
        assert bar["width"] <= 390
        assert button["height"] >= 48
        picture(page, "lost-killed")
        page.keyboard.press("Escape")
        page.wait_for_timeout(300)
        assert page.get_by_text(LOST).is_visible()
        assert page.get_by_text("stopping").count() == 0


@pytest.mark.long
def test_a_server_that_is_frozen_and_wakes_up(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        errors = listen(page)
        page.goto(address)
        page.get_by_text("nothing is running").wait_for(timeout=SLOW)
        for _ in range(2):
            click(page, "Connect", trial=True)  # the server enables it, so not once it is frozen
            os.kill(server.pid, signal.SIGSTOP)
            # what is pressed before the page knows must not act when the server wakes up
            click(page, "Connect")
            began = time.monotonic()
            page.get_by_text(LOST).wait_for(timeout=8000)
            assert time.monotonic() - began < 6.0
            assert stop_button(page).is_disabled()
            page.wait_for_timeout(500)
            os.kill(server.pid, signal.SIGCONT)
            page.get_by_text(LOST).wait_for(state="detached", timeout=20_000)
            page.get_by_text("pressed while the connection was lost").first.wait_for(timeout=5000)
            assert stop_button(page).is_enabled()
            page.wait_for_timeout(500)
            assert page.get_by_text("connecting").count() == 0
            assert page.evaluate("document.querySelector('.q-page-container').inert") is False
        # and works
        click(page, "Connect")
        page.get_by_text("samples per second").first.wait_for(timeout=SLOW)
        assert not errors


@pytest.mark.long
def test_stop_is_only_acknowledged_by_the_server(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 300)
        started(page)
        os.kill(server.pid, signal.SIGSTOP)
        try:
            stop_button(page).click()
            page.get_by_text("sending STOP").wait_for(timeout=2000)
            page.get_by_text("STOP has not arrived: use the emergency stop").wait_for(timeout=2500)
            assert page.get_by_text("stopping").count() == 0
            page.get_by_text(LOST).wait_for(timeout=5000)
        finally:
            os.kill(server.pid, signal.SIGCONT)
        page.get_by_text("at rest, 0 V").wait_for(timeout=SLOW)  # late, but it counts


@pytest.mark.long
def test_a_page_that_is_loaded_again_in_a_run_controls_it_still(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, _), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 200)
        started(page)
        page.reload()
        page.get_by_text(re.compile(r"running · \d+\.\d s")).wait_for(timeout=SLOW)
        assert page.locator("section[aria-label='Run'] .swingid-step-head").get_attribute("aria-expanded") == "true"
        go_to(page, "Rehearse")
        assert page.get_by_label("duration, s").input_value() == "200"
        page.wait_for_timeout(500)
        assert page.get_by_text("Another page controls").is_hidden()
        page.keyboard.press("Escape")
        page.get_by_text("at rest, 0 V").wait_for(timeout=SLOW)


@pytest.mark.long
def test_two_pages_that_press_at_once_begin_one_step(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, _), browser() as chromium:
        page, other = chromium.new_page(), chromium.new_page()
        for each in (page, other):
            each.goto(address)
            each.get_by_text("nothing is running").wait_for(timeout=SLOW)
        for each in (page, other):
            each.evaluate("document.querySelectorAll('button.q-btn').forEach((one) => one.click())")
        page.get_by_text("samples per second").first.wait_for(timeout=SLOW)
        other.get_by_text("samples per second").first.wait_for(timeout=SLOW)
        for each in (page, other):
            assert each.get_by_text("samples per second").count() == 1


@pytest.mark.long
def test_wrong_fields_and_stop_of_a_rehearsal(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, _), browser() as chromium:
        page = chromium.new_page()
        errors = listen(page)
        page.goto(address)
        ready_to_run(page, 5)
        go_to(page, "Rehearse")
        words, seconds = page.get_by_label("reference", exact=True), page.get_by_label("duration, s")
        for field, value, sentence in (
            (seconds, "1000000000", "duration is 1e+09 s"),
            (seconds, "", "write a number of seconds"),
            (seconds, "25", ""),
            (words, "file /etc/passwd", "a page takes no file"),
            (words, "", "write a motion"),
            (words, "sine 0.8 rad 8.5 rad/s", ""),
            (page.get_by_label("stop at relative uncertainty, %"), "-1", "give 0 to 99 %"),
        ):
            field.fill(value)
            if sentence:
                click(page, "Rehearse on the twin")
                page.get_by_text(sentence).wait_for(timeout=5000)
                assert page.get_by_text("rehearsing").count() == 0
        picture(page, "live-wrong-field")
        page.get_by_label("stop at relative uncertainty, %").fill("0")
        seconds.fill("3500")
        click(page, "Rehearse on the twin")
        page.get_by_text("the twin runs it").wait_for(timeout=SLOW)
        began = time.monotonic()
        page.keyboard.press("Escape")
        page.get_by_text("stopped", exact=True).wait_for(timeout=5000)
        assert time.monotonic() - began < 3.0
        page.get_by_text("nothing is running").wait_for(timeout=5000)
        assert waits(page, "Run").count() == 1
        assert not errors


def pause_workers(server: int) -> None:
    """Pause both processes in which the page computes as soon as they are there, so that no computation ends."""
    children = ["pgrep", "-P", str(server), "-f", "spawn_main"]
    until = time.monotonic() + SLOW / 1000
    while len(workers := subprocess.run(children, capture_output=True).stdout.split()) < 2:
        assert time.monotonic() < until
    for worker in workers:
        os.kill(int(worker), signal.SIGSTOP)


@pytest.mark.long
def test_stop_ends_the_identification_of_a_result(tmp_path):
    with served("--rig", "paper", "--folder", str(tmp_path)) as (address, server), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        ready_to_run(page, 20)
        click(page, "Run")
        page.get_by_text(re.compile("wrote .*mcap")).wait_for(timeout=SLOW)
        pause_workers(server.pid)
        go_to(page, "Result")
        answers = page.get_by_role("group", name="results side by side")
        answers.get_by_text("…").first.wait_for(timeout=SLOW)
        page.keyboard.press("Escape")
        answers.get_by_text("stopped from the page").first.wait_for(timeout=5000)
        assert answers.get_by_text("…").count() == 0
        page.wait_for_timeout(1000)
        page.get_by_role("button", name="Answer again").click()  # and again
        page.locator(".swingid-large").wait_for(timeout=SLOW)


@pytest.mark.long
def test_the_page_works_by_its_names_and_with_the_token(tmp_path):
    arguments = ("--rig", "paper", "--folder", str(tmp_path))
    with browser() as chromium:
        with served(*arguments) as (address, _):
            for name in ("localhost", "127.0.0.1"):
                connects(chromium.new_page(), address.replace("127.0.0.1", name))
            page = chromium.new_page()
            page.add_init_script("window.WebSocket = undefined")
            connects(page, address)  # by polling
            evil = chromium.new_page()
            frame = f"<html><body><iframe src='{address}' width=900 height=600></iframe></body></html>"
            evil.route("http://evil.example/", lambda route: route.fulfill(body=frame))
            evil.goto("http://evil.example/")
            evil.wait_for_timeout(1500)
            assert len(evil.frames) == 2
            assert "swingid" not in evil.frames[1].content()
        with served(*arguments, "--host", "0.0.0.0", SWINGID_TOKEN="a b+c/é") as (address, _):
            page = chromium.new_page()
            assert page.goto(address).status == 403
            page.goto(f"{address}?token=a%20b%2Bc%2F%C3%A9")
            assert page.url == address  # without the token
            connects(page, address)


def connects(page, address: str) -> None:
    """Open the page and press its first button."""
    page.goto(address)
    errors = listen(page)
    # a page that controlled is gone only after a while
    page.get_by_text("Another page controls").wait_for(state="hidden", timeout=40_000)
    click(page, "Connect")
    page.get_by_text("samples per second").first.wait_for(timeout=SLOW)
    assert not errors
    page.close()
