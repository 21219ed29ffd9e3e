"""How a closed loop behaved, from its log: tracking, settling of the gain, chatter, saturation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.recording.recording import Recording

STILL = 0.01
"""Share of its final value within which the gain k tilde counts as settled."""

AT_LIMIT = 0.999
"""Share of the voltage limit from which on a command counts as saturated."""


@dataclass(frozen=True)
class Loop:
    """Measures of one run; NaN where there is no loop.

    wanted, tracking: RMS of y_m less its mean, and of y_m - q1, over the second half (rad). k_tilde: the gain at the
    end. settling (s): since when k tilde is within 1 % of it. chatter: RMS of the voltage's change from sample to
    sample over the second half (V; direct drive N m). saturated: share of the second half at the voltage's limit.
    """

    wanted: float = np.nan
    tracking: float = np.nan
    k_tilde: float = np.nan
    settling: float = np.nan
    chatter: float = np.nan
    saturated: float = np.nan


def loop_of(log: Recording, limit: float | None) -> Loop:
    """The measures of a log that holds its reference and its gain. limit: of the voltage, None for none."""
    if log.reference is None or log.adaptive_gain is None:
        return Loop()
    half = slice(len(log) // 2, None)
    gain = log.adaptive_gain
    far = np.flatnonzero(np.abs(gain - gain[-1]) > STILL * abs(gain[-1]))
    settled = log.time[far[-1] + 1] - log.time[0] if len(far) else 0.0
    commands = log.voltage if log.voltage is not None else log.torque
    chatter = saturated = np.nan
    if commands is not None:
        chatter = float(np.sqrt(np.mean(np.diff(commands[half]) ** 2)))
        saturated = 0.0 if limit is None else float(np.mean(np.abs(commands[half]) >= AT_LIMIT * limit))
    tracking = float(np.sqrt(np.mean((log.reference - log.angle)[half] ** 2)))
    return Loop(float(np.std(log.reference[half])), tracking, float(gain[-1]), float(settled), chatter, saturated)
