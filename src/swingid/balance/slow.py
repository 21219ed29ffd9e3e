"""Slow changes within a log: a bearing that warms, a zero of the angle that drifts, as further unknowns of the balance.

Friction c_0 sgn v + c_1 v whose coefficients change slowly adds Σ_k P_k(x) (γ_0k sgn v + γ_1k v), with Legendre's
polynomials P_1, P_2, … of the time x, −1 at the start of the used part and 1 at its end: over it each is 0 in the mean,
so the terms of the law keep their meaning, the mean over the log. A zero of the angle that drifts by δ(t) = Σ_k δ_k P_k
adds −κ δ, κ the stiffness (of gravity b cos q1). Both are columns beside those of the law windows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from swingid.balance.fits import WindowFit, covariance_by, fit_rows, residuals_beside
from swingid.balance.rows import Signals, dry_column
from swingid.balance.systematics import left_by_place
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear, squared_distance
from swingid.numerics.test_functions import project
from swingid.result.data import Changing
from swingid.uncertainty.significance import CERTAIN, DECISIVE, INDICATED, bayesian, normal_of_ratio

SlowKind = Literal["friction", "zero"]

ORDERS: dict[SlowKind, int] = {"friction": 2, "zero": 3}
"""Highest polynomial of the time: a bearing warms once, a zero wanders."""

CHANGING = ("coulomb", "viscous")
"""Terms of friction whose coefficients may change."""


def name_of(term: str, order: int) -> str:
    """Name of the unknown that is the coefficient of P_order of a term."""
    return f"{term} over time {order}"


def names_of(kind: SlowKind, more: int = 0) -> tuple[str, ...]:
    """Names of the unknowns of a kind, up to `more` orders beyond ORDERS."""
    terms = CHANGING if kind == "friction" else ("zero",)
    return tuple(name_of(term, k) for term in terms for k in range(1, ORDERS[kind] + more + 1))


def progress(signals: Signals, instants: Array) -> Array:
    """The time over the used part of the log: −1 at its start, 1 at its end."""
    first, last = float(signals.nodes.stamps[0]), float(signals.nodes.stamps[-1])
    return 2 * (instants - first) / (last - first) - 1


def polynomial(order: int, x: Array) -> Array:
    """Legendre's polynomial of this order at x, by Bonnet's recursion."""
    before, value = np.ones_like(x), x
    for n in range(1, order):
        before, value = value, ((2 * n + 1) * x * value - n * before) / (n + 1)
    return value


def slope(order: int, x: Array) -> Array:
    """Its derivative: Σ (2k + 1) P_k over k = order − 1, order − 3 and so on."""
    value = np.zeros_like(x)
    for k in range(order - 1, -1, -2):
        value += (2 * k + 1) * (polynomial(k, x) if k else 1.0)
    return value


def has_stiffness(fit: WindowFit) -> bool:
    """Return whether a drift of the angle's zero acts in the balance at all: on a linear axis without a spring it does
    not.
    """
    return any(fit.value(term.name) or fit.equation.seeks(term.name) for term in fit.equation.conservative)


def slow_columns(signals: Signals, fit: WindowFit, kind: SlowKind, more: int = 0) -> dict[str, Array]:
    """The columns of a kind on the windows of a fit, by the names of their unknowns."""
    windows = fit.rows.windows
    x, rate = progress(signals, signals.nodes.flat[0]), 2 / float(signals.nodes.stamps[-1] - signals.nodes.stamps[0])
    columns: dict[str, Array] = {}
    for order in range(1, ORDERS[kind] + more + 1):
        shape = polynomial(order, x).reshape(signals.angle.shape)
        if kind == "zero":
            smooth = [(-signals.stiffness(fit.value) * shape, 0)]
        else:
            change = rate * slope(order, x).reshape(signals.angle.shape)
            # ∫φ P q1' = −∫φ' P q1 − ∫φ P' q1: from the angle, as all columns
            smooth = [(-signals.angle * shape, 1), (-signals.angle * change, 0)]
            at_edges = polynomial(order, progress(signals, signals.edges[:-1]))
            columns[name_of("coulomb", order)] = dry_column(signals, windows, shape, at_edges)
        name = name_of("zero" if kind == "zero" else "viscous", order)
        columns[name] = project(signals.nodes, smooth, windows.centres, windows.half).sum(axis=1)
    return {name: columns[name] for name in names_of(kind, more)}


def _roughly(signals: Signals, fit: WindowFit, kind: SlowKind) -> Array:
    """The columns (rows, n) with the polynomials at the middle of each window: quick, wrong by their change within."""
    rows, x = fit.rows, progress(signals, fit.rows.windows.centres)
    shapes = [polynomial(order, x) for order in range(1, ORDERS[kind] + 1)]
    bases = [rows[name] for name in CHANGING] if kind == "friction" else [rows["offset"]]
    return np.column_stack([shape * base for base in bases for shape in shapes])


def with_slow(fit: WindowFit, signals: Signals, kinds: Iterable[SlowKind]) -> WindowFit | None:
    """The fit with slow changes of these kinds as unknowns; None where there are too few rows. No declared effects."""
    columns: dict[str, Array] = {}
    for kind in kinds:
        columns |= slow_columns(signals, fit, kind)
    return fit_rows(fit.rows.beside(columns), fit.equation, fit.noise, (*fit.friction, *columns))


@dataclass(frozen=True)
class SlowTest:
    """What slow changes, as columns (rows, m) beside those of a fit, explain of its residuals.

    significance: of the change, in standard deviations of a normal quantity. left: residuals beside them (rows,).
    """

    columns: Array
    significance: float
    left: Array


def slow_test(fit: WindowFit, signals: Signals, kind: SlowKind) -> SlowTest | None:
    """Return whether slow changes of a kind show; None where there are too few rows, or nothing that may change.

    Their coefficients θ of m unknowns have the covariance V, with neighbouring rows correlated and noise of the sensors
    counted as in the fit; θᵀ V⁻¹ θ / m is nearly of the distribution F(m, ν). First with the polynomials at the middle
    of each window, which is quick and nearly right.
    """
    count = len(names_of(kind))
    few = fit.independent - len(fit.unknowns) - count < count
    if few or (kind == "zero" and not has_stiffness(fit)) or fit.is_exact:
        return None
    quick = _tested(fit, _roughly(signals, fit, kind))
    if quick.significance < INDICATED:
        return quick
    return _tested(fit, np.column_stack(list(slow_columns(signals, fit, kind).values())))


def _tested(fit: WindowFit, columns: Array, beside: Array | None = None) -> SlowTest:
    """The test of these columns; beside: of other causes (rows, n), as further unknowns."""
    count, more = columns.shape[1], columns if beside is None else np.hstack([beside, columns])
    alone, used = fit.beside(more).alone(), len(fit.unknowns) + more.shape[1]
    theta = alone.values[-count:]
    covariance = covariance_by(fit, alone.influence[-count:], alone.residuals, used)
    # columns that are equal here, as of dry and viscous friction at one speed, count once
    wald = squared_distance(theta, covariance) / count
    freedom = max(fit.independent - used, 1.0)
    return SlowTest(columns, normal_of_ratio(wald, count, freedom), alone.residuals)


def slow_kinds(fit: WindowFit, signals: Signals, others: Iterable[Array]) -> tuple[SlowKind, ...]:
    """What changes within the log: significant, also beside each of the other causes, none of which explains more.

    others: columns (rows, n) of other causes; any torque that depends on the angle is one, too. It explains more where
    its Bayesian criterion is lower by `DECISIVE`: noise of the samples hides such differences, and no change.
    """
    tests = {kind: slow_test(fit, signals, kind) for kind in ORDERS}
    significant = {kind: test for kind, test in tests.items() if test is not None and test.significance > CERTAIN}
    if not significant:
        return ()
    rows, causes = len(fit.rows), [columns for columns in others if columns.shape[1]]
    remaining = [(float(np.sum(residuals_beside(fit, columns) ** 2)), columns.shape[1]) for columns in causes]
    remaining.append((rows * left_by_place(fit, signals, np.zeros((rows, 0))), 1))
    best = min(bayesian(power, count, fit.independent) for power, count in remaining)
    return tuple(
        kind
        for kind, test in significant.items()
        if bayesian(float(test.left @ test.left), test.columns.shape[1], fit.independent) < best + DECISIVE
        and all(_tested(fit, test.columns, beside).significance > CERTAIN for beside in causes)
    )


@dataclass(frozen=True)
class SlowEffect:
    """What a slow change does to a11: its change by the unknowns, and the standard uncertainty that is left.

    u: change of a11 by polynomials of one order more.
    """

    kind: SlowKind
    change: float
    u: float


def slow_effects(law: WindowFit, signals: Signals, kinds: Iterable[SlowKind]) -> list[SlowEffect]:
    """The effect of each kind on a11; law: with slow changes of these kinds as unknowns."""
    effects, columns = [], law.columns
    target = columns @ law.fit.values + law.fit.residuals
    for kind in kinds:
        without = fit_linear(np.delete(columns, slice_of(law, kind), axis=1), target)
        more = slow_columns(signals, law, kind, 1)
        further = np.column_stack([column for name, column in more.items() if name not in law.unknowns])
        next_order = law.beside(further).solved()
        change = law.a11 - float(without.values[0])
        effects.append(SlowEffect(kind, change, abs(float(next_order.values[0]) - law.a11)))
    return effects


def slice_of(law: WindowFit, kind: SlowKind) -> list[int]:
    """Places of the unknowns of a kind."""
    return [law.unknowns.index(name) for name in names_of(kind)]


def change_over_time(law: WindowFit, signals: Signals, kind: SlowKind, points: int = 41) -> Changing:
    """The change at instants of the log: of the zero in rad or m, of the friction as a share of its mean loss."""
    times = np.linspace(float(signals.nodes.stamps[0]), float(signals.nodes.stamps[-1]), points)
    x, at = progress(signals, times), slice_of(law, kind)
    shapes = [polynomial(order, x) for order in range(1, ORDERS[kind] + 1)]
    weights = np.array(shapes)
    if kind == "friction":
        size = np.abs(signals.speed.ravel())
        powers = [float(np.mean(size**n)) for n in (1, 2, 3, 4)]
        loss = sum(law.value(name) * powers[n] for n, name in enumerate(("coulomb", "viscous", "quadratic", "cubic")))
        weights = np.vstack([weights * powers[0], weights * powers[1]]) / (abs(loss) or 1.0)
    spread = np.sqrt(np.maximum(np.einsum("kt,kl,lt->t", weights, law.covariance[np.ix_(at, at)], weights), 0.0))
    unit = "1" if kind == "friction" else "m" if signals.linear else "rad"
    return Changing(kind, unit, times, law.fit.values[at] @ weights, spread)
