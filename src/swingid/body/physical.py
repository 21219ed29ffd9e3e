"""The test whether a body can have a tensor: positive second moments of its mass; the closest tensor that one can have.

The pseudo-inertia about the centre of mass, Σ = ½ tr(J) 1 − J = ∫ x xᵀ dm, is positive semidefinite (Wensing, Kim and
Slotine 2018, IEEE RA-L 3, 60); its eigenvalues ½ tr(J) − λ_k ≥ 0 are the triangle inequality of the principal moments.
The parameters of the closest tensor are log-Cholesky, Σ = L Lᵀ with L_ii = e^{a_i} (Rucker and Wensing 2022, IEEE
RA-L 7, 3773).
"""

from __future__ import annotations

import numpy as np

from swingid.body.directions import elements_of, matrix_of, rows_of
from swingid.errors import UnanswerableError
from swingid.format import number, plus_minus
from swingid.numerics.arrays import Array
from swingid.uncertainty.significance import DETECTED
from swingid.uncertainty.uncertain import Uncertain, weighted_sum

THIN = 1e-6
"""Least second moment of the closest tensor over the largest: a thin body is at the edge, where none has a density."""

TRACE = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def second_moments(matrix: Array) -> Array:
    """∫ x xᵀ dm about the centre of mass (3, 3), of a tensor (3, 3); the tensor of second moments Σ is tr(Σ) 1 − Σ."""
    moments: Array = 0.5 * np.trace(matrix) * np.eye(3) - matrix
    return moments


def least_second_moment(matrix: Array, elements: tuple[Uncertain, ...]) -> Uncertain:
    """The least ∫ (e·x)² dm over directions e, negative where no body has the tensor."""
    _, vectors = np.linalg.eigh(second_moments(matrix))
    return weighted_sum(elements, 0.5 * TRACE - rows_of(vectors[:, :1].T)[0])


def require_physical(matrix: Array, elements: tuple[Uncertain, ...], hint: str) -> bool:
    """Return whether a body can have the tensor; False where it cannot, within the uncertainty.

    Raises UnanswerableError where the triangle inequality is violated beyond it. hint: what to check.
    """
    least = least_second_moment(matrix, elements)
    if least.value >= 0:
        return True
    moments = np.linalg.eigvalsh(matrix)[::-1]
    if -least.value <= DETECTED * least.u:
        return False
    shown = ", ".join(number(float(moment), "", 4) for moment in moments)
    gap = plus_minus(-2 * least.value, 2 * least.u, "kg m^2")
    raise UnanswerableError(
        f"no body has the principal moments {shown} kg m²: the largest exceeds the sum of the others by {gap} "
        f"(triangle inequality); {hint}.",
        code="not-physical",
    )


def closest(values: Array, covariance: Array) -> Array:
    """Elements (6,) that a body can have, the closest to `values` in the metric of their covariance (6, 6)."""
    from scipy.optimize import least_squares

    moments = second_moments(matrix_of(values))
    powers, vectors = np.linalg.eigh(moments)
    size = float(powers[-1])
    start = np.linalg.cholesky((vectors * np.maximum(powers, 1e-3 * size)) @ vectors.T / size)
    lower = np.tril_indices(3, -1)
    scale = np.sqrt(np.diag(covariance))
    spreads, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    whiten = (axes / np.sqrt(np.maximum(spreads, 1e-12 * spreads[-1]))).T / scale

    def elements(parameters: Array) -> Array:
        factor = np.diag(np.exp(parameters[:3]))
        factor[lower] = parameters[3:]
        matrix = size * factor @ factor.T
        return elements_of(np.trace(matrix) * np.eye(3) - matrix)

    first = np.r_[np.log(np.diag(start)), start[lower]]
    least = np.r_[np.full(3, 0.5 * np.log(THIN)), np.full(3, -np.inf)]
    # a start on the bound is none for least_squares
    first[:3] = np.maximum(first[:3], least[:3] + 1e-3)
    solution = least_squares(
        lambda p: whiten @ (elements(p) - values), first, bounds=(least, np.inf), xtol=1e-14, ftol=1e-14, gtol=1e-14
    )
    result: Array = elements(solution.x)
    return result
