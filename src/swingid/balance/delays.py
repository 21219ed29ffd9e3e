"""Delay of the turning points found, because the acceleration jumps where friction changes its sign.

A cubic fitted over ±w has a bias of its slope in the middle by that jump. The estimated friction gives the bias; the
angle itself gives, with more noise, the share of the jump that is in it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from swingid.balance.rows import Signals
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import gauss_rule
from swingid.numerics.spline import kinked_slopes
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.speed import typical_step

Torque = Callable[[Array], Array]


DRIVEN = 0.5
"""Prior standard deviation of the share of friction's jump that is in the angle."""

FARTHEST = 0.25
"""Delay, in half-widths of the cubic, beyond which this theory is not valid: the axis may rest as well."""


def dry_levels(signals: Signals, value: Callable[[str], float]) -> Array:
    """Dry friction of load on the bearing at each turning point (N m or N), half of its jump there.

    value: of a coefficient by its name.
    """
    angles = signals.motion.turning_angles
    dry = [term for term in signals.terms.values() if term.term.is_dry]
    return sum((value(term.name) * term.term.of_angle(angles, *term.at) for term in dry), np.zeros(len(angles)))


def late_reversals(
    signals: Signals, torque: Torque, inertia: float, noise: Noise, levels: Array | float = 0.0
) -> Array:
    """Delay of each turning point (s) with this friction, times the share of it that is consistent with the angle.

    A drive may take over the jump of friction in part or wholly, as a controller that compensates friction does: then
    less of it is in the angle. So the prior of the share is 1 ± 1/2.
    """
    motion = signals.motion
    with np.errstate(over="ignore", invalid="ignore"):  # an inertia of 0, as of a dead channel, gives an infinite delay
        late = lateness(motion, torque, max(inertia, 1e-300), levels)
    late = np.where(np.abs(late) < FARTHEST * motion.reach, late, 0.0)
    share, spread = share_seen(motion, signals.nodes.stamps, signals.angle_values, late, noise.angle)
    if spread > 0:
        share = (share / spread**2 + 1 / DRIVEN**2) / (1 / spread**2 + 1 / DRIVEN**2)
    return share * late


def dry_friction(torque: Torque, levels: Array | float = 0.0) -> float:
    """Dry friction (N m or N), half of the jump at a reversal; levels: as of `dry_levels`."""
    above, below = torque(np.array([1e-9, -1e-9]))
    return float(abs(above - below + 2 * (np.mean(levels) if np.size(levels) else 0.0))) / 2


def lateness(motion: Motion, torque: Torque, inertia: float, levels: Array | float = 0.0) -> Array:
    """Delay (s) of each turning point where all of the friction, torque(speeds), accelerates the inertia.

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
    """Share of the delays `late` by the angle at the turning points, with its standard uncertainty.

    A cubic with a kink in the middle has no delay, but four times the noise, which is averaged over the turning points:
    the uncertainty is that of their scatter, and at least that by `noise` (standard deviation of one sample).
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
    remaining = rest - excess * late
    variance = max(float(remaining @ remaining) / (count - 1) / power, float(white @ white) / power**2)
    return 1.0 + excess, float(np.sqrt(variance))
