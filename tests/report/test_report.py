"""The report stands alone, holds what there is, leaves out what there is not, and draws what the numbers say."""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import factories
from long_cases import quick_first
from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.recording.recording import Recording, Source
from swingid.report import tables, write_report
from swingid.report.measurement import render
from swingid.report.style import house_style
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import BudgetEntry, scatter

VOID = {"meta", "br", "hr", "img", "input", "link"}
Case = tuple[Result, Recording | None, Rig | None]

CASES: dict[str, Callable[[], Case]] = {
    "clean": lambda: (factories.clean_result(), factories.rotary_log(), factories.rotary_rig()),
    "doubtful": lambda: (factories.doubtful_result(), factories.rotary_log(), factories.rotary_rig()),
    "refused": lambda: (factories.refused_result(), factories.rotary_log(), factories.rotary_rig()),
    "unreadable": lambda: (factories.refused_result(), None, None),
    "linear": lambda: (factories.linear_result(), factories.linear_log(), factories.linear_rig()),
    "free": lambda: (factories.free_result(), factories.free_log(), factories.free_rig()),
}

HEAD = {"answer", "identification", "method"}
COMMON = HEAD | {"parameters", "rig", "log", "turning-points", "budget", "notes", "provenance"}
SECTIONS = {
    "clean": COMMON | {"swings", "friction", "residuals", "kinds"},
    "doubtful": COMMON - {"budget"} | {"warnings", "swings", "friction", "residuals", "kinds"},
    "refused": HEAD | {"provenance"},
    "unreadable": HEAD | {"provenance"},
    "linear": COMMON | {"friction", "residuals"},
    "free": COMMON | {"swings"},
}


