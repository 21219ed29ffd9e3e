"""Principal moments and axes of a tensor with their uncertainties, by perturbation of the eigenvalues.

δλ_k = e_kᵀ δJ e_k, δe_k = Σ_j e_j (e_jᵀ δJ e_k)/(λ_k − λ_j): first order holds where the moments are apart by more than
their uncertainties. Where two are not, the axes in their plane are not determined, and only the hull of both intervals
contains the moments with the stated probability: sorting pushes estimates of equal moments apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.body.directions import row_between, rows_of
from swingid.numerics.arrays import Array
from swingid.uncertainty.budget import Parameter
from swingid.uncertainty.significance import DETECTED
from swingid.uncertainty.uncertain import Uncertain, weighted_sum


@dataclass(frozen=True)
class Principal:
    """A principal moment, its axis (3,), the standard uncertainty of its direction (rad) towards the worst side.

    together: numbers of the moments it is not distinguishable from; its axis is then not determined (angle nan).
    """

    moment: Parameter
    direction: Array
    angle: float
    together: tuple[int, ...] = ()


def principal(matrix: Array, elements: Sequence[Uncertain], unit: str) -> tuple[Principal, ...]:
    """Principal moments of a tensor (3, 3), the largest first; `elements` give the uncertainty."""
    moments, vectors = np.linalg.eigh(matrix)
    moments, axes = moments[::-1], vectors[:, ::-1].T
    axes = np.array([axis * (1.0 if axis[np.argmax(np.abs(axis))] > 0 else -1.0) for axis in axes])
    values = [weighted_sum(elements, row) for row in rows_of(axes)]
    alike = [[_alike(values[i], values[j]) or i == j for j in range(3)] for i in range(3)]
    if alike[0][1] and alike[1][2]:
        alike = [[True] * 3] * 3
    principals = []
    for k in range(3):
        together = tuple(j for j in range(3) if j != k and alike[k][j])
        angles = [
            weighted_sum(elements, row_between(axes[j], axes[k])).u / abs(moments[k] - moments[j])
            for j in range(3)
            if j != k and j not in together
        ]
        angle = math.nan if together else max(angles)
        principals.append(Principal(_hull(k, together, values, unit), axes[k], angle, together))
    return tuple(principals)


def _alike(first: Uncertain, second: Uncertain) -> bool:
    """Return whether two moments are not distinguishable; two equal ones differ by 2.5 u in the mean, for they are
    sorted.
    """
    gap = first - second
    return abs(gap.value) <= DETECTED * gap.u


def _hull(k: int, together: Sequence[int], moments: Sequence[Uncertain], unit: str) -> Parameter:
    """The moment with its interval, or with the hull of those it is not distinguishable from."""
    parameter = moments[k].parameter(unit)
    ends = [moments[j].parameter(unit).interval95 for j in (k, *together)]
    if not together or any(end is None for end in ends):
        return parameter
    low, high = min(end[0] for end in ends if end), max(end[1] for end in ends if end)
    return replace(parameter, interval95=(low, high))
