"""What was measured: the channels of the log over one time axis, the part that was used marked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.report.style import envelope, new_figure, prefixed
from swingid.result.plot import BLUE, GREY, INK, ORANGE, PALE, PURPLE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Panel:
    """One quantity over time, with a second line behind it where there is one to compare."""

    label: str
    unit: str
    values: Array
    colour: str
    behind: Array | None = None


def draw_log(log: Recording, unused: Iterable[tuple[float, float]], *, linear: bool) -> Figure:
    """Panels of all channels that `log` has; the parts `unused` (s) are greyed."""
    panels = panels_of(log, linear=linear)
    figure, axes = new_figure(0.6 + 1.05 * len(panels), len(panels), share_time=True)
    for ax, panel in zip(axes, panels, strict=True):
        _draw(ax, log.time, panel)
        for begin, end in unused:
            ax.axvspan(begin, end, color=PALE, lw=0, zorder=0)
    axes[-1].set_xlabel("time, s")
    axes[-1].set_xlim(log.time[0], log.time[-1])
    figure.align_ylabels(axes)
    return figure


def panels_of(log: Recording, *, linear: bool) -> list[Panel]:
    """The channels that the log has, in the order of the drawing, in SI units."""
    angle, name = ("m", "position") if linear else ("rad", "angle")
    panels = [Panel(name, angle, log.angle, BLUE, log.reference)]
    if log.reference is not None:
        panels.append(Panel("tracking error", angle, log.reference - log.angle, VERMILION))
    if log.wheel_angle is not None:
        panels.append(Panel("wheel speed", "rad/s", speed_of(log.time, log.wheel_angle, wheel_span(log)), PURPLE))
    if log.voltage is not None:
        panels.append(Panel("voltage", "V", log.voltage, ORANGE))
    if log.torque is not None:
        panels.append(Panel("force" if linear else "torque", "N" if linear else "N m", log.torque, ORANGE))
    if log.adaptive_gain is not None and np.isfinite(log.adaptive_gain).any():
        made = log.metadata.get("simulation")
        backstepping = isinstance(made, dict) and str(made.get("controller")).startswith("Backstepping")
        panels.append(Panel("estimate α̂₂" if backstepping else "adaptive gain k̃", "", log.adaptive_gain, INK))
    return panels


def wheel_span(log: Recording) -> float:
    """Time in s over which the wheel's angle is differenced: 10 ms, or one step of a slower log on either side."""
    return max(0.01, 2 / log.rate) if len(log) > 1 else 0.01


def speed_of(time: Array, angle: Array, span: float) -> Array:
    """Difference quotient of `angle` over about `span` seconds around each sample, for drawing only."""
    first = np.searchsorted(time, time - 0.5001 * span)
    last = np.searchsorted(time, time + 0.5001 * span, side="right") - 1
    spread = time[last] - time[first]
    usable = spread > 0
    return np.where(usable, (angle[last] - angle[first]) / np.where(usable, spread, 1.0), np.nan)


def _draw(ax: Axes, time: Array, panel: Panel) -> None:
    factor, unit = prefixed(panel.values, panel.unit)
    if panel.behind is not None:
        ax.plot(*envelope(time, panel.behind * factor), color=GREY, lw=0.9, ls=(0, (4, 2)))
    ax.plot(*envelope(time, panel.values * factor), color=panel.colour, lw=0.8)
    ax.set_title(f"{panel.label} (dashed: its reference)" if panel.behind is not None else panel.label, pad=3)
    ax.set_ylabel(unit)
    ax.locator_params(axis="y", nbins=4)
