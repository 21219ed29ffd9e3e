"""What the turning points of a free decay show without any window: its periods, and its loss of energy.

Half-periods of a pendulum grow with the amplitude, those of a spring do not. How they depend on it in the fitted
balance follows from its torques.
"""

from __future__ import annotations

import numpy as np

from swingid.checks.hypothesis import Evidence, Finding, Judged
from swingid.format import plus_minus
from swingid.model.terms import DISPLACEMENT
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.uncertainty.significance import CERTAIN

FEWEST = 8
"""Turning points, of which three unknowns are fitted."""

PLACES = 64
"""Angles between two turning points, evenly spread in the phase of a sine."""

ROUNDS = 3
"""Iterations between the speed at an angle and the work of friction up to it."""

SMALL = 1e-4
"""Step (rad, m) of a derivative by the angle."""

SLOPE_OF_CUBIC = 75 / 4
"""Variance of the slope of a cubic through samples over ±r, in σ²/r² over their number."""


def period_of_amplitude(evidence: Evidence, judged: Judged) -> list[Finding] | None:
    """Whether half-periods change with the amplitude A otherwise than those of the fitted balance T, by 1 + s A²/16.

    By a fit of t0 + τ Σ T (1 + s A²/16) to the turning times. Not where an impulse at each reversal acts.
    Of 212 simulated decays as their rig (five laws of friction, 12 to 16 bit, noise up to 0.5 mrad) 3 have a finding,
    none of which matters; with 1 % of error of the angle's scale 19 of 25 have one, and 17 matter.
    """
    law, motion = evidence.law, evidence.signals.motion
    known = all(term.term.kind == DISPLACEMENT for term in evidence.signals.further)
    if law.equation.drive != "none" or "memory" in law.unknowns or len(motion.turning_times) < FEWEST or not known:
        return None
    expected, weight = half_periods(evidence), motion.swing_sizes**2 / 64
    sums = [np.append(0.0, np.cumsum(one)) for one in (expected, expected * weight)]
    fit = fit_linear(np.column_stack([np.ones_like(sums[0]), *sums]), motion.turning_times)
    u = float(max(fit.covariance(2)[2, 2], fit.influence[2] ** 2 @ _noise(evidence))) ** 0.5
    if not abs(fit.values[2]) > CERTAIN * u:
        return []
    change, spread = (float(2 * one / fit.values[1] * np.mean(weight)) for one in (fit.values[2], u))
    text = (
        "the period changes with the amplitude otherwise than by the torques of the balance, its square by "
        f"{plus_minus(100 * change, 100 * spread, '%')} on average: a torque that depends on the angle is not as "
        "stated (spring, cable, magnets), or the scale of the angle is wrong; the inertia may be off by as much."
    )
    return [Finding(change * law.a11, text)]


def half_periods(evidence: Evidence) -> Array:
    """Time (s) from each turning point q0 to the next q1 by the fitted balance (swings,), ∫dq/q'.

    a11 q'²/2 = V(q0) − V(q) − W(q): W is the work of friction, of which the turning points give the whole,
    V(q0) − V(q1), and the friction law the share up to each angle.
    """
    law, motion = evidence.law, evidence.signals.motion
    start, stop = motion.turning_angles[:-1, None], motion.turning_angles[1:, None]
    phase = np.linspace(-np.pi / 2, np.pi / 2, 2 * PLACES + 1)
    way = (start + stop) / 2 + (stop - start) / 2 * np.sin(phase)
    angle, pieces = way[:, 1::2], np.abs(np.diff(way))
    fall, lost = (_potential(evidence, start) - _potential(evidence, one) for one in (angle, stop))
    share, speed = (angle - start) / (stop - start), np.zeros_like(angle)
    for _ in range(ROUNDS):
        speed = np.sqrt(np.maximum(2 * (fall - lost * share) / law.a11, 1e-300))
        torque = evidence.choice.friction.torque((np.sign(stop - start) * speed).ravel()).reshape(angle.shape)
        work = np.abs(torque) * (pieces[:, ::2] + pieces[:, 1::2])
        share = (np.cumsum(work, axis=1) - np.abs(torque) * pieces[:, 1::2]) / np.sum(work, axis=1)[:, None]
    result: Array = np.sum(np.abs(stop - start) / 2 * np.cos(phase[1::2]) / speed, axis=1) * np.pi / PLACES
    return result


def loss_unexplained(evidence: Evidence) -> float | None:
    """RMS of the lack of fit of the loss per full swing, over the RMS of the loss; None with too few swings.

    At a turning point of a free decay all energy is potential, b (1 − cos q), so its fall over one full swing is the
    work of friction ∫F(q1') q1' dt; None without the gravity torque b and with further terms, too.
    """
    signals, equation = evidence.signals, evidence.law.equation
    motion, b = signals.motion, equation.value("gravity_torque")
    if equation.drive != "none" or not b or signals.further or len(motion.turning_times) < 4:
        return None
    potential = b * (1 - np.cos(motion.turning_angles))
    speed, (instants, weights) = signals.speed.ravel(), signals.nodes.flat
    power = evidence.choice.friction.torque(speed) * speed
    work = np.interp(motion.turning_times, instants, np.cumsum(power * weights))
    lost = potential[:-2] - potential[2:]
    left = lost - (work[2:] - work[:-2])
    return float(np.sqrt(np.mean(left**2) / np.mean(lost**2)))


def _potential(evidence: Evidence, angle: Array) -> Array:
    """Of gravity and springs (J)."""
    law = evidence.law
    springs = (law.value(one.name) * (angle - one.shift.value) ** 2 / 2 for one in evidence.signals.further)
    return sum(springs, -law.value("gravity_torque") * np.cos(angle))


def _noise(evidence: Evidence) -> Array:
    """Variances (s²) of the turning times by white noise of the angle, through the slope of its cubics."""
    law, motion = evidence.law, evidence.signals.motion
    slope = SLOPE_OF_CUBIC * law.noise.angle**2 * law.noise.step / (2 * motion.reach**3)
    near = motion.turning_angles + SMALL * np.array([[-1.0], [1.0]])
    acceleration = np.diff(_potential(evidence, near), axis=0)[0] / (2 * SMALL * law.a11)
    result: Array = slope / np.maximum(acceleration**2, 1e-300)
    return result
