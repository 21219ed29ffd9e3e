"""The controllers of one block of runs in the vector units, each tested against its compiled step of `control`.

The consecutive compensator (14)-(20) of relative degree 2 is one function of a column. That of another degree has a
chain of matrices: its exponential is a Taylor series of vectors, in as many shares for all columns as the largest turn
takes. Backstepping (21) with the observers (23) is one function, too.
"""

from __future__ import annotations

import numpy as np

from swingid.control.law import TAYLOR_TERMS
from swingid.numerics.arrays import Array
from swingid.numerics.vectors import decay, njit_lane, sine_cosine, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble.lanes import LANES

LARGEST_SHARE = 0.5
"""Of a turn times a norm of the chain: up to here `TAYLOR_TERMS` of the exponential leave rounding."""


@njit_lane
def within(value: float, limit: float) -> float:
    """Value between -limit and limit."""
    value = value if value > -limit else -limit
    return value if value < limit else limit


@njit_lane
def grown_gain(lane: Array, i: int, e: float) -> float:
    """Run i's next gain (17), (18) at the error e (rad), and its filter moved on by a sample."""
    k, held, fading = lane[at.K_TILDE, i], lane[at.FILTERED, i], lane[at.ERROR_DECAY, i]
    filtered = held if fading > 0.0 else e
    grown = k + lane[at.LAMBDA_H, i]
    most = lane[at.K_MAX, i]
    grown = grown if grown < most else most
    grown = grown if grown > k else k
    lane[at.FILTERED, i] = e + (held - e) * fading
    return float(grown if abs(filtered) > lane[at.DELTA0, i] else k)


@njit_lane
def wheel_speed(lane: Array, i: int, rate: float) -> float:
    """Run i's wheel speed (rad/s) from its readings, `law.wheel_speed`; rate: samples per second."""
    wheel, memory = lane[at.WHEEL_READING, i], lane[at.WHEEL_MEMORY, i]
    change = (wheel - memory) * (1.0 - lane[at.WHEEL_DECAY, i])
    lane[at.WHEEL_MEMORY, i] = memory + change
    return float(change * rate)


@njit_lane
def first_seen(lane: Array) -> None:
    """Begin the filters of the wheel's speed with its reading at the first sample."""
    widest()
    for i in range(LANES):
        wheel, memory = lane[at.WHEEL_READING, i], lane[at.WHEEL_MEMORY, i]
        lane[at.WHEEL_MEMORY, i] = memory if lane[at.WHEEL_SEEN, i] != 0.0 else wheel


@njit_lane
def compensated(lane: Array, i: int, u: float, speed: float) -> float:
    """`law.motor_compensation` (V) of u (V) at the wheel's speed (rad/s)."""
    dry = lane[at.COULOMB, i]
    u += dry if speed > 0.0 else (-dry if speed < 0.0 else 0.0)
    switch = u - lane[at.EMF_RATIO, i] * speed
    positive, negative = lane[at.DEAD_POSITIVE, i], lane[at.DEAD_NEGATIVE, i]
    return u + (positive if switch > 0.0 else (negative if switch < 0.0 else 0.0))


@njit_lane
def grow(lane: Array, i: int, wanted: tuple[bool, float]) -> int:
    """Run i's ERROR and NEXT_GAIN; 1 where the gain grows. wanted: as of `command_all`."""
    reference = lane[at.REFERENCE, i]
    e = (wanted[1] if wanted[0] else reference) - lane[at.ANGLE_READING, i]
    k, k_next = lane[at.K_TILDE, i], grown_gain(lane, i, e)
    lane[at.ERROR, i], lane[at.NEXT_GAIN, i] = e, k_next
    return 1 if k_next != k else 0


@njit_lane
def compensator_command(lane: Array, i: int, rate: float) -> None:
    """Command of run i by its compensator of relative degree 2, `compensator_step`."""
    e, k, k_next = lane[at.ERROR, i], lane[at.K_TILDE, i], lane[at.NEXT_GAIN, i]
    xi = lane[at.XI, i]
    slope = k * k * lane[at.K1, i] * (e - xi)
    gain_term = lane[at.DIFFERENTIATE, i] * (k_next - k) * xi
    u = lane[at.ALPHA1, i] * (gain_term + k * slope) + lane[at.ALPHA0, i] * k * xi
    u = compensated(lane, i, u, wheel_speed(lane, i, rate))
    lane[at.COMMAND, i] = within(u, lane[at.LIMIT, i])


