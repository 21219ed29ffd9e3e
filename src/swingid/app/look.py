"""The step Look: a log is dropped or an example picked; its columns as they are read, and what each is."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from nicegui import events, ui

from swingid.app.analysis import Analyst, example, looked
from swingid.app.draft import ROLES, SIGNED, UNITS, Draft
from swingid.app.parts import entry, more, plain_button, said
from swingid.app.plot import Line, Plot
from swingid.errors import InputError, SwingidError

LARGEST, MOST = 200_000_000, 20
"""Bytes of one file, and number of files, that a page takes; `swingid identify` takes larger ones."""

TOO_MUCH = f"a page takes {MOST} files of {LARGEST / 1e6:.0f} MB at most; swingid identify takes larger ones"

EXAMPLES = {"free": ("A free pendulum", "free-decay.csv"), "wheel": ("The paper's rig", "driven-wheel.csv")}
"""Examples by name: words and file."""

TEXTS = (".csv", ".txt", ".tsv", ".dat")
"""Endings of files whose lines above the table can be skipped."""

COLOURS = {"time": "#767676", "reference": "#E69F00", "voltage": "#009E73", "torque": "#009E73"}

Taken = Callable[[Mapping[str, Path], Mapping[str, Any]], Awaitable[None]]


class Look:
    """Content of the step. taken: called with the files and what `looked` found; changed: after each choice."""

    def __init__(self, analyst: Analyst, folder: Path, taken: Taken, changed: Callable[[], None]) -> None:
        self.analyst, self.folder, self.taken, self.changed = analyst, folder, taken, changed
        self.place: ui.column
        self.home: ui.element
        self.upload: ui.upload

    def offer(self) -> None:
        """A place to drop files, and examples."""
        upload = self.upload = ui.upload(
            multiple=True, auto_upload=True, max_file_size=LARGEST, max_files=MOST, on_multi_upload=self._uploaded,
            on_rejected=lambda: ui.notify(TOO_MUCH, type="warning"),
        )  # fmt: skip
        upload.props('label="Drop a log here, or choose a file" flat').classes("swingid-drop")
        upload.on(
            "click", js_handler=f"(event) => event.target.closest('.q-btn') || getElement({upload.id}).pickFiles()"
        )
        text = "CSV, Excel, MATLAB, Parquet, HDF5, MCAP, LabVIEW, JSON, phyphox. Files stay on this machine."
        ui.label(text).classes("swingid-quiet")
        with ui.element("div").classes("swingid-chips"):
            ui.label("No log at hand?")
            for name, (words, _) in EXAMPLES.items():
                plain_button(words, lambda name=name: self._example(name))
        self.state = ui.column().classes("w-full")

    async def _uploaded(self, event: events.MultiUploadEventArguments) -> None:
        folder = Path(mkdtemp(dir=self.folder))
        paths: dict[str, Path] = {}
        for file in event.files[:MOST]:
            name = safe_name(file.name, paths)
            if file.size() > LARGEST:
                said(self.state, f"{name} has more than {LARGEST / 1e6:.0f} MB; swingid identify reads it in parts")
                return
            paths[name] = folder / name
            await file.save(paths[name])
        self.upload.reset()
        self._take_soon(paths)

    async def _example(self, name: str) -> None:
        said(self.state, "simulating the log of the example; the first time that is compiled, for half a minute …")
        file = EXAMPLES[name][1]
        path = Path(mkdtemp(dir=self.folder)) / file
        await self.analyst.do(example, name, str(path))
        self._take_soon({file: path})

    def _take_soon(self, paths: Mapping[str, Path], skip: int = 0) -> None:
        """`take`, after the event of an element that is then taken away."""
        with self.home:
            ui.timer(0.01, lambda: self.take(paths, skip), once=True)

    async def take(self, paths: Mapping[str, Path], skip: int = 0) -> None:
        """Look at files, without their first `skip` lines, and hand on what is found; what cannot be read is said."""
        said(self.state, "reading the file …")
        first = next(iter(paths.values()), None)
        try:
            if first is None:
                raise InputError("no file has come; drop it again", code="no-log")
            look = await self.analyst.do(looked, str(first), skip)
        except SwingidError as error:
            said(self.state, error.message.replace(f"{first.parent}/" if first else "", ""))
            if first is not None and first.suffix.lower() in TEXTS:
                with self.state:
                    self._ask_skip(paths, skip)
            return
        await self.taken(paths, look)

    def _ask_skip(self, paths: Mapping[str, Path], skip: int) -> None:
        """Lines of a text above its table, where they are not found by themselves."""
        with ui.element("div").classes("swingid-chips"):
            lines = ui.number("lines to skip above the table", value=skip, min=0, precision=0)
            lines.props("dense outlined").classes("w-64")
            plain_button("Read again", lambda: self._take_soon(paths, int(lines.value or 0)))

    def show(self, draft: Draft, look: Mapping[str, Any]) -> None:
        """The columns, those with a role first."""
        self.draft, self.found = draft, look
        self.place = ui.column().classes("w-full gap-0")
        self._fill()
        if not look["is_named"]:
            text = "No line above the numbers names the columns, so they are called column1, column2 and so on."
            ui.label(text).classes("swingid-quiet")
        if next(iter(draft.logs.values())).suffix.lower() in TEXTS:
            with more("Are lines above the table read wrongly?"):
                self._ask_skip(draft.logs, draft.skip)
        self.state = ui.column().classes("w-full")

    def _fill(self) -> None:
        self.place.clear()
        draft, columns = self.draft, self.found["columns"]
        roles = {column: role for role, column in draft.columns.items()}
        used = [draft.columns[role] for role in ROLES if role in draft.columns and draft.columns[role] in columns]
        with self.place:
            if "time" not in draft.columns:
                self._ask_rate()
            for name in used:
                self._channel(name, roles[name])
            others = [name for name in columns if name not in used]
            if others:
                with more(f"{len(others)} other column{'s' if len(others) > 1 else ''}: {', '.join(others[:6])}"):
                    for name in others:
                        self._channel(name, "")
            if not draft.moves:
                text = "Which column is the angle of the body, or its rate?"
                ui.label(f"{text} Of a video: which are x and y of a mark on it?").classes("swingid-wrong")

    def _ask_rate(self) -> None:
        text = "No column is a clock. How many rows come each second?"
        ui.label(text).classes("swingid-strong")
        entry("rows per second", self.draft.rate, self._set_rate).classes("w-48")

    def _ask_tick(self) -> None:
        """The time of a tick, which no log determines."""
        units = self.draft.units
        tick = entry("time of a tick", units.get("time", ""), partial(self._put, units, "time"), placeholder="0.5 us")
        tick.props("dense outlined stack-label").classes("w-32")

    def _channel(self, name: str, role: str) -> None:
        """One column: its plot, and what it is."""
        column, draft = self.found["columns"][name], self.draft
        with ui.element("div").classes("swingid-channel"):
            if column["drawn"] is None or role == "time":
                with ui.column().classes("gap-0"):
                    ui.label(name).classes("swingid-plot-title")
                    ui.label(column["range"]).classes("swingid-quiet swingid-numbers")
            else:
                time, values = (np.asarray(drawn) for drawn in column["drawn"])
                unit = draft.units.get(role, "") or column["unit"]
                plot = Plot(name, [Line("value", unit, colour=COLOURS.get(role, ""))], height=112 if role else 88)
                plot.show(time, [values])
            with ui.column().classes("gap-2"):
                with ui.element("div").classes("swingid-chips"):
                    options = {"": "not used"} | ROLES
                    self._select(f"what {name} is", options, role, lambda value: self._assign(name, value), "w-48")
                    if role == "time" and draft.ticks:
                        self._ask_tick()
                    elif role in UNITS:
                        units = list(dict.fromkeys([*UNITS[role], draft.units.get(role, UNITS[role][0])]))
                        unit = draft.units.get(role, UNITS[role][0])
                        self._select(f"unit of {name}", units, unit, lambda value: self._set_unit(role, value), "w-28")
                    if role in SIGNED:
                        signs = {1: "sign +", -1: "sign −"}
                        sign = draft.signs.get(role, 1)
                        self._select(f"sign of {name}", signs, sign, lambda value: self._set_sign(role, value), "w-28")
                    if role == "angle" and not draft.linear:
                        self._zero()
                what = draft.why.get(role, "") if role else column["what"]
                ui.label(what).classes("swingid-quiet")

    def _zero(self) -> None:
        zero = self.draft.zero if self.draft.zero in ("down", "up") else "other"
        words = {"down": "0 is hanging", "up": "0 is upright", "other": "hanging reads …"}
        self._select("zero of the angle", words, zero, self._set_zero, "w-44")
        if zero == "other":
            reads = self.draft.zero.strip()
            entry("the log reads where it hangs", reads, self._set_reading).classes("w-48")

    def _select(self, words: str, options: Any, value: Any, chosen: Callable[[Any], None], wide: str) -> None:
        made = ui.select(options, value=value, on_change=lambda event: chosen(event.value))
        made.props(f'dense outlined options-dense aria-label="{words}"').classes(wide)

    def _assign(self, column: str, role: str) -> None:
        self.draft.assign(column, role)
        self._fill()
        self.changed()

    def _set_unit(self, role: str, unit: str) -> None:
        self.draft.why[role] = "your choice"
        self._put(self.draft.units, role, unit)
        self._fill()

    def _set_sign(self, role: str, sign: int) -> None:
        self._put(self.draft.signs, role, sign)

    def _put(self, table: dict[str, Any], role: str, value: object) -> None:
        table[role] = value
        self.changed()

    def _set_rate(self, text: str) -> None:
        self.draft.rate = text
        self.changed()

    def _set_zero(self, zero: str) -> None:
        self._set_reading(zero if zero != "other" else "")
        self._fill()

    def _set_reading(self, text: str) -> None:
        self.draft.zero = text or " "
        self.changed()


def safe_name(name: str, taken: Sequence[str] | Mapping[str, Any]) -> str:
    """The last part of a file's name without what paths and terminals read, and not one that is taken."""
    last = re.split(r"[/\\]", name)[-1]
    plain = re.sub(r"[^\w.()+,= -]", "_", last).strip(". ")[-100:] or "log"
    stem, dot, ending = plain.rpartition(".")
    new, number = plain, 2
    while new in taken:
        new = f"{stem} ({number}){dot}{ending}" if dot else f"{plain} ({number})"
        number += 1
    return new
