"""What pages are made of: frame, steps in order down the page, buttons, lists; with labels for screen readers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nicegui import ui

STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8")


class Frame:
    """Title, one sentence on what is going on, and the place of the steps; dark or light as the system is."""

    def __init__(self, title: str, sentence: str) -> None:
        ui.add_css(STYLE)
        ui.colors(negative="#B3261E", positive="#009E73", warning="#B26A00")
        self._dark = ui.dark_mode(None)
        self.place = ui.column().classes("swingid-page")
        with self.place:
            with ui.element("div").classes("swingid-top"):
                self._title = ui.html("", sanitize=False, tag="h1")
                ui.button(icon="contrast", on_click=lambda: self._dark.set_value(self._dark.value is not True)).props(
                    'flat round aria-label="dark or light page"'
                ).style("color: var(--quiet) !important")
            self._sentence = ui.label().classes("swingid-say").props('aria-live="polite"')
        self.entitle(title)
        self.say(sentence)

    def entitle(self, title: str) -> None:
        """Another title, of the page and of its tab."""
        with self.place:  # who asks may stand in what was taken away
            ui.page_title(f"{title} · swingid" if title != "swingid" else title)
        self._title.set_content(escaped(title))

    def say(self, sentence: str) -> None:
        """Another sentence."""
        self._sentence.set_text(sentence)


class Step:
    """One step: done (a tick and one line, folded), now (open), next (may be opened), or later (grey, with what it
    waits for).
    """

    def __init__(self, number: int, word: str, waits: str, opened: Callable[[Step], Any]) -> None:
        self.word, self.waits, self.number = word, waits, number
        self.state = "later"
        self._shown: tuple[str, str | None, bool | None] | None = None
        with ui.element("section").classes("swingid-step later") as self.frame:
            self.frame.props(f'aria-label="{word}"')
            with ui.element("button").classes("swingid-step-head") as self.head:
                self.head.props('type="button" aria-expanded="false" aria-disabled="true"')
                self.mark = ui.label(str(number)).classes("swingid-step-mark")
                with ui.element("span"):
                    ui.label(word).classes("swingid-step-title").props('role="heading" aria-level=2')
                    self.line = ui.label(waits).classes("swingid-step-line")
            self.body = ui.column().classes("swingid-step-body")
            self.body.set_visibility(False)
        self.head.on("click", lambda: opened(self))

    def show(self, state: str, line: str | None = None, *, is_open: bool | None = None) -> None:
        """Its state ("done", "now", "next", "later"), the line below its title, and whether it is open."""
        if (state, line, is_open) == self._shown:
            return
        self._shown = state, line, is_open
        self.state = state
        is_open = state == "now" if is_open is None else is_open
        self.frame.classes(replace=f"swingid-step {state}")
        self.mark.set_text("✓" if state == "done" else str(self.number))
        if line is not None or state == "later":
            self.line.set_text(self.waits if line is None else line)
        self.line.set_visibility(bool(self.line.text))
        self.body.set_visibility(is_open)
        self.head.props(f'aria-expanded="{"true" if is_open else "false"}"')
        self.head.props(f'aria-disabled="{"true" if state == "later" else "false"}"')


def main_button(word: str, action: Callable[..., Any]) -> ui.button:
    """The one button that offers what is next."""
    made = ui.button(word, on_click=action, color=None).props("unelevated no-caps")
    return made.classes("swingid-button swingid-main")


def plain_button(word: str, action: Callable[..., Any]) -> ui.button:
    """Any other button."""
    return ui.button(word, on_click=action, color=None).props("flat no-caps").classes("swingid-button swingid-plain")


def emphasise(button: ui.button, *, main: bool) -> None:
    """Make a button the main one of its step, or one of the others."""
    add, remove = ("swingid-main", "swingid-plain") if main else ("swingid-plain", "swingid-main")
    if add not in button.classes:
        button.classes(add=add, remove=remove)


def choice_button(word: str, chosen: bool, action: Callable[[], Any]) -> ui.element:
    """One of several ways that stand side by side."""
    with ui.element("button").classes("swingid-way") as made:
        made.props(f'type="button" aria-pressed="{"true" if chosen else "false"}"')
        ui.label(word)
    return made.on("click", lambda: action())


def mend_words(mend: Mapping[str, object]) -> str:
    """Keys and values that are written into rig.toml."""
    return ", ".join(f"{key} = {value}" for key, value in mend.items())


def mend_button(mend: Mapping[str, object], mended: Callable[[Mapping[str, object]], Any]) -> None:
    """What offers to write keys and values into rig.toml; nothing where there are none."""
    if mend:
        main_button(f"Set {mend_words(mend)}", lambda: mended(mend)).classes("self-start")


def entry(words: str | None, value: str, put: Callable[[str], Any], **options: Any) -> ui.input:
    """A field of text. put: called with what is typed."""
    return ui.input(words, value=value, on_change=lambda event: put(str(event.value or "").strip()), **options)


def said(place: ui.element, text: str) -> None:
    """A line in the place of what was there."""
    place.clear()
    with place:
        ui.label(text).classes("swingid-text").props('aria-live="polite"')


def html(text: str, kind: str = "") -> ui.html:
    """HTML of this program's own, of which all that others wrote went through `escaped`."""
    return ui.html(text, sanitize=False).classes(kind)


def on_page(text: str) -> str:
    """A sentence with what the page has in the place of options of a command."""
    return text.replace("--part FROM:TO", "drag over it in Part").replace("--report FILE", "Report, in Keep")


def code(text: str, name: str = "") -> str:
    """HTML of lines that are to be copied; name: for screen readers."""
    label = f' aria-label="{name}"' if name else ""
    return f'<pre class="swingid-code"{label}>{escaped(text)}</pre>'


def escaped(text: object) -> str:
    """Text for HTML."""
    from html import escape

    return escape(str(text))


@contextmanager
def more(word: str) -> Iterator[None]:
    """What is shown on demand."""
    with ui.element("details").classes("swingid-more"):
        with ui.element("summary"):
            ui.label(word).classes("inline")
        with ui.column().classes("w-full gap-2"):
            yield


MARKS = {"ok": "✓", "note": "·", "unknown": "?", "advice": "i", "repair": "!", "fault": "✕"}
"""Signs of the levels of checks, the worst last."""


def findings(checks: Iterable[Mapping[str, Any]]) -> None:
    """What an inspection found, the worst first: sign, title, sentence with what to do."""
    levels = tuple(MARKS)
    with ui.element("div").classes("w-full").props('role="list" aria-label="checks of the log"'):
        for check in sorted(checks, key=lambda check: levels.index(check["level"]), reverse=True):
            with ui.element("div").classes("swingid-finding").props('role="listitem"'):
                ui.label(MARKS[check["level"]]).props(f'title="{check["level"]}"')
                ui.label(check["title"]).classes("swingid-strong")
                remedy = check["remedy"] if check["remedy"] and check["remedy"] not in check["evidence"] else ""
                text = check["evidence"].rstrip(".")
                ui.label(f"{text}: {remedy}." if remedy else f"{text}.").classes("swingid-text")