@njit_lane
def fade(lane: Array, i: int, rate: float) -> None:
    """How far run i's xi nears the error in this sample, into FADING."""
    k, k_next = lane[at.K_TILDE, i], lane[at.NEXT_GAIN, i]
    turn = (1.0 / (3.0 * rate)) * (k * k + k * k_next + k_next * k_next)
    lane[at.FADING, i] = decay(lane[at.K1, i] * turn)


@njit_lane
def compensators(lane: Array, rate: float, fading: int, wanted: tuple[bool, float]) -> int:
    """Commands of all runs by compensators of relative degree 2; whether FADING is to be computed at the next sample.

    fading: whether it is to be at this one: it changes with the gains alone. wanted: as of `command_all`.
    """
    widest()
    growing = 0
    for i in range(LANES):
        growing += grow(lane, i, wanted)
    for i in range(LANES):
        compensator_command(lane, i, rate)
    if growing + fading > 0:
        for i in range(LANES):
            fade(lane, i, rate)
    for i in range(LANES):
        e, xi = lane[at.ERROR, i], lane[at.XI, i]
        lane[at.XI, i] = e + (xi - e) * lane[at.FADING, i]
        lane[at.K_TILDE, i] = lane[at.NEXT_GAIN, i]
    return growing


@njit_lane
def observed(lane: Array, i: int, first: int, angle: float, rate: float) -> float:
    """Speed (rad/s) of run i by the observer (23) whose rows begin at `first`, moved on to `angle` (rad)."""
    last, gap, p, seen = lane[first, i], lane[first + 1, i], lane[first + 2, i], lane[first + 3, i] != 0.0
    a = first + 4
    slope = (angle - last) * rate
    kick = lane[a + 9, i]
    kick = kick if gap > 0.0 else (-kick if gap < 0.0 else 0.0)
    next_gap = lane[a, i] * gap + lane[a + 1, i] * p + lane[a + 4, i] * slope + lane[a + 5, i] * kick
    next_p = lane[a + 2, i] * gap + lane[a + 3, i] * p
    next_p += lane[a + 6, i] * slope + lane[a + 7, i] * kick
    gap = next_gap if seen else gap
    p = next_p if seen else p
    lane[first, i], lane[first + 1, i], lane[first + 2, i], lane[first + 3, i] = angle, gap, p, 1.0
    return float(p + lane[a + 8, i] * gap)


@njit_lane
def reference_rates(lane: Array, i: int, rate: float) -> tuple[float, float]:
    """Run i's y_m' and y_m'' as of `backstepping.reference_rates`."""
    reference, y1, y2, y3 = lane[at.REFERENCE, i], lane[at.BEFORE, i], lane[at.BEFORE + 1, i], lane[at.BEFORE + 2, i]
    seen = lane[at.SEEN, i]
    speed = (3.0 * reference - 4.0 * y1 + y2) * (0.5 * rate)
    speed = speed if seen >= 2.0 else ((reference - y1) * rate if seen == 1.0 else 0.0)
    early, late = reference - 2.0 * y1 + y2, 2.0 * reference - 5.0 * y1 + 4.0 * y2 - y3
    bend = late if seen >= 3.0 else (early if seen >= 2.0 else 0.0)
    lane[at.BEFORE, i], lane[at.BEFORE + 1, i], lane[at.BEFORE + 2, i] = reference, y1, y2
    lane[at.SEEN, i] = seen + 1.0 if seen < 3.0 else 3.0
    return speed, bend * (rate * rate)


