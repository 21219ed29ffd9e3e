"""Directions of axes: rows of the design, how well they determine a tensor, and the best next axis.

A tensor J has the elements (xx, yy, zz, xy, xz, yz), J_xy = −∫xy dm; the inertia about an axis n through the centre of
mass is h(n) · elements.
"""

from __future__ import annotations

import math

import numpy as np

from swingid.numerics.arrays import Array

NAMES = ("xx", "yy", "zz", "xy", "xz", "yz")
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""How often each element is in the matrix: weights of the squared Frobenius norm."""

TRIED = 2000
"""Directions tried for the next axis: 3° apart."""

RANK = 1e-6
"""Singular value over the largest one below which a direction of the six elements is not seen at all."""


def rows_of(directions: Array) -> Array:
    """Rows h (n, 6) with nᵀ J n = h · elements, of unit vectors (n, 3)."""
    x, y, z = np.asarray(directions, dtype=np.float64).T
    rows: Array = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z], axis=1)
    return rows


def matrix_of(elements: Array) -> Array:
    """The symmetric matrix (3, 3) of six elements."""
    matrix = np.empty((3, 3))
    for value, (i, j) in zip(elements, PLACES, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def elements_of(matrix: Array) -> Array:
    """The six elements of a symmetric matrix (3, 3)."""
    return np.array([matrix[i, j] for i, j in PLACES])


def row_between(a: Array, b: Array) -> Array:
    """Row (6,) with aᵀ J b = row · elements."""
    row: Array = elements_of((np.outer(a, b) + np.outer(b, a)) / 2) * TWICE
    return row


def rank_of(directions: Array) -> int:
    """Number of independent equations for the six elements, at most 6."""
    sizes = np.linalg.svd(rows_of(directions), compute_uv=False)
    return int(np.sum(sizes > RANK * sizes[0]))


def condition(directions: Array) -> float:
    """Largest over smallest singular value of the rows: icosahedron's six axes 1.6, three axes and diagonals 2.6."""
    return float(np.linalg.cond(rows_of(directions)))


def hemisphere(count: int = TRIED) -> Array:
    """Unit vectors (count, 3) spread evenly over the upper half (golden spiral); an axis has no sign."""
    k = np.arange(count) + 0.5
    z, angle = k / count, math.pi * (1 + math.sqrt(5)) * k
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def missing_direction(directions: Array) -> Array:
    """The direction (3,) that shows most of what the others do not determine."""
    _, sizes, vectors = np.linalg.svd(rows_of(directions))
    unseen = vectors[np.r_[sizes, np.zeros(6 - len(sizes))] <= RANK * sizes[0]]
    tried = hemisphere()
    direction: Array = tried[int(np.argmax(np.sum((rows_of(tried) @ unseen.T) ** 2, axis=1)))]
    return direction


def next_direction(covariance: Array, variances: Array) -> tuple[Array, float]:
    """The direction (3,) whose measurement reduces Σ u² of all nine elements most, and the share that is left.

    covariance (6, 6): what further axes can reduce. variances (TRIED,): of a measurement about each direction of
    `hemisphere()`. A measurement with row h and variance v leaves C − C h hᵀ C/(v + hᵀ C h).
    """
    rows = rows_of(hemisphere())
    gains = rows @ covariance
    removed = (gains**2 @ TWICE) / (variances + np.sum(gains * rows, axis=1))
    best = int(np.argmax(removed))
    total = float(np.diag(covariance) @ TWICE)
    direction: Array = hemisphere()[best]
    return direction, 1 - float(removed[best]) / total
