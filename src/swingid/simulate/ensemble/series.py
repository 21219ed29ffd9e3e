"""One step of the motion by Taylor's series of the equations of motion (I), (II) within one mode.

Within a mode the right-hand side is made of sums, products and the sine, so its Taylor coefficients follow from one
another (Moore 1966; Hairer, Norsett, Wanner, Solving ODE I, I.8), sine and cosine by s' = c q1', c' = -s q1'. The sine
itself is computed once per step. Five terms of the speeds leave an error of (rate h)^6/6!, 1e-17 of the angle at 1 ms.

Time counts in steps of h: q1(x) = q1 + U x + U1 x^2/2 + ..., h q1' = U + U1 x + ... + U5 x^5, and Y for the wheel.
"""

from __future__ import annotations

from swingid.simulate.ensemble.lane_functions import decay, njit_lane

Coefficients = tuple[float, float, float, float, float]
Mobility = tuple[float, float, float]


@njit_lane
def coefficients(
    sine: float,
    cosine: float,
    u: float,
    y: float,
    gravity: float,
    viscous: float,
    quadratic: float,
    load1: float,
    load2: float,
    drag: float,
    mobility: Mobility,
) -> tuple[Coefficients, Coefficients]:
    """U1 ... U5 and Y1 ... Y5 from sine and cosine of q1, U and Y at the start, and the constants of the mode.

    Axis: load1 - gravity sin q1 - viscous U - quadratic U^2 (N m); wheel: load2 - drag Y (N m); mobility h^2 M^-1 as
    (11, 12, 22), where 12 is taken off.
    """
    m11, m12, m22 = mobility
    r1 = load1 - gravity * sine - u * (viscous + quadratic * u)
    r2 = load2 - drag * y
    u1, y1 = m11 * r1 - m12 * r2, m22 * r2 - m12 * r1
    s1, c1 = u * cosine, -u * sine
    w1 = 2.0 * u * u1
    r1, r2 = -gravity * s1 - viscous * u1 - quadratic * w1, -drag * y1
    u2, y2 = 0.5 * (m11 * r1 - m12 * r2), 0.5 * (m22 * r2 - m12 * r1)
    s2, c2 = 0.5 * (u * c1 + u1 * cosine), -0.5 * (u * s1 + u1 * sine)
    w2 = 2.0 * u * u2 + u1 * u1
    r1, r2 = -gravity * s2 - viscous * u2 - quadratic * w2, -drag * y2
    u3, y3 = (1 / 3) * (m11 * r1 - m12 * r2), (1 / 3) * (m22 * r2 - m12 * r1)
    s3, c3 = (1 / 3) * (u * c2 + u1 * c1 + u2 * cosine), -(1 / 3) * (u * s2 + u1 * s1 + u2 * sine)
    w3 = 2.0 * (u * u3 + u1 * u2)
    r1, r2 = -gravity * s3 - viscous * u3 - quadratic * w3, -drag * y3
    u4, y4 = 0.25 * (m11 * r1 - m12 * r2), 0.25 * (m22 * r2 - m12 * r1)
    s4 = 0.25 * (u * c3 + u1 * c2 + u2 * c1 + u3 * cosine)
    w4 = 2.0 * (u * u4 + u1 * u3) + u2 * u2
    r1, r2 = -gravity * s4 - viscous * u4 - quadratic * w4, -drag * y4
    u5, y5 = 0.2 * (m11 * r1 - m12 * r2), 0.2 * (m22 * r2 - m12 * r1)
    return (u1, u2, u3, u4, u5), (y1, y2, y3, y4, y5)


@njit_lane
def coefficients_with_peak(
    sine: float,
    cosine: float,
    u: float,
    y: float,
    gravity: float,
    viscous: float,
    quadratic: float,
    load1: float,
    load2: float,
    drag: float,
    mobility: Mobility,
    height: float,
    peak: float,
) -> tuple[Coefficients, Coefficients]:
    """As `coefficients`, with Stribeck's peak, height exp(-peak U^2) (N m), taken off the axis' load.

    The series of g = exp(y) is that of g' = y' g.
    """
    m11, m12, m22 = mobility
    g = height * decay(peak * u * u)
    r1 = load1 - gravity * sine - u * (viscous + quadratic * u) - g
    r2 = load2 - drag * y
    u1, y1 = m11 * r1 - m12 * r2, m22 * r2 - m12 * r1
    s1, c1 = u * cosine, -u * sine
    w1 = 2.0 * u * u1
    e1 = -peak * w1
    g1 = e1 * g
    r1, r2 = -gravity * s1 - viscous * u1 - quadratic * w1 - g1, -drag * y1
    u2, y2 = 0.5 * (m11 * r1 - m12 * r2), 0.5 * (m22 * r2 - m12 * r1)
    s2, c2 = 0.5 * (u * c1 + u1 * cosine), -0.5 * (u * s1 + u1 * sine)
    w2 = 2.0 * u * u2 + u1 * u1
    e2 = -2.0 * peak * w2
    g2 = 0.5 * (e1 * g1 + e2 * g)
    r1, r2 = -gravity * s2 - viscous * u2 - quadratic * w2 - g2, -drag * y2
    u3, y3 = (1 / 3) * (m11 * r1 - m12 * r2), (1 / 3) * (m22 * r2 - m12 * r1)
    s3, c3 = (1 / 3) * (u * c2 + u1 * c1 + u2 * cosine), -(1 / 3) * (u * s2 + u1 * s1 + u2 * sine)
    w3 = 2.0 * (u * u3 + u1 * u2)
    e3 = -3.0 * peak * w3
    g3 = (1 / 3) * (e1 * g2 + e2 * g1 + e3 * g)
    r1, r2 = -gravity * s3 - viscous * u3 - quadratic * w3 - g3, -drag * y3
    u4, y4 = 0.25 * (m11 * r1 - m12 * r2), 0.25 * (m22 * r2 - m12 * r1)
    s4 = 0.25 * (u * c3 + u1 * c2 + u2 * c1 + u3 * cosine)
    w4 = 2.0 * (u * u4 + u1 * u3) + u2 * u2
    g4 = 0.25 * (e1 * g3 + e2 * g2 + e3 * g1 - 4.0 * peak * w4 * g)
    r1, r2 = -gravity * s4 - viscous * u4 - quadratic * w4 - g4, -drag * y4
    u5, y5 = 0.2 * (m11 * r1 - m12 * r2), 0.2 * (m22 * r2 - m12 * r1)
    return (u1, u2, u3, u4, u5), (y1, y2, y3, y4, y5)


@njit_lane
def turned(u: float, k: Coefficients, x: float) -> float:
    """Angle (rad) passed at the fraction x of a step: the integral of `moved`."""
    return x * (
        u + x * (1 / 2 * k[0] + x * (1 / 3 * k[1] + x * (1 / 4 * k[2] + x * (1 / 5 * k[3] + x * 1 / 6 * k[4]))))
    )


@njit_lane
def moved(u: float, k: Coefficients, x: float) -> float:
    """Speed (rad per step) at the fraction x of a step."""
    return u + x * (k[0] + x * (k[1] + x * (k[2] + x * (k[3] + x * k[4]))))


@njit_lane
def slope(k: Coefficients, x: float) -> float:
    """Derivative of `moved` (rad per step^2)."""
    return k[0] + x * (2.0 * k[1] + x * (3.0 * k[2] + x * (4.0 * k[3] + x * 5.0 * k[4])))
