"""Latency, encoder nonlinearity and zero of the angle, estimated from the log's own balance of momentum.

To first order each of them adds a column to the regression of equation (I) (self-calibration in docs/theory.md). With
the channels as logged and a11 known from the fit without them:

    δ of the wheel against the angle     −a12 ∫φ'' q2'          (direct drive: δ of the angle against the torque, ∫φ' τ)
    α cos k q2 on the wheel's encoder    −a12 ∫φ'' cos k q2
    α cos k q1 on the axis' encoder      −a11 ∫φ'' cos k q1 − b ∫φ cos k q1 cos q1
    δ of the angle's zero                −b ∫φ cos q1

They are fitted beside inertia and friction, with wide normal priors: where the motion does not determine one, its
posterior standard deviation stays that of the prior.

A latency δ that both angles share cancels in equation (I); against the voltage it shows in that of the motor, (II):

    a12 ∫φ'' q1 + a22 ∫φ'' q2 = N ∫φ (M(u(t + δ), q2') − f2 N q2' − f3 sgn q2')

The torque per volt and the friction of the motor are left free, so that a small error of these constants is not taken
for a latency. While the wheel rests, friction is any torque up to f3, and about a reversal a smoothed speed does not
show when friction jumps; there both sides are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance import wheel_equation as at
from swingid.balance.covariance import LAG
from swingid.balance.errors import late_error, shaped_errors
from swingid.balance.fits import WindowFit, fit_with_prior
from swingid.balance.rows import Signals, Windows
from swingid.balance.wheel_equation import WheelRows
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project_impulses
from swingid.preparation.noise import Noise
from swingid.recording.recording import Recording

PRIOR_LATENCY = 0.01

PRIOR_ENCODER = np.radians(1.0)

PRIOR_ZERO = 0.2
"""Prior standard deviations (s, rad, rad), weakly informative: ten times what a rig has."""

ROUNDS = 3

SHARP = 3.0
"""Fits on windows of other lengths count where they are at most so many times less certain than the best."""

STEPS = 3

RESTING = 0.3
"""Share of a window in which the wheel may rest."""

FEWEST = 20

GOOD = 0.05
"""Share of the inertial side that may be left for the balance to be that of this motor."""


@dataclass(frozen=True)
class Extra:
    """A small quantity estimated from the balance: value, standard uncertainty, prior standard deviation (s, rad)."""

    name: str
    value: float
    uncertainty: float
    prior: float

    @property
    def identifiable(self) -> bool:
        """Return whether the posterior standard deviation is well below the prior one."""
        return self.uncertainty < 0.3 * self.prior


def extras(fits: list[WindowFit], signals: Signals, turn: float) -> dict[str, Extra]:
    """Every small quantity of this rig by name, from fits on windows of several lengths.

    The value is that of the windows which determine it best; the difference of windows of other lengths is added to its
    uncertainty, for what the friction basis does not describe depends on the length. turn: of the wheel per turn of its
    encoder.
    """
    by_name: dict[str, list[tuple[float, float]]] = {}
    priors: dict[str, float] = {}
    for fit in fits:
        for extra in _fitted(fit, signals, turn):
            by_name.setdefault(extra.name, []).append((extra.uncertainty, extra.value))
            priors[extra.name] = extra.prior
    return {name: pooled(name, sorted(several), priors[name]) for name, several in by_name.items()}


def amplitude(extras: dict[str, Extra], which: str) -> tuple[float, float, bool]:
    """Amplitude of α cos + β sin of an encoder ("wheel 1"), standard uncertainty (rad), whether it is identifiable."""
    cosine, sine = extras[f"{which} cosine"], extras[f"{which} sine"]
    size = float(np.hypot(cosine.value, sine.value))
    power = (cosine.value * cosine.uncertainty) ** 2 + (sine.value * sine.uncertainty) ** 2
    both = float(np.hypot(cosine.uncertainty, sine.uncertainty) / np.sqrt(2))
    return size, max(float(np.sqrt(power)) / max(size, 1e-300), both), cosine.identifiable and sine.identifiable


def _fitted(fit: WindowFit, signals: Signals, turn: float) -> Iterator[Extra]:
    """One joint fit of friction, inertia and all extra columns on the windows of `fit`."""
    more = _columns(fit, signals, turn)
    solved, error = fit_with_prior(fit, [prior * column for prior, column in more.values()], ROUNDS)
    count = len(fit.rows)
    residuals = solved.residuals[:count]
    data = LinearFit(solved.values, residuals, solved.influence[:, :count], solved.condition)
    from_prior = solved.influence[:, count:] * error
    variances = np.diag(data.covariance(LAG) + from_prior @ from_prior.T)
    for k, (name, (prior, _)) in enumerate(more.items(), start=len(fit.unknowns)):
        yield Extra(name, float(solved.values[k]) * prior, float(np.sqrt(max(variances[k], 0.0))) * prior, prior)


def _columns(fit: WindowFit, signals: Signals, turn: float) -> dict[str, tuple[float, Array]]:
    """Prior standard deviation and column of every small quantity of this rig, by name."""
    by_name, rows, values = {}, fit.rows, fit.coefficients
    if signals.wheel is not None or signals.torque is not None:
        by_name["latency"] = PRIOR_LATENCY, late_error(rows, signals, values)
    wheel = None if signals.wheel is None else signals.wheel / turn
    for channel, angle in (("wheel", wheel), ("angle", None if signals.linear else signals.angle)):
        if angle is None:
            continue
        if channel == "angle" and fit.value("gravity_torque"):
            by_name["zero"] = PRIOR_ZERO, _zero_column(fit, signals)
        # nonlinearity once and twice per turn
        shapes = ((k, name, of(k * angle)) for k in (1, 2) for name, of in (("cosine", np.cos), ("sine", np.sin)))
        waves = {f"{channel} {k} {name}": shape for k, name, shape in shapes}
        effects = shaped_errors(rows, signals, channel, waves.values(), values)
        by_name |= {name: (PRIOR_ENCODER, column) for name, column in zip(waves, effects.T, strict=True)}
    return by_name


def _zero_column(fit: WindowFit, signals: Signals) -> Array:
    return shaped_errors(fit.rows, signals, "angle", [np.ones_like(signals.angle)], fit.coefficients)[:, 0]


def zero_of(fits: list[WindowFit], signals: Signals) -> Extra | None:
    """How far 0 of the angle lies beside hanging (rad, to be taken off the angle); None without gravity.

    Estimated jointly with friction that depends on the direction, which has the same frequency; fits: as of `extras`.
    """
    if not fits[0].equation.value("gravity_torque") or signals.linear:
        return None
    zeros = []
    for fit in fits:
        solved = fit_linear(np.column_stack([fit.columns, _zero_column(fit, signals)]), fit.known)
        zeros.append((float(np.sqrt(solved.covariance(LAG)[-1, -1])), float(solved.values[-1])))
    zeros.sort()
    return pooled("zero", zeros, PRIOR_ZERO)


def pooled(name: str, estimates: list[tuple[float, float]], prior: float) -> Extra:
    """The most certain of (uncertainty, value), sorted, and how far the others that are not much worse lie from it."""
    best, value = estimates[0]
    others = np.array([v for u, v in estimates if u < SHARP * best])
    return Extra(name, value, float(np.hypot(best, np.sqrt(np.mean((others - value) ** 2)))), prior)


def voltage_latency(
    log: Recording, rig: Rig, signals: Signals, windows: Windows, noise: Noise
) -> tuple[float, float] | None:
    """δ (s) beyond what the rig file states, and its standard uncertainty, from rows on `windows`.

    None without voltage or motor constants, where the wheel rests too often, and where equation (II) does not close.
    """
    motor = rig.drive.motor
    if motor is None or signals.wheel is None or log.voltage is None or motor.torque_per_volt.value == 0:
        return None
    wheel, values = WheelRows.of(signals, windows, noise), at.products_of(rig)
    rests, axis = _about_rests(wheel), signals.motion.speed
    turns = 1.0 - rests
    coupled = values[at.COUPLING] * axis.acceleration(wheel.middles)
    resting = rests * (coupled + wheel.speed.acceleration(wheel.middles))
    kept = wheel.integrals(rests[None])[:, 0]
    wheel = replace(wheel, windows=windows.select(kept < RESTING * windows.half))
    if len(wheel.windows) < FEWEST:
        return None
    inertial, _ = wheel.inertial(values[at.COUPLING])
    late, latency = signals.encoders.angle.latency.value, 0.0
    for _ in range(STEPS):
        voltage = wheel.voltage(held=log.drive_held, late=late + latency)
        driven, *free = turns * at.right_side(values, voltage, wheel.rate, np.sign(wheel.rate))
        columns = wheel.integrals(np.stack([resting + driven, *free]))
        active = (at.branches(values, voltage, wheel.rate) != 0.0) * turns
        steps = values[at.GAIN] * _steps(log, late + latency, active, wheel.windows)
        solved = fit_linear(np.column_stack([steps, columns[:, 1:]]), inertial - columns[:, 0])
        latency += float(solved.values[0])
    if float(np.std(solved.residuals)) > GOOD * float(np.std(inertial)):
        return None
    return latency, float(np.sqrt(solved.covariance(LAG)[0, 0]))


def _about_rests(wheel: WheelRows) -> Array:
    """1 between rows at which the wheel rests or turns around, and as far from there as its speed is smoothed."""
    stamps, rate, reach = wheel.nodes.stamps, wheel.rate, wheel.speed.half_width
    slow_here = np.abs(rate) < wheel.slow
    slow_here[1:] |= rate[1:] * rate[:-1] <= 0
    counted = np.append(0, np.cumsum(slow_here))
    first = np.searchsorted(stamps, stamps[:-1] - reach)
    last = np.minimum(np.searchsorted(stamps, stamps[1:] + reach), len(rate))
    result: Array = (counted[last] > counted[first]).astype(np.float64)
    return result


def _steps(log: Recording, late: float, active: Array, windows: Windows) -> Array:
    """∫φ u'(t + late) dt where the motor is outside its dead zone: a held voltage changes in steps at the rows."""
    assert log.voltage is not None
    if log.drive_held:
        instants, changes, weight = log.time[1:-1], np.diff(log.voltage[:-1]), (active[1:] + active[:-1]) / 2
    else:
        instants, changes, weight = (log.time[1:] + log.time[:-1]) / 2, np.diff(log.voltage), active
    return project_impulses(instants - late, changes * weight, windows.centres, windows.half)
