"""Equation (II) simulated in closed form from event to event, with exact sensitivities, under a held voltage.

Between events the wheel obeys q2'' = α − λ q2' with constant α and λ: the voltage is held, and the branch of (8) and
the sign of q2' stay. The measured axis enters as straight lines between its samples: each change of its speed kicks
the wheel by −ρ times as much, so that q2 follows −ρ q1 exactly from sample to sample. Events are a stop or reversal
of the wheel, which may stick there, and the edges of the dead zone. At an edge M is continuous, so sensitivities pass
unchanged; at a reversal the acceleration jumps from a to a', and the sensitivity of the speed is multiplied by
a'/a (the saltation of the flow); while a wheel sticks it is 0. Products as in `balance.wheel_equation`, per a22.
"""

from __future__ import annotations

import math

import numpy as np

from swingid.balance.wheel_equation import COULOMB, COUNT, COUPLING, DAMPING, EMF, GAIN, NEGATIVE, POSITIVE
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_called, njit_helper

STATES = COUNT + 2
"""Places of a sensitivity: the products, then the angle and the speed at the start."""

MOST_EVENTS = 64
NO_BRANCH = -2


@njit_called
def _decay(x: float) -> tuple[float, float, float, float]:
    """(1 − e^−x)/x, (x − 1 + e^−x)/x², and their derivatives to x."""
    if abs(x) < 0.02:
        first = 1.0 - x * (1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x / 720))))
        second = 1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720 - x / 5040))))
        slope1 = -(1 / 2 - x * (1 / 3 - x * (1 / 8 - x * (1 / 30 - x * (1 / 144 - x / 840)))))
        slope2 = -(1 / 6 - x * (1 / 12 - x * (1 / 40 - x * (1 / 180 - x * (1 / 1008 - x / 6720)))))
        return first, second, slope1, slope2
    e = math.exp(-x)
    first = (1.0 - e) / x
    second = (1.0 - first) / x
    slope1 = (e - first) / x
    return first, second, slope1, (-slope1 - second) / x


@njit_called
def _dead(ideal: float, high: float, low: float) -> float:
    """The torque after the dead zone."""
    return max(ideal - high, 0.0) + min(ideal - low, 0.0)


@njit_helper
def _flow(v: float, alpha: float, rate: float, t: float, d_alpha: Array, d_rate: Array, s: Array) -> float:
    """Speed after t (s) of q2'' = α − λ q2'; `s` (2, 9) is moved along, the angle's gain is left in ``s[2, 0]``."""
    first, second, slope1, slope2 = _decay(rate * t)
    e = math.exp(-rate * t)
    gained = v * t * first + alpha * t * t * second
    for k in range(STATES):
        ds = s[1, k]
        s[0, k] += t * first * ds + t * t * second * d_alpha[k] + (v * slope1 + alpha * t * slope2) * t * t * d_rate[k]
        s[1, k] = e * ds + t * first * d_alpha[k] + (alpha * slope1 - v * e / t) * t * t * d_rate[k]
    s[2, 0] = gained
    return v * e + alpha * t * first


@njit_called
def _time_to(v: float, target: float, alpha: float, rate: float) -> float:
    """Time (s) until the speed reaches `target`; infinite if it never does."""
    a = alpha - rate * v
    way = target - v
    if a == 0.0 or way * a < 0.0:
        return math.inf
    share = rate * way / a
    if share >= 1.0:
        return math.inf
    if abs(share) < 1e-12:
        return way / a
    return -math.log1p(-share) / rate


@njit_called
def _branch(ideal: float, high: float, low: float) -> int:
    """Branch of (8): +1 above the dead zone, 0 inside, −1 below; without a dead zone the sign of the torque."""
    if ideal > high or (high == low == 0.0 and ideal >= 0.0):
        return 1
    if ideal < low or high == low == 0.0:
        return -1
    return 0


