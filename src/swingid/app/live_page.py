"""The page beside a live rig: Connect, Check, Rehearse, Run, Result, Keep; one person controls, others watch."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import ui

from swingid.app.analysis import track_of
from swingid.app.answer import Answer
from swingid.app.desk import Desk, Fields
from swingid.app.draft import Draft
from swingid.app.keep import Keep
from swingid.app.kinds import kind_of, kind_of_rig
from swingid.app.live_plots import CheckPlots, RehearsalPlots, RunPlots
from swingid.app.live_steps import STEPS
from swingid.app.live_steps import Step as LiveStep
from swingid.app.order import DURATION, MOTION, UNTIL, WrongFieldError, order_of, share_of
from swingid.app.part import Part
from swingid.app.parts import Frame, Step, emphasise, main_button, mend_words, plain_button, said
from swingid.app.rig_view import RigView
from swingid.app.runner import Seen
from swingid.app.stop_bar import StopBar
from swingid.app.task import Halt, Task
from swingid.errors import SwingidError
from swingid.format import number
from swingid.model.rig import Rig

DRAWS = 30.0
"""Draws per second of a run."""

BEGIN = "Connect the rig, check it, rehearse the motion, run it."

QUIET = 3.0
"""Seconds without news of a run after which the page says so; samples come every 5 ms, a journal ends within 1 s."""


class LivePage:
    """One browser's page on a live rig."""

    def __init__(self, desk: Desk) -> None:
        self.desk, self.runner = desk, desk.runner
        self.client = ui.context.client
        self.plant = Rig.load(desk.rig)
        self.logs: dict[str, ui.column] = {}
        self.said: dict[str, str] = {}
        self.buttons: dict[str, ui.button] = {}
        self.next: dict[str, ui.button] = {}
        self.inputs: dict[str, ui.input | ui.number] = {}
        self.plots: dict[str, Any] = {}
        self.cursor = self.drawn = self.lines = 0
        self.task = self.runner.seen
        self.finished: Seen | None = None
        self.shown = ""
        self.is_answered = False
        self.open = ""

    def build(self) -> None:
        """Lay the page out."""
        self.frame = Frame(self.plant.name, BEGIN)
        with self.frame.place, ui.element("div").classes("swingid-live") as self.beside:
            with ui.column().classes("swingid-beside gap-2"):
                self.view = RigView(kind_of(kind_of_rig(self.plant)))
                text = "Another page controls this rig; here you watch. STOP works everywhere."
                self.watching = ui.label(text).classes("swingid-text")
            with ui.column().classes("w-full gap-0"):
                self.steps = {step.name: Step(k, step.title, step.waits, self._go) for k, step in enumerate(STEPS, 1)}
                self._fill()
        with ui.footer().classes("p-0"):
            self.bar = StopBar(self._stop)
        self.open = self.name if self.runner.busy else STEPS[0].name
        self._enable(mine=False)  # a page controls once its browser is there
        self.watching.set_visibility(False)
        ui.timer(1 / DRAWS, self._draw)

    def _fill(self) -> None:
        """What is in each step: words, what it asks for, its buttons, what it draws."""
        asked = {"check": self._clear_box, "rehearse": self._order_panel}
        drawn: dict[str, Callable[[], Any]] = {
            "check": lambda: CheckPlots(self.logs["check"]),
            "rehearse": lambda: RehearsalPlots(self.logs["rehearse"], self.plant),
            "run": lambda: RunPlots(self.plant),
        }
        device = self.desk.address or "none given, so the twin of the rig file takes its place"
        for step in STEPS:
            with self.steps[step.name].body:
                if step.do is None:
                    said(ui.column().classes("w-full"), "no run yet")
                    continue
                for text, kind in ((step.text, "swingid-text"), (step.note, "swingid-quiet")):
                    if text:
                        ui.label(text.format(device=device, rig=self.desk.rig)).classes(kind)
                if step.name in asked:
                    asked[step.name]()
                self._action(step)
                if step.name in drawn:
                    self.plots[step.name] = drawn[step.name]()

    def _go(self, step: Step) -> None:
        """Open a step, or fold it."""
        name = STEPS[step.number - 1].name
        if step.state == "later":
            return
        self.open = "" if self.open == name else name

    def _clear_box(self) -> None:
        self.clear = ui.checkbox("I have looked at the rig: clear a fault of an earlier run")

    def _order_panel(self) -> None:
        fields = self.desk.fields
        with ui.row().classes("items-start"):
            self.inputs[MOTION] = ui.input("reference", value=fields.motion).classes("w-80 max-w-full")
            self.inputs[DURATION] = ui.number("duration, s", value=fields.duration).classes("w-40")
            self.inputs[UNTIL] = ui.number("stop at relative uncertainty, %", value=fields.until).classes("w-60")
        for each in self.inputs.values():
            each.props("outlined dense stack-label bottom-slots")  # room for what is wrong with a field
        ui.label("0 %: run for the whole duration.").classes("text-sm")

    def _action(self, step: LiveStep) -> None:
        name, then = step.name, STEPS[STEPS.index(step) + 1]
        with ui.row().classes("swingid-step-end"):
            self.buttons[name] = main_button(step.button, lambda: None).on(
                "click", lambda event: self._press(name, event.args), js_handler="() => emit(window.swingidBeat)"
            )
            self.next[name] = plain_button(f"Next: {then.title}", lambda: self._go_to(then.name))
        self.logs[name] = ui.column().classes("w-full gap-1 swingid-log").props('aria-live="polite" role="log"')

    def _go_to(self, name: str) -> None:
        self.open = name

    @property
    def fields(self) -> Fields:
        """What is written in the fields now."""
        return Fields(*(self.inputs[name].value for name in (MOTION, DURATION, UNTIL)))

    @property
    def me(self) -> str:
        """Which page this is; the same after a reload."""
        return self.client.tab_id or self.client.id

    def _press(self, kind: str, beat: object) -> None:
        """A button of a step: begin it, unless what was pressed does not hold any more."""
        if not self.bar.is_fresh(beat):
            ui.notify("pressed while the connection was lost, so it did nothing; press again", type="warning")
            return
        desk, fields = self.desk, self.fields
        if not desk.controls(self.me) or self.runner.busy or not desk.opened()[kind]:
            return
        values: dict[str, Any] = {}
        if kind in ("rehearse", "run"):
            try:
                order = order_of(fields.motion, fields.duration, share_of(fields.until), self.plant)
            except WrongFieldError as error:
                self.inputs[error.field].error = error.message
                return
            except SwingidError as error:
                said(self.logs[kind], error.message)
                return
            values = {"motion": fields.motion, "duration": order.duration, "until": order.until}
            if kind == "rehearse":
                desk.rehearsed = fields
            elif fields != desk.rehearsed:
                return
        desk.fields = fields
        out = desk.new_journal() if kind == "run" else ""
        self.runner.start(Task(kind, desk.address, desk.rig, **values, out=out, clear=bool(self.clear.value)))

    def _stop(self) -> None:
        """Once: fade out; again while it goes on: 0 V at once. A computation ends."""
        self.runner.stop()
        if not self.runner.busy:
            self.desk.analyst.stop()

    @property
    def name(self) -> str:
        """The name of the step whose task is shown, "" before the first."""
        return "" if self.task.step is None else self.task.step.name

    def _draw(self) -> None:
        """What came since the last draw."""
        if not self.client.has_socket_connection:
            return
        seen = self.runner.seen
        if seen is not self.task:
            self.task, self.cursor, self.drawn, self.lines = seen, 0, 0, 0
            self.view.play(None)
            if self.name:
                self.logs[self.name].clear()
            if self.name in self.plots:
                self.plots[self.name].begin()
        if self.name and len(seen.lines) > self.lines:
            with self.logs[self.name]:
                for line in seen.lines[self.lines :]:
                    ui.label(line)
            self.lines = len(seen.lines)
            self.said[self.name] = seen.lines[-1]
        if new := min(seen.count - self.cursor, len(seen.rows)):
            self._add_rows(np.array([seen.rows[k] for k in range(-new, 0)], float))
            self.cursor = seen.count
        if len(seen.estimates) > self.drawn:
            self.drawn = len(seen.estimates)
            self.plots["run"].estimated(seen.estimates)
        if seen.ended and self.finished is not seen:
            self.finished = seen
            self._finish(seen)
        self._enable(mine=self.desk.controls(self.me))

    def _add_rows(self, rows: np.ndarray) -> None:
        if self.name in self.plots:
            self.plots[self.name].add(rows)
        if self.name != "rehearse":
            angle, wheel = float(rows[-1, 1]), float(rows[-1, 5])
            self.view.turn(angle, wheel if math.isfinite(wheel) else None)

    def _finish(self, seen: Seen) -> None:
        """A step has ended: what its plots show, and the motion of the twin."""
        if self.name in self.plots:
            self.plots[self.name].finish()
        if self.name == "rehearse" and seen.rows:
            t, angle, *_, wheel = np.array(seen.rows, float).T
            self.view.play(track_of(t, angle, wheel))

    def _enable(self, *, mine: bool) -> None:
        """Which steps are open, what the state line says; mine: whether this page controls."""
        runner = self.runner
        opened = self.desk.opened()
        opened["run"] = opened["run"] and self.desk.rehearsed == self.fields
        self.watching.set_visibility(not mine)
        for kind, is_open in opened.items():
            self.buttons[kind].set_enabled(mine and is_open and not runner.busy)
            passed = kind in runner.passed or (kind == "run" and bool(self.shown))
            self.next[kind].set_visibility(passed)
            emphasise(self.buttons[kind], main=not passed)
            emphasise(self.next[kind], main=passed)
            self._show(kind, is_open or kind == self.name, kind in runner.passed)
        journal = self.task.found.get("journal", "") if self.task.ended else ""
        for name in ("result", "report"):
            self._show(name, bool(journal or self.shown), name == "result" and self.is_answered)
        if (wide := self.open in ("result", "report")) != ("wide" in self.beside.classes):
            self.beside.classes(add="wide" if wide else "", remove="" if wide else "wide")
        self.bar.show(self._state_words(), moves=self.runner.moves, share=self._share())
        self.frame.say(self._sentence())
        if journal and journal != self.shown:
            self.shown = journal
            ui.timer(0.05, self._show_result, once=True)

    def _show(self, name: str, is_ready: bool, is_done: bool) -> None:
        """The state of a step, with the last line that was said in it."""
        state = "now" if self.open == name else "done" if is_done else "next"
        if not is_ready:
            state = "later"
        lines = self.said.get(name, "") if state == "done" else None if state == "later" else ""
        self.steps[name].show(state, lines, is_open=self.open == name and is_ready)

    def _share(self) -> float:
        """Share of the time of what goes on that is over, 0 where that is not known."""
        passed, remaining = (self.task.progress.get(name, 0.0) for name in ("time", "left"))
        return passed / (passed + remaining) if self.runner.busy and passed + remaining > 0 else 0.0

    def _sentence(self) -> str:
        """What is going on, and what is next."""
        passed, task = self.runner.passed, self.task
        if self.runner.busy and task.step is not None:
            return task.step.doing
        if task.ended and task.ended != "ok" and task.lines:
            line = task.lines[-1].rstrip(".")
            return f"{line[:1].upper()}{line[1:]}."
        if self.shown:
            return f"{Path(self.shown).name} is recorded." + ("" if self.is_answered else " Next: its result.")
        if self.desk.rehearsed != self.fields:
            passed = passed - {"rehearse"}
        done = [step.passed for step in STEPS if step.name in passed and step.passed]
        return done[-1] if done else BEGIN

    def _state_words(self) -> str:
        task, progress = self.task, self.task.progress
        elsewhere = self.runner.elsewhere
        if not self.runner.busy and elsewhere is not None:
            return (
                "stopping …" if self.runner.asked else f"{elsewhere.entry.words()} goes on: STOP, or the emergency stop"
            )
        if not self.runner.busy or task.step is None:
            if not task.found.get("seen", True):
                return "0 V was not seen: look at the rig"
            moved = task.moves and (task.found or task.ended in ("ok", "stopped"))
            return "at rest, 0 V" if moved else "nothing is running"
        if task.stops:
            return "stopping …"
        if task.step.halt is not Halt.FADES or not progress:
            remaining = f" {progress['left']:.0f} s at most are left" if progress.get("left") else ""
            return task.step.state + remaining
        silent = time.monotonic() - task.when
        if silent > QUIET:
            return f"no news of the run for {silent:.0f} s: STOP, or the emergency stop"
        remaining = f"{progress['time']:.1f} s, {progress['left']:.0f} s left"
        volts = f"{abs(progress['voltage']):.1f} of {progress['limit']:g} V"
        return f"{progress['state']} · {remaining} · error {number(progress['tracking'], 'rad', 2)} · {volts}"

    async def _show_result(self) -> None:
        """The log that was recorded, as the page on a log shows it."""
        journal = self.shown
        self.is_answered = False
        draft = Draft.of({Path(journal).name: Path(journal)}, self.plant)
        body = self.steps["result"].body
        body.clear()
        with body:
            ui.label(f"journal: {journal}").classes("swingid-mono")

            async def mend(values: Mapping[str, object]) -> None:
                """Take keys over for this answer; rig.toml of the step Keep has them."""
                draft.mends |= values
                ui.notify(f"used for this answer: {mend_words(values)}; the rig file stays as it is")
                await answer.run()
                await part.inspect()

            part = Part(self.desk.analyst, draft, mend)
            answer = Answer(self.desk.analyst, draft, mend)
            if not await part.show():
                return
            plain_button("Answer again, for these parts", answer.run)
            answer.show()
            plain_button(f"Next: {self.steps['report'].word}", lambda: self._go_to("report"))
        keep = self.steps["report"].body
        keep.clear()
        with keep:
            Keep(self.desk.analyst, draft).show()
        self.is_answered = await answer.run() is not None
        await part.inspect()


def live_page(desk: Desk) -> Callable[[], None]:
    """The function that lays the page out for each browser."""
    return lambda: LivePage(desk).build()
