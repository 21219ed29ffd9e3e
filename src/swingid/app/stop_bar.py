"""The bar at the foot of a live page: the state in words, and STOP; it says itself where it has lost the server."""

from __future__ import annotations

import time
from collections.abc import Callable

from nicegui import ui
from nicegui.element import Element

BEAT = 0.5
"""Seconds between two signs of life of the server; a page that gets none for 2 s says that it is not connected."""

FRESH = 4
"""Beats within which a press counts: what waited longer in a lost connection would act unexpected."""


class StopBar(Element, component="stop_bar.js"):
    """State and STOP. on_stop: called for each press that has arrived."""

    def __init__(self, on_stop: Callable[[], None]) -> None:
        super().__init__()
        self._on_stop = on_stop
        self._began = time.monotonic()
        self._props.update({"words": "", "moves": False, "share": 0.0, "beat": 0, "heard": 0})
        self.on("stop", self._pressed)
        ui.add_css("#popup { display: none; }")  # NiceGUI's own word for a lost connection, which would cover this

    def show(self, words: str, *, moves: bool, share: float = 0.0) -> None:
        """The state; moves: whether a motor can move; share: of the step's time that is over. With a sign of life."""
        self._set("words", words)
        self._set("moves", moves)
        self._set("share", round(share, 3))
        self._set("beat", self._now())

    def is_fresh(self, beat: object) -> bool:
        """Return whether a press is one of now; beat: the last one that its page had seen."""
        return isinstance(beat, int) and 0 <= self._now() - beat <= FRESH

    def _now(self) -> int:
        return int((time.monotonic() - self._began) / BEAT)

    def _pressed(self, event: object) -> None:
        count = getattr(event, "args", None)
        if isinstance(count, int):
            self._set("heard", count)
        self._on_stop()

    def _set(self, name: str, value: object) -> None:
        if self._props.get(name) != value:
            self._props[name] = value
            self.update()
