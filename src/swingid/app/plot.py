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
    """A channel of a plot: its name and unit; points: drawn as points without a line. colour: "" for the next one."""

    label: str
    unit: str = ""
    points: bool = False
    colour: str = ""


class Plot(Element, component="plot.js"):
    """Channels over time. title: for people and screen readers. limits: levels drawn as dashed lines.

    window: seconds that stay in view while rows are appended; 0 keeps all. pick: called with the begin and end (s) of
    a part that a person draws with the pointer; without it that zooms. band: lower end, estimate and upper end.
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
        band: Sequence[float] | None = None,
    ) -> None:
        super().__init__()
        self._props["title"] = title
        self._props["lines"] = [
            asdict(line) | {"colour": line.colour or COLOURS[k % 6]} for k, line in enumerate(lines)
        ]
        self._props["limits"] = [float(level) for level in limits]
        self._props["window"] = window
        self._props["height"] = height
        self._props["pickable"] = pick is not None
        self._props["band"] = None if band is None else [float(level) for level in band]
        self.classes("w-full")
        if pick is not None:
            self.on("pick", lambda event: pick(float(event.args["from"]), float(event.args["to"])))

    def show(self, time: Array, values: Sequence[Array]) -> None:
        """Replace what is drawn by channels (n,) over time (n,)."""
        self.show_each([(time, each) for each in values])

    def show_each(self, channels: Sequence[tuple[Array, Array]]) -> None:
        """The same, each channel with times of its own."""
        # a property, so that a plot in a step that is not opened yet has it, too
        self._props["shown"] = [packed(channel) for channel in channels]
        self.update()

    def append(self, time: Array, values: Sequence[Array]) -> None:
        """Add rows (n,) of all channels; a browser that does not show the plot yet does without them."""
        if len(time):
            self.run_method("append", *[packed((time, each)) for each in values])

    def entitle(self, title: str) -> None:
        """Another title."""
        if self._props["title"] != title:
            self._props["title"] = title
            self.update()

    def clear_rows(self) -> None:
        """Take all rows away."""
        self.run_method("clear")

    def shade(self, parts: Sequence[tuple[float, float]]) -> None:
        """Shade what lies outside of these parts (s); of none: nothing."""
        self._props["parts"] = [list(part) for part in parts]
        self.update()


def packed(columns: Sequence[Array]) -> Mapping[str, Any]:
    """Columns (n,) as base64 of little-endian 32 bit floats, one behind the other, with their length.

    The first number of a long time is kept apart, and so is the middle of the values, so 32 bits suffice for the rest.
    """
    time, *values = (np.asarray(column, dtype=float) for column in columns)
    first = float(time[0]) if len(time) else 0.0
    every = np.concatenate(values)
    good = every[np.isfinite(every)]
    middle = float(np.median(good)) if len(good) else 0.0
    numbers = np.concatenate([time - first, every - middle]).astype("<f4")
    data = base64.b64encode(numbers.tobytes()).decode()
    return {"first": first, "middle": middle, "rows": len(time), "data": data}
