"""The page on a log and its rig file, in a real browser: methods, constants, what is gone, who is let in."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import pytest

from browser import browser, listen, picture, served
from swingid import Recording, Rig, identify, parse_reference, simulate

LINEAR = """
name = "slide"
[axis]
kind = "linear"
gravity_torque = 0
[drive]
kind = "direct"
[log]
time = "t"
angle = "x"
torque = "f"
"""

SLOW = 90_000  # ms, with kernels that are compiled


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("page") / "run.parquet"
    simulate(Rig.load("paper"), parse_reference("sine 0.8 rad 8.5 rad/s"), duration=12.0, seed=1).save(path)
    return path


def shown(text: str) -> float:
    """The number of '(3.0220 ± 0.0001)e-3 kg m²', or '… × 10⁻³ kg m²'."""
    plain = text.replace("\N{NO-BREAK SPACE}", " ").replace(" × 10⁻³", "e-3")
    found = re.search(r"\(([\d.]+) ± [\d.]+\)e(-?\d+)", plain)
    assert found, text
    return float(found[1]) * 10.0 ** int(found[2])


@pytest.mark.long
def test_answers_of_all_methods_and_the_effect_of_a_constant(log):
    with served("--log", str(log), "--rig", "paper") as (address, _), browser() as chromium:
        page = chromium.new_page(viewport={"width": 1400, "height": 1000})
        errors = listen(page)
        page.goto(address)
        page.get_by_text("Ready", exact=False).first.wait_for(timeout=SLOW)
        page.get_by_text(re.compile(r"All \d+ checks")).click()
        assert page.get_by_role("listitem").count() > 5
        picture(page, "log-part")
        page.get_by_label("from, s").fill("4")
        page.get_by_role("button", name="Add this part").click()
        page.get_by_role("button", name="Answer", exact=True).last.click()
        forest = page.get_by_role("group", name="results side by side")
        forest.get_by_text("…").first.wait_for(timeout=SLOW)
        forest.get_by_text("…").first.wait_for(state="detached", timeout=SLOW)
        truth = Rig.load("paper").axis.inertia.value
        for method in ("momentum", "energy", "output-error"):
            row = forest.locator(".swingid-row", has_text=method).inner_text()
            assert shown(row) == pytest.approx(truth, rel=1e-3), row
        picture(page, "log-answer")

        page.get_by_text("What if a constant were off?").click()
        slider = page.get_by_label("relative change of axis.gravity_torque").locator("[tabindex='0']").first
        slider.focus()
        for _ in range(5):
            slider.press("ArrowRight")
        page.get_by_text(re.compile(r"inertia = .*% from")).wait_for(timeout=SLOW)
        effect, factor = page.get_by_text("inertia = ", exact=False), 1.0
        stated, until = Rig.load("paper"), time.monotonic() + 30
        while time.monotonic() < until:
            moved = slider.locator("xpath=ancestor::*[contains(@class,'row')][1]").inner_text()
            factor = 1.0 + float(re.search(r"([+-][\d.]+) %", moved)[1]) / 100
            off = stated.changed({"axis.gravity_torque": stated.axis.gravity_torque.value * factor})
            expected = identify(Recording.load(log, off).segment(4.0, 13.0), off).inertia.value
            if factor > 1.0 and abs(shown(effect.inner_text()) / expected - 1) < 1e-4:
                break
        assert factor > 1.0
        assert shown(effect.inner_text()) == pytest.approx(expected, rel=1e-4)

        page.set_viewport_size({"width": 390, "height": 800})
        page.get_by_label("dark or light page").click()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        picture(page, "log-phone")
        assert not errors


@pytest.mark.long
def test_a_log_that_is_gone_is_said_on_the_page_and_not_in_the_terminal(log, tmp_path):
    path = tmp_path / "gone.parquet"
    path.write_bytes(log.read_bytes())
    with served("--log", str(path), "--rig", "paper") as (address, process), browser() as chromium:
        page = chromium.new_page(viewport={"width": 390, "height": 800})
        page.goto(address)
        page.get_by_role("button", name="Answer", exact=True).last.click()
        page.get_by_text("What if a constant were off?").click()
        row = page.locator("[aria-label='relative change of drive.wheel.inertia']")
        row.wait_for(timeout=SLOW)
        assert row.bounding_box()["width"] > 150  # on a phone, too
        path.unlink()
        row.locator("[tabindex='0']").first.focus()
        page.keyboard.press("ArrowRight")
        page.get_by_text("gone.parquet does not exist").first.wait_for(timeout=SLOW)
        assert page.reload().status == 200
        page.get_by_role("heading", name="does not exist").wait_for(timeout=SLOW)
        process.terminate()
        assert "Traceback" not in process.communicate(timeout=20)[0]


@pytest.mark.long
def test_a_linear_axis_has_a_position(tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(LINEAR, encoding="utf-8")
    time = [0.002 * k for k in range(3000)]
    rows = [f"{t},{0.1 * math.sin(3 * t):.7f},{-9.0 * math.sin(3 * t):.6f}" for t in time]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["t,x,f", *rows]), encoding="utf-8")
    with served("--log", str(path), "--rig", str(rig)) as (address, _), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        plots = page.locator(".swingid-plot")
        plots.filter(has_text="The position: ").locator("span", has_text=re.compile("^m$")).wait_for(timeout=SLOW)
        page.locator("summary", has_text="Other channels").click()
        plots.filter(has_text="Force").locator("span", has_text=re.compile("^N$")).wait_for(timeout=SLOW)


@pytest.mark.long
def test_a_token_keeps_others_out(log):
    wide = served("--log", str(log), "--rig", "paper", "--host", "0.0.0.0", SWINGID_TOKEN="s3cret")
    with wide as (address, _), browser() as chromium:
        page = chromium.new_page()
        assert page.goto(address).status == 403
        assert "token" in page.content()
        assert page.goto(f"{address}?token=s3cre").status == 403
        assert page.goto(f"{address}?token=s3cret").status == 200
        page.locator("section.now").wait_for(timeout=SLOW)
        assert page.goto(address).status == 200  # the cookie
