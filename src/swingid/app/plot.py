"""A plot of channels over time in the page: uPlot 1.6 (MIT licence, in `vendor`), fed with new rows only."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from nicegui.element import Element

from swingid.numerics.arrays import Array
from swingid.result.plot import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION

COLOURS = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY)
"""Okabe and Ito's, in the order of the channels; each channel has its own dash pattern, too."""


@dataclass(frozen=True, slots=True)
class Line:
    """A channel of a plot: its name and unit; points: drawn as points without a line."""

    label: str
    unit: str = ""
    points: bool = False


class Plot(Element, component="plot.js"):
    """Channels over time. title: for people and screen readers. limits: levels drawn as dashed lines.

    window: seconds that stay in view while rows are appended; 0 keeps all. pick: called with the begin and end (s) of
    a part that a person draws with the pointer.
    """

    def __init__(
        self,
        title: str,
        lines: Sequence[Line],
        *,
        limits: Sequence[float] = (),
        window: float = 0.0,
        height: int = 180,
        pick: Callable[[float, float], None] | None = None,
    ) -> None:
        super().__init__()
        self._props["title"] = title
        self._props["lines"] = [asdict(line) | {"colour": COLOURS[k % 6]} for k, line in enumerate(lines)]
        self._props["limits"] = [float(level) for level in limits]
        self._props["window"] = window
        self._props["height"] = height
        self._props["pickable"] = pick is not None
        self.classes("w-full")
        if pick is not None:
            self.on("pick", lambda event: pick(float(event.args["from"]), float(event.args["to"])))

    def show(self, time: Array, values: Sequence[Array]) -> None:
        """Replace what is drawn by channels (n,) over time (n,)."""
        # a property, so that a plot in a tab that is not opened yet has it, too
        self._props["shown"] = [packed((time, each)) for each in values]
        self.update()

    def append(self, time: Array, values: Sequence[Array]) -> None:
        """Add rows (n,) of all channels; a browser that does not show the plot yet does without them."""
        if len(time):
            self.run_method("append", *[packed((time, each)) for each in values])

    def clear_rows(self) -> None:
        """Take all rows away."""
        self.run_method("clear")

    def shade(self, start: float, stop: float) -> None:
        """Shade what lies outside a part (s)."""
        self.run_method("shade", start, stop)


def packed(columns: Sequence[Array]) -> Mapping[str, Any]:
    """Columns (n,) as base64 of little-endian 32 bit floats, one behind the other, with their length.

    The first number of a long time is kept apart, so 32 bits suffice for the rest.
    """
    first = float(columns[0][0]) if len(columns[0]) else 0.0
    numbers = np.concatenate([np.asarray(columns[0]) - first, *columns[1:]]).astype("<f4")
    return {"first": first, "rows": len(columns[0]), "data": base64.b64encode(numbers.tobytes()).decode()}
