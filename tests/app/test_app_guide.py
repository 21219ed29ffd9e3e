"""The page that takes a log, in a real browser: from a dropped file to what is kept, every step clicked."""

from __future__ import annotations

import json
import math
import re
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest

from browser import browser, listen, picture, served
from swingid import Recording, Rig, identify
from swingid.app.analysis import answered, looked, reported, sketched, track_of
from swingid.app.draft import Draft, case_of, mend_of
from swingid.app.keep import command, five_lines, notebook
from swingid.app.kinds import KINDS, drawing, kind_of_rig
from swingid.app.look import safe_name
from swingid.cli import main
from swingid.result.codes import title

SLOW = 40_000  # ms, with kernels that are compiled

INERTIA, GRAVITY = 3.022e-3, 78e-3


RIG = """
[axis]
gravity_torque = "78 ± 0.4 mN*m"
[drive]
kind = "none"
[log]
time = "t_s"
angle = "pendulum_deg"
angle_unit = "deg"
"""


def released(start: float, stop: float, rate: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and angles (rad) of a pendulum of `INERTIA` and `GRAVITY`, held at 0.9 rad until `start`."""
    step = 1e-3
    count = round((stop - start) / step) + 1
    q, w, angles = 0.9, 0.0, np.empty(count)
    for k in range(count):  # Störmer's rule: its period is off by (ω h)²/24 = 1e-6
        angles[k] = q
        w += step * (-(GRAVITY / INERTIA) * math.sin(q) - 0.04 * w)
        q += step * w
    every = round(1 / rate / step)
    return start + step * np.arange(0, count, every), angles[::every]


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """Two releases one after the other, in degrees, the angle counted clockwise, beside a column of no use."""
    first, second = released(0.0, 15.0), released(15.01, 32.0)
    t, q = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    rows = [f"{a:.3f},{math.degrees(b):.5f},{20 + a / 100:.2f}" for a, b in zip(t, q, strict=True)]
    path = tmp_path_factory.mktemp("page") / "two releases.csv"
    path.write_text("\n".join(["t_s,pendulum_deg,temperature", *rows]) + "\n", encoding="utf-8")
    return path


def next_step(page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).last.click()


def test_from_a_dropped_file_to_what_is_kept(log, tmp_path):
    with served() as (address, process), browser() as chromium:
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        errors = listen(page)
        page.goto(address)
        page.get_by_text("Drop a log here").wait_for(timeout=SLOW)
        picture(page, "guide-drop")

        # what is no log is said as on the command line, under the file's own name
        page.set_input_files("input[type=file]", {"name": "../../etc/notes.csv", "mimeType": "", "buffer": b"  \n"})
        page.get_by_text("notes.csv is empty").wait_for(timeout=SLOW)
        assert "/" not in page.get_by_text("notes.csv is empty").inner_text()
        page.set_input_files("input[type=file]", log)

        # roles are guessed; another is chosen and taken back
        page.get_by_text("by its name, its unit is stated (deg)").wait_for(timeout=SLOW)
        choose(page, "what pendulum_deg is", "not used")
        page.get_by_text("Which column is the angle of the body").wait_for(timeout=SLOW)
        assert page.get_by_role("button", name="Next: which rig?").is_disabled()
        page.locator("summary", has_text="other columns").click()
        choose(page, "what pendulum_deg is", "angle")
        page.get_by_text("your choice").wait_for(timeout=SLOW)
        choose(page, "unit of pendulum_deg", "deg")
        choose(page, "sign of pendulum_deg", "sign −")
        picture(page, "guide-look")
        next_step(page, "Next: which rig?")

        cards = page.locator(".swingid-card")
        cards.first.wait_for(timeout=SLOW)
        assert "likely" in cards.first.inner_text()
        assert cards.filter(has_text="Needs a column of the torque").count() >= 1
        picture(page, "guide-rig")
        page.get_by_role("button", name=re.compile("A free pendulum")).click()

        # a constant with a mistake, then mended; "not known" is one of the ways
        mass = page.get_by_label("mass m")
        mass.fill("147.6 ± 0.2 mm")
        page.get_by_text("axis.mass is given in 'mm'").wait_for(timeout=SLOW)
        assert page.get_by_role("button", name="Next: the part to use").is_disabled()
        picture(page, "guide-know-wrong")
        page.get_by_role("button", name="product m g l").click()
        page.get_by_label("m g l", exact=True).fill("78 ± 0.4 mN m")
        page.get_by_text("in SI units").wait_for(timeout=SLOW)
        assert "angle_sign = -1" in page.get_by_label("rig.toml").inner_text()
        picture(page, "guide-know")
        next_step(page, "Next: the part to use")

        # both releases are offered; a part is drawn, and one is written
        page.get_by_role("button", name=re.compile("release 2")).wait_for(timeout=SLOW)
        page.get_by_text(re.compile(r"All \d+ checks of the log")).wait_for(timeout=SLOW)
        before = page.locator(".swingid-view g[transform]").get_attribute("transform")
        page.get_by_role("button", name="▶ Play").click()
        page.wait_for_function(
            "was => document.querySelector('.swingid-view g').getAttribute('transform') !== was", arg=before
        )
        page.get_by_role("button", name="❚❚ Pause").click()
        drag(page, 0.05, 0.4)
        page.get_by_role("button", name=re.compile("✕")).wait_for(timeout=SLOW)
        page.get_by_label("from, s").fill("16")
        page.get_by_label("to, s").fill("31")
        page.get_by_role("button", name="Add this part").click()
        page.get_by_role("button", name="16 to 31 s ✕").wait_for(timeout=SLOW)
        picture(page, "guide-part")
        next_step(page, "Answer")

        answer = page.get_by_role("group", name="answer")
        answer.wait_for(timeout=SLOW)
        value = shown(page.locator(".swingid-large").inner_text())
        assert value == pytest.approx(INERTIA, rel=1e-3)
        picture(page, "guide-answer")
        next_step(page, "Next: keep it")

        files = {}
        for name in ("rig.toml", "Result, JSON", "Notebook", "Report, HTML", "Report, PDF"):
            with page.expect_download(timeout=SLOW) as download:
                page.get_by_role("button", name=name).click()
            files[name] = download.value.path().read_bytes()
        picture(page, "guide-keep")
        check_kept(files, log, value)
        assert "result = sw.identify(log, rig, part=[(" in page.get_by_label("Python").inner_text()

        page.set_viewport_size({"width": 390, "height": 800})
        for name in ("Look", "Which rig?", "What you know", "Part", "Answer"):
            page.locator(f"section[aria-label='{name}'] button").first.click()
            page.locator(f"section.now[aria-label='{name}']").wait_for(timeout=SLOW)
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
        assert not errors
        process.terminate()
        assert "bug" not in process.stdout.read()


def test_a_page_that_begins_with_a_log_and_no_rig_file_shows_its_columns(log):
    with served("--log", str(log)) as (address, _), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        page.get_by_text("by its name, its unit is stated (deg)").wait_for(timeout=3 * SLOW)  # workers begin
        next_step(page, "Next: which rig?")
        page.locator(".swingid-card").first.wait_for(timeout=SLOW)


@pytest.mark.long
def test_what_is_wrong_in_a_rig_file_is_mended_by_a_button(tmp_path):
    t, q = released(0.0, 20.0)
    path, rig = tmp_path / "degrees.csv", tmp_path / "rig.toml"
    rows = [f"{a:.3f},{math.degrees(b):.5f}" for a, b in zip(t, q, strict=True)]
    path.write_text("\n".join(["t,q1", *rows]) + "\n", encoding="utf-8")
    text = 'name = "bench two"\n[axis]\ngravity_torque = "78 ± 0.4 mN*m"\n[drive]\nkind = "none"\n'
    rig.write_text(text + "[sensors]\ncounts_per_turn = 16384\n", encoding="utf-8")
    with served("--log", str(path), "--rig", str(rig)) as (address, _), browser() as chromium:
        page = chromium.new_page(viewport={"width": 1400, "height": 900}, color_scheme="dark")
        page.goto(address)
        page.get_by_role("heading", name="bench two").wait_for(timeout=SLOW)  # it begins at the step that is missing
        page.locator("section.now[aria-label='Part']").wait_for(timeout=SLOW)
        mend = page.get_by_role("button", name=re.compile("Set log.angle_unit = deg"))
        mend.wait_for(timeout=SLOW)
        picture(page, "guide-mend")
        mend.click()
        mend.wait_for(state="detached", timeout=SLOW)
        page.get_by_text(re.compile("^Ready")).wait_for(timeout=SLOW)
        next_step(page, "Answer")
        page.locator(".swingid-large").wait_for(timeout=SLOW)
        assert shown(page.locator(".swingid-large").inner_text()) == pytest.approx(INERTIA, rel=2e-3)
        page.locator("section[aria-label='What you know'] button").first.click()
        assert 'angle_unit = "deg"' in page.get_by_role("textbox", name="rig.toml").input_value()


def test_a_warning_is_headed_by_the_meaning_of_its_code():
    assert title("push-left") == "Somebody pushed the body, and the push cannot be cut out"
    assert title("of-another-package") == "of-another-package"


def test_a_warning_proposes_what_its_sentence_names():
    draft = Draft(base=Rig.load("paper").text)
    assert mend_of("x", "the signs differ; set wheel_angle_sign = -1 under [log]", draft) == {
        "log.wheel_angle_sign": -1
    }
    late = 'corrected; state sensors.wheel.latency = "0.3 ± 0.1 ms", or calibrate the encoders.'
    assert mend_of("x", late, draft) == {"sensors.wheel.latency": "0.3 ± 0.1 ms"}
    either = "set log.wheel_angle_sign = -1 or log.angle_sign = -1"  # of two ways the first
    assert mend_of("x", either, draft) == {"log.wheel_angle_sign": -1}
    assert mend_of("x", f"set log.angle = {json.dumps(Rig.load('paper').log.angle)}", draft) == {}  # as it is
    assert mend_of("x", "set log.nonsense = 3", draft) == {}
    assert mend_of("gravity-torque-disagrees", "no value", draft) == {"axis.gravity_torque": "unknown"}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_each_kind_of_rig_gives_a_rig_file_whichever_way_its_questions_are_answered(kind):
    columns = {"time": "t", "angle": "q", "wheel_angle": "w", "voltage": "u", "torque": "tau"}
    draft = Draft(columns=columns, units={"angle": "m" if kind.linear else "deg"}, kind=kind.name)
    assert kind.missing(columns) == ()
    for question in kind.questions:
        for number, way in enumerate(question.ways):
            texts = {one.key: one.example or next(iter(one.options)) for one in way.fields}
            draft.answers[question.name] = (number, texts)
            assert draft.trouble() == ("", ""), (question.name, way.words)
    draft.answers = {}
    assert kind_of_rig(draft.rig(filled=True)) == kind.name
    assert drawing(*kind.picture).count("<svg") == 2


def test_a_key_that_is_missing_is_said_with_its_question():
    draft = Draft(columns={"time": "t", "angle": "q"}, units={"angle": "counts"}, kind="free")
    draft.answers["gravity"] = (2, {})
    key, sentence = draft.trouble()
    assert key == "sensors.counts_per_turn"
    assert draft.where_to_say(key, sentence).endswith("; under “Encoder of the body” choose “kind and counts”.")
    draft.answers["encoder"] = (2, {"sensors.counts_per_turn": "5880"})
    assert draft.trouble() == ("", "")


@pytest.mark.parametrize("unknown", ["length", "across"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if "filar" in kind.name], ids=lambda kind: kind.name)
def test_strings_of_unknown_size_are_a_stiffness_that_is_not_known(kind, unknown):
    draft = Draft(columns={"time": "t", "angle": "q"}, kind=kind.name)
    draft.answers["length"] = (0, {f"axis.{kind.name}.length": "1 ± 0.001 m"})
    draft.answers[unknown] = (1, {})
    assert "mass" not in [one.name for one in kind.questions if draft.asks(one)]
    assert draft.open_fields() == []
    axis = draft.rig().axis
    assert (axis.bifilar, axis.trifilar, axis.stiffness) == (None, None, "unknown")
    assert axis.gravity_torque.value == 0


@pytest.mark.parametrize("parts", [(), ((16.0, 31.0),), ((1.0, 14.0), (16.0, 31.0))])
def test_the_lines_of_python_and_the_command_give_what_the_page_shows(log, tmp_path, parts, monkeypatch):
    draft = Draft.of({"a log.csv": log}, Rig.from_text(RIG))
    draft.parts = list(parts)
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    (tmp_path / "a log.csv").write_bytes(log.read_bytes())
    monkeypatch.chdir(tmp_path)
    case = case_of(draft)
    lines, made = five_lines(case), {}
    assert len(lines.splitlines()) == 5
    exec(lines, made)
    assert main([*shlex.split(command(case))[1:], "--json", "result.json"]) == 0
    shown = answered(case, "momentum", {})
    own = shown.main.value, shown.main.standard_uncertainty
    assert shown.main.value == pytest.approx(INERTIA, rel=1e-3)
    written = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    for one in (vars(made["result"].main), written["parameters"]["inertia"]):
        assert (one["value"], one["standard_uncertainty"]) == own
    # without parts both releases are found, and each is one
    assert len(made["result"].per_part) == len(written.get("per_part", ())) == (0 if len(parts) == 1 else 2)


def test_lines_and_notebook_name_a_method_that_is_chosen(log):
    case = case_of(Draft.of({"a log.csv": log}, Rig.from_text(RIG)))
    assert 'sw.identify(log, rig, "energy")' in five_lines(case, "energy")
    assert command(case, "energy").endswith("--rig rig.toml --method energy")
    assert 'rig, \\"energy\\")' in notebook(case, "energy")


def test_a_report_names_files_without_folders(log):
    case = case_of(Draft.of({"a log.csv": log}, Rig.from_text(RIG)))
    assert str(log.parent).encode() not in reported(case, "momentum", {}, ".html")


def test_each_release_is_offered(log):
    found = sketched(case_of(Draft.of({"a log.csv": log}, Rig.from_text(RIG))))["releases"]
    assert [round(end) for part in found for end in part] == pytest.approx([0, 15, 15, 32], abs=1)


def test_the_kind_of_an_encoder_is_written():
    draft = Draft(columns={"time": "t", "angle": "q"}, kind="free")
    draft.answers["gravity"] = (2, {})
    draft.answers["encoder"] = (1, {"sensors.sensor": "AS5600: magnet, 12 bit"})
    known = draft.rig().sensors
    assert (known.sensor, known.counts_per_turn) == ("AS5600", 4096)
    draft.answers["encoder"] = (4, {})
    assert draft.rig().sensors.of("angle").nonlinearity == 0.0


def test_a_mark_of_a_video_gives_the_angle(tmp_path):
    t, q = released(0.0, 20.0, rate=50.0)
    noise = np.random.default_rng(1).normal(0.0, 3e-4, (2, len(t)))
    x, y = 0.31 * np.sin(q) + noise[0], -0.31 * np.cos(q) + noise[1]
    path = tmp_path / "track.txt"
    path.write_text("t\tx\ty\n" + "\n".join(f"{a:.3f}\t{b:.5f}\t{c:.5f}" for a, b, c in zip(t, x, y, strict=True)))
    draft = Draft(logs={"track.txt": path})
    draft.take_guess(looked(str(path)))
    assert draft.moves
    draft.kind, draft.answers["gravity"] = "free", (1, {"axis.gravity_torque": "78 ± 0.4 mN m"})
    assert draft.rig_kind.missing(draft.columns) == ()
    assert draft.values()["log.point"] == ["x", "y"]
    found = answered(case_of(draft), "momentum", {})
    assert found.main.value == pytest.approx(INERTIA, abs=2 * found.main.standard_uncertainty)


def test_lines_above_a_table_are_skipped_where_they_are_not_found(log, tmp_path):
    rows = log.read_text(encoding="utf-8").splitlines()
    path = tmp_path / "odd.csv"
    path.write_text("\n".join(["a,b,c", "d,e,f", *rows]) + "\n", encoding="utf-8")
    draft = Draft(logs={"odd.csv": path})
    assert looked(str(path))["roles"].get("angle", {}).get("column") != "pendulum_deg"
    draft.take_guess(looked(str(path), 2))
    draft.kind, draft.answers["gravity"] = "free", (1, {"axis.gravity_torque": "78 ± 0.4 mN m"})
    assert draft.values()["log.skip_rows"] == 2
    assert answered(case_of(draft), "momentum", {}).main.value == pytest.approx(INERTIA, rel=1e-3)


def test_ticks_of_a_timer_need_their_time(log, tmp_path):
    rows = log.read_text(encoding="utf-8").splitlines()[1:]
    path = tmp_path / "ticks.csv"
    ticks = [f"{round(float(t) * 2e6)},{angle}" for t, angle, _ in (row.split(",") for row in rows)]
    path.write_text("\n".join(["ticks,pendulum_deg", *ticks]) + "\n", encoding="utf-8")
    draft = Draft(logs={"ticks.csv": path})
    draft.take_guess(looked(str(path)))
    assert draft.ticks
    assert not draft.has_clock
    draft.units["time"] = "0.5 us"
    assert draft.has_clock
    draft.kind, draft.answers["gravity"] = "free", (1, {"axis.gravity_torque": "78 ± 0.4 mN m"})
    assert draft.values()["log.time_unit"] == "0.5 us"
    assert answered(case_of(draft), "momentum", {}).main.value == pytest.approx(INERTIA, rel=1e-3)


@pytest.mark.parametrize("turned", ["angle", "none"])
def test_a_track_is_even_whatever_the_log_is(turned):
    time = np.array([0.0, 0.1, 0.5, 2.0])
    angle = np.array([0.0, np.nan, 0.5, 2.0]) if turned == "angle" else np.full(4, np.nan)
    track = track_of(time, angle)
    assert track["step"] * (len(track["angles"]) - 1) == pytest.approx(2.0, abs=0.02)
    expected = np.arange(len(track["angles"])) / 60 if turned == "angle" else np.zeros(len(track["angles"]))
    assert track["angles"] == pytest.approx(expected, abs=1e-3)


def test_names_of_dropped_files_are_no_paths():
    assert safe_name("../../etc/pass wd.csv", ()) == "pass wd.csv"
    assert safe_name("C:\\x\\run.csv", {"run.csv": 1}) == "run (2).csv"
    assert safe_name("..", ()) == "log"
    assert safe_name("a\x1b[31m\n.csv", ()) == "a__31m_.csv"


def choose(page, label: str, option: str) -> None:
    page.get_by_label(label).click()
    page.get_by_role("option", name=option, exact=True).click()


def drag(page, start: float, stop: float) -> None:
    """Draw over shares of the plot of the angle."""
    box = page.locator("section.now .u-over").first.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + start * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + stop * box["width"], y, steps=5)
    page.mouse.up()


def shown(text: str) -> float:
    """The number of '(3.022 ± 0.030) × 10⁻³'."""
    digits = re.search(r"([\d.]+) ± [\d.]+\) × 10⁻³", text.replace("\N{NO-BREAK SPACE}", " "))
    assert digits, text
    return float(digits[1]) * 1e-3


def check_kept(files: dict[str, bytes], log: Path, value: float) -> None:
    """The files are whole, and rig.toml gives the answer that was shown."""
    tomllib.loads(files["rig.toml"].decode())
    rig = Rig.from_text(files["rig.toml"].decode())
    again = identify(Recording.load(log, rig).segment(16.0, 31.0), rig)
    assert again.inertia.value == pytest.approx(value, rel=2e-3)
    result = json.loads(files["Result, JSON"])
    assert result["schema"] == "swingid.result/1"
    assert result["parameters"]["inertia"]["value"] == pytest.approx(value, rel=1e-3)
    assert len(result["per_log"]) == 2
    cells = json.loads(files["Notebook"])["cells"]
    assert "%%writefile rig.toml" in cells[1]["source"]
    assert b"<svg" in files["Report, HTML"]
    assert files["Report, PDF"].startswith(b"%PDF")
