"""The page on a log: what `inspect` finds, the part used, all methods side by side, the effect of each constant."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

import numpy as np
from nicegui import ui

from swingid.app.analysis import STOPPED, Analyst, answered, inspected, reported, sketched
from swingid.app.parts import Answers, Step, heading, page_frame, said, steps, table
from swingid.app.plot import Line, Plot
from swingid.errors import SwingidError
from swingid.format import percent, plus_minus, pretty_unit
from swingid.methods.table import DEFAULT, METHODS
from swingid.result.result import refusal

STEPS = (Step("check", "Check"), Step("result", "Result"), Step("constants", "Constants"), Step("report", "Report"))

WIDEST = 0.05
"""Largest relative change of a constant that a slider offers: what is worse is a mistake, no uncertainty."""

LEVELS = ("ok", "note", "unknown", "advice", "repair", "fault")
"""Levels of checks, the worst last."""


class LogPage:
    """One browser's page on a log and its rig file."""

    def __init__(self, log: str, rig: str, analyst: Analyst) -> None:
        self.log, self.rig, self.analyst = log, rig, analyst
        self.first = self.last = 0.0
        self.part: tuple[float, float] | None = None
        self.factors: dict[str, float] = {}
        self.stated: Mapping[str, Any] = {}
        self.values: dict[str, ui.label] = {}
        self.range: ui.range
        self.ends: list[ui.number]
        self.round = self.moved = 0

    def build(self) -> None:
        """Lay the page out; what takes time is filled in as it is found."""
        page_frame(self.log, rig=self.rig)
        self.place = ui.column().classes("w-full")
        said(self.place, "reading the log …")
        ui.timer(0.05, self._begin, once=True)

    async def sketch(self) -> Mapping[str, Any]:
        """What is drawn of the log (`analysis.sketched`); raises SwingidError where it cannot be read."""
        found: Mapping[str, Any] = await self.analyst.do(sketched, self.log, self.rig)
        self.first, self.last = found["first"], found["last"]
        return found

    async def _begin(self) -> None:
        try:
            found = await self.sketch()
        except SwingidError as error:  # a file that is gone, or that changed since the start
            self.place.clear()
            with self.place:
                heading(error.message)
            return
        self.place.clear()
        with self.place:
            ui.label(f"{found['duration']:.4g} s long").classes("text-sm")
            self.plots(found)
            with steps(STEPS) as (_, panels):
                with panels["check"]:
                    self.findings = ui.column().classes("w-full")
                    said(self.findings, "inspecting …")
                with panels["result"]:
                    self.result_panel()
                with panels["constants"]:
                    self.constants_panel()
                with panels["report"]:
                    self.report_panel()
        await asyncio.gather(self._inspect(), self.identify_all())

    def plots(self, found: Mapping[str, Any]) -> None:
        """The channels of a `sketch`; a part that is drawn over the angle is used."""
        (name, unit, time, values), *others = found["channels"]
        self.angle = Plot(name, [Line(name, unit)], pick=self._use)
        self.angle.show(time, [values])
        for name, unit, time, values in others:
            Plot(name, [Line(name, unit)], height=120).show(time, [values])

    async def _inspect(self) -> None:
        try:
            found = await self.analyst.do(inspected, self.log, self.rig)
        except SwingidError as error:
            said(self.findings, error.message)
            return
        self.findings.clear()
        with self.findings:
            heading(found["verdict"].line)
            if found["verdict"].advice:
                ui.label(found["verdict"].advice)
            rows = [
                (
                    "fine" if check["level"] == "ok" else check["level"],
                    check["title"],
                    check["evidence"],
                    check["remedy"],
                )
                for check in sorted(found["checks"], key=lambda check: LEVELS.index(check["level"]), reverse=True)
            ]
            table("checks of the log", ("", "check", "found", "what to do"), rows)

    def result_panel(self) -> None:
        """The part that is used, and every method side by side."""
        first, last = self.first, self.last
        ui.label("Part of the log that is used: move the ends, or draw over the angle above.")
        with ui.row(wrap=False).classes("w-full items-center px-4"):
            self.range = (
                ui.range(min=first, max=last, step=(last - first) / 1000, value={"min": first, "max": last})
                .props('aria-label="part of the log that is used, s"')
                .on("change", lambda: self._use(self.range.value["min"], self.range.value["max"]))
            )
        with ui.row().classes("items-center"):
            self.ends = [
                ui.number(label, value=value, min=first, max=last, format="%.4g")
                .classes("w-28")
                .on("change", lambda: self._use(self.ends[0].value, self.ends[1].value))
                for label, value in (("from, s", first), ("to, s", last))
            ]
            ui.button("whole log", on_click=lambda: self._use(first, last)).props("flat")
        self.side_by_side = Answers("moment of inertia by every method")

    def constants_panel(self) -> None:
        """A slider for each constant, and its effect."""
        ui.label(
            f"What a change of a constant does to the inertia by the method {DEFAULT}, for the part used. The rig file "
            "stays as it is."
        )
        self.effect = ui.label().classes("text-lg").props('aria-live="polite"')
        self.sliders = ui.column().classes("w-full")
        said(self.sliders, "identifying …")

    def report_panel(self) -> None:
        """Files to keep."""
        ui.label("The report of the part and the constants chosen here, as one file.")
        with ui.row():
            method = ui.select(list(METHODS), value=DEFAULT, label="method").classes("w-48")
            for word, ending in (("HTML report", ".html"), ("PDF report", ".pdf")):
                ui.button(word, on_click=lambda ending=ending: self._report(str(method.value), ending))

    async def _report(self, method: str, ending: str) -> None:
        try:
            content = await self.analyst.do(reported, self.log, self.rig, method, self.part, dict(self.factors), ending)
        except SwingidError as error:
            ui.notify(error.message, type="warning")
        else:
            ui.download.content(content, f"report{ending}")

    def _use(self, start: float | None, stop: float | None) -> None:
        """Identify from the part between two times (s); what is no part is taken back."""
        first, last = self.first, self.last
        begin = first if start is None else max(start, first)
        end = last if stop is None else min(stop, last)
        start, stop = (begin, end) if begin < end else self.part or (first, last)
        self.part = None if start <= first and stop >= last else (start, stop)
        self.range.set_value({"min": start, "max": stop})
        for shown, value in zip(self.ends, (start, stop), strict=True):
            shown.set_value(value)
        self.angle.shade(start, stop)
        ui.timer(0.01, self.identify_all, once=True)

    async def identify_all(self) -> None:
        """Every method, the default one first; a newer round ends an older one."""
        self.round += 1
        mine, factors = self.round, dict(self.factors)
        self.side_by_side.wait(METHODS)
        for method in (DEFAULT, *(name for name in METHODS if name != DEFAULT)):
            found = await self._answer(method, factors)
            if self.round != mine:
                return
            if found["error"] is not None and found["error"]["code"] == STOPPED:
                self.side_by_side.put_rest(found)
                return
            self.side_by_side.put(method, found)
            if method == DEFAULT:
                if not factors:
                    self.stated = found
                    self._make_sliders(found)
                else:
                    self.stated = await self._answer(DEFAULT, {})
                    if self.round != mine:
                        return
                self._show_effect(found)

    async def _answer(self, method: str, factors: Mapping[str, float]) -> Mapping[str, Any]:
        """The result of a method for the part that is used, as its JSON; a refusal where its process was ended."""
        try:
            found: Mapping[str, Any] = await self.analyst.do(answered, self.log, self.rig, method, self.part, factors)
        except SwingidError as error:
            return refusal(method, error).to_dict()
        return found

    def _make_sliders(self, found: Mapping[str, Any]) -> None:
        self.sliders.clear()
        with self.sliders:
            for key in found.get("sensitivities") or {}:
                with ui.row().classes("w-full items-center"):  # on a phone the name stands above its slider
                    ui.label(key).classes("w-full sm:w-64 shrink-0 font-mono text-sm")
                    ui.slider(min=-WIDEST, max=WIDEST, step=WIDEST / 50, value=0.0).props(
                        f'label aria-label="relative change of {key}"'
                    ).classes("flex-1 min-w-32").on(
                        "change", lambda event, key=key: self._changed(key, float(event.args))
                    )
                    self.values[key] = ui.label("+0.0 %").classes("w-16 shrink-0 text-right")
            if not found.get("sensitivities"):
                ui.label("This result depends on no constant of the rig file.")

    async def _changed(self, key: str, change: float) -> None:
        self.values[key].set_text(f"{100 * change:+.1f} %")
        self.factors[key] = 1.0 + change
        if change == 0.0:
            del self.factors[key]
        self.moved += 1
        mine = self.moved
        found = await self._answer(DEFAULT, dict(self.factors))
        if self.moved == mine:
            self._show_effect(found)

    def _show_effect(self, found: Mapping[str, Any]) -> None:
        if found["error"] is not None:
            self.effect.set_text(found["error"]["message"])
            return
        name, now = next(iter(found["parameters"].items()))
        text = f"{name} = {plus_minus(now['value'], now['standard_uncertainty'], now['unit'])}"
        before = self.stated["parameters"].get(name)
        if self.factors and before is not None:
            change = now["value"] / before["value"] - 1 if before["value"] else np.nan
            text += f", {percent(change, sign=True)} from {plus_minus(before['value'], None, pretty_unit(now['unit']))}"
        self.effect.set_text(text)
