"""Latency between the channels, estimated from the balance beyond first order.

A latency δ enters the rows as q' δ to first order, which a fit with its prior estimates. Its square does not: a wheel
late by δ seems weaker by (ω δ)²/2, 0.1 % for 5 ms at 8.5 rad/s. So the channel is corrected by the estimate, after
which first order suffices. A latency that is not declared is found in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from swingid.balance.choice import Choice, choose
from swingid.balance.covariance import LAG, sensor_variance
from swingid.balance.errors import errors_of, late_error
from swingid.balance.fits import WindowFit, fit_with_prior, residuals_beside
from swingid.balance.perturbations import RowError
from swingid.balance.rows import Signals
from swingid.checks.hypothesis import Evidence, Finding, Judged
from swingid.format import percent, plus_minus
from swingid.model.rig import Rig
from swingid.numerics.regression import LinearFit
from swingid.preparation.encoders import Correction, Encoders
from swingid.preparation.prepared import Part
from swingid.result.checked import Checked, noted, warned
from swingid.result.result import Message
from swingid.uncertainty.significance import BETTER, CERTAIN, MATTERS

NAMES = {"wheel": "the wheel angle", "angle": "the angle"}
"""Channels in messages."""

LATEST = 0.01
"""Prior standard deviation (s) of an undeclared latency: ten times that of a usual rig, so hardly informative."""

STEPS = 3
"""Corrections of a channel, at most."""

SMALL = 0.1
"""Share of the inertia's uncertainty up to which the remaining second order is negligible."""

SHARP = 3.0
"""Windows of other lengths are compared where their uncertainty of the latency is at most so many times larger."""

FEWEST = 20
"""Rows of windows of another length that are compared, at least."""


@dataclass(frozen=True)
class Latency:
    """Latency (s) of the wheel after the angle, or of the angle after the torque, with its standard uncertainty."""

    value: float
    u: float


@dataclass(frozen=True)
class Moved:
    """Correction of a latency found within its declared prior, with its messages."""

    corrections: tuple[Correction, ...] = ()
    checked: Checked = field(default_factory=Checked)


def with_latency(part: Part, memory: str = "auto", signals: Signals | None = None) -> tuple[Choice, Moved]:
    """The choice for a part of a log, with a channel corrected by the latency found within its declared prior.

    memory: as `balance.choice.MEMORY`; signals: of the part, where they are known. Where none is found, the uncertainty
    that remains is of first order; a warning where its square matters as well.
    """
    signals = signals or Signals.of(part.log, part.rig, part.motion, part.encoders)
    choice = choose(signals, part.rig, part.equation, part.noise, memory)
    if not latency_spread(part.encoders, part.rig):
        return choice, Moved()

    def negligible(choice: Choice, late: float, share: float) -> bool:
        return _second_order(choice.signals, late) < share * choice.law.total / abs(choice.law.a11)

    choice, latency, moved = _corrected(choice, part, memory, lambda now, late: negligible(now, late, SMALL))
    result, channel = Moved(), part.encoders.last
    if moved:
        text = (
            f"by the balance, {NAMES[channel]} is read "
            f"{plus_minus(1e3 * (moved + latency.value), 1e3 * latency.u, 'ms')} later than the rig file states, "
            "which is within the stated uncertainty; it was corrected by that."
        )
        corrections = (Correction(channel, "latency", moved, latency.u, "s", "found"),)
        result = Moved(corrections, noted(Message("latency-told", text)))
    if not negligible(choice, latency.u, 1.0):
        text = (
            f"the log determines the latency to within {1e3 * latency.u:.2g} ms only; its square, "
            f"{percent(_second_order(choice.signals, latency.u))} of the "
            "inertia, is not in the uncertainty: measure the latency, or record two motions of different frequency and "
            "calibrate it."
        )
        result = replace(result, checked=result.checked + warned(Message("latency-squared", text)))
    return choice, result


def channel_late(evidence: Evidence, judged: Judged) -> list[Finding] | None:
    """Return whether the balance shows a latency that the rig file does not declare, and the inertia is biased by
    it.
    """
    choice, part = evidence.choice, evidence.part
    rig, equation = part.rig, part.equation
    if not equation.driven or latency_spread(part.encoders, rig) or not _may_show(choice):
        return None
    channel, stated = part.encoders.last, part.encoders.of_channel(part.encoders.last).latency
    allowed = part.encoders.with_latency(channel, stated.value, LATEST)
    best, latency, moved = _corrected(choice, part, evidence.memory, lambda *_: False, allowed)
    law = best.law
    moved += latency.value
    u = float(np.hypot(latency.u, _scatter(best.tried.values(), best.signals.declaring(allowed), rig)))
    # the lack of fit by a latency widens the interval as well, which would then contain its effect
    least = MATTERS * min(judged.limits["timing"], law.u)
    if abs(moved) < CERTAIN * u or abs(law.a11 - choice.law.a11) < least:
        return []
    key = "sensors.wheel.latency" if channel == "wheel" else "sensors.latency"
    text = (
        f"{NAMES[channel]} is read {plus_minus(1e3 * moved, 1e3 * u, 'ms')} later than the rig file states; corrected "
        f"by that, the inertia would be {plus_minus(law.inertia, None, equation.shown(equation.unit))}. State "
        f'{key} = "{1e3 * (stated.value + moved):.3g} ± {1e3 * u:.2g} ms", or calibrate the encoders.'
    )
    return [Finding(math.inf, text)]


