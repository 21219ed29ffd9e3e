"""Generalised least squares: six elements of the tensor from the inertias about n axes.

y = H x + e, H the rows h(n_i). The covariance V of y is that of all sources; the directions' part depends on the tensor
itself, hence a few passes. Weights are the inverse of V without the constants that all results have in common (the
wheel's inertia): these change the tensor as a whole, and as their effects are known from measured values only, they
would let scatter move the estimate (Peelle 1987; Chiba and Smith 1991, ANL/NDM-121). The covariance of the elements,
G V Gᵀ with x = G y, has everything. Without such constants this is the estimate of least variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swingid.body.axes import Axis
from swingid.body.directions import matrix_of, rows_of
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.pooling.pooling import Deviation
from swingid.uncertainty.budget import Parameter
from swingid.uncertainty.uncertain import Uncertain, covariance, weighted_sum

PASSES = 4
"""Passes over the tensor in the uncertainty of the directions; its change moves weights only, so two suffice."""


@dataclass(frozen=True)
class AxisRow:
    """One axis of the fit: direction (3,), inertia about it and about its parallel through the centre of mass.

    fitted: by the tensor. deviation: measured less what the other axes give, in standard uncertainties, None where
    these do not determine it.
    """

    name: str
    direction: Array
    about_axis: Parameter
    central: Parameter
    fitted: float
    deviation: float | None


@dataclass(frozen=True)
class Fit:
    """Elements of the tensor as sums of sources, values (6,), covariance (6, 6) whole and without common constants.

    measured: the central inertias with all their sources. residuals (n,): measured less fitted. chi_square of the
    residuals with `freedom` degrees of freedom, 0 of six axes.
    """

    elements: tuple[Uncertain, ...]
    values: Array
    covariance: Array
    reducible: Array
    measured: tuple[Uncertain, ...]
    residuals: Array
    chi_square: float
    freedom: int

    @property
    def matrix(self) -> Array:
        """The tensor, (3, 3)."""
        return matrix_of(self.values)


def fit(axes: Sequence[Axis], common: frozenset[str] = frozenset()) -> Fit:
    """The tensor of axes whose directions have rank 6; `common`: keys of constants of results."""
    rows = rows_of(np.stack([axis.direction for axis in axes]))
    y = np.array([axis.central.value for axis in axes])
    values = fit_linear(rows, y).values
    for _ in range(PASSES):
        measured = [axis.tilted(matrix_of(values)) for axis in axes]
        gain = gain_of(rows, measured, common)
        values = gain @ y
    elements = tuple(weighted_sum(measured, weights) for weights in gain)
    whole = covariance(elements)
    alone = covariance([_without(element, common) for element in elements])
    residuals = y - rows @ values
    maker = np.eye(len(y)) - rows @ gain
    spread = maker @ (covariance(measured) + floor(measured)) @ maker.T
    chi_square, freedom = _chi_square(residuals, spread, len(y) - 6)
    return Fit(elements, values, whole, alone, tuple(measured), residuals, chi_square, freedom)


def gain_of(rows: Array, measured: Sequence[Uncertain], common: frozenset[str]) -> Array:
    """G (6, n) with x = G y, for rows (n, 6) of rank 6; constants of `common` that all axes have are not weighed."""
    everywhere = frozenset(key for key in common if all(key in element.shifts for element in measured))
    matrix = covariance([_without(element, everywhere) for element in measured]) + floor(measured)
    scale = np.sqrt(np.diag(matrix))
    root = np.linalg.cholesky(matrix / np.outer(scale, scale))
    whitened = np.linalg.solve(root, rows / scale[:, None])
    gain: Array = np.linalg.pinv(whitened) @ np.linalg.solve(root, np.diag(1 / scale))
    return gain


def floor(measured: Sequence[Uncertain]) -> Array:
    """Variance of the rounding of the values, (n, n): no axis is better than that."""
    variances: Array = np.diag([max((1e-9 * element.value) ** 2, 1e-300) for element in measured])
    return variances


def deviations(axes: Sequence[Axis], fitted: Fit, common: frozenset[str]) -> list[Deviation | None]:
    """Each axis against the tensor of the others (leave one out), common sources cancelled; None for lack of rank."""
    rows = rows_of(np.stack([axis.direction for axis in axes]))
    result: list[Deviation | None] = []
    for k, of_axis in enumerate(fitted.measured):
        others = [j for j in range(len(axes)) if j != k]
        rest = rows[others]
        sizes = np.linalg.svd(rest, compute_uv=False)
        if len(others) < 6 or sizes[-1] < 1e-6 * sizes[0]:
            result.append(None)
            continue
        measured = [fitted.measured[j] for j in others]
        weights = rows[k] @ gain_of(rest, measured, common)
        result.append(Deviation.of(k, of_axis, weighted_sum(measured, weights)))
    return result


def _without(value: Uncertain, keys: frozenset[str]) -> Uncertain:
    return value.only(lambda key: key not in keys)


def _chi_square(residuals: Array, spread: Array, freedom: int) -> tuple[float, int]:
    """Quadratic form of the residuals in their covariance, which has the rank `freedom`."""
    if freedom < 1:
        return 0.0, 0
    powers, vectors = np.linalg.eigh(spread)
    parts = vectors[:, -freedom:].T @ residuals
    return float(np.sum(parts**2 / powers[-freedom:])), freedom
