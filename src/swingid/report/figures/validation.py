"""Measured and predicted angle of one log, and the error of the prediction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.report.style import envelope, legend_above, new_figure, prefixed
from swingid.result.plot import BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.study.validate import Prediction

CLOSE = 5.0
"""The upper panel shows the last so many swings, where a free run has had most time to go astray."""


def draw_validation(prediction: Prediction, *, linear: bool = False) -> Figure:
    """Above: the end of the log, measured and in the free run. Below: the error of both predictions over the log.

    The legend says the normalised fit of each in per cent.
    """
    from swingid.study.validate.text import fit_text

    figure, (top, bottom) = new_figure(4.2, 2)
    unit = "m" if linear else "rad"
    time, measured = prediction.time, prediction.measured
    shown = slice(-min(len(time), _rows_of_swings(measured)), None)
    top.plot(time[shown], measured[shown], color=GREY, lw=2.6, label="measured")
    top.plot(
        time[shown], prediction.free[shown], color=BLUE, lw=1.2, ls="--", label="free run from the start of the log"
    )
    top.set_ylabel(f"{'position' if linear else 'angle'}, {unit}")
    top.set_title("the end of the log", loc="right", color=GREY)
    legend_above(top)
    errors = {
        f"free run, fit {fit_text(prediction.free_fit)}": (prediction.free, BLUE),
        f"one swing ahead, fit {fit_text(prediction.swing_fit)}": (prediction.swing, ORANGE),
    }
    finite = [values - measured for values, _ in errors.values() if np.isfinite(values).all()]
    factor, name = prefixed(np.concatenate(finite) if finite else np.zeros(1), unit)
    for label, (values, colour) in errors.items():
        if np.isfinite(values).all():
            bottom.plot(*envelope(time, factor * (values - measured)), color=colour, lw=0.9, label=label)
    bottom.set_ylabel(f"error, {name}")
    bottom.set_xlabel("time, s")
    legend_above(bottom)
    return figure


def _rows_of_swings(measured: np.ndarray) -> int:
    """Rows that hold the last swings: from the sign changes of the angle about its mean."""
    crossings = np.nonzero(np.diff(np.sign(measured - measured.mean())))[0]
    if len(crossings) < CLOSE + 1:
        return len(measured)
    return int(len(measured) - crossings[-int(CLOSE) - 1])
