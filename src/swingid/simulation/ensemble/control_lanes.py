"""The consecutive compensator (14)-(20) in lanes: `control.law.compensator_step` for relative degree 2."""

from __future__ import annotations

from swingid.numerics.arrays import Array
from swingid.simulation.ensemble.lane_functions import decay, njit_lane
from swingid.simulation.ensemble.lanes import (
    ALPHA0,
    ALPHA1,
    ANGLE_READING,
    COMMAND,
    COULOMB,
    DEAD_NEGATIVE,
    DEAD_POSITIVE,
    DELTA0,
    DIFFERENTIATE,
    EMF_RATIO,
    ERROR_DECAY,
    FILTERED,
    K1,
    K_MAX,
    K_TILDE,
    LAMBDA_H,
    LANES,
    LIMIT,
    PLANT_SIGN,
    REFERENCE,
    SIGMA0,
    WHEEL_DECAY,
    WHEEL_MEMORY,
    WHEEL_READING,
    WHEEL_SEEN,
    XI,
)  # fmt: skip


@njit_lane
def control(lane: Array, i: int, h: float) -> None:
    """Command of run i of a block from its readings, and its controller moved on by a sample of h (s), in place."""
    e = lane[REFERENCE * LANES + i] - lane[ANGLE_READING * LANES + i]
    wheel = lane[WHEEL_READING * LANES + i]
    k = lane[K_TILDE * LANES + i]
    xi, memory, seen = lane[XI * LANES + i], lane[WHEEL_MEMORY * LANES + i], lane[WHEEL_SEEN * LANES + i]
    held, fading = lane[FILTERED * LANES + i], lane[ERROR_DECAY * LANES + i]
    sigma0, k1 = lane[SIGMA0 * LANES + i], lane[K1 * LANES + i]

    filtered = held if fading > 0.0 else e
    grown = k + lane[LAMBDA_H * LANES + i]
    most = lane[K_MAX * LANES + i]
    grown = grown if grown < most else most
    grown = grown if grown > k else k
    k_next = grown if abs(filtered) > lane[DELTA0 * LANES + i] else k
    rate = sigma0 * k * k * k1 * (e - xi)
    gain_term = lane[DIFFERENTIATE * LANES + i] * ((k_next - k) / h) * xi
    u = lane[ALPHA1 * LANES + i] * (gain_term + k * rate) + lane[ALPHA0 * LANES + i] * k * xi
    u = lane[PLANT_SIGN * LANES + i] * u

    memory = memory if seen != 0.0 else wheel
    change = (wheel - memory) * (1.0 - lane[WHEEL_DECAY * LANES + i])
    speed = change / h
    dry = lane[COULOMB * LANES + i]
    u += dry if speed > 0.0 else (-dry if speed < 0.0 else 0.0)
    switch = u - lane[EMF_RATIO * LANES + i] * speed
    positive, negative = lane[DEAD_POSITIVE * LANES + i], lane[DEAD_NEGATIVE * LANES + i]
    u += positive if switch > 0.0 else (negative if switch < 0.0 else 0.0)

    turn = sigma0 * h * (k * k + k * k_next + k_next * k_next) * (1 / 3)
    limit = lane[LIMIT * LANES + i]
    u = u if u > -limit else -limit
    lane[COMMAND * LANES + i] = u if u < limit else limit
    lane[XI * LANES + i] = e + (xi - e) * decay(k1 * turn)
    lane[FILTERED * LANES + i] = e + (held - e) * fading
    lane[K_TILDE * LANES + i] = k_next
    lane[WHEEL_MEMORY * LANES + i] = memory + change
    lane[WHEEL_SEEN * LANES + i] = 1.0
