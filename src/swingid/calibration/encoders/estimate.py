"""From logs to the encoders' parts: Gauss–Newton over the joint fit, each step about straightened readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swingid.balance.agreement import COMPARABLE
from swingid.balance.rows import Signals
from swingid.calibration.encoders.joint import JointFit, fit_jointly
from swingid.calibration.encoders.logs import CalibrationLog
from swingid.calibration.encoders.parts import Part, with_parts
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.scale import Scale
from swingid.uncertainty.dark import dark_uncertainty

STEPS = 4
"""Gauss–Newton steps at most; the third changes nothing that can be seen with 1°."""

SETTLED = 0.02
"""Change of every part, in its standard uncertainties, that ends the steps."""

STRETCHES = (0.5, 2.0**-0.5, 2.0**0.5)
"""Lengths of windows beside the chosen one on which the parts are found as well."""


@dataclass(frozen=True)
class Estimate:
    """Values of the parts (rad, s) by key and what makes them uncertain.

    drift (parts,): uncertainty from windows of other lengths; grid, scatter (parts,): standard uncertainties. errors:
    standard deviation of a row of each log.
    """

    asked: tuple[Part, ...]
    values: dict[str, float]
    scatter: Array
    grid: Array
    drift: Array
    errors: Array

    @property
    def uncertainties(self) -> dict[str, float]:
        """Standard uncertainties of the parts by key."""
        whole = np.sqrt(self.scatter**2 + self.grid**2 + self.drift**2)
        return {part.key: float(u) for part, u in zip(self.asked, whole, strict=True)}


@dataclass(frozen=True)
class Solved:
    """The joint fit about the parts `values` (by key, nuisances 0), with the rig that states them.

    signals: of the readings straightened by them.
    """

    fit: JointFit
    values: dict[str, float]
    bent: Rig
    signals: list[Signals]
    a11: float
    b: float


def solve(logs: Sequence[CalibrationLog], rig: Rig, asked: Sequence[Part]) -> Solved:
    """Gauss–Newton to the parts that make the balances of all logs close best with one inertia."""
    values = {part.key: 0.0 for part in asked}
    a11, b = _first(logs, rig)
    for _ in range(STEPS):
        bent = with_parts(rig, values, asked)
        signals = [log.signals(bent) for log in logs]
        fit = fit_jointly([log.rows(s, bent, a11, b) for log, s in zip(logs, signals, strict=True)], asked, values)
        a11, b = _known(fit, rig)
        # a nuisance is not taken off the readings: it is found whole each time
        step = np.where([part.nuisance for part in asked], 0.0, fit.parts)
        if np.max(np.abs(step / fit.uncertainties)) < SETTLED:
            break
        values = {part.key: values[part.key] + float(d) for part, d in zip(asked, step, strict=True)}
    return Solved(fit, values, bent, signals, a11, b)


def estimate(logs: Sequence[CalibrationLog], rig: Rig, asked: Sequence[Part]) -> Estimate:
    """The parts by all logs together, with what windows of other lengths say otherwise."""
    found = solve(logs, rig, asked)
    fit, others = found.fit, []
    for stretch in STRETCHES:
        pairs = zip(logs, found.signals, strict=True)
        rows = [log.rows(signals, found.bent, found.a11, found.b, stretch) for log, signals in pairs]
        if all(len(one.target) > 2 * len(one.own) + 8 for one in rows):
            others.append(fit_jointly(rows, asked, found.values))
    k = len(fit.common)
    nuisances = {part.key: float(v) for part, v in zip(asked, fit.parts, strict=True) if part.nuisance}
    return Estimate(
        asked=tuple(asked),
        values=found.values | nuisances,
        scatter=np.sqrt((fit.scatter + np.minimum(fit.grid, 0.0))[k:]),
        grid=np.sqrt(np.maximum(fit.grid, 0.0)[k:]),
        drift=_drift(fit, others),
        errors=fit.errors,
    )


def _first(logs: Sequence[CalibrationLog], rig: Rig) -> tuple[float, float]:
    """Inertia of the whole axis and gravity torque to begin with, from the most certain log."""
    best = min((log.first for log in logs), key=lambda fit: fit.total)
    b = Scale.of(rig).b
    return best.a11, best.value("gravity_torque") if b is None else b


def _known(fit: JointFit, rig: Rig) -> tuple[float, float]:
    b = Scale.of(rig).b
    return float(fit.common[0]), float(fit.common[1]) if b is None else b


def _drift(chosen: JointFit, others: Sequence[JointFit]) -> Array:
    """Uncertainty of every part by what windows of other lengths give otherwise; see `balance.agreement`.

    All lengths use the same samples, so the variance of a difference is the difference of the variances.
    """
    found = np.zeros(len(chosen.parts))
    mine = chosen.uncertainties
    for other in others:
        for k, u in enumerate(other.uncertainties):
            if u < COMPARABLE * mine[k]:
                gap, variance = float(other.parts[k] - chosen.parts[k]), abs(float(u**2 - mine[k] ** 2))
                found[k] = max(found[k], dark_uncertainty(gap, variance, float(mine[k])))
    return found
