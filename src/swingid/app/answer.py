"""The step Answer: the number, its picture, what dominates its interval, warnings as cards, methods side by side."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from nicegui import ui

from swingid.app.analysis import STOPPED, Analyst, answered
from swingid.app.draft import Draft, case_of, mend_of
from swingid.app.parts import escaped, html, mend_button, more, on_page, said
from swingid.app.plot import Line, Plot
from swingid.errors import SwingidError
from swingid.format import percent, plus_minus, pretty_unit
from swingid.methods.table import DEFAULT, METHODS
from swingid.report.tables import swings_off
from swingid.report.words import RIG as RIG_WORDS
from swingid.report.words import parameter_word
from swingid.result.brief import coverage, remedy, value_and_reach
from swingid.result.codes import title
from swingid.result.plot import BLUE, ORANGE
from swingid.result.result import Parameter, Result, refusal
from swingid.result.summary import share, sorted_budget

WIDEST = 0.05
"""Largest relative change of a constant that a slider offers: what is worse is a mistake, no uncertainty."""

SHOWN = 5
"""Contributions that are shown as bars."""

OUTSIDE, FEW = 8.0, 0.1
"""Robust standard deviations beyond which a swing is left out of the picture, for the others to be seen; the largest
share of swings that is left out: more of them are no exceptions, and all are shown.
"""

FILE = re.compile(r"^[^:;]*\.\w{2,8}: (?:rig [^:]*: )?")
"""The file and the rig file that a refusal begins with."""


STATES = re.compile(r"(?:the|an?|its?|they|their|this|these|that|which|both|no)\b", re.IGNORECASE)
"""How the end of a sentence begins that states something more, and is nothing to do."""


class Answer:
    """Content of the step. mended: called with keys and values that a person takes over from a warning."""

    def __init__(self, analyst: Analyst, draft: Draft, mended: Callable[[Mapping[str, object]], Any]) -> None:
        self.analyst, self.draft, self.mended = analyst, draft, mended
        self.factors: dict[str, float] = {}
        self.found: dict[str, Result] = {}
        self.stated: Result | None = None
        self.round = self.moved = 0

    def show(self) -> None:
        """The places of what is to be computed."""
        self.main = ui.column().classes("w-full gap-4")
        said(self.main, "identifying …")
        ui.label("Methods side by side").classes("swingid-strong")
        self.methods = ui.column().classes("w-full")
        with more("What if a constant were off?"):
            text = "The rig file stays as it is; the inertia by the method momentum for the part used."
            ui.label(text).classes("swingid-quiet")
            self.effect = ui.label().classes("text-lg swingid-numbers").props('aria-live="polite"')
            self.sliders = ui.column().classes("w-full")

    async def run(self) -> Result | None:
        """Compute every method, the default one first; its result, None where a newer round has begun."""
        self.round += 1
        mine = self.round
        self.found = {}
        self._draw_methods()
        main = await self.one(DEFAULT, {})
        if self.round != mine or self.main.is_deleted:
            return None
        self.stated = self.found[DEFAULT] = main
        self._draw(main)
        self._draw_methods()
        self._make_sliders(main)
        ui.timer(0.01, lambda: self._others(mine, main), once=True)
        return main

    async def _others(self, mine: int, result: Result) -> None:
        for method in (name for name in METHODS if name != DEFAULT):
            if result.error is None or result.error.code != STOPPED:  # what a person has stopped is not begun again
                result = await self.one(method, {})
            if self.round != mine or self.methods.is_deleted:
                return
            self.found[method] = result
            self._draw_methods()

    async def one(self, method: str, factors: Mapping[str, float]) -> Result:
        """The result of a method; a refusal where its process was ended."""
        try:
            result: Result = await self.analyst.do(answered, case_of(self.draft), method, factors)
        except SwingidError as error:
            return refusal(method, error)
        return result

    def _draw(self, result: Result) -> None:
        self.main.clear()
        with self.main:
            if result.error is not None:
                self._card("No answer", result.error.message, result.error.code)
                return
            number_of(result, linear=self.draft.linear)
            ui.label(status_of(result)).classes("text-lg swingid-text")
            for warning in result.warnings:
                self._card(title(warning.code), warning.message, warning.code)
            swings_picture(result)
            shares(result)
            rest(result, linear=self.draft.linear)

    def _card(self, title: str, sentence: str, code: str) -> None:
        """A warning: what, why, what to do, and where a key mends it a button that writes the key."""
        shown = on_page(sentence)
        why, _, remedy = shown.rpartition("; ")
        if STATES.match(remedy):
            why, remedy = "", shown
        with ui.element("div").classes("swingid-warning").props('role="group" aria-label="warning"'):
            ui.label(title).classes("swingid-strong")
            ui.label(_sentence(why or remedy)).classes("swingid-text")
            if why:
                ui.label(f"Do this: {remedy[:1].lower()}{remedy[1:]}").classes("swingid-text")
            mend_button(mend_of(code, sentence, self.draft), self.mended)

    def _draw_methods(self) -> None:
        self.methods.clear()
        with self.methods:
            html(forest([(name, *_row_of(self.found.get(name))) for name in METHODS]), "w-full")

    def _make_sliders(self, result: Result) -> None:
        self.sliders.clear()
        self.factors.clear()
        self._show_effect(result)
        with self.sliders:
            for key in result.sensitivities:
                with ui.row().classes("w-full items-center"):  # on a phone the name stands above its slider
                    ui.label(key).classes("w-full sm:w-64 shrink-0 swingid-mono")
                    slider = ui.slider(min=-WIDEST, max=WIDEST, step=WIDEST / 50, value=0.0)
                    slider.props(f'aria-label="relative change of {key}"').classes("flex-1 min-w-32")
                    shown = ui.label("+0.0 %").classes("w-16 shrink-0 text-right")
                    slider.on_value_change(lambda event, at=shown: at.set_text(f"{100 * event.value:+.1f} %"))
                    slider.on("change", lambda event, key=key, at=shown: self._changed(key, float(event.args), at))
            if not result.sensitivities:
                ui.label("This result depends on no constant of the rig file.")

    async def _changed(self, key: str, change: float, shown: ui.label) -> None:
        shown.set_text(f"{100 * change:+.1f} %")
        self.factors[key] = 1.0 + change
        if change == 0.0:
            del self.factors[key]
        self.moved += 1
        mine = self.moved
        result = await self.one(DEFAULT, dict(self.factors))
        if self.moved == mine:
            self._show_effect(result)

    def _show_effect(self, result: Result) -> None:
        if result.error is not None:
            self.effect.set_text(result.error.message)
            return
        name, now = result.leading, result.main
        text = f"{name} = {value_and_reach(now, fine=True)}"
        before = None if self.stated is None else self.stated.parameters.get(name)
        if self.factors and before is not None:
            change = now.value / before.value - 1 if before.value else np.nan
            text += f", {percent(change, sign=True)} from {plus_minus(before.value, None, before.unit)}"
        self.effect.set_text(text)


def number_of(result: Result, *, linear: bool) -> None:
    """The value and its U (95 %), large."""
    with ui.column().classes("gap-0 w-full").props('role="group" aria-label="answer"'):
        words = parameter_word(result.leading, linear=linear).words
        ui.label(words[:1].upper() + words[1:]).classes("swingid-quiet")
        value = value_and_reach(result.main, fine=True)
        ui.label(value.replace("\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}", " ± ")).classes("swingid-large")
        ui.label(coverage(result.main)).classes("swingid-unit swingid-numbers")


def status_of(result: Result) -> str:
    """The status in one sentence."""
    count = len(result.warnings)
    if not count:
        return "Good: nothing in the log contradicts the rig file."
    return f"Check this number first: {'one warning' if count == 1 else f'{count} warnings'}."


def swings_picture(result: Result) -> None:
    """One inertia per swing, the estimate and its interval as a band; of several logs or parts one for each."""
    main = result.main
    if result.per_log or result.per_part:
        logs = [(str(of_log.provenance.get("log") or "log"), *_row_of(of_log)) for of_log in result.per_log]
        each = _parts(result) if result.per_part else logs
        html(forest(each, main), "w-full")
        return
    swings = None if result.details is None else result.details.swings
    if swings is None or len(swings.times) < 2:
        return
    off = swings_off(result)
    good = np.isfinite(swings.values)
    times, values, sides = swings.times[good], swings.values[good], swings.sides[good]
    middle = np.median(values)
    spread = 1.4826 * np.median(np.abs(values - middle))
    near = np.abs(values - middle) <= max(OUTSIDE * spread, 1e-12 * abs(middle))
    bounds = main.interval95
    band = None if not bounds else (bounds[0], main.value, bounds[1])
    words = parameter_word(result.leading, linear=main.unit == "kg").words
    title = f"{int(near.sum())} swings give the same {words} to {percent(spread / abs(middle))}"
    if np.mean(~near) > FEW:
        near[:] = True
        title = (
            f"{len(values)} swings do not give the same {words}: it scatters by {percent(np.std(values) / abs(middle))}"
        )
    elif off:
        title = f"{int(near.sum())} swings agree to {percent(spread / abs(middle))}, but not with the answer"
    elif not near.all():
        title += f"; {int((~near).sum())} far off are not drawn"
    unit = pretty_unit(main.unit)
    lines = [Line("upper", unit, points=True, colour=BLUE), Line("lower", unit, True, ORANGE)]
    plot = Plot(title, lines, height=240, band=band)
    upper, lower = near & (sides > 0), near & (sides < 0)
    plot.show_each([(times[upper], values[upper]), (times[lower], values[lower])])
    if off:
        ui.label(off).classes("swingid-text")
    if band is not None:
        text = "Dots: swings about upper and lower turning points. Line and band: the answer, its 95 % interval."
        ui.label(text).classes("swingid-quiet")


def shares(result: Result) -> None:
    """The contributions to the interval, the largest first, and what would reduce that."""
    entries = sorted_budget(result.budget, result.leading)[:SHOWN]
    if not entries or not entries[0].standard_uncertainty:
        return
    largest = share(entries[0].standard_uncertainty, result.main)
    first = f"Largest part of the interval: {in_words(entries[0].source)}, {largest}"
    ui.label(f"{first}. To reduce it: {on_page(remedy(entries[0], result))}.").classes("swingid-text")
    rows = []
    for entry in entries:
        width = 100 * entry.standard_uncertainty / entries[0].standard_uncertainty
        track = f'<div class="swingid-bar-track"><div class="swingid-bar-fill" style="width:{width:.1f}%"></div></div>'
        text = share(entry.standard_uncertainty, result.main, fine=True)
        rows.append(row(f"<div>{escaped(in_words(entry.source))}</div>{track}<div>{text}</div>"))
    made = "".join(rows)
    html(f'<div class="swingid-rows swingid-shares" role="img" aria-label="contributions">{made}</div>', "w-full")


def in_words(source: str) -> str:
    """A source of uncertainty in words, with its key in rig.toml where it is one."""
    word = RIG_WORDS.get(source)
    return source if word is None else f"{word.words} ({source})"


def rest(result: Result, *, linear: bool) -> None:
    """Friction and what else was identified; notes on demand."""
    others = {name: parameter for name, parameter in result.parameters.items() if name != result.leading}
    with ui.column().classes("gap-0"):
        for name, parameter in others.items():
            words = parameter_word(name, linear=linear).words
            ui.label(f"{words[:1].upper()}{words[1:]}: {value_and_reach(parameter, fine=True)}").classes(
                "swingid-numbers"
            )
        if others:
            ui.label("± U (95 %)").classes("swingid-quiet")
    if result.notes:
        with more(f"{len(result.notes)} notes: what was assumed and done"):
            for note in result.notes:
                ui.label(_sentence(note.message)).classes("swingid-text")


def _row_of(result: Result | None) -> tuple[Parameter | None, str]:
    """The main parameter of a result, if any, and a mark or a sentence beside it."""
    if result is None:
        return None, "computing …"
    if result.leading not in result.parameters:
        return None, _sentence(FILE.sub("", result.error.message) if result.error else "no number")
    return result.main, "" if result.status == "ok" else " ⚠"


def _parts(result: Result) -> list[tuple[str, Parameter | None, str]]:
    """What each part of a log gives alone; its interval by its standard uncertainty and k = 1.96."""
    rows: list[tuple[str, Parameter | None, str]] = []
    for part in result.per_part:
        name = f"{part.start:.4g} to {part.stop:.4g} s"
        if part.value is None:
            rows.append((name, None, "No number."))
        else:
            mark = "" if part.status == "ok" else " ⚠"
            rows.append((name, Parameter.of(part.value, part.standard_uncertainty, result.main.unit), mark))
    return rows


def forest(rows: Sequence[tuple[str, Parameter | None, str]], common: Parameter | None = None) -> str:
    """Results side by side: name, value and interval of each on one scale, and a mark, or a sentence for none.

    common: whose interval is the band behind all; without it that of the first row that has one.
    """
    mains = [main for _, main, _ in rows if main] + ([common] if common else [])
    ends = [end for main in mains for end in (*(main.interval95 or ()), main.value)]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    room = 0.08 * (high - low) or abs(high) * 1e-3 or 1.0
    low, high = low - room, high + room

    def drawn(kind: str, bounds: tuple[float, float]) -> str:
        a, b = (100 * (end - low) / (high - low) for end in bounds)
        return f'<i class="{kind}" style="left:{a:.2f}%;width:{b - a:.2f}%"></i>'

    first = common or next((main for main in mains if main.interval95), None)
    band = drawn("band", first.interval95) if first and first.interval95 else ""
    made = []
    for name, main, text in rows:
        head = f"<div>{escaped(name)}</div>"
        if main is None:
            made.append(row(f'{head}<div class="swingid-quiet">{escaped(text)}</div><div></div>'))
            continue
        line = drawn("line", main.interval95) if main.interval95 else ""
        dot = f'<i class="dot" style="left:{100 * (main.value - low) / (high - low):.2f}%"></i>'
        value = escaped(value_and_reach(main, fine=True))
        made.append(row(f'{head}<div class="swingid-track">{band}{line}{dot}</div><div>{value}{text}</div>'))
    label = 'role="group" aria-label="results side by side"'
    return f'<div class="swingid-rows swingid-forest" {label}>{"".join(made)}</div>'


def row(cells: str) -> str:
    """One row of three cells: a name, a bar, a value; on a phone the bar is below."""
    return f'<div class="swingid-row">{cells}</div>'


def _sentence(text: str) -> str:
    """Return the text with a full stop, and a capital letter where it does not begin with a key of the rig file."""
    text = text.strip()
    begin = text if re.match(r"\w+\.\w", text) else f"{text[:1].upper()}{text[1:]}"
    return begin + ("" if text.endswith((".", "!", "?")) else ".")
