"""Friction against speed: what the log shows, and the law that describes it best."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.report.style import legend_above, new_figure, prefixed
from swingid.result.plot import BLUE, GREY, VERMILION
from swingid.result.result import COVERAGE_FACTOR, FrictionCurve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONG = 36
"""Letters of a law's name that no longer leave room for two columns of the legend."""


def draw_friction(curve: FrictionCurve, *, linear: bool) -> Figure | None:
    """Torque (or force) over speed with 95 % bars; the law is drawn apart for the two directions of motion."""
    known = np.isfinite(curve.torques)
    if not known.any():
        return None
    torque, speed = ("N", "m/s") if linear else ("N m", "rad/s")
    factor, unit = prefixed(np.concatenate([curve.torques, curve.law_torques]), torque)
    speed_factor, speed_unit = prefixed(curve.speeds, speed)
    figure, (ax,) = new_figure(3.1)
    ax.axhline(0, color=GREY, lw=0.7)
    ax.axvline(0, color=GREY, lw=0.7)
    for k, side in enumerate((curve.speeds < 0, curve.speeds > 0)):
        ax.plot(
            curve.speeds[side] * speed_factor,
            curve.law_torques[side] * factor,
            color=VERMILION,
            lw=1.6,
            label=f"law: {curve.law}" if k == 0 and curve.law else None,
        )
    ax.errorbar(
        curve.speeds[known] * speed_factor,
        curve.torques[known] * factor,
        yerr=COVERAGE_FACTOR * np.nan_to_num(curve.uncertainties[known], nan=0.0) * factor,
        fmt="o",
        ms=4,
        mew=0,
        color=BLUE,
        elinewidth=0.9,
        label="from the log, without a law (95 %)",
    )
    ax.set_xlabel(f"{'speed' if linear else 'angular speed'}, {speed_unit}")
    ax.set_ylabel(f"{'force' if linear else 'torque'}, {unit}")
    legend_above(ax, 2 if len(curve.law) < LONG else 1)
    return figure
