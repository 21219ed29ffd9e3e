"""The adaptation: a series-parallel model of the swing equation, whose prediction error drives α̂2 and α̂3.

    x̂2' = −α̂3 x2 + α̂2 φ + l (x2 − x̂2),   φ = −sin x1 + c7 x4 − c4 u2
    α̂3' = −γ1 e x2,   e = x2 − x̂2
    α̂2' = −γ2 e sin x1    "printed"        α̂2' = γ2 e φ    "consistent"

α̂4 = c4 α̂2 and α̂7 = c7 α̂2 as in the paper, so that the drive's terms are a factor of α̂2. The paper's laws with the
prediction error e in the place of its tracking error e2: with V = e²/2 + (α2 − α̂2)²/(2γ2) + (α3 − α̂3)²/(2γ1) the
consistent law gives V' = −l e².
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from swingid.errors import UnanswerableError, UsageError
from swingid.methods.backstepping.signals import Signals
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_called

LAWS = ("printed", "consistent")

STIFFEST = 2.0
"""Largest step of the integration times the rates of model and adaptation; Runge–Kutta 4 is stable up to 2.8."""


@dataclass(frozen=True)
class Gains:
    """l (1/s) of the model, γ1 (1/rad²) and γ2 (1/s²), first estimates α2 (1/s²) and α3 (1/s), their lower bound.

    As in section 5, with l = n2. On a linear axis m takes the place of rad.
    """

    law: str = "printed"
    gain: float = 10.0
    gamma1: float = 10.0
    gamma2: float = 100.0
    alpha2: float = 1.0
    alpha3: float = 1.0
    least: float = 1e-6

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise UsageError(
                f'unknown law {self.law!r} of "backstepping"; choose "printed" or "consistent".', code="no-law"
            )
        for name in ("gain", "gamma1", "gamma2", "alpha2", "alpha3"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < np.inf:
                raise UsageError(f"{name} must be a positive number, not {value!r}.", code="bad-gain")


def adapted(signals: Signals, gains: Gains) -> tuple[Array, Array]:
    """α̂2 (1/s²) and α̂3 (1/s) at the stamps of `signals`, both (n,).

    Raises UsageError where gains that were given are too high for the rate of the log, UnanswerableError where those
    of the paper are.
    """
    longest = float(np.max(np.diff(signals.time)))
    quick = np.sqrt(gains.gamma1) * np.max(np.abs(signals.speed))
    quick = np.hypot(quick, np.sqrt(gains.gamma2) * max(np.max(np.abs(signals.phi)), np.max(np.abs(signals.sine))))
    if longest * (gains.gain + quick) > STIFFEST:
        _refuse(longest, (longest * (gains.gain + quick) / STIFFEST) ** 2, gains)
    pushed = signals.phi if gains.law == "consistent" else -signals.sine
    constants = np.array([gains.gain, gains.gamma1, gains.gamma2, gains.alpha2, gains.alpha3, gains.least])
    estimates: Array = _adapt(signals.time, signals.speed, signals.phi, pushed, constants)
    return estimates[0], estimates[1]


@njit_called
def _slopes(
    model: float, alpha2: float, alpha3: float, x2: float, phi: float, pushed: float, gains: Array
) -> tuple[float, float, float]:
    error = x2 - model
    return -alpha3 * x2 + alpha2 * phi + gains[0] * error, gains[2] * error * pushed, -gains[1] * error * x2


@njit
def _adapt(time: Array, x2: Array, phi: Array, pushed: Array, gains: Array) -> Array:
    """Runge–Kutta 4 over every interval of the rows; signals (n − 1, 3) at its start, middle and end."""
    rows = len(time)
    estimates = np.empty((2, rows))
    model, alpha2, alpha3 = x2[0, 0], gains[3], gains[4]
    estimates[0, 0], estimates[1, 0] = alpha2, alpha3
    for k in range(rows - 1):
        h = time[k + 1] - time[k]
        a0, a1, a2 = _slopes(model, alpha2, alpha3, x2[k, 0], phi[k, 0], pushed[k, 0], gains)
        s = 0.5 * h
        b0, b1, b2 = _slopes(model + s * a0, alpha2 + s * a1, alpha3 + s * a2, x2[k, 1], phi[k, 1], pushed[k, 1], gains)
        c0, c1, c2 = _slopes(model + s * b0, alpha2 + s * b1, alpha3 + s * b2, x2[k, 1], phi[k, 1], pushed[k, 1], gains)
        d0, d1, d2 = _slopes(model + h * c0, alpha2 + h * c1, alpha3 + h * c2, x2[k, 2], phi[k, 2], pushed[k, 2], gains)
        model += h / 6.0 * (a0 + 2.0 * b0 + 2.0 * c0 + d0)
        alpha2 = max(alpha2 + h / 6.0 * (a1 + 2.0 * b1 + 2.0 * c1 + d1), gains[5])
        alpha3 = max(alpha3 + h / 6.0 * (a2 + 2.0 * b2 + 2.0 * c2 + d2), gains[5])
        estimates[0, k + 1], estimates[1, k + 1] = alpha2, alpha3
    return estimates


def _refuse(longest: float, factor: float, gains: Gains) -> NoReturn:
    """Raise the error of rows that lie `longest` s apart, where gain, gamma1 and gamma2 are `factor` times too high."""
    if (gains.gain, gains.gamma1, gains.gamma2) == (Gains.gain, Gains.gamma1, Gains.gamma2):
        raise UnanswerableError(
            f"rows lie up to {longest:.3g} s apart, too far for the adaptation with the gains of the paper; log "
            "faster, take a part without a gap (--part FROM:TO), or the momentum method.",
            code="slow-rows",
        )
    raise UsageError(
        f"the gains gain, gamma1 and gamma2 are too high for rows {longest:.3g} s apart; lower them by a factor of "
        f"{factor:.2g}.",
        code="bad-gain",
    )
