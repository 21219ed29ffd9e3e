"""What a log's own balance says of its clocks and encoders: latency, once and twice per turn, the zero of the angle.

To first order each of them adds a column to row (I) (THEORY 4, self-calibration). With the channels as logged and
a11 known from the fit without them:

    δ of the wheel against the angle     −a12 ∫φ'' q2'          (direct drive: δ of the angle against the torque, ∫φ' τ)
    α cos k q2 on the wheel's encoder    −a12 ∫φ'' cos k q2
    α cos k q1 on the axis' encoder      −a11 ∫φ'' cos k q1 − b ∫φ cos k q1 cos q1
    δ of the angle's zero                −b ∫φ cos q1

They are fitted beside inertia and friction, with wide normal priors: what the motion does not tell keeps their width.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from swingid.balance.fits import LAG, WindowFit, columns_of, known_side
from swingid.balance.rows import Rows, Signals
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project
from swingid.preparation.scale import Scale

PRIOR_LATENCY = 0.01
PRIOR_ENCODER = np.radians(1.0)
PRIOR_ZERO = 0.2
"""Standard deviations (s, rad, rad) that are no knowledge but bounds: ten times what a rig has."""

ROUNDS = 3
SHARP = 3.0
"""Fits on windows of other lengths count where they are at most so many times less certain than the best."""


@dataclass(frozen=True)
class Extra:
    """A small quantity that the balance can tell: value and standard uncertainty (s or rad), and what it was before."""

    name: str
    value: float
    uncertainty: float
    prior: float

    @property
    def told(self) -> bool:
        """Whether the log says more than a bound of ten times what a rig has."""
        return self.uncertainty < 0.3 * self.prior


@dataclass(frozen=True)
class _Column:
    name: str
    prior: float
    values: Array


def extras(fits: list[WindowFit], signals: Signals, scale: Scale, turn: float) -> dict[str, Extra]:
    """Every small quantity of this rig by name, from fits on windows of several lengths.

    The value is that of the windows which tell it best; what windows of other lengths say otherwise is added to its
    uncertainty, for what the friction basis does not describe depends on the length. turn: of the wheel per turn of its
    encoder.
    """
    found: dict[str, list[tuple[float, float]]] = {}
    priors: dict[str, float] = {}
    for fit in fits:
        for one in _fitted(fit, signals, scale, turn):
            found.setdefault(one.name, []).append((one.uncertainty, one.value))
            priors[one.name] = one.prior
    return {name: pooled(name, sorted(several), priors[name]) for name, several in found.items()}


def amplitude(found: dict[str, Extra], which: str) -> tuple[float, float, bool]:
    """Amplitude of α cos + β sin of an encoder ("wheel 1"), its standard uncertainty (rad), whether it is told."""
    cosine, sine = found[f"{which} cosine"], found[f"{which} sine"]
    size = float(np.hypot(cosine.value, sine.value))
    power = (cosine.value * cosine.uncertainty) ** 2 + (sine.value * sine.uncertainty) ** 2
    both = float(np.hypot(cosine.uncertainty, sine.uncertainty) / np.sqrt(2))
    return size, max(float(np.sqrt(power)) / max(size, 1e-300), both), cosine.told and sine.told


def _fitted(fit: WindowFit, signals: Signals, scale: Scale, turn: float) -> Iterator[Extra]:
    """One joint fit of friction, inertia and all extra columns on the windows of `fit`."""
    rows = fit.rows
    friction = tuple(name for name in fit.unknowns if name in rows.friction)
    names, columns = columns_of(rows, scale, friction)
    target = known_side(rows, scale)
    more = list(
        _columns(rows, signals, scale, fit.a11, fit.value("gravity_torque") if scale.b is None else scale.b, turn)
    )
    count = len(target)
    wide = np.column_stack([columns, *(column.values * column.prior for column in more)])
    residuals = fit.fit.residuals[:count]
    for _ in range(ROUNDS):
        error = np.sqrt(LAG / 2 * np.mean(residuals**2))
        prior = np.hstack([np.zeros((len(more), len(names))), error * np.eye(len(more))])
        solved = fit_linear(np.vstack([wide, prior]), np.append(target, np.zeros(len(more))))
        residuals = solved.residuals[:count]
    data = LinearFit(solved.values, residuals, solved.influence[:, :count], solved.condition)
    from_prior = solved.influence[:, count:] * error
    variances = np.diag(data.covariance(LAG) + from_prior @ from_prior.T)
    for k, column in enumerate(more, start=len(names)):
        spread = float(np.sqrt(max(variances[k], 0.0))) * column.prior
        yield Extra(column.name, float(solved.values[k]) * column.prior, spread, column.prior)


def _columns(rows: Rows, signals: Signals, scale: Scale, a11: float, b: float, turn: float) -> Iterator[_Column]:
    windows, nodes = rows.windows, signals.nodes

    def integrals(*pairs: tuple[Array, int]) -> Array:
        return project(nodes, list(pairs), windows.centres, windows.half)

    if signals.wheel is not None and signals.wheel_rate is not None:
        yield _Column("latency", PRIOR_LATENCY, -scale.a12 * integrals((signals.wheel_rate, 2))[:, 0])
        for k in (1, 2):
            for name, function in (("cosine", np.cos), ("sine", np.sin)):
                wave = function(k * signals.wheel / turn)
                yield _Column(f"wheel {k} {name}", PRIOR_ENCODER, -scale.a12 * integrals((wave, 2))[:, 0])
    elif signals.torque is not None:
        yield _Column("latency", PRIOR_LATENCY, integrals((signals.torque, 1))[:, 0])
    if signals.linear:
        return
    cosine = signals.cosine
    if b:
        yield _Column("zero", PRIOR_ZERO, -b * integrals((cosine, 0))[:, 0])
    for k in (1, 2):
        for name, function in (("cosine", np.cos), ("sine", np.sin)):
            wave = function(k * signals.angle)
            part = integrals((wave, 2), (wave * cosine, 0))
            yield _Column(f"angle {k} {name}", PRIOR_ENCODER, -(a11 * part[:, 0] + b * part[:, 1]))


def zero_of(fits: list[WindowFit], signals: Signals, scale: Scale) -> Extra | None:
    """How far 0 of the angle lies beside hanging (rad, to be taken off the angle); None where gravity does not tell.

    Told beside friction that depends on the direction, which swings at the same frequency; fits: as of `extras`.
    """
    if not scale.b or signals.linear:
        return None
    found = []
    for fit in fits:
        windows = fit.rows.windows
        friction = tuple(name for name in fit.unknowns if name in fit.rows.friction)
        _, columns = columns_of(fit.rows, scale, friction)
        cosine = project(signals.nodes, [(signals.cosine, 0)], windows.centres, windows.half)[:, 0]
        solved = fit_linear(np.column_stack([columns, -scale.b * cosine]), known_side(fit.rows, scale))
        found.append((float(np.sqrt(solved.covariance(LAG)[-1, -1])), float(solved.values[-1])))
    found.sort()
    return pooled("zero", found, PRIOR_ZERO)


def pooled(name: str, found: list[tuple[float, float]], prior: float) -> Extra:
    """The most certain of (uncertainty, value), sorted, and how far the others that are not much worse lie from it."""
    best, value = found[0]
    others = np.array([v for u, v in found if u < SHARP * best])
    return Extra(name, value, float(np.hypot(best, np.sqrt(np.mean((others - value) ** 2)))), prior)
