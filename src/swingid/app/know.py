"""The steps Which rig? and What you know: drawings as cards; the fields that this rig needs, rig.toml as it grows."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from nicegui import ui

from swingid.app.draft import Draft
from swingid.app.kinds import KINDS, Field, Question, drawing
from swingid.app.parts import choice_button, code, entry, html, plain_button
from swingid.errors import SwingidError
from swingid.model.rig import Rig

MISSING = {
    "angle": "the angle",
    "angle_speed": "its rate",
    "wheel_angle": "the angle of the wheel",
    "wheel_speed": "its speed",
    "voltage": "the voltage",
    "torque": "the torque or force",
}


def rig_cards(draft: Draft, first: str, chosen: Callable[[str], Any]) -> None:
    """The kinds of rigs as cards, the likely one first; one whose columns are missing says which."""
    with ui.element("div").classes("swingid-cards"):
        for kind in sorted(KINDS, key=lambda kind: kind.name != first):
            missing = kind.missing(draft.columns)
            wrong = "" if not missing else f"Needs a column of {' or '.join(MISSING[role] for role in missing)}."
            if not wrong and kind.linear != draft.linear:
                wrong = "Needs an angle: its unit in Look is one of length."
                if kind.linear:
                    wrong = "Needs a position: set its unit in Look to m."
            with ui.element("button").classes("swingid-card") as card:
                card.props(f'type="button" aria-pressed="{"true" if kind.name == draft.kind else "false"}"')
                if wrong:
                    card.props('aria-disabled="true"')
                html(drawing(*kind.picture))
                ui.label(kind.title).classes("swingid-card-title")
                ui.label(wrong or kind.words).classes("swingid-quiet")
                if kind.name == first and not wrong:
                    ui.label("likely, by the columns").style("color: var(--accent)").classes("text-sm")
            if not wrong:
                card.on("click", lambda name=kind.name: chosen(name))


class Know:
    """Content of the step What you know. changed: called after each answer."""

    def __init__(self, draft: Draft, changed: Callable[[], None]) -> None:
        self.draft, self.changed = draft, changed
        self.wrong: dict[str, ui.label] = {}
        self.code: ui.html

    def show(self) -> None:
        """Questions beside the drawing and the rig.toml that follows."""
        kind = self.draft.rig_kind
        if self.draft.base or kind is None:
            self._show_text()
            return
        with ui.element("div").classes("swingid-columns"):
            self.place = ui.column().classes("w-full gap-0")
            with ui.column().classes("w-full gap-2"):
                html(drawing(*kind.picture), "w-full swingid-measured")
                ui.label("rig.toml").classes("swingid-strong")
                self.code = html("", "w-full")
                plain_button("Copy", lambda: ui.clipboard.write(self.draft.text()))
        self._fill()

    def _show_text(self) -> None:
        """A rig file that was given, to be edited as text."""
        area = ui.textarea(value=self.draft.text()).props('outlined autogrow aria-label="rig.toml"').classes("w-full")
        area.props('input-class="swingid-mono"')
        note = ui.label().classes("swingid-wrong")

        def take() -> None:
            try:
                rig = Rig.from_text(str(area.value or ""))
            except SwingidError as error:
                note.set_text(error.message)
                return
            note.set_text("")
            self.draft.base, self.draft.name, self.draft.mends = rig.text, rig.name, {}
            self.changed()

        plain_button("Use this text", take)

    def _fill(self) -> None:
        kind = self.draft.rig_kind
        assert kind is not None
        self.place.clear()
        self.wrong = {}
        with self.place:
            for question in kind.questions:
                if self.draft.asks(question):
                    self._question(question)
            if kind.name == "flywheel" and len(self.draft.logs) > 1:
                self._bodies()
            self._name()
            self.rest = ui.label().classes("swingid-quiet").props('aria-live="polite"')
        self._check()

    def _name(self) -> None:
        with ui.element("div").classes("swingid-question"):
            ui.label("Name of the rig").classes("swingid-strong")
            made = entry(None, self.draft.name, self._set_name)
            made.props('dense outlined aria-label="name of the rig"').classes("w-full")

    def _set_name(self, name: str) -> None:
        self.draft.name = name or "my-rig"
        self._check()

    def _question(self, question: Question) -> None:
        number, texts = self.draft.answers.get(question.name, (0, {}))
        choice = question.ways[number]
        with ui.element("div").classes("swingid-question").props(f'role="group" aria-label="{question.words}"'):
            with ui.column().classes("gap-1"):
                ui.label(question.words).classes("swingid-strong")
                ui.label(question.where).classes("swingid-quiet")
            with ui.column().classes("gap-2 w-full"):
                with ui.element("div").classes("swingid-chips"):
                    for k, offered in enumerate(question.ways if len(question.ways) > 1 else ()):
                        choice_button(offered.words, k == number, partial(self._choose, question, k))
                for each in choice.fields:
                    self._field(question, each, texts.get(each.key, ""))
                if choice.cost:
                    ui.label(choice.cost).classes("swingid-quiet")

    def _field(self, question: Question, field: Field, text: str) -> None:
        def put(event: Any) -> None:
            number, texts = self.draft.answers.get(question.name, (0, {}))
            self.draft.answers[question.name] = (number, {**texts, field.key: str(event.value or "").strip()})
            self._check()

        if field.options:
            value = text if text in field.options else None
            made: Any = ui.select(list(field.options), value=value, label=field.words, on_change=put)
        else:
            made = ui.input(field.words, value=text, placeholder=field.example, on_change=put).props("debounce=250")
        made.props(f'outlined dense stack-label aria-label="{field.words}"').classes("w-full")
        self.wrong[field.key] = ui.label().classes("swingid-wrong").props('aria-live="polite"')

    def _choose(self, question: Question, number: int) -> None:
        texts = self.draft.answers.get(question.name, (0, {}))[1]
        self.draft.answers[question.name] = (number, texts)
        self._fill()

    def _bodies(self) -> None:
        """The known body on the axis in each log."""
        self.draft.added = (self.draft.added + [""] * len(self.draft.logs))[: len(self.draft.logs)]

        def put(k: int, text: str) -> None:
            self.draft.added[k] = text
            self._check()

        with ui.element("div").classes("swingid-question"):
            with ui.column().classes("gap-1"):
                ui.label("Known body on the wheel").classes("swingid-strong")
                text = "Its inertia in each log, 0 for none. Without one the answer is friction over inertia."
                ui.label(text).classes("swingid-quiet")
            with ui.column().classes("gap-2 w-full"):
                for k, name in enumerate(self.draft.logs):
                    made = entry(name, self.draft.added[k], partial(put, k), placeholder="2.000 ± 0.002 g m²")
                    made.props("outlined dense stack-label").classes("w-full")

    def _check(self) -> None:
        """What is wrong, beside its field; what was read; the rig.toml; the next step."""
        key, sentence = self.draft.trouble()
        kind = self.draft.rig_kind
        fields = [
            (field, texts)
            for question in (kind.questions if kind else ())
            for choice, texts in [self.draft.way(question)]
            for field in choice.fields
        ]
        for field, texts in fields:
            if field.key not in self.wrong:
                continue
            typed = bool(texts.get(field.key))
            bad = field.key == key and typed
            read = self.draft.read_as(field.key) if typed and not field.options else ""
            self.wrong[field.key].set_text(sentence if bad else f"= {read} in SI units" if read else "")
            self.wrong[field.key].classes(replace="swingid-wrong" if bad else "swingid-quiet")
        empty = self.draft.open_fields()
        seen = any(field.key == key and texts.get(field.key) for field, texts in fields)
        missing = f"Still to fill in, or “not known”: {', '.join(empty)}." if empty else ""
        above = "A field above is not right: "
        self.rest.set_text(missing or (f"{above}{sentence}" if seen else self.draft.where_to_say(key, sentence)))
        self.rest.classes(replace="swingid-quiet" if missing else "swingid-wrong")
        self.code.set_content(code(self.draft.text(), "rig.toml"))
        self.changed()