@njit_lane
def backstepping(lane: Array, i: int, rate: float) -> None:
    """Command of run i by (21), `backstepping_step`, moved on by a sample in place."""
    angle, n = lane[at.ANGLE_READING, i], at.STEPPING
    n1, n2, gamma1, gamma2 = lane[n, i], lane[n + 1, i], lane[n + 2, i], lane[n + 3, i]
    c4, c7, consistent, least = lane[n + 4, i], lane[n + 5, i], lane[n + 6, i], lane[n + 7, i]
    alpha2, alpha3 = lane[at.K_TILDE, i], lane[at.FILTERED, i]
    speed, bend = reference_rates(lane, i, rate)
    x2 = observed(lane, i, at.AXIS_OBSERVER, angle, rate)
    x4 = observed(lane, i, at.WHEEL_OBSERVER, lane[at.WHEEL_READING, i], rate)
    sine, _ = sine_cosine(angle)
    e1 = angle - lane[at.REFERENCE, i]
    e2 = x2 + n1 * e1 - speed
    wanted = e1 - alpha3 * x2 - alpha2 * sine + c7 * alpha2 * x4 + n1 * (x2 - speed) - bend + n2 * e2
    u2 = wanted / (c4 * alpha2)
    u0 = compensated(lane, i, u2, x4)
    applied = within(u0, lane[at.LIMIT, i])
    u2 -= u0 - applied
    drive = (c7 * x4 - c4 * u2) - sine if consistent != 0.0 else -sine
    h = 1.0 / rate
    alpha3 -= h * gamma1 * e2 * x2
    alpha2 += h * gamma2 * e2 * drive
    lane[at.FILTERED, i] = alpha3 if alpha3 > least else least
    lane[at.K_TILDE, i] = alpha2 if alpha2 > least else least
    lane[at.COMMAND, i] = within(applied, lane[at.RIG_LIMIT, i])


@njit_lane
def chain_series(lane: Array, n: int, rate: float) -> None:
    """Taylor series of xi(t) of all runs up to the power n into POWERS, row (n + 1) j + i: t^i of xi_(j+1)."""
    widest()
    for j in range(n):
        for i in range(LANES):
            lane[at.POWERS + (n + 1) * j, i] = lane[at.CHAIN + j, i]
        for k in range(1, n + 1):
            for i in range(LANES):
                lane[at.POWERS + (n + 1) * j + k, i] = 0.0
    for power in range(n):
        inverse = 1.0 / (power + 1)
        for j in range(n):
            for m in range(min(power, 2) + 1):
                for i in range(LANES):
                    gain = lane[at.K_TILDE, i]
                    slope = (lane[at.NEXT_GAIN, i] - gain) * rate
                    sigma = gain * gain if m == 0 else (2.0 * gain * slope if m == 1 else slope * slope)
                    lane[at.SHARE, i] = lane[at.SIGMA0, i] * sigma
                    lane[at.WANTED, i] = 0.0
                if j < n - 1:
                    for i in range(LANES):
                        lane[at.WANTED, i] = lane[at.POWERS + (n + 1) * (j + 1) + power - m, i]
                else:
                    for i in range(LANES):
                        force = lane[at.K, i] * lane[at.ERROR, i]
                        lane[at.WANTED, i] = force if power == m else 0.0
                    for c in range(n):
                        for i in range(LANES):
                            state = lane[at.POWERS + (n + 1) * c + power - m, i]
                            lane[at.WANTED, i] -= lane[at.K + c, i] * state
                for i in range(LANES):
                    rise = lane[at.SHARE, i] * lane[at.WANTED, i] * inverse
                    lane[at.POWERS + (n + 1) * j + power + 1, i] += rise


@njit_lane
def chain_output(lane: Array, n: int, rate: float) -> None:
    """`law.chain_output` of all runs into WANTED."""
    widest()
    if n == 0:
        for i in range(LANES):
            scaled = lane[at.ALPHA, i] * lane[at.K_TILDE, i]
            lane[at.WANTED, i] = scaled * lane[at.ERROR, i]
        return
    chain_series(lane, n, rate)
    for i in range(LANES):
        lane[at.WANTED, i] = 0.0
    factorial = 1.0
    for power in range(n + 1):
        factorial *= max(power, 1)
        for i in range(LANES):
            gain = lane[at.K_TILDE, i]
            value = gain * lane[at.POWERS + power, i]
            if power > 0:
                slope = lane[at.DIFFERENTIATE, i] * (lane[at.NEXT_GAIN, i] - gain) * rate
                value += slope * lane[at.POWERS + power - 1, i]
            lane[at.WANTED, i] += lane[at.ALPHA + n - power, i] * factorial * value


