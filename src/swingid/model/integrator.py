"""One Runge-Kutta step of the motion within one mode, and its dense output.

Dormand and Prince 5(4) (Hairer, Norsett, Wanner, Solving ODE I, II.5). Angles between the ends of a step
are the quintic polynomial through angle, speed and acceleration at both ends: its error O(h^6) is below
that of the step.

State y = (q1, q1', q2, q2', z). The integrator lives in one array `work` (10, 5) of rows: seven stages (the
first is y' at the start, the last y' at the new state), a trial state, the new state, the state y itself. Rows
are named by number, not cut out as views: a view costs as much as a right-hand side.
"""

from __future__ import annotations

from collections.abc import Callable

from swingid.model.dynamics import accelerations
from swingid.model.friction import bristle_rate
from swingid.model.parameters import COULOMB_N, COULOMB_P, SIGMA0
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import FLOAT, INT, MATRIX, VECTOR, KernelPointer, njit, njit_inlined, place, tuple_of

Q1, V1, Q2, V2, Z, STATES = 0, 1, 2, 3, 4, 5
FIRST, SECOND, THIRD, FOURTH, FIFTH, SIXTH, LAST, TRIAL, NEW, NOW, ROWS = map(place, range(11))

Mode = tuple[int, int, int]
"""(s1, s2, branch) of `swingid.model.dynamics`."""

# Allowed error of one step, absolute and relative: angles (rad), speeds (rad/s), bristles (of Fc/sigma0).
ANGLE_ERROR, SPEED_ERROR, BRISTLE_ERROR, RELATIVE_ERROR = 1e-11, 1e-9, 1e-8, 1e-13


@njit_inlined
def derivative(work: Array, state: int, slope: int, mode: Mode, u: float, p: Array) -> None:
    """Slope y' at the state in row `state` of `work` (10, 5), into row `slope`, in a mode under the command u."""
    v1, v2, z = work[state, V1], work[state, V2], work[state, Z]
    s1, s2, branch = mode
    a1, a2 = accelerations(work[state, Q1], v1, v2, z, s1, s2, branch, u, p)
    work[slope, Q1], work[slope, V1], work[slope, Q2], work[slope, V2] = v1, a1, v2, a2
    work[slope, Z] = bristle_rate(v1, s1, z, p)


@njit
def step(work: Array, h: float, mode: Mode, u: float, p: Array) -> float:
    """One step of h (s) from row NOW into row NEW; returns its error estimate over the allowed error.

    Row FIRST must hold y' of row NOW; row LAST holds y' of row NEW afterwards.
    """
    k = work
    for i in range(STATES):
        work[TRIAL, i] = work[NOW, i] + h * (1 / 5) * k[0, i]
    derivative(work, TRIAL, SECOND, mode, u, p)
    for i in range(STATES):
        work[TRIAL, i] = work[NOW, i] + h * (3 / 40 * k[0, i] + 9 / 40 * k[1, i])
    derivative(work, TRIAL, THIRD, mode, u, p)
    for i in range(STATES):
        work[TRIAL, i] = work[NOW, i] + h * (44 / 45 * k[0, i] - 56 / 15 * k[1, i] + 32 / 9 * k[2, i])
    derivative(work, TRIAL, FOURTH, mode, u, p)
    for i in range(STATES):
        slope = 19372 / 6561 * k[0, i] - 25360 / 2187 * k[1, i] + 64448 / 6561 * k[2, i] - 212 / 729 * k[3, i]
        work[TRIAL, i] = work[NOW, i] + h * slope
    derivative(work, TRIAL, FIFTH, mode, u, p)
    for i in range(STATES):
        slope = 9017 / 3168 * k[0, i] - 355 / 33 * k[1, i] + 46732 / 5247 * k[2, i] + 49 / 176 * k[3, i]
        work[TRIAL, i] = work[NOW, i] + h * (slope - 5103 / 18656 * k[4, i])
    derivative(work, TRIAL, SIXTH, mode, u, p)
    for i in range(STATES):
        slope = 35 / 384 * k[0, i] + 500 / 1113 * k[2, i] + 125 / 192 * k[3, i] - 2187 / 6784 * k[4, i]
        work[NEW, i] = work[NOW, i] + h * (slope + 11 / 84 * k[5, i])
    derivative(work, NEW, LAST, mode, u, p)
    return error_ratio(work, h, p)


@njit_inlined
def error_ratio(work: Array, h: float, p: Array) -> float:
    """Largest component of the embedded error estimate of a step of h (s) over what is allowed; 1 is the limit."""
    k, worst = work, 0.0
    for i in range(STATES):
        error = 71 / 57600 * k[0, i] - 71 / 16695 * k[2, i] + 71 / 1920 * k[3, i] - 17253 / 339200 * k[4, i]
        error = abs(h * (error + 22 / 525 * k[5, i] - 1 / 40 * k[6, i]))
        allowed = SPEED_ERROR if i in (V1, V2) else ANGLE_ERROR
        if i == Z:
            if p[SIGMA0] == 0.0:
                break
            allowed = BRISTLE_ERROR * max(p[COULOMB_P], p[COULOMB_N]) / p[SIGMA0]
        worst = max(worst, error / (allowed + RELATIVE_ERROR * abs(work[NOW, i])))
    return worst


@njit_inlined
def quintic(
    x: float, h: float, start: tuple[float, float, float], end: tuple[float, float, float]
) -> tuple[float, float]:
    """Angle and speed at the fraction x of a step of h (s), from (angle, speed, acceleration) at both ends.

    Written as the Taylor polynomial of the start plus what is missing at the end, so that x = 0 is exact.
    """
    q, v, a = start
    d0 = end[0] - (q + h * (v + 0.5 * h * a))
    d1 = h * (end[1] - (v + h * a))
    d2 = h * h * (end[2] - a)
    c3 = 10.0 * d0 - 4.0 * d1 + 0.5 * d2
    c4 = -15.0 * d0 + 7.0 * d1 - d2
    c5 = 6.0 * d0 - 3.0 * d1 + 0.5 * d2
    angle = q + h * x * (v + 0.5 * h * x * a) + x * x * x * (c3 + x * (c4 + x * c5))
    speed = v + h * x * a + x * x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)) / h
    return angle, speed


Step = Callable[[Array, float, Mode, float, Array], float]
STEP_KERNEL = KernelPointer(step, FLOAT(MATRIX, FLOAT, tuple_of(INT, 3), FLOAT, VECTOR))
