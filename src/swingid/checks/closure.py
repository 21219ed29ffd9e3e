"""The test whether the terms of the balance explain a log: what they leave beyond the noise of the sensors."""

from __future__ import annotations

import math

import numpy as np

from swingid.balance.fits import WindowFit
from swingid.checks.hypothesis import Evidence, Finding
from swingid.errors import UnanswerableError
from swingid.format import percent

CLOSES = 0.2
"""Share of the term of the inertia, or of a larger one of gravity, that the balance may leave.

Of 53 foreign logs whose answer meets the evidence (benchmarks/strangers.py) the balance leaves 0.1 to 11 %; of a torque
column that is the speed 83 %, of angle and torque exchanged 150 %, without the gravity torque of a pendulum 65 %.
"""

OPEN = 0.5
"""Share from which on there is no answer: half of the motion has another cause than the model."""


def share_left(law: WindowFit) -> float:
    """What the terms leave beyond the noise of the sensors, as a share of the inertia's term or of gravity's (rms)."""
    excess = max(law.lost / len(law.rows) - float(np.mean(law.noise_of(law.rows.windows.half))), 0.0)
    terms = (law.a11 * law.rows["inertia"], law.value("gravity_torque") * law.rows["gravity_torque"])
    return float(np.sqrt(excess)) / max(*(float(np.std(term)) for term in terms), 1e-300)


def balance_open(evidence: Evidence) -> list[Finding]:
    """Return whether the balance does not close, so that log and rig file do not belong together.

    Raises UnanswerableError where it leaves more than `OPEN`.
    """
    share = share_left(evidence.law)
    if share <= CLOSES:
        return []
    text = (
        f"inertia, gravity, drive and friction leave {percent(share)} of the larger of their terms: a torque acts that "
        "the rig file does not have, or a column is not what [log] states; correct the column, sign, unit or constant "
        "(inspect tests each)."
    )
    if share > OPEN:
        raise UnanswerableError(text, code="balance-open")
    return [Finding(math.inf, text)]
