"""The page beside a live rig: Connect, Check, Rehearse, Run, Result, Report; one person controls, others watch."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from nicegui import ui

from swingid.app.analysis import Analyst
from swingid.app.log_page import LogPage
from swingid.app.parts import Step, page_frame, ready, said, steps
from swingid.app.plot import Line, Plot
from swingid.app.runner import Kind, Runner, Task
from swingid.errors import SwingidError
from swingid.format import number, percent, plus_minus
from swingid.model.rig import Rig

STEPS = (
    Step("connect", "Connect"),
    Step("check", "Check"),
    Step("rehearse", "Rehearse"),
    Step("run", "Run"),
    Step("result", "Result"),
    Step("report", "Report"),
)

DRAWS, WINDOW = 30.0, 10.0
"""Draws per second of a run, and seconds that stay in view."""

STALE = 15.0
"""Seconds without a sign of the page that controls, after which another one may."""


@dataclass
class Desk:
    """What all pages of one rig share: the runner, who controls, what was chosen."""

    rig: str
    address: str
    folder: Path
    analyst: Analyst
    runner: Runner = field(default_factory=Runner)
    controller: str = ""
    seen: float = 0.0
    rehearsed: tuple[str, float] | None = None

    def controls(self, page: str) -> bool:
        """Whether this page controls; the first one does, and another after that one is gone."""
        now = time.monotonic()
        if not self.controller or (self.controller != page and now - self.seen > STALE):
            self.controller = page
        if self.controller == page:
            self.seen = now
            return True
        return False


class LivePage:
    """One browser's page on a live rig."""

    def __init__(self, desk: Desk) -> None:
        self.desk, self.runner = desk, desk.runner
        self.me = ui.context.client.id
        self.plant = Rig.load(desk.rig)
        self.logs: dict[Kind, ui.column] = {}
        self.buttons: dict[Kind, ui.button] = {}
        self.motion: ui.input
        self.duration: ui.number
        self.until: ui.number
        self.cursor = self.drawn = self.lines = 0
        self.task = self.runner.seen
        self.presses = 0
        self.result: LogPage | None = None

    def build(self) -> None:
        """Lay the page out."""
        page_frame(self.desk.address or f"emulator of {self.plant.name}", rig=self.desk.rig)
        self.watching = ui.label("Another page controls this rig; here you watch. STOP works everywhere.")
        with steps(STEPS) as (self.tabs, panels):
            with panels["connect"]:
                ui.label(f"Device: {self.desk.address or 'none given, so the twin of the rig file is the rig'}")
                self._action("connect", "Connect")
            with panels["check"]:
                ui.label("The body must hang still. Small pulses turn the wheel, to find signs and delay.")
                self.clear = ui.checkbox("I have looked at the rig: clear a fault of an earlier run")
                self._action("check", "Check")
            with panels["rehearse"]:
                self._order_panel()
                self._action("rehearse", "Rehearse on the twin")
            with panels["run"]:
                self._action("run", "Run")
                self._plots()
            with panels["result"]:
                self.result_place = ui.column().classes("w-full")
                said(self.result_place, "no run yet")
            with panels["report"]:
                self.report_place = ui.column().classes("w-full")
                said(self.report_place, "no run yet")
        with ui.footer().classes("items-center justify-between py-2").style("background: #D55E00"):
            self.state = ui.label("at rest, 0 V").classes("text-base").props('aria-live="polite"')
            ui.button("STOP (Esc)", on_click=self._stop).props(
                "color=white text-color=black size=xl aria-keyshortcuts=Esc"
            )
        ui.keyboard(on_key=self._key, ignore=[])
        self._enable(mine=False)  # a page controls once its browser is there
        self.watching.set_visibility(False)
        ui.timer(1 / DRAWS, self._draw)

    def _order_panel(self) -> None:
        with ui.row().classes("items-center"):
            self.motion = ui.input("reference", value="sine 0.8 rad 8.5 rad/s").classes("w-64")
            self.duration = ui.number("duration, s", value=25, min=1, max=86400).classes("w-28")
            self.until = ui.number("stop at relative uncertainty, %", value=0, min=0, max=99).classes("w-52")
        ui.label("0 %: run for the whole duration.").classes("text-sm")

    def _action(self, kind: Kind, word: str) -> None:
        self.buttons[kind] = ui.button(word, on_click=lambda: self._begin(kind))
        self.logs[kind] = ui.column().classes("w-full gap-1 font-mono text-sm").props('aria-live="polite" role="log"')

    def _plots(self) -> None:
        limit = self.plant.drive.motor.voltage_limit if self.plant.drive.motor else None
        levels = [] if limit is None else [limit, -limit]
        self.estimate_text = ui.label("").classes("text-lg").props('aria-live="polite"')
        self.angle = Plot("angle and reference", [Line("angle", "rad"), Line("reference", "rad")], window=WINDOW)
        self.error = Plot("tracking error", [Line("error", "rad")], window=WINDOW, height=120)
        self.voltage = Plot("voltage", [Line("voltage", "V")], window=WINDOW, height=120, limits=levels)
        self.gain = Plot("adaptive gain", [Line("gain")], window=WINDOW, height=110)
        names = ("estimate", "lower end of the 95 % interval", "upper end")
        self.estimates = Plot("inertia after each swing, kg m²", [Line(name) for name in names])

    def _begin(self, kind: Kind) -> None:
        desk = self.desk
        if not desk.controls(self.me) or self.runner.busy:
            return
        out = ""
        if kind == "run":
            out = str(desk.folder / time.strftime("run-%Y%m%d-%H%M%S.mcap"))
            for plot in (self.angle, self.error, self.voltage, self.gain):
                plot.clear_rows()
        order = (str(self.motion.value), float(self.duration.value or 0.0))
        if kind == "rehearse":
            desk.rehearsed = order
        share = float(self.until.value or 0.0) / 100
        self.runner.start(Task(kind, desk.address, desk.rig, *order, share, out, bool(self.clear.value)))

    def _stop(self) -> None:
        """Once: fade out; again while it goes on: 0 V at once."""
        self.presses += 1
        self.runner.stop(hard=self.presses > 1)
        self.state.set_text("stopping …" if self.runner.busy else "at rest, 0 V")

    def _key(self, event: object) -> None:
        key = getattr(event, "key", None)
        if getattr(event.action, "keydown", False) and not event.action.repeat and key == "Escape":  # type: ignore[attr-defined]
            self._stop()

    def _draw(self) -> None:
        """What came since the last draw."""
        seen = self.runner.seen
        if seen is not self.task:
            self.task, self.cursor, self.drawn, self.lines, self.presses = seen, 0, 0, 0, 0
            if seen.kind is not None:
                self.logs[seen.kind].clear()
        if seen.kind is not None and len(seen.lines) > self.lines:
            with self.logs[seen.kind]:
                for line in seen.lines[self.lines :]:
                    ui.label(line)
            self.lines = len(seen.lines)
        if new := min(seen.count - self.cursor, len(seen.rows)):
            self._add_rows(np.array([seen.rows[k] for k in range(-new, 0)], float))
            self.cursor = seen.count
        self._add_estimates()
        self._enable(mine=self.desk.controls(self.me))

    def _add_rows(self, rows: np.ndarray) -> None:
        t, angle, reference, gain, voltage = rows.T
        self.angle.append(t, [angle, reference])
        self.error.append(t, [angle - reference])
        self.voltage.append(t, [voltage])
        self.gain.append(t, [gain])

    def _add_estimates(self) -> None:
        new = self.task.estimates[self.drawn :]
        self.drawn += len(new)
        known = [(t, value, u) for _, t, value, u, _ in self.task.estimates if u is not None]
        if new and known:
            t, value, u = np.array(known).T
            self.estimates.show(t, [value, value - 1.96 * u, value + 1.96 * u])
        if new:
            swing, _, value, u, unit = new[-1]
            share = "" if u is None else f", {percent(u / abs(value))}"
            self.estimate_text.set_text(f"after swing {swing}: {plus_minus(value, u, unit)}{share}")

    def _enable(self, *, mine: bool) -> None:
        """Which steps are open, what the state line says; mine: whether this page controls."""
        runner, passed = self.runner, self.runner.passed
        order = (str(self.motion.value), float(self.duration.value or 0.0))
        fresh = "rehearse" in passed and self.desk.rehearsed == order
        open_steps: dict[Kind, bool] = {
            "connect": True,
            "check": "connect" in passed,
            "rehearse": "check" in passed,
            "run": "check" in passed and fresh,
        }
        self.watching.set_visibility(not mine)
        for kind, is_open in open_steps.items():
            self.buttons[kind].set_enabled(mine and is_open and not runner.busy)
            ready(self.tabs[kind], is_open or kind == self.task.kind)
        done = self.task.kind == "run" and bool(self.task.ended) and bool(self.task.found)
        for name in ("result", "report"):
            ready(self.tabs[name], done or self.result is not None)
        self.state.set_text(self._state_words())
        if done and (self.result is None or self.result.log != self.task.found["journal"]):
            self._show_result(self.task.found["journal"])

    def _state_words(self) -> str:
        progress = self.task.progress
        if not self.runner.busy:
            return "at rest, 0 V"
        if self.presses:
            return "stopping …"
        if self.task.kind != "run" or not progress:
            return {"connect": "connecting …", "check": "checking …", "rehearse": "rehearsing …"}.get(
                str(self.task.kind), "getting ready …"
            )
        left = f"{progress['time']:.1f} s, {progress['left']:.0f} s left"
        volts = f"{abs(progress['voltage']):.1f} of {progress['limit']:g} V"
        return f"{progress['state']} · {left} · error {number(progress['tracking'], 'rad', 2)} · {volts}"

    def _show_result(self, journal: str) -> None:
        """The log that was recorded, as the page on a log shows it."""
        try:
            self.result = LogPage(journal, self.desk.rig, self.desk.analyst)
        except SwingidError as error:
            said(self.result_place, error.message)
            self.task.found = {}
            return
        self.result_place.clear()
        with self.result_place:
            ui.label(f"journal: {journal}").classes("font-mono text-sm")
            self.result.plots()
            self.result.result_panel()
            self.result.constants_panel()
        self.report_place.clear()
        with self.report_place:
            self.result.report_panel()
        with self.result_place:
            ui.timer(0.05, self.result.identify_all, once=True)


def live_page(desk: Desk) -> Callable[[], None]:
    """The function that lays the page out for each browser."""
    return lambda: LivePage(desk).build()
