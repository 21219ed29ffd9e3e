"""Equation (II) on modulating functions within parts without reversal of the wheel, and which constants it determines.

The balance is linear in the products as long as each instant keeps its branch of (8). M is continuous at the edges
of the dead zone, so solving the linear balance and assigning the branches anew is Gauss–Newton's step on the
balance as it is, with exact derivatives. The voltage is held, so the branch changes at samples, where a row of
nodes ends, or by the slow change of the speed, where M has a mere kink.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swingid.balance import wheel_equation as at
from swingid.balance.rows import Windows
from swingid.calibration.motor.channels import IDLE, WheelLog
from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.model.rig.fields import stated
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project
from swingid.result.result import Message

LAG = 4
"""Neighbouring windows (2L long, one every L/2) that share data."""

FEWEST_ROWS, MOST_STEPS = 24, 40

EMPTY = 4e-3
"""Norm of a column, relative to that at full excitation, below which it counts as empty."""

PARALLEL, SHARE = 1e-7, 0.05
"""Singular values below this share of the largest mean that columns with such a share in the direction are parallel."""

SHORTEST, LONGEST = 12, 1.0
"""Half-lengths of the windows: at least so many samples, at most so many seconds."""


APART = 0.2
"""A part of a sum counts as identifiable when its own standard uncertainty is below this share of it."""

NEARLY = 3.0
"""… or when its uncertainty is that of the sum, to this factor."""

KNOWN = 1 / 3
"""Relative standard uncertainty of gain and damping above which the log is refused."""

BRANCHED = [at.GAIN, at.EMF, at.POSITIVE, at.NEGATIVE, at.COULOMB]
"""Products whose columns depend on the branches; those of the others are exact integrals of the angles."""

SIDES = {at.POSITIVE: "positive", at.NEGATIVE: "negative"}

WORDS = {
    at.GAIN: "efficiency * torque_per_volt",
    at.DAMPING: "efficiency * back_emf + gear_ratio * viscous",
    at.POSITIVE: "coulomb + dead_zone[1]",
    at.NEGATIVE: "coulomb - dead_zone[0]",
    at.COULOMB: "coulomb",
    at.EMF: "back_emf",
    at.COUPLING: "rotor_inertia",
}


@dataclass(frozen=True)
class LogRows:
    """One log on its windows: the integrals that do not depend on the branches are computed once.

    target (w,): ∫φ q2''. fixed (w, 2): columns of DAMPING and COUPLING.
    """

    log: WheelLog
    windows: Windows
    voltage: Array
    speed: Array
    target: Array
    fixed: Array

    @classmethod
    def of(cls, log: WheelLog, half: float) -> LogRows | None:
        """Windows of half-length `half` (s) within the runs of a log; None where none fits."""
        centres = [
            np.linspace(a + half, b - half, max(1, round((b - a - 2 * half) / (half / 2)) + 1))
            for a, b in log.runs
            if b - a > 2 * half
        ]
        if not centres:
            return None
        where = np.concatenate(centres)
        windows = Windows(where, np.full(len(where), half))
        wheel, angle = log.nodes.spline(log.wheel), log.nodes.spline(log.angle)
        part = project(log.nodes, [(wheel, 2), (wheel, 1), (angle, 2)], windows.centres, windows.half)
        speed = log.speed.at_nodes(log.nodes)
        fixed = np.column_stack([part[:, 1], -part[:, 2]])  # −∫φ q2' = ∫φ' q2
        return cls(log, windows, log.voltage_at_nodes(), speed, part[:, 0], fixed)

    def columns(self, values: Array) -> Array:
        """Columns (w, 7) of the balance with the branches that `values` give."""
        signals = at.regressors(values, self.voltage, self.speed, np.sign(self.speed))
        columns = [(signals[k], 0) for k in BRANCHED]
        result = np.empty((len(self.target), at.COUNT))
        result[:, BRANCHED] = project(self.log.nodes, columns, self.windows.centres, self.windows.half)
        result[:, [at.DAMPING, at.COUPLING]] = self.fixed
        return result


@dataclass(frozen=True)
class BalanceFit:
    """Products (7,) by equation (II), with the covariance (7, 7) of the free ones (zeros elsewhere).

    free: which products were fitted; seen: whose columns are neither empty nor a sum of others. half: half-length of
    the windows in s.
    """

    values: Array
    covariance: Array
    free: Bools
    seen: Bools
    rows: tuple[LogRows, ...]
    half: float


def fit_balance(logs: Sequence[WheelLog], start: Array, free: Bools) -> BalanceFit:
    """Fit the free products on windows of the length that determines them best; the others stay as in `start`.

    Raises UnanswerableError where no length gives enough windows.
    """
    step = max(log.noise.step for log in logs)
    longest = max(float(np.diff(log.runs, axis=1).max()) for log in logs)
    half, fits = SHORTEST * step, list[BalanceFit]()
    while half < min(LONGEST, longest / 2) or not fits:
        rows = tuple(part for log in logs if (part := LogRows.of(log, half)) is not None)
        if sum(len(part.target) for part in rows) >= FEWEST_ROWS:
            fits.append(_fit(rows, start, free, half))
        elif half > longest / 2:
            break
        half *= 1.6
    if not fits:
        raise UnanswerableError(
            f"{logs[0].name}: the wheel turns one way for {longest:.3g} s at most, too short for the balance; use "
            "lower frequencies in the voltage, or more rows per second.",
            code="too-short",
        )
    return min(fits, key=_log_variance)


def _log_variance(fit: BalanceFit) -> float:
    """Sum of the logarithms of the variances of gain, damping and friction."""
    wanted = [k for k in (at.GAIN, at.DAMPING, at.POSITIVE, at.NEGATIVE) if fit.free[k]]
    return float(np.sum(np.log(np.maximum(np.diag(fit.covariance)[wanted], 1e-300))))


def _fit(rows: tuple[LogRows, ...], start: Array, free: Bools, half: float) -> BalanceFit:
    target = np.concatenate([part.target for part in rows])
    sizes = [len(part.target) for part in rows]
    weights = np.ones(len(target))
    values = start
    for _ in range(2 if len(rows) > 1 else 1):
        values, columns, fit = _gauss_newton(rows, target, weights, values, free)
        residuals = np.split(target - columns @ values, np.cumsum(sizes)[:-1])
        level = [max(float(np.sqrt(np.mean(part**2))), 1e-300) for part in residuals]
        weights = np.repeat([level[0] / of_test for of_test in level], sizes)
    covariance = np.zeros((at.COUNT, at.COUNT))
    covariance[np.ix_(free, free)] = fit.covariance(LAG)
    seen = _seen(columns, rows, free)
    return BalanceFit(values, covariance, free, seen, rows, half)


def _seen(columns: Array, rows: tuple[LogRows, ...], free: Bools) -> Bools:
    """Which products are excited: neither an empty column nor one that is a sum of others."""
    sizes = np.linalg.norm(columns, axis=0)
    whole = np.linalg.norm(np.concatenate([part.windows.half for part in rows])) * 32 / 35
    volts = max(float(np.abs(part.voltage).max()) for part in rows)
    full = np.array([whole * volts, sizes[at.DAMPING], sizes[at.DAMPING], whole, whole, whole, 0.0])
    seen = np.asarray(sizes > EMPTY * full)
    where = np.flatnonzero(seen & free)
    _, s, directions = np.linalg.svd(columns[:, where] / sizes[where], full_matrices=False)
    for k in np.flatnonzero(s < PARALLEL * s[0]):
        seen[where[np.abs(directions[k]) > SHARE]] = False
    return seen


def _gauss_newton(
    rows: tuple[LogRows, ...], target: Array, weights: Array, start: Array, free: Bools
) -> tuple[Array, Array, LinearFit]:
    """Products at which the branches that they give are those that they were fitted with."""

    def stacked(values: Array) -> Array:
        return np.concatenate([part.columns(values) for part in rows])

    def loss(values: Array, columns: Array) -> float:
        return float(np.sum((weights * (target - columns @ values)) ** 2))

    def solved(values: Array, columns: Array) -> LinearFit:
        known = columns[:, ~free] @ values[~free]
        return fit_linear(weights[:, None] * columns[:, free], weights * (target - known))

    values, columns = start.copy(), stacked(start)
    least = loss(values, columns)
    for _ in range(MOST_STEPS):
        fit = solved(values, columns)
        step = np.zeros(at.COUNT)
        step[free] = fit.values - values[free]
        for _ in range(6):
            tried = at.allowed(values + step, free)
            new = stacked(tried)
            now = loss(tried, new)
            if now <= least * (1 + 1e-12):
                break
            step = step / 2
        else:
            break
        settled = bool(np.all(np.abs(tried - values) <= 1e-9 * np.abs(tried) + 1e-15))
        values, columns, least = tried, new, now
        if settled:
            break
    return values, columns, solved(values, columns)


@dataclass(frozen=True)
class Separation:
    """What is fitted and what is held: free (7,) products, values (7,) to start from and to hold, notes on it.

    emf, coulomb: whether back_emf and viscous, coulomb and dead zone, are distinguishable.
    """

    free: Bools
    values: Array
    emf: bool
    coulomb: bool
    notes: tuple[Message, ...]


def separate(fit: BalanceFit, rig: Rig, name: str) -> Separation:
    """Which products a fit of all distinguishes; the rest is held at the stated values.

    Raises UnanswerableError where not even gain and damping are identifiable; `name` is the log's, for the message.
    """
    u = np.sqrt(np.diag(fit.covariance))
    u[fit.free & ~fit.seen] = np.inf
    _require_excitation(fit, u, name)
    free, values = fit.free.copy(), fit.values.copy()
    by_rig = at.products_of(rig)
    sides = {k: side for k, side in SIDES.items() if not np.isfinite(u[k])}
    notes = [
        Message("not-seen", f"the motor never drives in {side} direction, so {WORDS[k]} keeps the rig's values.")
        for k, side in sides.items()
    ]
    emf = _identifiable(fit.values[at.EMF], u[at.EMF], u[at.DAMPING])
    coulomb = _identifiable(fit.values[at.COULOMB], u[at.COULOMB], min(u[at.POSITIVE], u[at.NEGATIVE]))
    assert rig.drive.motor is not None
    if not emf:
        free[at.EMF], values[at.EMF] = False, min(by_rig[at.EMF], max(fit.values[at.DAMPING], 0.0))
        held = "the rig's back_emf is kept" if stated(rig.drive.motor, "back_emf") else "back_emf is taken as 0"
        text = (
            "back_emf and viscous are collinear: only efficiency * back_emf + gear_ratio * viscous is identifiable, "
            f"because the log hardly coasts inside the dead zone; {held} and viscous takes the rest (let the wheel "
            "coast at 0 V)."
        )
        notes.append(Message("back-emf-with-viscous", text))
    if not coulomb:
        least = max(min((fit.values[k] for k in SIDES if k not in sides), default=0.0), 0.0)
        known = stated(rig.drive.motor, "coulomb")
        free[at.COULOMB], values[at.COULOMB] = False, min(by_rig[at.COULOMB], least) if known else least
        held = "the rig's coulomb is kept" if known else "coulomb takes as much as it can"
        text = (
            "coulomb and dead_zone are collinear: only coulomb + dead_zone[1] and coulomb - dead_zone[0] are "
            f"identifiable, because the motor hardly brakes the wheel or lets it coast; {held} and dead_zone takes the "
            "rest."
        )
        notes.append(Message("coulomb-with-dead-zone", text))
    for k in sides:
        free[k], values[k] = False, max(by_rig[k], values[at.COULOMB])
    return Separation(free, values, emf, coulomb, tuple(notes))


def _identifiable(value: float, spread: float, of_sum: float) -> bool:
    return bool(np.isfinite(spread) and (spread <= APART * abs(value) or spread <= NEARLY * of_sum))


def _require_excitation(fit: BalanceFit, u: Array, name: str) -> None:
    voltage = max(float(np.abs(part.log.voltage).max()) for part in fit.rows)
    if voltage < IDLE:
        raise UnanswerableError(
            f"{name}: the voltage never drives the wheel, so torque_per_volt is not identifiable; log a voltage test "
            "of several frequencies.",
            code="no-voltage",
        )
    unknown = [k for k in (at.GAIN, at.DAMPING) if not u[k] <= KNOWN * abs(fit.values[k])]
    if unknown:
        others = [k for k in SIDES if not u[k] <= KNOWN * abs(fit.values[k])]
        together = " and ".join(WORDS[k] for k in [*unknown, *others])
        raise UnanswerableError(
            f"{name}: {together} are not distinguishable, because the voltage has too few frequencies or is too short; "
            "log a test of several frequencies that turns the wheel both ways.",
            code="not-identifiable",
        )
    if fit.values[at.GAIN] < 0:
        raise UnanswerableError(
            f"{name}: a positive voltage turns the wheel backwards, so a sign is wrong; check log.voltage_sign and "
            "log.wheel_angle_sign.",
            code="wrong-sign",
        )
