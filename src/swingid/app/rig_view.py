"""The drawing of a rig whose body turns as the measured angle does."""

from __future__ import annotations

from nicegui.element import Element


class RigView(Element, component="rig_view.js"):
    """picture: SVG as of `kinds.drawing`."""

    def __init__(self, picture: str) -> None:
        super().__init__()
        self._props["picture"] = picture
        self.classes("w-full")

    def turn(self, angle: float) -> None:
        """Show the body at an angle (rad) from hanging."""
        self.run_method("turn", angle)
