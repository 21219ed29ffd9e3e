"""What a free decay loses from swing to swing, and how much of it the friction law explains."""

from __future__ import annotations

import numpy as np

from swingid.balance.friction import FrictionLaw
from swingid.balance.rows import Signals


def loss_unexplained(signals: Signals, law: FrictionLaw, b: float) -> float | None:
    """RMS of what the law leaves of the loss per full swing, over the RMS of the loss; None with too few swings.

    At a turning point all energy is potential, b (1 − cos q), so its fall over one full swing is the work of friction
    ∫F(q1') q1' dt. b: gravity torque in N m.
    """
    motion = signals.motion
    if len(motion.turning_times) < 4:
        return None
    potential = b * (1 - np.cos(motion.turning_angles))
    power = law.torque(signals.speed.ravel()) * signals.speed.ravel()
    instants, weights = signals.nodes.flat
    work = np.interp(motion.turning_times, instants, np.cumsum(power * weights))
    lost = potential[:-2] - potential[2:]
    left = lost - (work[2:] - work[:-2])
    return float(np.sqrt(np.mean(left**2) / np.mean(lost**2)))
