"""From a dropped file to its number on the page: acts of a person, seconds that are waited, in a headless browser.

    python benchmarks/stopwatch_page.py --logs FOLDER [--only NAME]

An act is a click, a choice or a field that is typed. What is chosen and typed follows from the rig files of the
strangers' table (what the repositories say); reading and thinking are a person's and not measured. FOLDER as of
``benchmarks/stopwatch.py``.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import stopwatch
import swingid as sw
from swingid.app.draft import ROLES, SIGNED, UNITS
from swingid.app.kinds import Question, Way, kind_of, kind_of_rig

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from browser import browser, served

SLOW = 60_000
"""Longest wait for anything of the page, ms."""


class Person:
    """What a person does to the page; `acts` counts it."""

    def __init__(self, page: Any) -> None:
        self.page, self.acts = page, 0

    def click(self, name: str) -> None:
        """A button of the step that is open."""
        button = self.page.locator("section.now").get_by_role("button", name=re.compile(f"^{re.escape(name)}"))
        button.last.click(timeout=SLOW)
        self.acts += 1

    def choose(self, label: str, option: str) -> None:
        """An option of a list; no act where it is chosen already."""
        box = self.page.get_by_label(label, exact=True)
        if option in self.page.locator(f'.q-field:has([aria-label="{label}"])').last.inner_text().splitlines():
            return
        box.click(timeout=SLOW)
        self.page.get_by_role("option", name=option, exact=True).click(timeout=SLOW)
        self.acts += 1

    def type(self, label: str, text: str) -> None:
        """A field."""
        self.page.get_by_role("textbox", name=label, exact=True).or_(
            self.page.get_by_role("spinbutton", name=label)
        ).fill(text, timeout=SLOW)
        self.acts += 1

    def counts(self, number: str) -> None:
        """The counts per turn of an encoder whose kind is not in the list."""
        group = self.page.get_by_role("group", name="Encoder of the body", exact=True)
        group.get_by_role("button", name="kind and counts", exact=True).click(timeout=SLOW)
        group.get_by_label("kind", exact=True).first.click(timeout=SLOW)
        self.page.get_by_role("option", name=re.compile("^potentiometer")).click(timeout=SLOW)
        self.type("counts per turn", number)
        self.acts += 2


def look(person: Person, log: Mapping[str, Any], *, linear: bool) -> None:
    """Roles of the columns, units, signs, zero, rate."""
    page = person.page
    page.locator("section.now .swingid-channel").first.wait_for(timeout=SLOW)
    for role, words in ROLES.items():
        if isinstance(column := log.get(role), str) and role != "reference":
            if page.get_by_label(f"what {column} is", exact=True).count() and not shown(page, f"what {column} is"):
                page.locator("summary", has_text="other column").click()
                person.acts += 1
            person.choose(f"what {column} is", words)
            if role in UNITS:
                person.choose(
                    f"unit of {column}", log.get(f"{role}_unit", "m" if linear and role == "angle" else UNITS[role][0])
                )
            if role in SIGNED and log.get(f"{role}_sign") == -1:
                person.choose(f"sign of {column}", "sign −")
    if "rate" in log:
        if page.get_by_label("rows per second").count() == 0:  # a column was taken for a clock
            person.choose(f"what {clock(page)} is", "not used")
        person.type("rows per second", str(log["rate"]))
    zero = log.get("angle_zero", "down")
    if zero in ("down", "up"):
        if page.get_by_label("zero of the angle").count():
            person.choose("zero of the angle", {"down": "0 is hanging", "up": "0 is upright"}[zero])
    else:
        person.choose("zero of the angle", "hanging reads …")
        person.type("the log reads where it hangs", str(zero))
    person.click("Next")


def shown(page: Any, label: str) -> bool:
    """Whether a field can be seen."""
    return bool(page.get_by_label(label, exact=True).first.is_visible())


def clock(page: Any) -> str:
    """The column that the page takes for the clock."""
    for channel in page.locator(".swingid-channel").all():
        if "time" in channel.locator(".q-field").first.inner_text().splitlines():
            return str(channel.locator(".swingid-plot-title").inner_text())
    raise LookupError("no column is taken for a clock")


def way_of(question: Question, known: Mapping[str, Any]) -> tuple[int, Way]:
    """How a question is answered by a rig file: a value that it states, what follows of itself, or not known."""
    for k, way in enumerate(question.ways):
        if way.fields and all(known.get(one.key, "unknown") != "unknown" and not one.options for one in way.fields):
            unit = question.name == "gravity" and str(known[way.fields[0].key]).split()[0] == "1"
            if not unit or "wheel" in known.get("drive.kind", ""):  # 1 N m stands for "not known"
                return k, way
    for k, way in enumerate(question.ways):
        if not way.fields and way.values and all(known.get(key) == value for key, value in way.values.items()):
            return k, way
    return next((k, way) for k, way in enumerate(question.ways) if not way.fields)


def know(person: Person, kind: str, known: Mapping[str, Any]) -> None:
    """The kind of rig, and what is known of it."""
    card = person.page.get_by_role("button", name=re.compile(f"^{re.escape(kind_of(kind).title)}"))
    card.click(timeout=SLOW)
    person.acts += 1
    person.page.locator("section.now .swingid-question").first.wait_for(timeout=SLOW)
    for question in kind_of(kind).questions:
        if question.name == "encoder" and known.get("log.angle_unit") == "counts":
            person.counts(str(known["sensors.counts_per_turn"]))
            continue
        group = person.page.get_by_role("group", name=question.words, exact=True)
        if group.count() == 0:
            continue
        k, way = way_of(question, known)
        if k:
            group.get_by_role("button", name=way.words, exact=True).click(timeout=SLOW)
            group.locator("button[aria-pressed=true]", has_text=way.words).wait_for(timeout=SLOW)
            person.acts += 1
        for one in way.fields:
            person.type(one.words, str(known[one.key]))
    person.click("Next")


def part(person: Person, span: list[float] | None) -> None:
    """The part of the log that is used."""
    person.page.get_by_text(re.compile(r"checks of the log|^Ready|^Not ready", re.IGNORECASE)).first.wait_for(
        timeout=SLOW
    )
    if span is not None:
        for label, value in zip(("from, s", "to, s"), span, strict=True):
            person.type(label, f"{value:g}")
        person.click("Add this part")
    person.click("Answer")


@contextmanager
def dropped(entry: Mapping[str, Any], folder: Path) -> Iterator[Path]:
    """The log as a file."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / ("log" + Path(entry["url"].split("?")[0]).suffix)
        path.write_bytes(stopwatch.content_of(dict(entry), folder))
        yield path


