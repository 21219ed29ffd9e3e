"""One inertia per swing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.report.style import new_figure
from swingid.result.plot import GREEN, draw_swing_points, plot_result
from swingid.result.result import COVERAGE_FACTOR, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HIDDEN = 5.0
"""How many times wider than the swings the answer's band must be for them to get a panel of their own."""


def draw_swings(result: Result) -> Figure | None:
    """`plot_result` on a figure of the report; None where the method gives one number for all swings.

    Where the band of the answer is so wide that the swings are a line in it, a second panel shows them alone.
    """
    swings = result.details.swings if result.details else None
    if swings is None or len(swings.times) == 0:
        return None
    inertia = result.inertia
    reach = COVERAGE_FACTOR * np.nan_to_num(swings.uncertainties)
    size = float(np.max(swings.values + reach) - np.min(swings.values - reach))
    hidden = inertia.interval95 is not None and inertia.interval95[1] - inertia.interval95[0] > HIDDEN * size
    figure, axes = new_figure(5.0 if hidden and inertia.value else 3.3, 2 if hidden and inertia.value else 1)
    plot_result(result, axes[0])
    if len(axes) > 1:
        draw_swing_points(axes[1], swings, scale=100 / inertia.value, offset=-100.0)
        axes[1].axhline(0.0, color=GREEN, lw=1.6, zorder=0.6)
        axes[1].set_title("the swings alone, with what scatter and sensors explain (95 %)", pad=4)
        axes[1].set_ylabel("from the answer, %")
        axes[1].set_xlabel(axes[0].get_xlabel())
        axes[0].set_xlabel("")
        axes[1].set_xlim(axes[0].get_xlim())
    return figure
