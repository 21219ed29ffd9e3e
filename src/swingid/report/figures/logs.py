"""One inertia per log, of several."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swingid.report.style import new_figure
from swingid.result.plot import plot_result
from swingid.result.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_logs(result: Result) -> Figure | None:
    """`plot_result` of several logs on a figure of the report; None for one log."""
    if not result.per_log:
        return None
    figure, (axes,) = new_figure(3.3)
    plot_result(result, axes)
    return figure
