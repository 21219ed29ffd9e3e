"""SciPy: least_squares over solve_ivp, one long shot with unknown initial state, as its manual and many a script do."""

from __future__ import annotations

import numpy as np
from problem import SCALE, START, Log, slope

NAME, PACKAGES = "SciPy, least_squares over solve_ivp", ("scipy",)


def fit(log: Log) -> float:
    from scipy.integrate import solve_ivp
    from scipy.optimize import least_squares

    voltage, readings = log.voltage, log.angles
    last = len(voltage) - 1

    def predicted(unknown: np.ndarray) -> np.ndarray:
        theta = tuple(SCALE * unknown[:3])

        def right(t: float, x: np.ndarray) -> tuple:
            # held to the next sample; a step never goes beyond one, and its end belongs to it
            return slope(np, x, voltage[min(int((t - 1e-9) * 1000.0 + 1e-6), last)], theta, log.motor)

        found = solve_ivp(right, (0.0, log.time[-1]), unknown[3:], t_eval=log.time, rtol=1e-6, max_step=log.step)
        return found.y[[0, 2]].T

    def residuals(unknown: np.ndarray) -> np.ndarray:
        return ((predicted(unknown) - readings) / log.noise).ravel()

    first = np.concatenate([np.array(START) / SCALE, log.first_state])
    found = least_squares(residuals, first, x_scale=np.array([1, 1, 1, 1e-3, 1e-2, 1e-2, 1e-1]))
    return float(SCALE[0] * found.x[0])
