"""Where the constants and the state of the runs of a block stand: one flat array, a row per quantity, a column per run.

Everything of a block lies in one array of rows of the fixed length `LANES`. So the compiler sees that no two rows
overlap, and turns the loop over the runs into vector instructions without asking.

Speeds are kept as U = h q1' and Y = h q2' (rad per step of h), for which Taylor's coefficients have no powers of h.
"""

from __future__ import annotations

import numpy as np

from swingid.control import law
from swingid.model import parameters as places
from swingid.model.sensors import ALPHA, BETA, RESOLUTION, ZERO
from swingid.numerics.arrays import Array

LANES = 32
"""Runs of a block. Its rows are 18 kB, which leaves room in the first-level cache for what is written."""

# State of motion and controller, and what a sample leaves; FLAG: 0, or where the step
# must be taken by itself into how many parts it may have to be cut.
Q1, U, Q2, Y, K_TILDE, FILTERED, WHEEL_MEMORY, WHEEL_SEEN, XI = range(9)
REFERENCE, ANGLE_READING, WHEEL_READING, COMMAND, FLAG = range(9, 14)
# The axis: torques of gravity and friction, per U where they grow with it.
GRAVITY, VISCOUS_P, VISCOUS_N, QUADRATIC, COULOMB_P, COULOMB_N, STATIC_P, STATIC_N = range(14, 22)
OFFSET, PEAK, DIRECT, AXIS_STICKS, AXIS_KINK = range(22, 27)
# The motor: eta c1, eta c2 / h, edges of the dead zone, N, N^2 f2 / h, N f3; torque that releases the wheel.
GAIN, BACK_EMF, EDGE_P, EDGE_N, GEAR, MOTOR_DRAG, MOTOR_COULOMB, WHEEL_STATIC, WHEEL_KINK = range(27, 36)
# Mobilities h^2 M^-1 where both slide and where one slides alone; a12 / h^2.
M11, M12, M22, ALONE1, ALONE2, A12 = range(36, 42)
# The controller, as in `control.law`, and the rig's own limit.
DELTA0, LAMBDA_H, SIGMA0, K_MAX, ERROR_DECAY, WHEEL_DECAY, PLANT_SIGN, DIFFERENTIATE, LIMIT = range(42, 51)
COULOMB, DEAD_NEGATIVE, DEAD_POSITIVE, EMF_RATIO, ALPHA1, ALPHA0, K1 = range(51, 58)
RIG_LIMIT = 58
# Encoders of axis and wheel.
ANGLE_STEP, ANGLE_COSINE, ANGLE_SINE, ANGLE_ZERO, WHEEL_STEP, WHEEL_COSINE, WHEEL_SINE, WHEEL_ZERO = range(59, 67)
ROWS = 67

KNOWN = (
    places.A11, places.A12, places.A22, places.B, places.DIRECT, places.GEAR, places.C1, places.C2, places.ETA,
    places.D1, places.D2, places.F2, places.F3, places.WHEEL_STATIC, places.AXIS_STICKS, places.VISCOUS_P,
    places.VISCOUS_N, places.COULOMB_P, places.COULOMB_N, places.STATIC_P, places.STATIC_N, places.STRIBECK_SPEED,
    places.QUADRATIC, places.OFFSET,
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
    block[QUADRATIC] = p[:, places.QUADRATIC] / h**2
    speed = p[:, places.STRIBECK_SPEED]
    block[PEAK] = np.divide(1.0, (speed * h) ** 2, out=np.zeros_like(speed), where=speed > 0.0)
    uneven = p[:, places.VISCOUS_P] != p[:, places.VISCOUS_N]
    block[AXIS_KINK] = (p[:, places.AXIS_STICKS] != 0.0) | (p[:, places.QUADRATIC] != 0.0) | uneven
    block[GAIN], block[BACK_EMF] = eta * p[:, places.C1], eta * p[:, places.C2] / h
    block[EDGE_P], block[EDGE_N] = p[:, places.D1], p[:, places.D2]
    block[MOTOR_DRAG], block[MOTOR_COULOMB] = gear**2 * p[:, places.F2] / h, gear * p[:, places.F3]
    block[WHEEL_KINK] = p[:, places.WHEEL_STATIC] != 0.0
    block[M11], block[M12], block[M22] = h**2 * a22 / determinant, h**2 * a12 / determinant, h**2 * a11 / determinant
    block[ALONE1], block[ALONE2], block[A12] = h**2 / a11, h**2 / a22, a12 / h**2


def pack_controller(block: Array, gains: Array, h: float) -> None:
    """Gains of the compensator into a block, from (LANES, 18) of `Compensator.parameters`; sample time h (s)."""
    for row, place in (
        (DELTA0, law.DELTA0), (SIGMA0, law.SIGMA0), (K_MAX, law.K_TILDE_MAX), (ERROR_DECAY, law.ERROR_DECAY),
        (WHEEL_DECAY, law.WHEEL_DECAY), (PLANT_SIGN, law.PLANT_SIGN), (DIFFERENTIATE, law.DIFFERENTIATE_GAIN),
        (LIMIT, law.LIMIT), (COULOMB, law.COULOMB), (DEAD_NEGATIVE, law.DEAD_NEGATIVE),
        (DEAD_POSITIVE, law.DEAD_POSITIVE), (EMF_RATIO, law.BACK_EMF), (ALPHA1, law.ALPHA), (ALPHA0, law.ALPHA + 1),
        (K1, law.ALPHA + 2),
    ):  # fmt: skip
        block[row] = gains[:, place]
    block[LAMBDA_H] = gains[:, law.LAMBDA0] * h


def pack_encoders(block: Array, encoders: Array) -> None:
    """Encoders (LANES, 2, 4) of `model.sensors`, those of axis and wheel, into a block."""
    for first, encoder in ((ANGLE_STEP, encoders[:, 0]), (WHEEL_STEP, encoders[:, 1])):
        for i, place in enumerate((RESOLUTION, ALPHA, BETA, ZERO)):
            block[first + i] = encoder[:, place]
