"""One step of the motion by Taylor's series of the equations of motion (I), (II) within one mode.

Within a mode the right-hand side is made of sums, products and the sine, so its derivatives follow from one
another (Moore 1966; Hairer, Norsett, Wanner, Solving ODE I, I.8), sine and cosine by s' = c q1', c' = -s q1'. The sine
itself is computed once per step. Five terms of the speeds leave an error of (rate h)^6/6!, 1e-17 of the angle at 1 ms.

Time counts in steps of h: q1(x) = q1 + U x + U1 x^2/2 + ..., h q1' = U + U1 x + ... + U5 x^5/5!, and Y for the wheel.
The lanes have the derivatives U1 ... U5 themselves, by Leibniz' rule, so that nothing waits for a division by k.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.vectors import njit_lane

Derivatives = tuple[float, float, float, float, float]
Pair = tuple[float, float]
Bent = tuple[float, float, float, float, float, float]

ONE = np.int64(1023 << 52)
"""Bits of 1.0."""


@njit_lane
def derivatives(
    sine: float,
    cosine: float,
    u: float,
    slopes: Pair,
    gravity: Pair,
    viscous: Pair,
    drag: Pair,
    bent: Bent,
    rich: int | None,
) -> tuple[Derivatives, Derivatives]:
    """U1 ... U5 and Y1 ... Y5 from sine and cosine of q1 and U at the start, where the slopes are (U1, Y1).

    U' = gravity sin q1 + viscous U + drag Y + ..., and Y' alike: of each the first is in U', the second in Y'. Where
    `rich` is not None, friction has the terms f = quadratic U^2 + cubic U^3 + g (N m), too; U' has -m11 f, Y' has
    m12 f. bent: m11, m12, quadratic (with its sign), cubic, narrowness and present value of Stribeck's g.
    """
    u1, y1 = slopes
    gu, gy = gravity
    vu, vy = viscous
    du, dy = drag
    m11, m12, quadratic, cubic, peak, g = bent
    s1, c1 = u * cosine, -u * sine
    u2, y2 = (gu * s1 + du * y1) + vu * u1, (gy * s1 + dy * y1) + vy * u1
    a, b, c, e1, g1 = 0.0, 0.0, 0.0, 0.0, 0.0
    if rich is not None:  # first, second and third derivative of the polynomial terms by U
        a, b, c = u * (2.0 * quadratic + 3.0 * cubic * u), 2.0 * quadratic + 6.0 * cubic * u, 6.0 * cubic
        e1 = -2.0 * peak * u * u1
        g1 = e1 * g
        f = g1 + a * u1
        u2, y2 = u2 - m11 * f, y2 + m12 * f
    s2, c2 = u * c1 + u1 * cosine, -(u * s1 + u1 * sine)
    u3, y3 = (gu * s2 + du * y2) + vu * u2, (gy * s2 + dy * y2) + vy * u2
    w2, e2, g2 = 0.0, 0.0, 0.0
    if rich is not None:
        w2 = u1 * u1
        e2 = -2.0 * peak * (u * u2 + w2)
        g2 = e1 * g1 + e2 * g
        f = g2 + (a * u2 + b * w2)
        u3, y3 = u3 - m11 * f, y3 + m12 * f
    twice = 2.0 * u1
    s3 = (u * c2 + twice * c1) + u2 * cosine
    c3 = -((u * s2 + twice * s1) + u2 * sine)
    u4, y4 = (gu * s3 + du * y3) + vu * u3, (gy * s3 + dy * y3) + vy * u3
    w3, e3, g3 = 0.0, 0.0, 0.0
    if rich is not None:
        w3 = 3.0 * u1 * u2
        e3 = -2.0 * peak * (u * u3 + w3)
        g3 = e1 * g2 + 2.0 * e2 * g1 + e3 * g
        f = g3 + ((a * u3 + b * w3) + c * u1 * w2)
        u4, y4 = u4 - m11 * f, y4 + m12 * f
    s4 = (u * c3 + 3.0 * (u1 * c2 + u2 * c1)) + u3 * cosine
    u5, y5 = (gu * s4 + du * y4) + vu * u4, (gy * s4 + dy * y4) + vy * u4
    if rich is not None:
        w4 = 4.0 * u1 * u3 + 3.0 * u2 * u2
        e4 = -2.0 * peak * (u * u4 + w4)
        g4 = e1 * g3 + 3.0 * (e2 * g2 + e3 * g1) + e4 * g
        f = g4 + ((a * u4 + b * w4) + 6.0 * c * w2 * u2)
        u5, y5 = u5 - m11 * f, y5 + m12 * f
    return (u1, u2, u3, u4, u5), (y1, y2, y3, y4, y5)


@njit_lane
def of(lane: Array, i: int, first: int) -> Derivatives:
    """Run i's series whose rows begin at `first`."""
    return lane[first, i], lane[first + 1, i], lane[first + 2, i], lane[first + 3, i], lane[first + 4, i]


@njit_lane
def at_end(u: float, k: Derivatives) -> float:
    """Speed (rad per step) at the end of a step; the newest derivative comes last: only its sum waits for it."""
    return (((u + k[0]) + 1 / 2 * k[1]) + (1 / 6 * k[2] + 1 / 24 * k[3])) + 1 / 120 * k[4]


@njit_lane
def turned_at_end(u: float, k: Derivatives) -> float:
    """Angle (rad) passed at the end of a step, alike."""
    return (((u + 1 / 2 * k[0]) + 1 / 6 * k[1]) + (1 / 24 * k[2] + 1 / 120 * k[3])) + 1 / 720 * k[4]


@njit_lane
def turned(u: float, k: Derivatives, x: float) -> float:
    """Angle (rad) passed at the fraction x of a step."""
    return x * (
        u + x * (1 / 2 * k[0] + x * (1 / 6 * k[1] + x * (1 / 24 * k[2] + x * (1 / 120 * k[3] + x * (1 / 720 * k[4])))))
    )


@njit_lane
def speed(u: float, k: Derivatives, x: float) -> float:
    """Speed (rad per step) at the fraction x of a step."""
    return u + x * (k[0] + x * (1 / 2 * k[1] + x * (1 / 6 * k[2] + x * (1 / 24 * k[3] + x * (1 / 120 * k[4])))))


@njit_lane
def slope(k: Derivatives, x: float) -> float:
    """Derivative of the speed (rad per step^2) at the fraction x of a step."""
    return k[0] + x * (k[1] + x * (1 / 2 * k[2] + x * (1 / 6 * k[3] + x * (1 / 24 * k[4]))))


@njit_lane
def sixth_root(x: float) -> float:
    """Sixth root of x, 0 < x <= 1, to 3 %, by the logarithm that the bits of a number are."""
    bits = np.float64(np.float64(x).view(np.int64) - ONE) * (1 / 6)
    return float(np.int64(np.int64(bits) + ONE).view(np.float64))
