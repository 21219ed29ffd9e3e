"""Latency between the channels, estimated from the balance beyond first order.

A latency δ enters the rows as q' δ to first order, which a fit with its prior estimates. Its square does not: a wheel
late by δ seems weaker by (ω δ)²/2, 0.1 % for 5 ms at 8.5 rad/s. So the channel is corrected by the estimate, after
which first order suffices. A latency that is not declared is found in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from swingid.balance.choice import Choice, choose
from swingid.balance.errors import errors_of, late_error
from swingid.balance.fits import LAG, WindowFit, fit_with_prior, residuals_beside, sensor_variance
from swingid.balance.perturbations import RowError
from swingid.balance.rows import Signals
from swingid.checks.ran import ran
from swingid.format import percent, plus_minus
from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensor
from swingid.numerics.regression import LinearFit
from swingid.preparation.encoders import Channel, Correction
from swingid.preparation.prepared import Part
from swingid.recording.findings import Kind
from swingid.result.result import Message
from swingid.uncertainty.significance import BETTER, CERTAIN, MATTERS

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
    """Correction of a latency found within its declared prior, with its notes and warnings."""

    corrections: tuple[Correction, ...] = ()
    notes: list[Message] = field(default_factory=list)
    warnings: list[Message] = field(default_factory=list)


def with_latency(part: Part, memory: str = "auto", signals: Signals | None = None) -> tuple[Choice, Moved]:
    """The choice for a part of a log, with a channel corrected by the latency found within its declared prior.

    memory: as `balance.choice.MEMORY`; signals: of the part, where they are known. Where none is found, the uncertainty
    that remains is of first order; a warning where its square matters as well.
    """
    first = (
        _chosen(part, 0.0, memory) if signals is None else choose(signals, part.rig, part.equation, part.noise, memory)
    )
    choice, moved, result = first, 0.0, Moved()
    if not _declared_spread(part):
        return choice, result
    found = latency_of(choice.law, choice.signals, part.rig)
    for _ in range(STEPS):
        if _second_order(choice.signals, found.value) < SMALL * choice.law.total / abs(choice.law.a11):
            break
        moved += found.value
        choice = _chosen(part, moved, memory)
        found = latency_of(choice.law, choice.signals, part.rig)
    channel, name, _ = _late_channel(part)
    if moved:
        text = (
            f"by the balance, {name} is read {plus_minus(1e3 * (moved + found.value), 1e3 * found.u, 'ms')} later than "
            "the rig file states, which is within the stated uncertainty; it was corrected by that."
        )
        corrections = (Correction(channel, "latency", moved, found.u, "s", "found"),)
        result = Moved(corrections, [Message("latency-told", text)])
    left = _second_order(choice.signals, found.u)
    if left > choice.law.total / abs(choice.law.a11):
        text = (
            f"the log determines the latency to within {1e3 * found.u:.2g} ms only; its square, {percent(left)} of the "
            "inertia, is not in the uncertainty: measure the latency, or record two motions of different frequency and "
            "calibrate it."
        )
        result.warnings.append(Message("latency-squared", text))
    return choice, result


def check_latency(choice: Choice, part: Part, uncertainty: float, memory: str = "auto") -> list[Message]:
    """A warning where the balance shows a latency that the rig file does not declare, and the inertia is biased by it.

    uncertainty: the inertia's, with all declared imperfections and without the lack of fit by the latency.
    """
    rig, equation = part.rig, part.equation
    if equation.drive == "none" or _declared_spread(part) or not _may_show(choice, rig):
        return []
    ran("latency")
    channel, name, sensor = _late_channel(part)
    allowed = part.encoders.with_latency(channel, sensor.latency.value, LATEST)
    best, moved = choice, 0.0
    for _ in range(STEPS):
        moved += latency_of(best.law, best.signals.declaring(allowed), rig).value
        best = _chosen(part, moved, memory)
    law, signals = best.law, best.signals.declaring(allowed)
    found = latency_of(law, signals, rig)
    moved += found.value
    u = float(np.hypot(found.u, _scatter(best.tried.values(), signals, rig)))
    if abs(moved) < CERTAIN * u:
        return []
    # the lack of fit by a latency widens the interval as well, which would then contain its effect
    if abs(law.a11 - choice.law.a11) < MATTERS * min(uncertainty, law.u):
        return []
    key = "sensors.wheel.latency" if channel == "wheel" else "sensors.latency"
    text = (
        f"{name} is read {plus_minus(1e3 * moved, 1e3 * u, 'ms')} later than the rig file states; corrected by that, "
        f"the inertia would be {plus_minus(law.inertia, None, equation.unit)}. State "
        f'{key} = "{1e3 * (sensor.latency.value + moved):.3g} ± {1e3 * u:.2g} ms", or calibrate the encoders.'
    )
    return [Message("late-channel", text, Kind.LATE_CHANNEL)]


def _late_channel(part: Part) -> tuple[Channel, str, Sensor]:
    """The channel that is corrected, its name in messages and its encoder: the wheel, or the angle for a torque."""
    if part.rig.drive.kind == "reaction-wheel":
        return "wheel", "the wheel angle", part.encoders.wheel
    return "angle", "the angle", part.encoders.angle


def _declared_spread(part: Part) -> float:
    """Declared standard deviation (s) of the latency that the balance depends on; 0 in a free decay."""
    if part.rig.drive.kind == "none":
        return 0.0
    stds = [part.encoders.angle.latency.std or 0.0]
    if part.rig.drive.kind == "reaction-wheel":
        stds.append(part.encoders.wheel.latency.std or 0.0)
    return float(np.hypot.reduce(stds))


def _chosen(part: Part, moved: float, memory: str) -> Choice:
    """The choice with the late channel corrected by `moved` (s) beyond what the rig file states."""
    channel, _, sensor = _late_channel(part)
    encoders = part.encoders.with_latency(channel, sensor.latency.value + moved, sensor.latency.std)
    return choose(Signals.of(part.log, part.rig, part.motion, encoders), part.rig, part.equation, part.noise, memory)


def latency_of(law: WindowFit, signals: Signals, rig: Rig) -> Latency:
    """The latency with its declared prior, estimated beside inertia, friction and nonlinearities.

    Its uncertainty is that by the scatter of the rows, and at least that by noise of the sensors.
    """
    items = errors_of(law.rows, signals, rig, law.equation, law.coefficients)
    items = [item for item in items if item.of.fitted]
    solved, error = fit_with_prior(law, [item.rows * item.std for item in items])
    rows, unknowns = len(law.rows), len(law.unknowns)
    weights = np.zeros((1, unknowns + len(items)))
    for k, item in enumerate(items, start=unknowns):
        weights[0, k] = _counts(item, rig) * item.std
    influence = weights @ solved.influence
    data = LinearFit(solved.values, solved.residuals[:rows], influence[:, :rows], 1.0).covariance(LAG)
    sensor, _ = sensor_variance(law.rows, influence[0, :rows], law.coefficients, law.noise)
    from_prior = float(np.sum((influence[:, rows:] * error) ** 2))
    return Latency(float(weights[0] @ solved.values), float(np.sqrt(max(data[0, 0], sensor) + from_prior)))


def _counts(item: RowError, rig: Rig) -> float:
    """+1 for the late channel, −1 for the one that it is compared with, 0 for what is no latency."""
    if rig.drive.kind == "reaction-wheel":
        return {"wheel latency": 1.0, "angle latency": -1.0}.get(item.source, 0.0)
    return {"angle latency": 1.0}.get(item.source, 0.0)


def _scatter(fits: Iterable[WindowFit], signals: Signals, rig: Rig) -> float:
    """Standard deviation of the latency over windows of other lengths that determine it nearly as well."""
    found = [latency_of(fit, signals, rig) for fit in fits if len(fit.rows) >= FEWEST]
    least = min((one.u for one in found), default=0.0)
    values = [one.value for one in found if one.u < SHARP * least]
    return float(np.std(values)) if len(values) > 1 else 0.0


def _may_show(choice: Choice, rig: Rig) -> bool:
    """Whether one column more, without a prior, reduces the residuals enough: quick, and a necessary condition."""
    law = choice.law
    late = late_error(law.rows, choice.signals, law.coefficients)
    left = residuals_beside(law, late[:, None])
    return float(left @ left) < BETTER**2 * float(law.fit.residuals @ law.fit.residuals)


def _second_order(signals: Signals, late: float) -> float:
    """(ω δ)²/2, relative change of the inertia by the square of a latency."""
    speed = signals.motion.speed
    power = np.mean(speed.acceleration(speed.grid) ** 2) / max(float(np.mean(speed.speed**2)), 1e-300)
    return float(power * late**2 / 2)
