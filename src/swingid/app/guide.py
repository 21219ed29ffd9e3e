"""The page on a log: Look, Which rig?, What you know, Part, Answer, Keep; it begins at the step that is missing."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nicegui import ui

from swingid.app.analysis import Analyst
from swingid.app.answer import Answer
from swingid.app.draft import Draft
from swingid.app.keep import Keep
from swingid.app.kinds import likely
from swingid.app.know import Know, rig_cards
from swingid.app.look import Look
from swingid.app.part import Part
from swingid.app.parts import Frame, Step, main_button, mend_words, plain_button
from swingid.result.brief import value_and_reach

SENTENCE = "Drop a log of a swinging body, and get its moment of inertia with an interval."


@dataclass(frozen=True, slots=True)
class LogStep:
    """A step of the page on a log: its title, what it waits for while it can't be opened, what lays its content out.

    offer: word of the button that leads to it. line: what has come of it, "" before.
    """

    title: str
    waits: str
    show: Callable[[Guide], Awaitable[None]]
    offer: str = ""
    line: Callable[[Guide], str] = lambda _: ""


class Guide:
    """One browser's page on a log. reached: number of the last step that may be opened."""

    def __init__(self, analyst: Analyst, folder: Path, draft: Draft) -> None:
        self.analyst, self.folder, self.draft = analyst, folder, draft
        self.found: Mapping[str, Any] = {}
        self.reached = 0
        self.known = ""
        self.answer: Answer | None = None
        self.look = Look(analyst, folder, self._taken, self._looked)
        self.next: ui.button | None = None

    def build(self) -> None:
        """Lay the page out; what takes time is filled in as it is found."""
        self.frame = Frame(self.draft.name if self.draft.base else "swingid", SENTENCE)
        self.look.home = self.frame.place
        with self.frame.place:
            self.steps = [Step(k, step.title, step.waits, self._reopen) for k, step in enumerate(STEPS, 1)]
        ui.timer(0.02, self._begin, once=True)

    async def _begin(self) -> None:
        logs = self.draft.logs
        if logs and not self.draft.base:  # as if they were dropped
            self.draft.logs = {}
            await self._open(LOOK)
            await self.look.take(logs)
        else:
            await self.go(PART if logs else LOOK)

    async def _reopen(self, step: Step) -> None:
        number = step.number - 1
        if number <= self.reached:
            await self.go(number)

    async def go(self, number: int) -> None:
        """Open a step; those before it are done."""
        with self.frame.place:  # for who asks may stand in what is taken away
            ui.timer(0.01, lambda: self._open(number), once=True)

    async def _open(self, number: int) -> None:
        self.reached = max(self.reached, number)
        for k, (step, shown) in enumerate(zip(STEPS, self.steps, strict=True)):
            line = step.line(self)
            if k == number:
                shown.show("now", "")
            elif k < self.reached or (k == self.reached and line):
                shown.show("done", line)
            else:
                shown.show("later")
        body = self.steps[number].body
        body.clear()
        self.next = None
        with body:
            await STEPS[number].show(self)

    def _end(self, number: int, *, ready: bool = True) -> None:
        """The button that offers the next step."""
        with ui.row().classes("swingid-step-end"):
            self.next = main_button(STEPS[number].offer, lambda: self.go(number))
            self.next.set_enabled(ready)

    async def _look(self) -> None:
        if not self.draft.logs:
            self.frame.say(SENTENCE)
            self.look.offer()
            return
        if self.draft.base:
            ui.label(", ".join(self.draft.logs))
        elif self.found:
            self.look.show(self.draft, self.found)
        with ui.row().classes("swingid-step-end"):
            self.next = main_button(STEPS[RIG].offer, lambda: self.go(PART if self.draft.base else RIG))
            plain_button("Another log", self._restart)
        self._looked()

    async def _restart(self) -> None:
        self.draft.logs, self.found, self.reached = {}, {}, LOOK
        self.draft.parts = []
        await self.go(LOOK)

    async def _taken(self, paths: Mapping[str, Path], look: Mapping[str, Any]) -> None:
        """Files have come."""
        self.draft.logs, self.found = dict(paths), look
        self.draft.take_guess(look)
        self.frame.say(f"{rows_of(look)}. Are these the right columns?")
        self.reached = PART if self.draft.base else LOOK
        await self.go(self.reached)

    def _looked(self) -> None:
        """A role, unit or sign was changed: what rests on it is to be done again."""
        columns = self.draft.columns
        ready = bool(self.draft.base) or (self.draft.moves and self.draft.has_clock)
        if self.next is not None:
            self.next.set_enabled(ready)
        kind = self.draft.rig_kind
        if not self.draft.base and kind is not None and (kind.missing(columns) or kind.linear != self.draft.linear):
            self.draft.kind = ""
            self._forget(RIG)
        elif not self.draft.base and self.draft.text() != self.known:
            self._forget(KNOW if self.draft.kind else RIG)

    def _forget(self, number: int) -> None:
        """Steps after this one wait again."""
        if self.reached > number:
            self.reached, self.answer = number, None
            for step in self.steps[number + 1 :]:
                step.show("later")

    async def _rig(self) -> None:
        self.frame.say("Which of these looks like your rig?")
        first = likely(self.draft.columns, linear=self.draft.linear, returns=self.found.get("returns", True))
        rig_cards(self.draft, first, self._choose)

    async def _choose(self, name: str) -> None:
        if self.draft.kind != name:
            self.draft.kind, self.draft.answers, self.draft.mends = name, {}, {}
            self._forget(RIG)
        await self.go(KNOW)

    async def _know(self) -> None:
        self.frame.say("What do you know of it? “Not known” is an answer, too.")
        Know(self.draft, self._known).show()
        self._end(PART)
        self._known()

    def _known(self) -> None:
        fine = not self.draft.trouble()[1] and not self.draft.open_fields()
        if self.next is not None:
            self.next.set_enabled(fine)
        self.frame.entitle(self.draft.name if self.draft.base or self.draft.name != "my-rig" else "swingid")
        if self.draft.text() != self.known:
            self.known = self.draft.text()
            self._forget(KNOW)

    async def _part(self) -> None:
        self.frame.say("Which part of the log swings as it should?")
        part = Part(self.analyst, self.draft, self.mend)
        if not await part.show():
            return
        self._end(ANSWER)
        ui.timer(0.01, part.inspect, once=True)

    async def mend(self, values: Mapping[str, object]) -> None:
        """Write keys into rig.toml, and answer anew."""
        self.draft.mends |= values
        ui.notify(f"written: {mend_words(values)}")
        await self.go(ANSWER if self.reached >= ANSWER else PART)

    async def _answer(self) -> None:
        self.frame.say("Identifying …")
        answer = self.answer = Answer(self.analyst, self.draft, self.mend)
        answer.show()
        self._end(KEEP, ready=False)
        ui.timer(0.01, lambda: self._run(answer), once=True)

    async def _run(self, answer: Answer) -> None:
        result = await answer.run()
        if result is None or answer is not self.answer:
            return
        self.frame.say(f"{STEPS[ANSWER].line(self)}." if result.parameters else "No answer yet: see what is missing.")
        if self.next is not None:
            self.next.set_enabled(bool(result.parameters))

    async def _keep(self) -> None:
        Keep(self.analyst, self.draft).show()

    def _line_of_look(self) -> str:
        return ", ".join(self.draft.logs) + (f": {rows_of(self.found)}" if self.found else "")

    def _line_of_rig(self) -> str:
        kind = self.draft.rig_kind
        return f"rig file {self.draft.name}" if self.draft.base else kind.title if kind else ""

    def _line_of_known(self) -> str:
        return "as the rig file states" if self.draft.base else f"{self.draft.filled()} stated, the rest not known"

    def _line_of_part(self) -> str:
        spans = ", ".join(f"{a:.4g} to {b:.4g} s" for a, b in self.draft.parts)
        return (spans or "whole log") if self.reached > PART else ""

    def _line_of_answer(self) -> str:
        result = None if self.answer is None else self.answer.stated
        return f"{value_and_reach(result.main, fine=True)} (95 %)" if result is not None and result.parameters else ""


def rows_of(look: Mapping[str, Any]) -> str:
    """How many rows a log has, and how long it is."""
    return f"{look['rows']} rows" + (f", {look['duration']:.4g} s" if look["duration"] else "")


STEPS = (
    LogStep("Look", "what the columns of your log are", Guide._look, line=Guide._line_of_look),
    LogStep("Which rig?", "waits for the columns of a log", Guide._rig, "Next: which rig?", Guide._line_of_rig),
    LogStep("What you know", "waits for the kind of rig", Guide._know, line=Guide._line_of_known),
    LogStep("Part", "waits for the rig", Guide._part, "Next: the part to use", Guide._line_of_part),
    LogStep("Answer", "waits for the part of the log", Guide._answer, "Answer", Guide._line_of_answer),
    LogStep("Keep", "waits for the answer", Guide._keep, "Next: keep it"),
)
"""The steps in order."""

LOOK, RIG, KNOW, PART, ANSWER, KEEP = range(len(STEPS))
