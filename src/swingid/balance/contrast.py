"""Values that are linear in the rows of a fit, as a difference of two estimates is: their variances of type A."""

from __future__ import annotations

import numpy as np

from swingid.balance.fits import LAG, WindowFit, sensor_variance, with_excess
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit


def variances(fit: WindowFit, influence: Array, residuals: Array | None = None, unknowns: int | None = None) -> Array:
    """Variances (..., m) of values of this influence (..., m, windows), as those of the inertia of a fit.

    By sensor noise, and by the scatter of the residuals (of the fit, if not given) beyond it. unknowns: which these
    residuals (..., windows) have used, if not those of the fit.
    """
    left = fit.fit.residuals if residuals is None else residuals
    used = len(fit.unknowns) if unknowns is None else unknowns
    rows = len(fit.rows)
    wide = LinearFit(np.zeros(used), left, influence, 1.0)
    scattered = wide.covariance(LAG).diagonal(0, -2, -1)
    sensor, seen = sensor_variance(fit.rows, influence, fit.coefficients, fit.noise)
    found: Array = with_excess(sensor, seen, scattered, max(rows - used, 1))
    return found
