"""The page on a log: Look, Which rig?, What you know, Part, Answer, Keep; it begins at the step that is missing."""

from __future__ import annotations

from collections.abc import Mapping
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
from swingid.app.parts import Frame, Step, main_button, plain_button
from swingid.result.brief import value_and_reach

WORDS = (
    ("Look", "what the columns of your log are"),
    ("Which rig?", "waits for the columns of a log"),
    ("What you know", "waits for the kind of rig"),
    ("Part", "waits for the rig"),
    ("Answer", "waits for the part of the log"),
    ("Keep", "waits for the answer"),
)
LOOK, RIG, KNOW, PART, ANSWER, KEEP = range(6)

SENTENCE = "Drop a log of a swinging body, and get its moment of inertia with an interval."


class Guide:
    """One browser's page on a log."""

    def __init__(self, analyst: Analyst, folder: Path, draft: Draft) -> None:
        self.analyst, self.folder, self.draft = analyst, folder, draft
        self.found: Mapping[str, Any] = {}
        self.reached = 0
        self.lines = [""] * len(WORDS)
        self.known = ""
        self.answer: Answer | None = None
        self.look = Look(analyst, folder, self._taken, self._looked)
        self.next: ui.button | None = None

    def build(self) -> None:
        """Lay the page out; what takes time is filled in as it is found."""
        known = bool(self.draft.base)
        self.frame = Frame(self.draft.name if known else "swingid", SENTENCE)
        self.look.home = self.frame.place
        with self.frame.place:
            self.steps = [Step(k + 1, word, waits, self._reopen) for k, (word, waits) in enumerate(WORDS)]
        if known:
            self.lines[RIG] = f"rig file {self.draft.name}"
            self.lines[KNOW] = "as the rig file states"
        ui.timer(0.02, self._begin, once=True)

    async def _begin(self) -> None:
        if not self.draft.logs:
            await self.go(LOOK)
            return
        self.lines[LOOK] = ", ".join(self.draft.logs)
        if not self.draft.base:
            await self.look.take(self.draft.logs)
            return
        self.reached = PART
        await self.go(PART)

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
        for k, step in enumerate(self.steps):
            if k == number:
                step.show("now", "")
            else:
                done = k < number or k < self.reached or (k == self.reached and bool(self.lines[k]))
                step.show("done" if done else "later", self.lines[k] if done else None)
        body = self.steps[number].body
        body.clear()
        self.next = None
        with body:
            await (self._look, self._rig, self._know, self._part, self._answer, self._keep)[number]()

    def _end(self, word: str, number: int, *, ready: bool = True) -> None:
        """The button that offers the next step."""
        with ui.row().classes("swingid-step-end"):
            self.next = main_button(word, lambda: self.go(number))
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
            self.next = main_button("Next: which rig?", lambda: self.go(PART if self.draft.base else RIG))
            plain_button("Another log", self._restart)
        self._looked()

    async def _restart(self) -> None:
        self.draft.logs, self.found, self.reached, self.lines[LOOK] = {}, {}, 0, ""
        self.draft.parts = []
        await self.go(LOOK)

    async def _taken(self, paths: Mapping[str, Path], look: Mapping[str, Any]) -> None:
        """Files have come."""
        self.draft.logs, self.found = dict(paths), look
        self.draft.take_guess(look)
        rows = f"{look['rows']} rows" + (f", {look['duration']:.4g} s" if look["duration"] else "")
        self.lines[LOOK] = f"{', '.join(paths)}: {rows}"
        self.frame.say(f"{rows}. Are these the right columns?")
        if self.draft.base:
            self.reached = PART
            await self.go(PART)
            return
        self.reached = LOOK
        await self.go(LOOK)

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
            self.reached = number
            for k in range(number + 1, len(WORDS)):
                self.lines[k] = ""
                self.steps[k].show("later")

    async def _rig(self) -> None:
        self.frame.say("Which of these looks like your rig?")
        first = likely(self.draft.columns, linear=self.draft.linear, returns=self.found.get("returns", True))
        rig_cards(self.draft, first, self._choose)

    async def _choose(self, name: str) -> None:
        if self.draft.kind != name:
            self.draft.kind, self.draft.answers, self.draft.mends = name, {}, {}
            self._forget(RIG)
        kind = self.draft.rig_kind
        self.lines[RIG] = kind.title if kind else ""
        await self.go(KNOW)

    async def _know(self) -> None:
        self.frame.say("What do you know of it? “Not known” is an answer, too.")
        know = Know(self.draft, self._known)
        know.show()
        self._end("Next: the part to use", PART)
        self._known()

    def _known(self) -> None:
        fine = not self.draft.trouble()[1] and not self.draft.open_fields()
        if self.next is not None:
            self.next.set_enabled(fine)
        self.frame.entitle(self.draft.name if self.draft.base or self.draft.name != "my-rig" else "swingid")
        count = self.draft.filled()
        self.lines[KNOW] = "as the rig file states" if self.draft.base else f"{count} stated, the rest not known"
        if self.draft.text() != self.known:
            self.known = self.draft.text()
            self._forget(KNOW)

    async def _part(self) -> None:
        self.frame.say("Which part of the log swings as it should?")
        part = Part(self.analyst, self.draft, self.mend)
        if not await part.show():
            return
        self._end("Answer", ANSWER)
        ui.timer(0.01, part.inspect, once=True)

    async def mend(self, values: Mapping[str, object]) -> None:
        """Write keys into rig.toml, and answer anew."""
        self.draft.mends |= values
        ui.notify("written: " + ", ".join(f"{key} = {value}" for key, value in values.items()))
        await self.go(ANSWER if self.reached >= ANSWER else PART)

    async def _answer(self) -> None:
        spans = ", ".join(f"{a:.4g} to {b:.4g} s" for a, b in self.draft.parts)
        self.lines[PART] = spans or "whole log"
        self.steps[PART].show("done", self.lines[PART])
        self.frame.say("Identifying …")
        answer = self.answer = Answer(self.analyst, self.draft, self.mend)
        answer.show()
        self._end("Next: keep it", KEEP, ready=False)
        ui.timer(0.01, lambda: self._run(answer), once=True)

    async def _run(self, answer: Answer) -> None:
        result = await answer.run()
        if result is None or answer is not self.answer:
            return
        if result.parameters:
            shown = value_and_reach(result.main, fine=True)
            self.lines[ANSWER] = f"{shown} (95 %)"
            self.frame.say(f"{shown} (95 %).")
            if self.next is not None:
                self.next.set_enabled(True)
        else:
            self.frame.say("No answer yet: see what is missing.")

    async def _keep(self) -> None:
        Keep(self.analyst, self.draft).show()
