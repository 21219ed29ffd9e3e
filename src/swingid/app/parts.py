"""What pages are made of: frame, steps, tables, results side by side; with labels for screen readers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from nicegui import ui

from swingid.format import interval, plus_minus

STYLE = """
body { font-family: system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
.swingid-plot-title { font-size: 0.85rem; opacity: 0.8; }
.u-legend { font-size: 0.75rem; }
.body--dark .u-legend { color: #d8dce0; }
table.swingid { border-collapse: collapse; width: 100%; font-size: 0.9rem; }
table.swingid th { text-align: left; font-weight: 600; border-bottom: 1px solid #767676; padding: 4px 8px; }
table.swingid td { border-bottom: 1px solid rgba(118,118,118,.3); padding: 4px 8px; vertical-align: top; }
table.swingid td.number { white-space: nowrap; font-variant-numeric: tabular-nums; }
.swingid-scroll { overflow-x: auto; width: 100%; }
:focus-visible { outline: 3px solid #E69F00; outline-offset: 2px; }
"""


WAITS = "…"
"""In the place of a value that is being computed."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a page: its name in the code and the word on its tab."""

    name: str
    word: str


def page_frame(title: str, *, rig: str) -> ui.header:
    """Title, header and the style that every page has; dark or light as the system is, until a person chooses."""
    ui.page_title(f"swingid · {title}")
    ui.add_css(STYLE)
    ui.colors(primary="#0072B2", negative="#D55E00", positive="#009E73", warning="#E69F00")
    dark = ui.dark_mode(None)
    with ui.header(wrap=False).classes("items-center justify-between py-1") as header:
        with ui.column().classes("gap-0 min-w-0"):
            ui.label(title).classes("text-lg font-semibold truncate max-w-full").props('role="heading" aria-level=1')
            ui.label(f"rig file {rig}").classes("text-xs truncate max-w-full")
        ui.button(icon="contrast", on_click=lambda: dark.set_value(dark.value is not True)).props(
            'flat round color=white aria-label="dark or light page"'
        )
    return header


@contextmanager
def steps(
    all_steps: Sequence[Step], shown: str | None = None
) -> Iterator[tuple[Mapping[str, ui.tab], Mapping[str, ui.tab_panel]]]:
    """Tabs of the steps, `shown` or the first one open, and their panels; one that must wait: see `ready`."""
    with ui.tabs().classes("w-full").props("inline-label outside-arrows mobile-arrows no-caps") as tabs:
        found = {step.name: ui.tab(step.name, f"{k + 1}. {step.word}") for k, step in enumerate(all_steps)}
    with ui.tab_panels(tabs, value=shown or all_steps[0].name).classes("w-full").props("keep-alive animated=false"):
        panels = {step.name: ui.tab_panel(step.name) for step in all_steps}
    yield found, panels


def ready(tab: ui.tab, is_ready: bool) -> None:
    """Whether a step can be gone to."""
    tab.props(remove="disable") if is_ready else tab.props("disable")


def heading(text: str) -> None:
    """A heading within a step."""
    ui.label(text).classes("text-lg font-semibold").props('role="heading" aria-level=2')


def said(place: ui.element, text: str) -> None:
    """A line in the place of what was there."""
    place.clear()
    with place:
        ui.label(text).props('aria-live="polite"')


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()) -> None:
    """A plain table that a screen reader reads; it scrolls where a phone is narrower. numbers: columns not broken."""
    with ui.element("div").classes("swingid-scroll"), ui.element("table").classes("swingid") as made:
        made.props(f'aria-label="{caption}"')
        with ui.element("thead"), ui.element("tr"):
            for word in head:
                with ui.element("th").props('scope="col"'):
                    ui.label(word)
        with ui.element("tbody"):
            for row in rows:
                with ui.element("tr"):
                    for k, text in enumerate(row):
                        with ui.element("td").classes("number" if k in numbers else ""):
                            ui.label(text)


class Answers:
    """Results of several methods in one table, each filled in when it is there."""

    def __init__(self, caption: str) -> None:
        self.caption = caption
        self.rows: dict[str, Sequence[str]] = {}
        self.place = ui.column().classes("w-full")

    def wait(self, methods: Iterable[str]) -> None:
        """Empty rows for these methods."""
        self.rows = dict.fromkeys(methods, (WAITS, "", "", ""))
        self._draw()

    def put(self, method: str, found: Mapping[str, Any]) -> None:
        """The result of a method, as its JSON."""
        self.rows[method] = answer_row(found)
        self._draw()

    def put_rest(self, found: Mapping[str, Any]) -> None:
        """The same for all methods that have none."""
        self.rows = {name: answer_row(found) if row[0] == WAITS else row for name, row in self.rows.items()}
        self._draw()

    def _draw(self) -> None:
        self.place.clear()
        head = ("method", "value ± standard uncertainty", "95 % interval", "status", "what it says")
        with self.place:
            table(self.caption, head, [(name, *row) for name, row in self.rows.items()], numbers=(1, 2))


def answer_row(found: Mapping[str, Any]) -> Sequence[str]:
    """Value, interval, status and warnings of a result."""
    said = " ".join(message["message"] for message in found["warnings"])
    if found["error"] is not None or not found["parameters"]:
        return ("–", "–", found["status"], found["error"]["message"] if found["error"] else said)
    name, main = next(iter(found["parameters"].items()))
    value, bounds = main["value"], main["interval95"]
    shown = plus_minus(value, main["standard_uncertainty"], main["unit"])
    within = interval(tuple(bounds), main["unit"], middle=value) if bounds else "–"
    return (shown if name == "inertia" else f"{name} {shown}", within, found["status"], said)
