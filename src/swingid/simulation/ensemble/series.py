"""One step of the motion by Taylor's series of the equations of motion (I), (II) within one mode.

Within a mode the right-hand side is made of sums, products and the sine, so its derivatives follow from one
another (Moore 1966; Hairer, Norsett, Wanner, Solving ODE I, I.8), sine and cosine by s' = c q1', c' = -s q1'. The sine
itself is computed once per step. Five terms of the speeds leave an error of (rate h)^6/6!, 1e-17 of the angle at 1 ms.

Time counts in steps of h: q1(x) = q1 + U x + U1 x^2/2 + ..., h q1' = U + U1 x + ... + U5 x^5/5!, and Y for the wheel.
The lanes have the derivatives U1 ... U5 themselves, by Leibniz' rule, so that nothing waits for a division by k.
"""

from __future__ import annotations

from swingid.numerics.vectors import decay, njit_lane

Derivatives = tuple[float, float, float, float, float]
Axis = tuple[float, float, float, float, float, float, float]
Mobility = tuple[float, float, float]
Linear = tuple[float, float, float, float, float]


@njit_lane
def per_torque(axis: Axis, wheel: tuple[float, float], mobility: Mobility) -> tuple[Linear, Linear]:
    """U' = gu s + vu U + qu U^2 + du Y + lu, and Y' alike: so that a derivative waits only for those just before it."""
    gravity, viscous, quadratic, load1, _, _, _ = axis
    load2, drag = wheel
    m11, m12, m22 = mobility
    u = (-m11 * gravity, -m11 * viscous, -m11 * quadratic, m12 * drag, m11 * load1 - m12 * load2)
    return u, (m12 * gravity, m12 * viscous, m12 * quadratic, -m22 * drag, m22 * load2 - m12 * load1)


@njit_lane
def first(
    sine: float,
    u: float,
    y: float,
    axis: Axis,
    wheel: tuple[float, float],
    mobility: Mobility,
    rich: int | None,
) -> tuple[float, float, float]:
    """U1, Y1 and Stribeck's g (N m), as of `derivatives`."""
    (gu, vu, qu, du, lu), (gy, vy, qy, dy, ly) = per_torque(axis, wheel, mobility)
    u1 = ((lu + gu * sine) + du * y) + u * (vu + qu * u)
    y1 = ((ly + gy * sine) + dy * y) + u * (vy + qy * u)
    g = 0.0
    if rich is not None:
        square = u * u
        g = axis[5] * decay(axis[6] * square)
        f = g + axis[4] * (u * square)
        u1, y1 = u1 - mobility[0] * f, y1 + mobility[1] * f
    return u1, y1, g


@njit_lane
def derivatives(
    sine: float,
    cosine: float,
    u: float,
    y: float,
    axis: Axis,
    wheel: tuple[float, float],
    mobility: Mobility,
    rich: int | None,
) -> tuple[Derivatives, Derivatives]:
    """U1 ... U5 and Y1 ... Y5 from sine and cosine of q1, U and Y at the start, and the constants of the mode.

    axis = (gravity, viscous, quadratic, load, cubic, height, peak): load - gravity sin q1 - viscous U - quadratic U^2
    and, where `rich` is not None, - cubic U^3 - g with g = height exp(-peak U^2) (N m), Stribeck's. wheel = (load,
    drag): load - drag Y (N m). mobility: h^2 M^-1 as (11, 12, 22), where 12 is taken off.
    """
    _, _, _, _, cubic, _, peak = axis
    m11, m12, _ = mobility
    (gu, vu, qu, du, _), (gy, vy, qy, dy, _) = per_torque(axis, wheel, mobility)
    u1, y1, g = first(sine, u, y, axis, wheel, mobility, rich)
    e1, e2, g1, g2 = 0.0, 0.0, 0.0, 0.0
    lean = 3.0 * cubic * (u * u)
    tu, ty = vu + 2.0 * u * qu, vy + 2.0 * u * qy
    s1, c1 = u * cosine, -u * sine
    u2, y2 = ((gu * s1 + du * y1) + tu * u1), ((gy * s1 + dy * y1) + ty * u1)
    if rich is not None:
        e1 = -2.0 * peak * u * u1
        g1 = e1 * g
        f = g1 + lean * u1
        u2, y2 = u2 - m11 * f, y2 + m12 * f
    s2, c2 = u * c1 + u1 * cosine, -(u * s1 + u1 * sine)
    w2 = 2.0 * u1 * u1
    u3, y3 = ((gu * s2 + qu * w2) + du * y2) + tu * u2, ((gy * s2 + qy * w2) + dy * y2) + ty * u2
    if rich is not None:
        e2 = -peak * (2.0 * u * u2 + w2)
        g2 = e1 * g1 + e2 * g
        f = g2 + (lean * u2 + 3.0 * cubic * u * w2)
        u3, y3 = u3 - m11 * f, y3 + m12 * f
    twice = 2.0 * u1
    s3 = (u * c2 + twice * c1) + u2 * cosine
    c3 = -((u * s2 + twice * s1) + u2 * sine)
    w3 = 3.0 * twice * u2
    u4, y4 = ((gu * s3 + qu * w3) + du * y3) + tu * u3, ((gy * s3 + qy * w3) + dy * y3) + ty * u3
    g3, e3 = 0.0, 0.0
    if rich is not None:
        e3 = -peak * (2.0 * u * u3 + w3)
        g3 = e1 * g2 + 2.0 * e2 * g1 + e3 * g
        f = g3 + (lean * u3 + 3.0 * cubic * (u * w3 + u1 * w2))
        u4, y4 = u4 - m11 * f, y4 + m12 * f
    s4 = (u * c3 + 3.0 * (u1 * c2 + u2 * c1)) + u3 * cosine
    w4 = 8.0 * u1 * u3 + 6.0 * u2 * u2
    u5, y5 = ((gu * s4 + qu * w4) + du * y4) + tu * u4, ((gy * s4 + qy * w4) + dy * y4) + ty * u4
    if rich is not None:
        e4 = -peak * (2.0 * u * u4 + w4)
        g4 = e1 * g3 + 3.0 * (e2 * g2 + e3 * g1) + e4 * g
        f = g4 + (lean * u4 + cubic * (3.0 * u * w4 + 18.0 * w2 * u2))
        u5, y5 = u5 - m11 * f, y5 + m12 * f
    return (u1, u2, u3, u4, u5), (y1, y2, y3, y4, y5)


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
