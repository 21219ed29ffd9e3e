"""The choice of the law windows: their length, and whether friction has a memory.

The length minimises the standard uncertainty of the inertia: short windows amplify sensor noise, long ones let through
what the friction basis does not describe, and both show in the scatter of the rows.
"""

from __future__ import annotations

import numpy as np

from swingid.errors import UnanswerableError
from swingid.identify.momentum.balance import Signals, rows_of
from swingid.identify.momentum.calibration import with_declared
from swingid.identify.momentum.fits import BASIS, WindowFit, fit_rows
from swingid.identify.momentum.systematics import grid_spread
from swingid.identify.momentum.windows import law_windows
from swingid.identify.noise import Noise
from swingid.identify.scale import Scale
from swingid.model.rig import Rig

DETECTED = 4.0
"""Standard uncertainties beyond which a friction memory counts as seen."""


FLAT = 1.25
"""Of windows whose uncertainties are equal within this factor the longest is taken."""


def choose_law(signals: Signals, rig: Rig, scale: Scale, noise: Noise) -> tuple[WindowFit, dict[float, WindowFit]]:
    """The "law" fit of least uncertainty, declared imperfections included, and all fits tried by half-length in s.

    If friction has a memory, an impulse at each reversal (the old direction lives on for a moment: LuGre's
    bristles, backlash, a short stick) is fitted too, where it is seen beyond noise and encoder grid. Raises
    UnanswerableError for a log too short for any window.
    """
    tried = _search(signals, scale, noise, BASIS)
    remembered = {
        half: fit
        for half, plain in tried.items()
        # over a whole swing and more, an impulse at each reversal looks like inertia
        if half < 0.55 * signals.motion.half_period
        and (fit := fit_rows(plain.rows, scale, noise, (*BASIS, "memory"))) is not None
    }
    if remembered:
        sharpest = min(remembered.values(), key=lambda fit: fit.uncertainty("memory"))
        spread = np.hypot(sharpest.uncertainty("memory"), grid_spread(signals, sharpest, noise, "memory"))
        if abs(sharpest.value("memory")) > DETECTED * spread:
            tried = remembered
    tried = {half: with_declared(fit, rig, signals, scale) for half, fit in tried.items()}
    least = min(fit.total for fit in tried.values())
    return max((fit for fit in tried.values() if fit.total <= FLAT * least), key=lambda fit: fit.half), tried


def _search(signals: Signals, scale: Scale, noise: Noise, friction: tuple[str, ...]) -> dict[float, WindowFit]:
    """Fits by half-length: octaves downwards while they get better, then the half octaves beside the best."""
    time = signals.nodes.time
    longest = min(0.75 * signals.motion.half_period, (time[-1] - time[0]) / 5)
    shortest = 4 * noise.step
    tried: dict[float, WindowFit] = {}

    def attempt(half: float) -> WindowFit | None:
        fit = fit_rows(rows_of(signals, law_windows(signals, half)), scale, noise, friction)
        if fit is not None and np.isfinite(fit.u):
            tried[half] = fit
        return tried.get(half)

    half = longest
    while half > shortest:
        fit = attempt(half)
        if fit is not None and fit.u > 2.5 * min(other.u for other in tried.values()):
            break
        half /= 2
    if not tried:
        raise UnanswerableError(
            f"the log holds {time[-1] - time[0]:.3g} s of usable motion, too little to fit inertia and friction; "
            "record at least five swings.",
            code="too-short",
        )
    best = min(tried, key=lambda length: tried[length].u)
    for neighbour in (best / np.sqrt(2), best * np.sqrt(2)):
        if shortest < neighbour < longest:
            attempt(neighbour)
    return tried