@njit_helper
def _law(products: Array, branch: int, side: float, u: float, d_alpha: Array, d_rate: Array) -> tuple[float, float]:
    """(α, λ) of q2'' = α − λ q2' in a mode, and their derivatives to the products, which are its coefficients."""
    above, below = (1.0 if branch > 0 else 0.0), (1.0 if branch < 0 else 0.0)
    d_alpha[:] = 0.0
    d_rate[:] = 0.0
    d_alpha[GAIN] = u * (above + below)
    d_alpha[POSITIVE], d_alpha[NEGATIVE] = -above, below
    d_alpha[COULOMB] = above - below - side
    d_rate[DAMPING], d_rate[EMF] = 1.0, above + below - 1.0
    alpha = rate = 0.0
    for j in range(COUNT):
        alpha += d_alpha[j] * products[j]
        rate += d_rate[j] * products[j]
    return alpha, rate


@njit_called
def _next_event(
    v: float, alpha: float, rate: float, branch: int, edges: tuple[float, float], left: float
) -> tuple[float, int, float]:
    """Time (s) to the next event, at most `left`; its kind (0 none, 1 reversal, 2 edge of the dead zone); speed there.

    edges: speeds at which the torque passes the upper and the lower edge of the dead zone.
    """
    t, event, target = left, 0, 0.0
    reverse = math.inf if v == 0.0 else _time_to(v, 0.0, alpha, rate)
    if reverse < t:
        t, event = reverse, 1
    rising = alpha - rate * v > 0.0
    # a rising speed lowers the torque: it leaves branch + at the upper edge, the dead zone at the lower one
    at = edges[0] if branch > 0 or (branch == 0 and not rising) else edges[1]
    if branch == 0 or (branch > 0) == rising:
        reach = _time_to(v, at, alpha, rate)
        if reach < t:
            t, event, target = reach, 2, at
    return t, event, target


@njit_helper
def _over_sample(
    products: Array, h: float, u: float, q: float, v: float, s: Array, d_alpha: Array, d_rate: Array
) -> tuple[float, float]:
    """Angle and speed after a sample of h (s) from (q, v), through all events; `s` is moved along."""
    f, emf = products[COULOMB], products[EMF]
    high, low = max(products[POSITIVE] - f, 0.0), min(f - products[NEGATIVE], 0.0)
    ideal = products[GAIN] * u
    edges = (np.inf, -np.inf)
    if emf > 0.0 and high > low:
        edges = ((ideal - high) / emf, (ideal - low) / emf)
    left, forced, before = h, NO_BRANCH, 0.0
    for _ in range(MOST_EVENTS):
        side = 1.0 if v > 0.0 else -1.0
        if v == 0.0:
            hold = _dead(ideal, high, low)
            if abs(hold) <= f:
                s[1, :] = 0.0
                break
            side = 1.0 if hold > 0.0 else -1.0
        branch = forced if forced != NO_BRANCH else _branch(ideal - emf * v, high, low)
        alpha, rate = _law(products, branch, side, u, d_alpha, d_rate)
        if before != 0.0:
            s[1, :] *= alpha / before
            before = 0.0
        t, event, target = _next_event(v, alpha, rate, branch, edges, left)
        if t > 0.0:
            v = _flow(v, alpha, rate, t, d_alpha, d_rate, s)
            q += s[2, 0]
        left -= t
        forced = NO_BRANCH
        if event == 1:
            v, before = 0.0, alpha
        elif event == 2:
            v = target
            forced = 0 if branch != 0 else (1 if target == edges[0] else -1)
        if event == 0 or left <= 0.0:
            break
    return q, v


@njit
def simulate_wheel(
    products: Array, steps: Array, voltage: Array, kicks: Array, q: float, v: float, angles: Array, sensitivities: Array
) -> None:
    """Angle of the wheel at each sample of a part, and its derivatives.

    steps (n−1,) in s and voltage (n−1,) in V from sample to sample; kicks (n−1,): change of q1' in rad/s at the begin
    of each; q, v: angle and speed at the start. angles (n,) and sensitivities (n, 9) are filled.
    """
    s = np.zeros((3, STATES))
    s[0, COUNT] = s[1, COUNT + 1] = 1.0
    d_alpha, d_rate = np.zeros(STATES), np.zeros(STATES)
    angles[0] = q
    sensitivities[0] = s[0]
    for k in range(len(steps)):
        if kicks[k] != 0.0:
            v -= products[COUPLING] * kicks[k]
            s[1, COUPLING] -= kicks[k]
        q, v = _over_sample(products, steps[k], voltage[k], q, v, s, d_alpha, d_rate)
        angles[k + 1] = q
        sensitivities[k + 1] = s[0]
