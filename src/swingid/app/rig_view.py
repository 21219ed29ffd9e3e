"""The drawing of a rig whose body moves as the measured angle does, live or as a log is played back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

from swingid.app.kinds import Kind, drawing


class RigView(Element, component="rig_view.js"):
    """The drawing of a kind of rig; track: what it plays back, see `analysis.track_of`."""

    def __init__(self, kind: Kind, track: Mapping[str, Any] | None = None) -> None:
        super().__init__()
        self._props["picture"] = drawing(*kind.picture)
        self._props["moves"] = kind.moves
        self._props["track"] = None if track is None else dict(track)
        self.classes("w-full")

    def play(self, track: Mapping[str, Any] | None) -> None:
        """Play another track, at once; None: only what is measured now moves."""
        self._props["track"] = None if track is None else dict(track)
        self.update()

    def turn(self, angle: float, wheel: float | None = None) -> None:
        """Show the body at an angle (rad; m of a carriage) from rest, and its wheel at one (rad) to the body."""
        self.run_method("turn", angle, wheel)
