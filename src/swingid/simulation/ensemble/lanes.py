"""Where the constants and the state of the runs of a block stand: one array, a row per quantity, a column per run.

Everything of a block lies in one array, of a size that is part of its type (`BLOCK`). So the compiler sees that no two
rows overlap, and turns the loop over the runs into vector instructions without asking.

Speeds are kept as U = h q1' and Y = h q2' (rad per step of h), for which Taylor's coefficients have no powers of h.
(Kernels under njit have the places compiled in.)
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from swingid.control import backstepping as stepping
from swingid.control import law
from swingid.model import parameters as places
from swingid.model.sensors import ALPHA as ENCODER_ALPHA
from swingid.model.sensors import BETA as ENCODER_BETA
from swingid.model.sensors import RESOLUTION, ZERO
from swingid.numerics.arrays import Array

LANES = 32
"""Runs of a block. The rows that a step of most rigs touches are 18 kB, which leaves room in the first-level cache."""


FINEST = 2.0**-200
"""rad: steps of an encoder without steps. Multiples of it are all numbers above 1e-44, so nothing is rounded."""


def rows(first: int, *counts: int) -> tuple[int, ...]:
    """Places of rows from `first` on, so many of each name, and the next free one."""
    places = [first]
    for count in counts:
        places.append(places[-1] + count)
    return tuple(places)


# State of motion and controller, and what a sample leaves. FLAG: whether the step must be taken in parts; LEFT: which
# share of it `redo` left. The sine and the cosine are those of q1.
Q1, U, Q2, Y, K_TILDE, FILTERED, WHEEL_MEMORY, WHEEL_SEEN, XI = range(9)
REFERENCE, ANGLE_READING, WHEEL_READING, COMMAND, FLAG, LEFT, SINE, COSINE = range(9, 17)
# The axis: torques of gravity and friction, per U where they grow with it. KINK: products of two speeds up to this are
# a reversal that changes the friction (0, or -inf where none does).
GRAVITY, VISCOUS_P, VISCOUS_N, QUADRATIC, CUBIC, COULOMB_P, COULOMB_N, STATIC_P, STATIC_N = range(17, 26)
OFFSET, PEAK, DIRECT, AXIS_STICKS, AXIS_KINK = range(26, 31)
# The motor: eta c1, eta c2 / h, edges of the dead zone, N, N^2 f2 / h, N f3; torque that releases the wheel.
GAIN, BACK_EMF, EDGE_P, EDGE_N, GEAR, MOTOR_DRAG, MOTOR_COULOMB, WHEEL_STATIC, WHEEL_KINK = range(31, 40)
# Mobilities h^2 M^-1 where both slide and where one slides alone; a12 / h^2.
M11, M12, M22, ALONE1, ALONE2, A12 = range(40, 46)
# The compensator, as in `control.law`, what all controllers share, and the rig's own limit.
DELTA0, LAMBDA_H, SIGMA0, K_MAX, ERROR_DECAY, WHEEL_DECAY, PLANT_SIGN, DIFFERENTIATE, ALPHA1, ALPHA0, K1 = range(46, 57)
LIMIT, COULOMB, DEAD_NEGATIVE, DEAD_POSITIVE, EMF_RATIO, RIG_LIMIT = range(57, 63)
# Encoders of axis and wheel: step and 1/step, parts of the nonlinearity, zero; it and a row's noise.
ANGLE_STEP, ANGLE_INVERSE, ANGLE_COSINE, ANGLE_SINE, ANGLE_ZERO = range(63, 68)
WHEEL_STEP, WHEEL_INVERSE, WHEEL_COSINE, WHEEL_SINE, WHEEL_ZERO = range(68, 73)
ANGLE_NOISE, WHEEL_NOISE = range(73, 75)
# Encoders that are read late or early: q1, U, q2, Y at the start of the last step or part and its series, the fraction
# of the step at which a row is read, where axis and wheel are there; state at the last row; where the part begins.
START, SERIES1, SERIES2, WHEN, THERE, END, BEGIN, _NEXT = rows(75, 4, 5, 5, 1, 2, 4, 1)
# A step in parts: share that is still to be taken, sides (0: at rest) and whether they are to be decided, length of the
# part, what changes at its end; gravity's part of U' and Y' and mobilities (11, 12).
REMAINING, SIDE1, SIDE2, UNDECIDED, PART, CHANGE, PULLS, MOBILE, _NEXT = rows(_NEXT, 1, 1, 1, 1, 1, 1, 2, 2)
# The speed that is to be found, less that level, as a series; whether Newton's method is still far from it.
CHANGING, FAR, _NEXT = rows(_NEXT, 6, 1)
# A step between its loops: U1, Y1; viscous friction's and drag's parts of U' and Y'; g of Stribeck's peak, quadratic
# friction with its sign; ends U, Y, angles passed; how much too long the step is. Gravity's part of U' and Y'.
SLOPES, RATES, PRESENT, ENDS, TOO_LONG, PULL, _NEXT = rows(_NEXT, 2, 4, 2, 4, 1, 2)
# By how much xi of a compensator of order 1 fades in a sample.
FADING, _NEXT = rows(_NEXT, 1)
# Backstepping; its estimates stand in K_TILDE and FILTERED.
BEFORE, SEEN, AXIS_OBSERVER, WHEEL_OBSERVER, STEPPING, _NEXT = rows(_NEXT, 3, 1, 14, 14, 8)
# The chain (16) of another order than 1: xi, its distance from rest and a term of that, the Taylor series
# of xi, alpha, k; the error, the next gain, what the motor is to compensate, sum of |k|, and the share of a turn.
CHAIN_MOST = 4
CHAIN, DISTANCE, TERM, POWERS, ALPHA, K, ERROR, NEXT_GAIN, WANTED, NORM, SHARE, ROWS = rows(
    _NEXT, 4, 4, 4, 20, 5, 4, 1, 1, 1, 1, 1
)

BLOCK = np.dtype([("rows", np.float64, (ROWS, LANES))])
"""A block, for the kernels."""

KNOWN = (
    places.A11, places.A12, places.A22, places.B, places.DIRECT, places.GEAR, places.C1, places.C2, places.ETA,
    places.D1, places.D2, places.F2, places.F3, places.WHEEL_STATIC, places.AXIS_STICKS, places.VISCOUS_P,
    places.VISCOUS_N, places.COULOMB_P, places.COULOMB_N, places.STATIC_P, places.STATIC_N, places.STRIBECK_SPEED,
    places.QUADRATIC, places.CUBIC, places.OFFSET,
)  # fmt: skip
"""The constants that the lanes move by."""

OTHERS = np.setdiff1d(np.arange(places.SIZE), KNOWN)
"""All others: a run in which one of them is not 0 goes to the loop of single runs."""


def pack_motion(block: Array, p: Array, h: float) -> None:
    """Constants of motion into a block (ROWS, LANES), from p (LANES, SIZE) of `model.parameters`; step h (s)."""
    (a11, a12, a22), eta, gear = (p[:, [places.A11, places.A12, places.A22]].T), p[:, places.ETA], p[:, places.GEAR]
    determinant = a11 * a22 - a12 * a12
    for row, place in (
        (GRAVITY, places.B), (COULOMB_P, places.COULOMB_P), (COULOMB_N, places.COULOMB_N), (OFFSET, places.OFFSET),
        (STATIC_P, places.STATIC_P), (STATIC_N, places.STATIC_N), (DIRECT, places.DIRECT),
(GEAR, places.GEAR), (WHEEL_STATIC, places.WHEEL_STATIC), (AXIS_STICKS, places.AXIS_STICKS),
    ):  # fmt: skip
        block[row] = p[:, place]
    block[VISCOUS_P], block[VISCOUS_N] = p[:, places.VISCOUS_P] / h, p[:, places.VISCOUS_N] / h
    block[QUADRATIC], block[CUBIC] = p[:, places.QUADRATIC] / h**2, p[:, places.CUBIC] / h**3
    speed = p[:, places.STRIBECK_SPEED]
    block[PEAK] = np.divide(1.0, (speed * h) ** 2, out=np.zeros_like(speed), where=speed > 0.0)
    uneven = p[:, places.VISCOUS_P] != p[:, places.VISCOUS_N]
    kink = (p[:, places.AXIS_STICKS] != 0.0) | (p[:, places.QUADRATIC] != 0.0) | uneven
    block[AXIS_KINK] = np.where(kink, 0.0, -np.inf)
    block[GAIN], block[BACK_EMF] = eta * p[:, places.C1], eta * p[:, places.C2] / h
    block[EDGE_P], block[EDGE_N] = p[:, places.D1], p[:, places.D2]
    block[MOTOR_DRAG], block[MOTOR_COULOMB] = gear**2 * p[:, places.F2] / h, gear * p[:, places.F3]
    static = p[:, places.WHEEL_STATIC]
    block[WHEEL_KINK] = np.where((static > 0.0) & np.isfinite(static), 0.0, -np.inf)
    block[M11], block[M12], block[M22] = h**2 * a22 / determinant, h**2 * a12 / determinant, h**2 * a11 / determinant
    block[ALONE1], block[ALONE2], block[A12] = h**2 / a11, h**2 / a22, a12 / h**2
    block[PULL], block[PULL + 1] = -block[M11] * block[GRAVITY], block[M12] * block[GRAVITY]


def pack_compensator(block: Array, gains: Array, states: Array, h: float) -> None:
    """Compensators of one order into a block, from (LANES, ...) of `Compensator.parameters` and their states.

    The block has RIG_LIMIT. h: sample time (s).
    """
    _pack(block, gains, (DELTA0, LAMBDA_H, SIGMA0, K_MAX, ERROR_DECAY, WHEEL_DECAY, PLANT_SIGN, DIFFERENTIATE), (
        law.DELTA0, law.LAMBDA0, law.SIGMA0, law.K_TILDE_MAX, law.ERROR_DECAY, law.WHEEL_DECAY, law.PLANT_SIGN,
        law.DIFFERENTIATE_GAIN,
    ))  # fmt: skip
    _pack_motor(block, gains)
    block[LIMIT] = np.minimum(block[LIMIT], block[RIG_LIMIT])
    block[LAMBDA_H] *= h
    block[K_TILDE], block[FILTERED] = states[:, law.K_TILDE], states[:, law.FILTERED_ERROR]
    block[WHEEL_MEMORY], block[WHEEL_SEEN] = states[:, law.WHEEL_MEMORY], states[:, law.WHEEL_SEEN]
    order = int(gains[0, law.ORDER])
    alpha, k = gains[:, law.ALPHA : law.ALPHA + order + 1].T, gains[:, law.ALPHA + order + 1 :].T
    if order == 1:
        block[ALPHA1], block[ALPHA0] = alpha * block[PLANT_SIGN]
        block[K1], block[XI] = k[0] * block[SIGMA0], states[:, law.XI]
        block[DIFFERENTIATE] /= h
    else:
        block[ALPHA : ALPHA + order + 1], block[K : K + order] = alpha, k
        block[CHAIN : CHAIN + order] = states[:, law.XI :].T
        block[NORM] = np.maximum(1.0, np.abs(k).sum(axis=0))


def pack_backstepping(block: Array, gains: Array, states: Array) -> None:
    """Controllers (21) into a block, from (LANES, ...) of `Backstepping.parameters` and their states."""
    _pack_motor(block, gains)
    places_of = (stepping.N1, stepping.N2, stepping.GAMMA1, stepping.GAMMA2, stepping.C4, stepping.C7)
    _pack(block, gains, range(STEPPING, STEPPING + 8), (*places_of, stepping.CONSISTENT, stepping.LEAST))
    block[K_TILDE], block[FILTERED] = states[:, stepping.ALPHA2], states[:, stepping.ALPHA3]
    for row, column, first in (
        (AXIS_OBSERVER, stepping.AXIS, stepping.AXIS_OBSERVER),
        (WHEEL_OBSERVER, stepping.WHEEL, stepping.WHEEL_OBSERVER),
    ):
        block[row : row + 4] = states[:, column : column + 4].T
        block[row + 4 : row + 14] = gains[:, first : first + 10].T


def _pack_motor(block: Array, gains: Array) -> None:
    """What all controllers know of the motor, and their limit."""
    _pack(block, gains, (LIMIT, COULOMB, DEAD_NEGATIVE, DEAD_POSITIVE, EMF_RATIO), (
        law.LIMIT, law.COULOMB, law.DEAD_NEGATIVE, law.DEAD_POSITIVE, law.BACK_EMF,
    ))  # fmt: skip


def _pack(block: Array, gains: Array, to: Iterable[int], of: Iterable[int]) -> None:
    for row, place in zip(to, of, strict=True):
        block[row] = gains[:, place]


def pack_encoders(block: Array, encoders: Array) -> None:
    """Encoders (LANES, 2, 4) of `model.sensors`, those of axis and wheel, into a block."""
    for first, encoder in ((ANGLE_STEP, encoders[:, 0]), (WHEEL_STEP, encoders[:, 1])):
        step = encoder[:, RESOLUTION]
        block[first] = np.where(step > 0.0, step, FINEST)
        block[first + 1] = 1.0 / block[first]
        for i, place in enumerate((ENCODER_ALPHA, ENCODER_BETA, ZERO)):
            block[first + 2 + i] = encoder[:, place]
    block[ANGLE_NOISE], block[WHEEL_NOISE] = block[ANGLE_ZERO], block[WHEEL_ZERO]