class Page(HTMLParser):
    """Balance of tags, ids, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sections: set[str] = set()
        self.ids: list[str] = []
        self.tags: set[str] = set()
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        found = {key: value or "" for key, value in attrs}
        self.attributes += found.items()
        if "id" in found:
            self.ids.append(found["id"])
            if tag == "section":
                self.sections.add(found["id"])

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.text += data


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return {name: render(*case()) for name, case in CASES.items()}


@pytest.mark.parametrize("name", CASES)
def test_the_page_is_whole_and_stands_alone(pages: dict[str, str], name: str) -> None:
    page = Page(pages[name])
    assert page.tags & {"script", "link", "iframe", "img", "image", "object"} == set()
    assert len(page.ids) == len(set(page.ids))
    for key, value in page.attributes:
        if key in ("href", "xlink:href", "src"):
            assert value.removeprefix("#") in page.ids
        elif not key.startswith("xmlns"):
            assert "//" not in value
        assert set(re.findall(r"url\(#([^)]*)\)", value)) <= set(page.ids)
    assert re.search(r"@import|url\((?!#)", pages[name]) is None


@pytest.mark.parametrize("name", CASES)
def test_sections_are_those_with_data(pages: dict[str, str], name: str) -> None:
    assert Page(pages[name]).sections == SECTIONS[name]


def test_the_answer_comes_first_with_interval_and_status(pages: dict[str, str]) -> None:
    text = Page(pages["clean"]).text.replace("\u00a0", " ")
    head = text[: text.index("Parameters")]
    assert "J₁ = (3.023 ± 0.013) × 10⁻³ kg m²" in head
    assert "95 % interval [3.0103, 3.0353] × 10⁻³ kg m²" in head
    assert "standard uncertainty 6.4 × 10⁻⁶ kg m², 0.21 % of the value" in head
    assert "ok: no warnings" in head


def test_doubts_come_before_everything_but_the_answer(pages: dict[str, str]) -> None:
    text = Page(pages["doubtful"]).text
    assert "warning: with warnings" in text
    assert text.index("near resonance") < text.index("Parameters")
    assert "its uncertainty is unknown" in text[: text.index("near resonance")]


@pytest.mark.parametrize(
    ("logs", "title"),
    [(["a/one.csv", "two.csv"], "one.csv, two.csv, momentum method"), (["x.csv"] * 4, "4 logs, momentum method")],
)
def test_the_title_names_all_logs(logs: list[str], title: str) -> None:
    result = factories.clean_result()
    origin = {key: value for key, value in result.provenance.items() if key != "log"}
    assert f"<title>{title} – swingid</title>" in render(
        replace(result, provenance=origin | {"logs": logs}), None, None
    )


@pytest.mark.parametrize("name", ["refused", "unreadable"])
def test_a_refusal_says_only_why(pages: dict[str, str], name: str) -> None:
    page = Page(pages[name])
    assert "the angle moves by 0.0004 only; record a swing." in page.text
    assert "svg" not in page.tags


def test_the_rig_says_what_is_exact_and_hides_what_is_sought(pages: dict[str, str]) -> None:
    rig = pages["clean"].split('<section id="rig">')[1].split("<details>")[0].replace("\u00a0", " ")
    row = {key: line for line in rig.splitlines() if (key := re.search(r'"key">([\w.]+)<', line))}
    by_key = {match[1]: line for match, line in row.items()}
    assert "(113.40 ± 0.30) × 10⁻⁶ kg m²" in by_key["drive.wheel.inertia"]
    assert "exact" in by_key["drive.motor.gear_ratio"]
    assert "exact" not in by_key["axis.gravity_torque"]
    assert "(−299.6 … 548.5) × 10⁻⁶ N m" in by_key["drive.motor.dead_zone"]
    assert not any(key.startswith(("axis.inertia", "axis.friction")) for key in by_key)


def test_the_rig_has_the_terms_beyond_gravity_and_friction() -> None:
    text = factories.FREE.replace("[axis]", '[axis]\nstiffness = "0.05 ± 0.001 N*m/rad"', 1)
    (value,) = (row[1] for row in tables.rig_table(Rig.from_text(text)).rows if "axis.stiffness" in str(row))
    assert str(value).replace("\u00a0", " ") == "(0.0500 ± 0.0010) N m/rad"


def test_each_log_of_several_has_its_digest() -> None:
    result = factories.clean_result()
    origin = {key: value for key, value in result.provenance.items() if not key.startswith("log")}
    several = {"logs": ["a.csv", "b.csv"], "logs_sha256": ["a1" * 32, "b2" * 32]}
    page = Page(render(replace(result, provenance=origin | several), None, None))
    assert "SHA-256 of log 1" in page.text
    assert "b2" * 32 in page.text


def test_a_linear_axis_is_told_in_kg_n_and_m(pages: dict[str, str]) -> None:
    text = Page(pages["linear"]).text
    assert "M\u00a0=\u00a0(95.10" in text
    assert re.search(r"force, m?N\b", text)
    assert "position, m" in text
    for rotary in ("kg m²", "N m", "rad"):
        assert re.search(rf"\b{rotary}\b", text) is None


def test_a_log_of_the_twin_says_so_and_how_far_off_the_answer_is() -> None:
    metadata = {"made_by": "swingid simulate", "truth": {"inertia": 3.022e-3}}
    text = Page(render(factories.clean_result(), replace(factories.rotary_log(), metadata=metadata), None)).text
    assert "swingid simulate" in text
    assert "the error of the estimate is +0.026\u00a0%" in text


def test_everything_foreign_is_escaped() -> None:
    evil = '<script>alert("1")</script> & $x_1$ </svg>'
    rig = Rig.from_text(factories.ROTARY.replace('"bench"', f"'{evil}'"), evil)
    log = replace(factories.rotary_log(), source=Source(evil, None), metadata={evil: evil})
    result = factories.clean_result(log)
    assert result.details is not None
    assert result.details.friction is not None
    result = replace(
        result,
        notes=(Message(evil, evil),),
        warnings=(Message(evil, evil),),
        budget=(BudgetEntry(scatter(evil), "inertia", 1e-6),),
        provenance={evil: evil},
        details=replace(
            result.details,
            friction=replace(result.details.friction, law=evil, candidates={evil: 0.0, "b": 1.0}),
            estimates={evil: (3e-3, 1e-6), "b": (3e-3, 1e-6)},
        ),
    )
    page = Page(render(result, log, rig))
    assert "script" not in page.tags
    assert page.text.count('alert("1")') >= 8
    assert SECTIONS["clean"] <= page.sections


def test_the_same_result_gives_the_same_bytes(tmp_path: Path, pages: dict[str, str]) -> None:
    path = write_report(*CASES["clean"](), tmp_path / "report.html")
    assert path.read_text(encoding="utf-8") == pages["clean"]
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_place_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        write_report(*CASES["unreadable"](), tmp_path / "nowhere" / "report.html")
    assert caught.value.code == "cannot-write"
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError) as caught:
        write_report(*CASES["unreadable"](), tmp_path / "folder")
    assert caught.value.code == "cannot-write"
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_a_report_replaces_neither_a_device_nor_a_link(tmp_path: Path) -> None:
    """A pipe stands for every file that is none."""
    pipe, link, kept = tmp_path / "pipe", tmp_path / "link.html", tmp_path / "kept.html"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_report(*CASES["unreadable"](), pipe)
    assert os.read(reader, 15).lower() == b"<!doctype html>"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    link.symlink_to(kept)
    write_report(*CASES["unreadable"](), link)
    assert link.is_symlink()
    assert kept.is_file()
    with pytest.raises(InputError) as caught:
        write_report(*CASES["unreadable"](), "")
    assert caught.value.code == "cannot-write"


def test_a_name_that_is_no_text_is_reported_too(tmp_path: Path) -> None:
    result = factories.clean_result()
    name = os.fsdecode(b"bad\xff.csv")
    write_report(replace(result, provenance=result.provenance | {"log": name}), None, None, tmp_path / "r.html")
    assert "bad\\udcff.csv" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_the_users_matplotlib_is_left_alone() -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    with house_style():
        assert matplotlib.rcParams["svg.hashsalt"] == "swingid"
    assert dict(matplotlib.rcParams) == before


def test_importing_costs_no_matplotlib() -> None:
    code = "import sys, swingid.report, swingid.result.plot; print({'matplotlib', 'jinja2'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


FRAME = """<body style="margin:0"><iframe id="f" src="{page}" style="width:{width}px;height:800px;border:0"></iframe>
<p id="o"></p><script>document.getElementById("f").onload = () => {{ const page = document.getElementById("f")
.contentDocument; page.querySelectorAll("details").forEach((d) => d.open = true);
document.getElementById("o").textContent = "width " + page.documentElement.scrollWidth; }}</script>"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
@pytest.mark.parametrize("name", quick_first(1, ["clean", "linear", "refused"]))
def test_nothing_but_figures_scrolls_sideways_on_a_phone(tmp_path: Path, pages: dict[str, str], name: str) -> None:
    (tmp_path / "page.html").write_text(pages[name], encoding="utf-8")
    (tmp_path / "frame.html").write_text(FRAME.format(page="page.html", width=390), encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--disable-web-security"]
    flags += [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=3000", "--dump-dom"]
    frame = (tmp_path / "frame.html").as_uri()
    seen = subprocess.run(["chromium", *flags, frame], capture_output=True, text=True, timeout=60, check=False).stdout
    width = re.search(r'<p id="o">width (\d+)', seen)
    assert width is not None
    assert int(width[1]) <= 390


def test_figures_of_a_long_log_stay_small() -> None:
    log = factories.rotary_log(duration=200.0, rate=1000.0)
    assert len(render(factories.clean_result(log), log, None)) < 1_500_000


def test_the_checks_that_ran_stand_with_what_they_found() -> None:
    result = factories.clean_result()
    assert result.details is not None
    result = replace(
        result,
        warnings=(Message("zero-off", "the zero is off."),),
        details=replace(result.details, checks=("signs", "angle-zero")),
    )
    table = render(result, None, None).split('<section id="checks">')[1].split("</section>")[0]
    rows = [re.sub(r"<[^>]*>", "|", row) for row in table.split("<tr>")[2:]]
    assert len(rows) == 2
    assert "signs of the channels" in rows[0]
    assert "passed" in rows[0]
    assert "|warning|" in rows[1].replace("||", "|")
    assert "zero-off" in rows[1]


def test_nested_data_is_shown_without_the_brackets_of_python():
    data = {"scale": np.float64(0.15), "part": [15.379858382443523, 20.0], "empty": [], "repairs": [{"what": "gap"}]}
    found = {words: cell.key for words, cell in tables.metadata_table(data).rows}
    assert found == {"scale": "0.15", "part": "15.37986, 20", "repairs": "what gap"}