def row(entry: Mapping[str, Any], folder: Path, chromium: Any, address: str) -> str:
    """A line of the table."""
    text = (stopwatch.HERE / "rigs" / entry["rig"]).read_text(encoding="utf-8")
    known = stopwatch.leaves(tomllib.loads(text))
    kind = kind_of_rig(sw.Rig.from_text(text))
    page = chromium.new_page(viewport={"width": 1400, "height": 900})
    person = Person(page)
    with dropped(entry, folder) as path:
        page.goto(address)
        page.get_by_text("Drop a log here").wait_for(timeout=SLOW)
        begin = time.perf_counter()
        page.set_input_files("input[type=file]", path)
        person.acts += 1
        columns = {key.removeprefix("log."): value for key, value in known.items() if key.startswith("log.")}
        look(person, columns, linear=kind_of(kind).linear)
        know(person, kind, known)
        part(person, entry.get("part"))
        answer = page.get_by_role("group", name="answer").or_(page.get_by_text("No answer"))
        answer.first.wait_for(timeout=SLOW)
        seconds = time.perf_counter() - begin
        found = " ".join(answer.first.inner_text().split())
    page.close()
    return f"| {entry['name']} | {kind} | {person.acts} | {seconds:.1f} s | {found[:90]} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=Path, required=True)
    parser.add_argument("--only")
    options = parser.parse_args()
    files = sorted((stopwatch.HERE / "logs.d").glob("*.toml"))
    by_name = {one["name"]: one for path in files for one in tomllib.loads(path.read_text())["log"]}
    print("| log | rig | acts | seconds | answer |\n|---|---|---|---|---|")
    with served() as (address, _), browser() as chromium:
        for name in stopwatch.NAMES:
            if options.only is None or options.only == name:
                print(row(by_name[name], options.logs, chromium, address), flush=True)


if __name__ == "__main__":
    main()
