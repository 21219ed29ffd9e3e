"""The step Part: the motion with its turning points, parts chosen by dragging, releases, what inspect finds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from nicegui import ui

from swingid.app.analysis import DIGITS, Analyst, inspected, named, sketched
from swingid.app.draft import Draft, case_of, mend_of
from swingid.app.kinds import kind_of
from swingid.app.parts import choice_button, findings, mend_button, more, on_page, plain_button, said
from swingid.app.plot import Line, Plot
from swingid.app.rig_view import RigView
from swingid.errors import SwingidError
from swingid.result.plot import BLUE, ORANGE

MOST = 12
"""Parts of one log."""

COLOURS = {"wheel": ORANGE, "voltage": "#009E73", "torque": "#009E73", "force": "#009E73"}


class Part:
    """Content of the step. mended: called with keys and values that a person takes over from a finding."""

    def __init__(self, analyst: Analyst, draft: Draft, mended: Callable[[Mapping[str, object]], Any]) -> None:
        self.analyst, self.draft, self.mended = analyst, draft, mended

    async def show(self) -> bool:
        """Plots and parts; False where the log cannot be read, which is said."""
        place = ui.column().classes("w-full")
        said(place, "reading the log …")
        case = case_of(self.draft)
        try:
            sketch = await self.analyst.do(sketched, case)
        except SwingidError as error:
            place.clear()
            with place:
                sentence = ui.label(named(error.message, case)).classes("text-lg swingid-text")
                sentence.props('role="heading" aria-level=3')
                self.checks = ui.column().classes("w-full")
            await self.inspect()
            return False
        place.clear()
        with place:
            self._plots(sketch)
        return True

    def _plots(self, sketch: Mapping[str, Any]) -> None:
        self.first, self.last, self.releases = sketch["first"], sketch["last"], sketch["releases"]
        (name, unit, time, values), *others = sketch["channels"]
        alone = len(self.draft.logs) == 1
        if not alone:
            ui.label(f"{len(self.draft.logs)} logs are used whole; this is {next(iter(self.draft.logs))}.")
        turns, sizes = (np.asarray(each) for each in sketch["turning"])
        title = f"The {name}: {len(turns)} turning points"
        lines = [Line(name, unit, colour=BLUE), Line("turns", unit, points=True, colour=ORANGE)]
        with ui.element("div").classes("swingid-live"):
            with ui.column().classes("swingid-beside"):
                RigView(kind_of(self.draft.kind), sketch["track"])
            with ui.column().classes("w-full gap-2"):
                if alone:
                    ui.label("Drag over the part to use, or over several.")
                self.angle = Plot(title, lines, pick=self._add if alone else None, height=240)
                self.angle.show_each([(time, values), (turns, sizes)])
        if alone:
            self.chips = ui.element("div").classes("swingid-chips")
            self._draw_parts()
        with more("Other channels") if others else ui.column():
            for name, unit, time, values in others:
                title = f"{name[:1].upper()}{name[1:]}"
                Plot(title, [Line(name, unit, colour=COLOURS.get(name, ""))], height=120).show(time, [values])
        self.checks = ui.column().classes("w-full")
        said(self.checks, "checking the log …")

    def _draw_parts(self) -> None:
        """The chosen parts, each to be taken away, those offered, and two fields for a further one."""
        self.angle.shade(sorted(self.draft.parts))
        self.chips.clear()
        with self.chips:
            whole = f"whole log: its {len(self.releases)} releases" if self.releases else "whole log"
            choice_button(whole, not self.draft.parts, lambda: self._set([]))
            for k, (start, stop) in enumerate(self.releases[:MOST]):
                chosen = (start, stop) in self.draft.parts
                words = f"release {k + 1}: {start:.2f} to {stop:.2f} s"
                choice_button(words, chosen, partial(self._toggle, (start, stop)))
            for part in self.draft.parts:
                if part not in self.releases:
                    words = f"{part[0]:.4g} to {part[1]:.4g} s  ✕"
                    choice_button(words, True, partial(self._toggle, part))
            self.ends = [
                ui.number(word, format="%.4g", min=self.first, max=self.last).props("dense outlined").classes("w-28")
                for word in ("from, s", "to, s")
            ]
            plain_button("Add this part", self._add_typed)

    def _add_typed(self) -> None:
        start, stop = (end.value for end in self.ends)
        self._add(self.first if start is None else start, self.last if stop is None else stop)

    def _add(self, start: float, stop: float) -> None:
        """A further part; those that it overlaps are taken into it."""
        start, stop = max(min(start, stop), self.first), min(max(start, stop), self.last)
        if stop <= start:
            ui.notify(f"the log has rows from {self.first:.4g} to {self.last:.4g} s", type="warning")
            return
        apart = [part for part in self.draft.parts if part[1] < start or part[0] > stop]
        over = [part for part in self.draft.parts if part not in apart]
        if over:
            ui.notify("joined with the part that it overlaps")
        joined = min([start, *(a for a, _ in over)]), max([stop, *(b for _, b in over)])
        self._set([*apart, (round(joined[0], DIGITS), round(joined[1], DIGITS))])

    def _toggle(self, part: tuple[float, float]) -> None:
        if part in self.draft.parts:
            self._set([other for other in self.draft.parts if other != part])
        else:
            self._add(*part)

    def _set(self, parts: list[tuple[float, float]]) -> None:
        self.draft.parts = sorted(parts)[:MOST]
        self._draw_parts()

    async def inspect(self) -> None:
        """What `swingid inspect` finds: the verdict, what can be mended, all checks on demand."""
        try:
            inspection = await self.analyst.do(inspected, case_of(self.draft))
        except SwingidError as error:
            said(self.checks, error.message)
            return
        if self.checks.is_deleted:
            return
        self.checks.clear()
        verdict = inspection["verdict"]
        line = verdict["line"]
        with self.checks:
            ui.label(f"{line[:1].upper()}{line[1:]}").classes("swingid-text")
            if verdict["advice"]:
                advice = on_page(verdict["advice"])
                ui.label(f"Better: {advice}.").classes("swingid-quiet")
            tried = inspection["changes_tried"]
            wrong = [check for check in inspection["checks"] if check["level"] == "repair"]
            proposed = [mend_of(check["code"], check["remedy"], self.draft) for check in wrong]
            for mend in [tried, *(other for other in proposed if not other.keys() & tried.keys())]:
                mend_button(mend, self.mended)
            with more(f"All {len(inspection['checks'])} checks of the log"):
                findings(inspection["checks"])