def latency_spread(encoders: Encoders, rig: Rig) -> float:
    """Declared standard deviation (s) of the latency that the balance depends on; 0 in a free decay."""
    if rig.drive.channel is None:
        return 0.0
    return float(np.hypot.reduce([encoders.of_channel(channel).latency.std or 0.0 for channel in encoders.channels]))


def _corrected(
    choice: Choice,
    part: Part,
    memory: str,
    enough: Callable[[Choice, float], bool],
    declared: Encoders | None = None,
) -> tuple[Choice, Latency, float]:
    """The choice with the late channel corrected beyond what the rig file states until it is `enough`.

    Also the latency that is left, and what was corrected (s). declared: encoders whose priors are taken, if not those
    of the part.
    """
    channel, stated = part.encoders.last, part.encoders.of_channel(part.encoders.last).latency

    def left() -> Latency:
        signals = choice.signals if declared is None else choice.signals.declaring(declared)
        return latency_of(choice.law, signals, part.rig)

    moved, latency = 0.0, left()
    for _ in range(STEPS):
        if enough(choice, latency.value):
            break
        moved += latency.value
        encoders = part.encoders.with_latency(channel, stated.value + moved, stated.std)
        signals = Signals.of(part.log, part.rig, part.motion, encoders)
        choice = choose(signals, part.rig, part.equation, part.noise, memory)
        latency = left()
    return choice, latency, moved


def latency_of(law: WindowFit, signals: Signals, rig: Rig) -> Latency:
    """The latency with its declared prior, estimated beside inertia, friction and nonlinearities.

    Its uncertainty is that by the scatter of the rows, and at least that by noise of the sensors.
    """
    items = errors_of(law.rows, signals, rig, law.equation, law.coefficients)
    items = [item for item in items if item.of.fitted]
    means = -np.array([item.of.mean for item in items])
    solved, error = fit_with_prior(law, [item.rows * item.std for item in items], means=means)
    rows, unknowns = len(law.rows), len(law.unknowns)
    weights = np.zeros((1, unknowns + len(items)))
    for k, item in enumerate(items, start=unknowns):
        weights[0, k] = _counts(item, signals.encoders) * item.std
    influence = weights @ solved.influence
    data = LinearFit(solved.values, solved.residuals[:rows], influence[:, :rows], 1.0).covariance(LAG)
    sensor, _ = sensor_variance(law.rows, influence[0, :rows], law.coefficients, law.noise)
    from_prior = float(np.sum((influence[:, rows:] * error) ** 2))
    return Latency(float(weights[0] @ solved.values), float(np.sqrt(max(data[0, 0], sensor) + from_prior)))


def _counts(item: RowError, encoders: Encoders) -> float:
    """+1 for the late channel, −1 for the one that it is compared with, 0 for what is no latency."""
    if item.of.shape != "latency":
        return 0.0
    return 1.0 if item.of.channel == encoders.last else -1.0


def _scatter(fits: Iterable[WindowFit], signals: Signals, rig: Rig) -> float:
    """Standard deviation of the latency over windows of other lengths that determine it nearly as well."""
    latencies = [latency_of(fit, signals, rig) for fit in fits if len(fit.rows) >= FEWEST]
    least = min((latency.u for latency in latencies), default=0.0)
    values = [latency.value for latency in latencies if latency.u < SHARP * least]
    return float(np.std(values)) if len(values) > 1 else 0.0


def _may_show(choice: Choice) -> bool:
    """Return whether one column more, without a prior, reduces the residuals enough: quick, and a necessary
    condition.
    """
    law = choice.law
    late = late_error(law.rows, choice.signals, law.coefficients)
    remaining = residuals_beside(law, late[:, None])
    return float(remaining @ remaining) < BETTER**2 * law.lost


def _second_order(signals: Signals, late: float) -> float:
    """(ω δ)²/2, relative change of the inertia by the square of a latency."""
    speed = signals.motion.speed
    power = np.mean(speed.acceleration(speed.grid) ** 2) / max(float(np.mean(speed.speed**2)), 1e-300)
    return float(power * late**2 / 2)