@njit_lane
def move_chain(lane: Array, n: int, h: float) -> None:
    """`law.held_chain` of all runs, moved on by a sample of h (s) in which the gain grows to NEXT_GAIN."""
    widest()
    most = 0.0
    for i in range(LANES):
        k, k_next = lane[at.K_TILDE, i], lane[at.NEXT_GAIN, i]
        turn = lane[at.SIGMA0, i] * h * (k * k + k * k_next + k_next * k_next) * (1 / 3)
        lane[at.SHARE, i] = turn
        most = max(most, turn * lane[at.NORM, i])
    shares = int(np.ceil(most / LARGEST_SHARE)) if most > LARGEST_SHARE else 1
    for j in range(n):
        for i in range(LANES):
            error = lane[at.ERROR, i] if j == 0 else 0.0
            lane[at.DISTANCE + j, i] = lane[at.CHAIN + j, i] - error
    for _ in range(shares):
        for j in range(n):
            for i in range(LANES):
                lane[at.TERM + j, i] = lane[at.DISTANCE + j, i]
        for term in range(1, TAYLOR_TERMS + 1):
            next_term(lane, n, 1.0 / (term * shares))
    for j in range(n):
        for i in range(LANES):
            error = lane[at.ERROR, i] if j == 0 else 0.0
            lane[at.CHAIN + j, i] = lane[at.DISTANCE + j, i] + error


@njit_lane
def next_term(lane: Array, n: int, factor: float) -> None:
    """The next term of the exponential's series in TERM, from the one before, and added to DISTANCE."""
    widest()
    for i in range(LANES):
        lane[at.WANTED, i] = 0.0
    for j in range(n):
        for i in range(LANES):
            lane[at.WANTED, i] -= lane[at.K + j, i] * lane[at.TERM + j, i]
    for j in range(n):
        for i in range(LANES):
            new = lane[at.WANTED, i] if j == n - 1 else lane[at.TERM + j + 1, i]
            new *= factor * lane[at.SHARE, i]
            lane[at.TERM + j, i] = new
            lane[at.DISTANCE + j, i] += new


@njit_lane
def chain(lane: Array, n: int, rate: float, wanted: tuple[bool, float]) -> None:
    """Commands of all runs by compensators whose chain (16) is of order n; wanted: as of `command_all`."""
    widest()
    for i in range(LANES):
        grow(lane, i, wanted)
    chain_output(lane, n, rate)
    for i in range(LANES):
        u = lane[at.PLANT_SIGN, i] * lane[at.WANTED, i]
        u = compensated(lane, i, u, wheel_speed(lane, i, rate))
        lane[at.COMMAND, i] = within(u, lane[at.LIMIT, i])
    move_chain(lane, n, 1.0 / rate)
    for i in range(LANES):
        lane[at.K_TILDE, i] = lane[at.NEXT_GAIN, i]


@njit_lane
def command_all(
    lane: Array,
    closed: int,
    rate: float,
    fading: int,
    wanted: tuple[bool, float],
    order: int | None,
    steps_back: int | None,
) -> int:
    """Commands of all runs, of the controllers or as given, each limited by its rig, too; as `compensators`.

    closed: whether there are controllers. wanted: whether all follow one reference, or have one command, and its value;
    else it is each run's REFERENCE. order: of chains that have another than 1, steps_back: backstepping.
    """
    widest()
    if wanted[0] and (steps_back is not None or not closed):
        for i in range(LANES):
            lane[at.REFERENCE, i] = wanted[1]
    if order is not None:
        chain(lane, order, rate, wanted)
    elif steps_back is not None:
        for i in range(LANES):
            backstepping(lane, i, rate)
    elif closed:
        return compensators(lane, rate, fading, wanted)
    else:
        for i in range(LANES):
            lane[at.COMMAND, i] = within(lane[at.REFERENCE, i], lane[at.RIG_LIMIT, i])
    return 0
