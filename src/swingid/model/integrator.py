"""One Runge-Kutta step of the motion within one mode, and its dense output.

Dormand and Prince 5(4) (Hairer, Norsett, Wanner, Solving ODE I, II.5). Angles between the ends of a step
are the quintic polynomial through angle, speed and acceleration at both ends: its error O(h^6) is below
that of the step.

State y = (q1, q1', q2, q2', z). `work` (9, 5) is scratch: seven stages, a trial state, the new state.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.model.dynamics import accelerations
from swingid.model.friction import bristle_rate
from swingid.model.parameters import COULOMB_N, COULOMB_P, SIGMA0
from swingid.numerics.compiled import njit

Q1, V1, Q2, V2, Z, STATES = 0, 1, 2, 3, 4, 5
S1, S2, BRANCH = 0, 1, 2
FIRST, LAST, TRIAL, NEW, ROWS = 0, 6, 7, 8, 9

# Allowed error of one step, absolute and relative: angles (rad), speeds (rad/s), bristles (of Fc/sigma0).
ANGLE_ERROR, SPEED_ERROR, BRISTLE_ERROR, RELATIVE_ERROR = 1e-11, 1e-9, 1e-8, 1e-13


@njit
def derivative(
    y: NDArray[np.float64],
    mode: NDArray[np.int64],
    u: float,
    p: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Y' of (I), (II) and the bristles in `mode` = (s1, s2, branch) under the held command u, into `out`."""
    a1, a2 = accelerations(y[Q1], y[V1], y[V2], y[Z], mode[S1], mode[S2], mode[BRANCH], u, p)
    out[Q1], out[V1], out[Q2], out[V2] = y[V1], a1, y[V2], a2
    out[Z] = bristle_rate(y[V1], mode[S1], y[Z], p)


@njit
def step(
    y: NDArray[np.float64],
    h: float,
    mode: NDArray[np.int64],
    u: float,
    p: NDArray[np.float64],
    work: NDArray[np.float64],
) -> float:
    """One step of h (s) from `y` into work[NEW]; returns its error estimate over the allowed error.

    work[FIRST] must hold y' at `y`; work[LAST] holds y' at the new state afterwards.
    """
    k, trial, new = work[:7], work[TRIAL], work[NEW]
    for i in range(STATES):
        trial[i] = y[i] + h * (1 / 5) * k[0, i]
    derivative(trial, mode, u, p, k[1])
    for i in range(STATES):
        trial[i] = y[i] + h * (3 / 40 * k[0, i] + 9 / 40 * k[1, i])
    derivative(trial, mode, u, p, k[2])
    for i in range(STATES):
        trial[i] = y[i] + h * (44 / 45 * k[0, i] - 56 / 15 * k[1, i] + 32 / 9 * k[2, i])
    derivative(trial, mode, u, p, k[3])
    for i in range(STATES):
        slope = 19372 / 6561 * k[0, i] - 25360 / 2187 * k[1, i] + 64448 / 6561 * k[2, i] - 212 / 729 * k[3, i]
        trial[i] = y[i] + h * slope
    derivative(trial, mode, u, p, k[4])
    for i in range(STATES):
        slope = 9017 / 3168 * k[0, i] - 355 / 33 * k[1, i] + 46732 / 5247 * k[2, i] + 49 / 176 * k[3, i]
        trial[i] = y[i] + h * (slope - 5103 / 18656 * k[4, i])
    derivative(trial, mode, u, p, k[5])
    for i in range(STATES):
        slope = 35 / 384 * k[0, i] + 500 / 1113 * k[2, i] + 125 / 192 * k[3, i] - 2187 / 6784 * k[4, i]
        new[i] = y[i] + h * (slope + 11 / 84 * k[5, i])
    derivative(new, mode, u, p, k[6])
    return _error(y, h, p, work)


@njit
def _error(y: NDArray[np.float64], h: float, p: NDArray[np.float64], work: NDArray[np.float64]) -> float:
    """Largest component of the embedded error estimate over what is allowed for it."""
    k, worst = work[:7], 0.0
    for i in range(STATES):
        error = 71 / 57600 * k[0, i] - 71 / 16695 * k[2, i] + 71 / 1920 * k[3, i] - 17253 / 339200 * k[4, i]
        error = abs(h * (error + 22 / 525 * k[5, i] - 1 / 40 * k[6, i]))
        allowed = ANGLE_ERROR
        if i in (V1, V2):
            allowed = SPEED_ERROR
        if i == Z:
            if p[SIGMA0] == 0.0:
                break
            allowed = BRISTLE_ERROR * max(p[COULOMB_P], p[COULOMB_N]) / p[SIGMA0]
        worst = max(worst, error / (allowed + RELATIVE_ERROR * abs(y[i])))
    return worst


@njit
def quintic(
    x: float, h: float, q: float, v: float, a: float, qh: float, vh: float, ah: float
) -> tuple[float, float]:
    """Angle and speed at the fraction x of a step of h (s), from angle, speed, acceleration at both ends.

    Written as the Taylor polynomial of the start plus what is missing at the end, so that x = 0 is exact.
    """
    d0 = qh - (q + h * (v + 0.5 * h * a))
    d1 = h * (vh - (v + h * a))
    d2 = h * h * (ah - a)
    c3 = 10.0 * d0 - 4.0 * d1 + 0.5 * d2
    c4 = -15.0 * d0 + 7.0 * d1 - d2
    c5 = 6.0 * d0 - 3.0 * d1 + 0.5 * d2
    angle = q + h * x * (v + 0.5 * h * x * a) + x * x * x * (c3 + x * (c4 + x * c5))
    speed = v + h * x * a + x * x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)) / h
    return angle, speed
