"""What the turning points of a free decay show without any window: its loss of energy."""

from __future__ import annotations

import numpy as np

from swingid.checks.hypothesis import Evidence


def loss_unexplained(evidence: Evidence) -> float | None:
    """RMS of the lack of fit of the loss per full swing, over the RMS of the loss; None with too few swings.

    At a turning point of a free decay all energy is potential, b (1 − cos q), so its fall over one full swing is the
    work of friction ∫F(q1') q1' dt; None without the gravity torque b and with other terms, too.
    """
    signals, equation = evidence.signals, evidence.law.equation
    motion, b = signals.motion, equation.value("gravity_torque")
    if equation.driven or not b or len(equation.terms) > 1 or len(motion.turning_times) < 4:
        return None
    potential = b * (1 - np.cos(motion.turning_angles))
    speed, (instants, weights) = signals.speed.ravel(), signals.nodes.flat
    power = evidence.choice.friction.torque(speed) * speed
    work = np.interp(motion.turning_times, instants, np.cumsum(power * weights))
    lost = potential[:-2] - potential[2:]
    unexplained = lost - (work[2:] - work[:-2])
    return float(np.sqrt(np.mean(unexplained**2) / np.mean(lost**2)))
