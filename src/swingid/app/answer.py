"""The step Answer: the number, its picture, what dominates its interval, warnings as cards, methods side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from nicegui import ui

from swingid.app.analysis import STOPPED, Analyst, answered
from swingid.app.draft import Draft, case_of, mend_of
from swingid.app.parts import escaped, html, main_button, more, said
from swingid.app.plot import Line, Plot
from swingid.errors import SwingidError
from swingid.format import percent, plus_minus, pretty_unit
from swingid.methods.table import DEFAULT, METHODS
from swingid.report.words import parameter_word
from swingid.result.plot import BLUE, ORANGE
from swingid.result.result import refusal

WIDEST = 0.05
"""Largest relative change of a constant that a slider offers: what is worse is a mistake, no uncertainty."""

SHOWN = 5
"""Contributions that are shown as bars."""

OUTSIDE = 8.0
"""Robust standard deviations beyond which a swing is left out of the picture, for the others to be seen."""

REMEDIES = (
    ("log.clock", "clock of the log", "Compare the log's clock with another one, and state log.clock."),
    ("axis.tilt", "tilt of the axis", "Level the axis with a spirit level, and state axis.tilt."),
    ("drive.wheel.tilt", "tilt of the wheel", "Measure the wheel's axis against that of the body."),
    ("drive.wheel.inertia", "inertia of the wheel", "Weigh and measure the wheel more exactly."),
    ("axis.gravity_torque", "gravity torque m g l", "Weigh the body and measure its lever more exactly."),
    ("axis.mass", "mass", "Weigh it more exactly."),
    ("axis.lever", "distance to the centre of mass", "Balance it on an edge, several times."),
    ("axis.g", "free fall", "State axis.latitude."),
    ("log.torque_gain", "gain of the torque", "Measure the torque with a lever on a scale."),
    ("sensors", "encoders", "One minute of calibration: swingid calibrate --encoders."),
    ("scatter", "scatter and sensor noise", "A log four times as long halves it."),
    ("torque that depends", "torque that depends on the angle", "Find what pulls or rolls: a cable, a bearing."),
    ("what is not modelled", "what no equation has", ""),
    ("disagreement", "disagreement within the log", "Use the part whose swings agree."),
    ("drift", "drift with the length of the windows", "Use the part whose swings agree."),
)
"""Words and a remedy for the sources of a budget, by how they begin."""


class Answer:
    """Content of the step. mended: called with keys and values that a person takes over from a warning."""

    def __init__(self, analyst: Analyst, draft: Draft, mended: Callable[[Mapping[str, object]], Any]) -> None:
        self.analyst, self.draft, self.mended = analyst, draft, mended
        self.factors: dict[str, float] = {}
        self.found: dict[str, Mapping[str, Any]] = {}
        self.stated: Mapping[str, Any] = {}
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

    async def run(self) -> Mapping[str, Any] | None:
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
        ui.timer(0.01, lambda: self._others(mine), once=True)
        return main

    async def _others(self, mine: int) -> None:
        found = self.stated
        for method in (name for name in METHODS if name != DEFAULT):
            if (found.get("error") or {}).get("code") != STOPPED:  # what a person has stopped is not begun again
                found = await self.one(method, {})
            if self.round != mine or self.methods.is_deleted:
                return
            self.found[method] = found
            self._draw_methods()

    async def one(self, method: str, factors: Mapping[str, float]) -> Mapping[str, Any]:
        """The result of a method, as its JSON; a refusal where its process was ended."""
        try:
            found: Mapping[str, Any] = await self.analyst.do(answered, case_of(self.draft), method, factors)
        except SwingidError as error:
            return refusal(method, error).to_dict()
        return found

    def _draw(self, found: Mapping[str, Any]) -> None:
        self.main.clear()
        with self.main:
            if found["error"] is not None or not found["parameters"]:
                self._card("No answer", found["error"]["message"], found["error"]["code"])
                return
            number_of(found, linear=self.draft.linear)
            ui.label(status_of(found)).classes("text-lg swingid-text")
            for warning in found["warnings"]:
                self._card(warning["code"].replace("-", " ").capitalize(), warning["message"], warning["code"])
            swings_picture(found)
            shares(found)
            rest(found, linear=self.draft.linear)

    def _card(self, title: str, sentence: str, code: str) -> None:
        """A warning: what, why, what to do, and where a key mends it a button that writes the key."""
        why, _, remedy = sentence.rpartition("; ")
        with ui.element("div").classes("swingid-warning").props('role="group" aria-label="warning"'):
            ui.label(title).classes("swingid-strong")
            ui.label(_sentence(why or remedy)).classes("swingid-text")
            if why:
                ui.label(f"Do this: {remedy[:1].lower()}{remedy[1:]}").classes("swingid-text")
            mend = mend_of(code, sentence, self.draft)
            if mend:
                words = ", ".join(f"{key} = {value}" for key, value in mend.items())
                main_button(f"Set {words}", lambda: self.mended(mend)).classes("self-start")

    def _draw_methods(self) -> None:
        self.methods.clear()
        with self.methods:
            html(forest(self.found), "w-full")

    def _make_sliders(self, found: Mapping[str, Any]) -> None:
        self.sliders.clear()
        self.factors.clear()
        self._show_effect(found)
        with self.sliders:
            for key in found.get("sensitivities") or {}:
                with ui.row().classes("w-full items-center"):  # on a phone the name stands above its slider
                    ui.label(key).classes("w-full sm:w-64 shrink-0 swingid-mono")
                    slider = ui.slider(min=-WIDEST, max=WIDEST, step=WIDEST / 50, value=0.0)
                    slider.props(f'label aria-label="relative change of {key}"').classes("flex-1 min-w-32")
                    shown = ui.label("+0.0 %").classes("w-16 shrink-0 text-right")
                    slider.on("change", lambda event, key=key, at=shown: self._changed(key, float(event.args), at))
            if not found.get("sensitivities"):
                ui.label("This result depends on no constant of the rig file.")

    async def _changed(self, key: str, change: float, shown: ui.label) -> None:
        shown.set_text(f"{100 * change:+.1f} %")
        self.factors[key] = 1.0 + change
        if change == 0.0:
            del self.factors[key]
        self.moved += 1
        mine = self.moved
        found = await self.one(DEFAULT, dict(self.factors))
        if self.moved == mine:
            self._show_effect(found)

    def _show_effect(self, found: Mapping[str, Any]) -> None:
        if found["error"] is not None:
            self.effect.set_text(found["error"]["message"])
            return
        name, now = next(iter(found["parameters"].items()))
        text = f"{name} = {plus_minus(now['value'], now['standard_uncertainty'], now['unit'])}"
        before = (self.stated.get("parameters") or {}).get(name)
        if self.factors and before is not None:
            change = now["value"] / before["value"] - 1 if before["value"] else np.nan
            text += f", {percent(change, sign=True)} from {plus_minus(before['value'], None, pretty_unit(now['unit']))}"
        self.effect.set_text(text)


def half_width(parameter: Mapping[str, Any]) -> float | None:
    """U (95 %) of a parameter; None where it has no interval."""
    bounds = parameter["interval95"]
    return None if not bounds else (bounds[1] - bounds[0]) / 2


def number_of(found: Mapping[str, Any], *, linear: bool) -> None:
    """The value and its U (95 %), large."""
    name, main = next(iter(found["parameters"].items()))
    value, u = main["value"], half_width(main)
    factor = main.get("coverage_factor")
    with ui.column().classes("gap-0 w-full").props('role="group" aria-label="answer"'):
        words = parameter_word(name, linear=linear).words
        ui.label(words[:1].upper() + words[1:]).classes("swingid-quiet")
        ui.label(plus_minus(value, u, "", fine=True).replace("\N{NO-BREAK SPACE}", " ")).classes("swingid-large")
        known = "" if u is None else f"(95 %, ± {percent(u / abs(value))}" if value else "(95 %"
        more_words = f", k = {factor:.2f})" if factor and known else ")" if known else "no interval"
        ui.label(f"{pretty_unit(main['unit'])} {known}{more_words}").classes("swingid-unit swingid-numbers")


def status_of(found: Mapping[str, Any]) -> str:
    """The status in one sentence."""
    count = len(found["warnings"])
    if not count:
        return "Good: nothing in the log contradicts the rig file."
    return f"Check this number first: {'one warning' if count == 1 else f'{count} warnings'}."


def swings_picture(found: Mapping[str, Any]) -> None:
    """One inertia per swing, the estimate and its interval as a band; of several logs one per log."""
    name, main = next(iter(found["parameters"].items()))
    swings = (found.get("details") or {}).get("swings")
    unit = pretty_unit(main["unit"])
    if found.get("per_log"):
        html(forest({str(k): one for k, one in enumerate(found["per_log"], 1)}, names=_logs(found)), "w-full")
        return
    if not swings or len(swings["times"]) < 2:
        return
    times, values, sides = (np.array(swings[key], dtype=float) for key in ("times", "values", "sides"))
    good = np.isfinite(values)
    times, values, sides = times[good], values[good], sides[good]
    middle = np.median(values)
    spread = 1.4826 * np.median(np.abs(values - middle))
    near = np.abs(values - middle) <= max(OUTSIDE * spread, 1e-12 * abs(middle))
    bounds = main["interval95"]
    band = None if not bounds else (bounds[0], main["value"], bounds[1])
    words = parameter_word(name, linear=main["unit"] == "kg").words
    title = f"{len(values)} swings give the same {words} to {percent(spread / abs(middle))}"
    if not near.all():
        title += f"; {int((~near).sum())} far off are not drawn"
    lines = [Line("upper turning points", unit, points=True, colour=BLUE), Line("lower", unit, True, ORANGE)]
    plot = Plot(title, lines, height=240, band=band)
    upper, lower = near & (sides > 0), near & (sides < 0)
    plot.show_each([(times[upper], values[upper]), (times[lower], values[lower])])
    if band is not None:
        ui.label("Dots: single swings. Line and band: the answer and its 95 % interval.").classes("swingid-quiet")


def _logs(found: Mapping[str, Any]) -> list[str]:
    return [str(one["provenance"].get("log") or f"part {k}") for k, one in enumerate(found["per_log"], 1)]


def contributions(found: Mapping[str, Any]) -> list[tuple[str, str, float]]:
    """Words, remedy and standard uncertainty of each source of the main parameter, the largest first."""
    name = next(iter(found["parameters"]))
    sums: dict[tuple[str, str], float] = {}
    for entry in found["budget"]:
        u = entry["standard_uncertainty"]
        if entry["parameter"] != name or not u:
            continue
        source = entry["source"]
        words, remedy = next(((w, r) for start, w, r in REMEDIES if source.startswith(start)), (source, ""))
        sums[words, remedy] = math.hypot(sums.get((words, remedy), 0.0), u)
    return sorted(((*key, u) for key, u in sums.items()), key=lambda one: one[2], reverse=True)


def shares(found: Mapping[str, Any]) -> None:
    """What dominates the interval, in a sentence with what would shrink it, and as bars."""
    main = next(iter(found["parameters"].values()))
    parts, value, u = contributions(found), main["value"], main["standard_uncertainty"]
    if not parts or not u or not value:
        return
    words, remedy, most = parts[0]
    left = math.sqrt(max(u * u - most * most, 0.0)) * (main.get("coverage_factor") or 1.96)
    text = f"Largest part of the interval: {words}, {percent(most / abs(value))}. Without it the answer has "
    ui.label(f"{text}± {percent(left / abs(value))} (95 %). {remedy}").classes("swingid-text")
    rows = []
    for words, remedy, own in parts[:SHOWN]:
        bar = f'<div class="swingid-bar-fill" style="width:{100 * own / most:.1f}%"></div>'
        hint = f'<br><span class="swingid-quiet">{escaped(remedy)}</span>' if remedy else ""
        track = f'<div class="swingid-bar-track">{bar}</div>'
        rows.append(row(f"<div>{escaped(words)}{hint}</div>{track}<div>{percent(own / abs(value))}</div>"))
    made = "".join(rows)
    html(f'<div class="swingid-rows swingid-shares" role="img" aria-label="contributions">{made}</div>', "w-full")


def rest(found: Mapping[str, Any], *, linear: bool) -> None:
    """Friction and what else was identified; notes on demand."""
    others = list(found["parameters"].items())[1:]
    with ui.column().classes("gap-0"):
        for name, one in others:
            words = parameter_word(name, linear=linear).words
            shown = plus_minus(one["value"], half_width(one), pretty_unit(one["unit"]), fine=True)
            ui.label(f"{words[:1].upper()}{words[1:]}: {shown}").classes("swingid-numbers")
        if others:
            ui.label("± U (95 %)").classes("swingid-quiet")
    if found["notes"]:
        with more(f"{len(found['notes'])} notes: what was assumed and done"):
            for note in found["notes"]:
                ui.label(_sentence(note["message"])).classes("swingid-text")


def forest(found: Mapping[str, Mapping[str, Any]], names: Sequence[str] = ()) -> str:
    """Results side by side: value and interval of each on one scale, the first one's band behind all."""
    if not names:
        names, results = list(METHODS), [found.get(name) for name in METHODS]
    else:
        results = list(found.values())
    mains = [next(iter(one["parameters"].values())) if one and one["parameters"] else None for one in results]
    ends = [end for main in mains if main for end in (*(main["interval95"] or ()), main["value"])]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    room = 0.08 * (high - low) or abs(high) * 1e-3 or 1.0
    low, high = low - room, high + room

    def at(value: float) -> float:
        return 100 * (value - low) / (high - low)

    first = next((main for main in mains if main and main["interval95"]), None)
    band = ""
    if first is not None:
        a, b = (at(end) for end in first["interval95"])
        band = f'<i class="band" style="left:{a:.2f}%;width:{b - a:.2f}%"></i>'
    rows = []
    for name, one, main in zip(names, results, mains, strict=True):
        head = f"<div>{escaped(name)}</div>"
        if main is None:
            said = "…" if one is None else _sentence((one["error"] or {}).get("message", "no number"))
            rows.append(row(f'{head}<div class="swingid-quiet">{escaped(said)}</div><div></div>'))
            continue
        drawn = f'<i class="dot" style="left:{at(main["value"]):.2f}%"></i>'
        if main["interval95"]:
            a, b = (at(end) for end in main["interval95"])
            drawn = f'<i class="line" style="left:{a:.2f}%;width:{b - a:.2f}%"></i>{drawn}'
        mark = "" if one and one["status"] == "ok" else " ⚠"
        text = plus_minus(main["value"], half_width(main), pretty_unit(main["unit"]), fine=True)
        rows.append(row(f'{head}<div class="swingid-track">{band}{drawn}</div><div>{escaped(text)}{mark}</div>'))
    made = "".join(rows)
    return f'<div class="swingid-rows swingid-forest" role="group" aria-label="results side by side">{made}</div>'


def row(cells: str) -> str:
    """One row of three cells: a name, a bar, a value; on a phone the bar is below."""
    return f'<div class="swingid-row">{cells}</div>'


def _sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    text = text.strip()
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith((".", "!", "?")) else ".")
