"""The model as the paper prints it: state-space form (10)-(11) and the polynomials of (13).

For tests, documentation and controllers that are designed on it; motion is computed from (I), (II). The form holds for
a viscous axis and a motor whose Coulomb friction and dead zone are compensated by u1 and u3, so that the voltage is u2
alone. (9), first row, has a wrong sign of M1d; (10) is right.
"""

from __future__ import annotations

import math

import numpy as np

from swingid.errors import UnanswerableError
from swingid.model.parameters import A11, A12, A22, C1, C2, ETA, F2, GEAR, VISCOUS_N, VISCOUS_P, B
from swingid.numerics.arrays import Array


def alphas(p: Array) -> Array:
    """alpha_1 ... alpha_9 of (11) as an array (10,), alpha_i at index i (index 0 unused, 0).

    Raises UnanswerableError for a rig without a wheel or with a viscous coefficient that depends on the direction.
    """
    if p[A12] == 0.0 or p[VISCOUS_P] != p[VISCOUS_N]:
        raise UnanswerableError(
            "the printed form (10) needs a wheel and one viscous coefficient; use (I), (II) for this rig",
            code="no-printed-form",
        )
    a11, a12, a22, n = p[A11], p[A12], p[A22], p[GEAR]
    alpha = np.zeros(10)
    alpha[1] = 1.0 / (a22 * a11 - a12**2)
    alpha[2] = alpha[1] * a22 * p[B]
    alpha[3] = alpha[1] * a22 * p[VISCOUS_P]
    alpha[4] = alpha[1] * a12 * n * p[ETA] * p[C1]
    alpha[5] = alpha[4] * a11 / a12
    alpha[6] = alpha[2] * a12 / a22
    alpha[7] = alpha[1] * a12 * n * (p[C2] * p[ETA] + p[F2] * n)
    alpha[8] = alpha[3] * a12 / a22
    alpha[9] = alpha[7] * a11 / a12
    return alpha


def state_space(x: Array, u2: float, alpha: Array) -> Array:
    """Slope x' (4,) of (10) for x = (q1, q1', q2, q2') (rad, rad/s) and the compensated voltage u2 (V)."""
    x1, x2, _, x4 = x
    return np.array(
        [
            x2,
            -alpha[3] * x2 - alpha[2] * math.sin(x1) + alpha[7] * x4 - alpha[4] * u2,
            x4,
            alpha[8] * x2 + alpha[6] * math.sin(x1) - alpha[9] * x4 + alpha[5] * u2,
        ]
    )


def polynomials(
    alpha: Array,
) -> tuple[Array, Array, Array]:
    """(r, a, h) of (13), y = r/a u2 + h/a sin y: coefficients of p, highest power first.

    As alpha_4 alpha_9 = alpha_5 alpha_7, r(p) = -alpha_4 p: it has the root 0, shared with a(p), and is not Hurwitz as
    (13) asks. The speed of the wheel is not held by a control of q1.
    """
    r = np.array([-alpha[4], -alpha[4] * alpha[9] + alpha[5] * alpha[7]])
    a = np.array([1.0, alpha[9] + alpha[3], alpha[3] * alpha[9] - alpha[7] * alpha[8], 0.0])
    h = np.array([-alpha[2], alpha[6] * alpha[7] - alpha[2] * alpha[9]])
    return r, a, h
