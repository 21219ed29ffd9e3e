"""Zero, bias and random walk of an angle that is the integral of a rate, as the balance of torques determines them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.balance.errors import channel_errors
from swingid.preparation.rate import BIAS, ZERO
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter, scatter

if TYPE_CHECKING:
    from swingid.balance.fits import Effect, WindowFit
    from swingid.balance.friction import FrictionLaw
    from swingid.balance.rows import Signals
    from swingid.numerics.arrays import Array
    from swingid.preparation.prepared import Part

SMALL = 1e-5
"""Error of the angle (rad or m) that is not worth another fit: friction of 1e-5 of the gravity torque."""

PARAMETER = "angle_speed_bias"
"""Name of the bias among the parameters of a result."""


def amounts_left(law: WindowFit, signals: Signals) -> dict[str, float] | None:
    """Amounts of zero, bias and walk by which the angle is still wrong; None where they do not matter.

    They are unknowns of the fit, linearised, and no terms of the friction law: what is larger is subtracted from the
    angle before both are fitted again. A constant torque c and a zero that is off by c/b are the same to first order,
    so the angle counts from where all constant torques together vanish, as in a free decay.
    """
    level = signals.encoders.level
    if level is None or not law.wandering or level.zero_std == 0:
        return None
    amounts = {effect.item.source: _error(effect) for effect in law.wandering}
    pull = sum(law.value(name) * slope for name, slope in law.rows.pulls.items())
    amounts[ZERO] -= law.value("offset") / pull if pull > 0 else 0.0
    unknowns = level.unknowns(signals.nodes.stamps)
    drift = sum(
        (amount * unknowns[name].shape for name, amount in amounts.items()), np.zeros(len(signals.nodes.stamps))
    )
    return amounts if float(np.max(np.abs(drift))) > SMALL else None


def _error(effect: Effect) -> float:
    """The error of the angle that the fit has found; its columns are what has to be added to the known side."""
    return -effect.value * effect.item.std


def wandering(law: WindowFit, friction: FrictionLaw, signals: Signals) -> Array:
    """Covariance of the terms of friction by what is left unknown of the angle."""
    level, covariance = signals.encoders.level, np.zeros_like(friction.covariance)
    if level is None or not law.wandering:
        return covariance
    errors = channel_errors(friction.rows, signals, [effect.item.of for effect in law.wandering], law.coefficients)
    for effect, error in zip(law.wandering, errors, strict=True):
        change = friction.influence @ error.rows * effect.spread * effect.item.std
        covariance += np.outer(change, change)
    return covariance


def with_bias(evaluated: Evaluated, law: WindowFit, part: Part) -> Evaluated:
    """The parameters with the bias of the rate, where one was logged: by the balance, else by the centres of swings."""
    level = part.encoders.level
    if level is None:
        return evaluated
    value, u = level.bias.value, level.bias.std
    for effect in law.wandering:
        if effect.item.source == BIAS:
            value, u = value + _error(effect), effect.spread * effect.item.std
    bias = Parameter.of(value, u, "m/s" if law.equation.linear else "rad/s")
    entries = [] if u is None else [BudgetEntry(scatter("scatter of the windows and sensor noise"), PARAMETER, u)]
    return Evaluated(
        evaluated.parameters | {PARAMETER: bias},
        [*evaluated.budget, *entries],
        evaluated.correlation,
        evaluated.sensitivities,
    )
