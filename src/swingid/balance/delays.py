"""How late turning points are found, because friction makes the acceleration jump where the axis turns around.

A cubic fitted over ±w takes the jump on one side for a slope in the middle. The friction found tells how much; the
angle itself tells, with more noise, how much of the jump it holds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from swingid.balance.rows import Signals
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import gauss_rule
from swingid.numerics.spline import kinked_slopes
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.speed import typical_step

Torque = Callable[[Array], Array]


class Fit(Protocol):
    """What `dry_levels` reads of a fit."""

    def value(self, name: str) -> float:
        """Value of an unknown, 0 where it was not sought."""


DRIVEN = 0.5
"""Standard uncertainty, before the log is seen, of the share of friction's jump that the angle shows."""

FARTHEST = 0.25
"""Delay, in half-widths of the cubic, beyond which this theory of it ends: the axis may rest as well."""


def dry_levels(signals: Signals, fit: Fit) -> Array:
    """Dry friction of the further terms at each turning point (N m or N), half of its jump there, as a fit has it."""
    angles = signals.motion.turning_angles
    dry = [term for term in signals.further if term.term.is_dry]
    return sum((fit.value(term.name) * term.term.of_angle(angles, *term.at) for term in dry), np.zeros(len(angles)))


def late_reversals(
    signals: Signals, torque: Torque, inertia: float, noise: Noise, levels: Array | float = 0.0
) -> Array:
    """How late each turning point is found (s) with this friction, as far as the angle does not deny it.

    A drive may take over some of the jump of friction or all of it, as a controller that compensates friction does:
    then less of it is in the angle. So the share that counts is 1 ± 1/2 before the angle is asked.
    """
    motion = signals.motion
    with np.errstate(over="ignore", invalid="ignore"):  # an inertia of 0, as of a dead channel, delays without end
        late = lateness(motion, torque, max(inertia, 1e-300), levels)
    late = np.where(np.abs(late) < FARTHEST * motion.reach, late, 0.0)
    share, spread = share_seen(motion, signals.nodes.stamps, signals.angle_values, late, noise.angle)
    if spread > 0:
        share = (share / spread**2 + 1 / DRIVEN**2) / (1 / spread**2 + 1 / DRIVEN**2)
    return share * late


def impulse_of(late: Array, torque: Torque, levels: Array | float = 0.0) -> float:
    """Impulse (N m s or N s) that turning points late by `late` make of the jump of friction there."""
    above, below = torque(np.array([1e-9, -1e-9]))
    return float(np.sqrt(np.mean(late**2)) * abs(above - below + 2 * (np.mean(levels) if np.size(levels) else 0.0)))


def lateness(motion: Motion, torque: Torque, inertia: float, levels: Array | float = 0.0) -> Array:
    """How late (s) each turning point is found where all of the friction, torque(speeds), is left to the inertia.

    About a turning point the speed is A t, and friction adds x with x'' = −F(A t)/a11 to an even motion. The slope of a
    cubic over t = ±w u in the middle is 2 w ∫ x'' G(u) du from 0 to 1 (x is odd), and A times the delay cancels it.
    """
    acceleration = np.maximum(np.abs(motion.speed.acceleration(motion.turning_times)), 1e-300)
    root, weights = gauss_rule(24)
    # nodes dense near 0, where friction changes within a small speed
    u, weights = root**2, 2 * weights * root
    response = 75 / 8 * ((1 - u**3) / 3 - u * (1 - u**2) / 2) - 105 / 8 * ((1 - u**5) / 5 - u * (1 - u**4) / 4)
    speeds = np.multiply.outer(acceleration * motion.reach, u)
    odd = (torque(speeds.ravel()) - torque(-speeds.ravel())).reshape(speeds.shape) / 2 + np.reshape(levels, (-1, 1))
    late: Array = 2 * motion.reach / inertia * (odd @ (weights * response)) / acceleration
    return late


def share_seen(motion: Motion, time: Array, angle: Array, late: Array, noise: float) -> tuple[float, float]:
    """Share of the delays `late` that the angle itself shows at the turning points, with its standard uncertainty.

    A cubic with a kink in the middle has no delay, but four times the noise, which the turning points average: by
    their scatter, and not better than `noise` (standard deviation of one sample) would let them.
    """
    acceleration = motion.speed.acceleration(motion.turning_times)
    rest = kinked_slopes(time, angle, motion.turning_times - late, motion.reach) / acceleration
    seen = np.isfinite(rest)
    count, rest, late = int(np.count_nonzero(seen)), rest[seen], late[seen]
    power = float(late @ late)
    if count < 2 or power == 0.0:
        return 1.0, np.inf
    excess = float(late @ rest) / power
    step = typical_step(time)
    white = noise * np.sqrt(150 * step / motion.reach**3) * late / acceleration[seen]
    left = rest - excess * late
    variance = max(float(left @ left) / (count - 1) / power, float(white @ white) / power**2)
    return 1.0 + excess, float(np.sqrt(variance))
