"""A channel that is read later than the other: what the balance tells of it, beyond first order.

A latency δ enters the rows as q' δ to first order, which a fit with its prior takes up. Its square does not: a wheel
late by δ looks weaker by (ω δ)²/2, 0.1 % for 5 ms at 8.5 rad/s. So the channel is moved by what the balance tells, and
the rest is first order again. A latency that nobody declared shows in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from swingid.balance.choice import Choice, choose
from swingid.balance.fits import LAG, WindowFit, fit_with_prior, residuals_beside, sensor_variance
from swingid.balance.imperfections import Imperfection, imperfections, late_channel
from swingid.balance.rows import Signals
from swingid.format import percent, plus_minus
from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensor
from swingid.numerics.regression import LinearFit
from swingid.preparation.encoders import Channel, Correction, Encoders
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.recording.findings import Kind
from swingid.recording.recording import Recording
from swingid.result.result import Message
from swingid.uncertainty.significance import BETTER, CERTAIN, MATTERS

LATEST = 0.01
"""Standard deviation (s) that an undeclared latency is allowed: no knowledge, but ten times what a rig has."""

STEPS = 3
"""Times a channel is moved, at most."""

SMALL = 0.1
"""Share of the inertia's uncertainty up to which what is left of second order does no harm."""

SHARP = 3.0
"""Windows of other lengths are heard where they tell the latency at most so many times worse."""

FEWEST = 20
"""Rows of windows of another length that may be heard."""


@dataclass(frozen=True)
class Seen:
    """What a fit begins with: the part of the log used, its motion as found in the angle, the rig."""

    log: Recording
    motion: Motion
    rig: Rig
    scale: Scale
    noise: Noise
    encoders: Encoders

    def moved(self, by: float) -> Choice:
        """The choice with the late channel moved `by` (s) beyond what the rig file says."""
        own = self.late.latency
        encoders = self.encoders.with_latency(self.channel, own.value + by, own.std)
        return choose(Signals.of(self.log, self.rig, self.motion, encoders), self.rig, self.scale, self.noise)

    @property
    def channel(self) -> Channel:
        """The channel that is moved: the wheel where there is one, else the angle against the torque."""
        return "wheel" if self.rig.drive.kind == "reaction-wheel" else "angle"

    @property
    def late(self) -> Sensor:
        """The encoder of that channel."""
        return self.encoders.wheel if self.channel == "wheel" else self.encoders.angle

    @property
    def spread(self) -> float:
        """Declared standard deviation (s) of the latency that the balance feels; 0 in a free decay."""
        if self.rig.drive.kind == "none":
            return 0.0
        stds = [self.encoders.angle.latency.std or 0.0]
        if self.rig.drive.kind == "reaction-wheel":
            stds.append(self.encoders.wheel.latency.std or 0.0)
        return float(np.hypot.reduce(stds))


@dataclass(frozen=True)
class Latency:
    """How late (s) the wheel is read after the angle, or the angle after the torque acts, with its uncertainty."""

    value: float
    u: float


@dataclass(frozen=True)
class Moved:
    """What was moved for a latency found within what is declared, and what is to be said of it."""

    corrections: tuple[Correction, ...] = ()
    notes: list[Message] = field(default_factory=list)
    warnings: list[Message] = field(default_factory=list)


def with_latency(choice: Choice, seen: Seen) -> tuple[Choice, Moved]:
    """The choice with a channel moved by the latency found within what is declared, and what was moved.

    Where none is found, the uncertainty that stays is of first order; a warning where its square matters as well.
    """
    rig, scale = seen.rig, seen.scale
    if not seen.spread:
        return choice, Moved()
    moved, found = 0.0, latency_of(choice.law, choice.signals, rig, scale, seen.noise)
    for _ in range(STEPS):
        if _second_order(choice.signals, found.value) < SMALL * choice.law.total / abs(choice.law.a11):
            break
        moved += found.value
        choice = seen.moved(moved)
        found = latency_of(choice.law, choice.signals, rig, scale, seen.noise)
    result = Moved()
    if moved:
        text = (
            f"the balance tells that {_channel(rig)} {plus_minus(1e3 * (moved + found.value), 1e3 * found.u, 'ms')} "
            "later than the rig file says, within what it allows; it was moved by that."
        )
        corrections = (Correction(seen.channel, "latency", moved, found.u, "s", "found"),)
        result = Moved(corrections, [Message("latency-told", text)])
    left = _second_order(choice.signals, found.u)
    if left > choice.law.total / abs(choice.law.a11):
        text = (
            f"the log tells the latency to within {1e3 * found.u:.2g} ms only; its square, {percent(left)} of the "
            "inertia, is not in the uncertainty: measure the latency, or record two motions of different frequency and "
            "calibrate it."
        )
        result.warnings.append(Message("latency-squared", text))
    return choice, result


def check_latency(choice: Choice, seen: Seen, uncertainty: float) -> list[Message]:
    """A warning where the balance shows a latency that the rig file does not declare, and the inertia suffers by it.

    uncertainty: the inertia's, with all declared imperfections.
    """
    rig, scale = seen.rig, seen.scale
    if scale.drive == "none" or seen.spread or not _may_show(choice, rig, scale):
        return []
    # as if the rig file said that its latency may be off by so much
    allowed = seen.encoders.with_latency(seen.channel, seen.late.latency.value, LATEST)
    best, moved = choice, 0.0
    for _ in range(STEPS):
        moved += latency_of(best.law, best.signals.declaring(allowed), rig, scale, seen.noise).value
        best = seen.moved(moved)
    law, found = best.law, latency_of(best.law, best.signals.declaring(allowed), rig, scale, seen.noise)
    moved += found.value
    u = float(np.hypot(found.u, _scatter(best.tried.values(), best.signals.declaring(allowed), seen)))
    if abs(moved) < CERTAIN * u:
        return []
    # what a latency leaves of the balance widens the interval as well, and would then hide it
    if abs(law.a11 - choice.law.a11) < MATTERS * min(uncertainty, law.u):
        return []
    key = "sensors.wheel.latency" if seen.channel == "wheel" else "sensors.latency"
    text = (
        f"{_channel(rig)} {plus_minus(1e3 * moved, 1e3 * u, 'ms')} later than the rig file says; moved by that the "
        f"inertia would be {plus_minus(law.a11 - scale.carried, None, scale.unit)}. State "
        f'{key} = "{1e3 * (seen.late.latency.value + moved):.3g} ± {1e3 * u:.2g} ms", or calibrate the encoders.'
    )
    return [Message("late-channel", text, Kind.LATE_CHANNEL)]


def latency_of(law: WindowFit, signals: Signals, rig: Rig, scale: Scale, noise: Noise) -> Latency:
    """The latency within what is declared of the encoders, found beside inertia, friction and nonlinearities.

    Its uncertainty is what the rows scatter, and no less than what noise of the sensors makes of it.
    """
    b = law.value("gravity_torque") if scale.b is None else scale.b
    items = [item for item in imperfections(rig, signals, law.rows, law.a11, b) if item.calibrates]
    solved, error = fit_with_prior(law, scale, [item.rows * item.std for item in items])
    rows, unknowns = len(law.rows.windows), len(law.unknowns)
    weights = np.zeros((1, unknowns + len(items)))
    for k, item in enumerate(items, start=unknowns):
        weights[0, k] = _counts(item, rig) * item.std
    influence = weights @ solved.influence
    data = LinearFit(solved.values, solved.residuals[:rows], influence[:, :rows], 1.0).covariance(LAG)
    sensor, _ = sensor_variance(law.rows, influence[0, :rows], law.a11, b, scale, noise)
    from_prior = float(np.sum((influence[:, rows:] * error) ** 2))
    return Latency(float(weights[0] @ solved.values), float(np.sqrt(max(data[0, 0], sensor) + from_prior)))


def _counts(item: Imperfection, rig: Rig) -> float:
    """+1 for the channel that is read late, −1 for the one that it is compared with, 0 for what is no latency."""
    if rig.drive.kind == "reaction-wheel":
        return {"wheel latency": 1.0, "angle latency": -1.0}.get(item.source, 0.0)
    return {"angle latency": 1.0}.get(item.source, 0.0)


def _scatter(fits: Iterable[WindowFit], signals: Signals, seen: Seen) -> float:
    """How far windows of other lengths, which tell the latency about as well, lie from each other."""
    enough = [fit for fit in fits if len(fit.rows.windows) >= FEWEST]
    found = [latency_of(fit, signals, seen.rig, seen.scale, seen.noise) for fit in enough]
    least = min((one.u for one in found), default=0.0)
    values = [one.value for one in found if one.u < SHARP * least]
    return float(np.std(values)) if len(values) > 1 else 0.0


def _may_show(choice: Choice, rig: Rig, scale: Scale) -> bool:
    """Whether one column more, without a bound, lets the residuals fall enough: quick, and true wherever it shows."""
    law = choice.law
    late = late_channel(choice.signals, law.rows, rig.drive.a12 if rig.drive.kind == "reaction-wheel" else 0.0)
    left = residuals_beside(law, scale, late[:, None])
    return float(left @ left) < BETTER**2 * float(law.fit.residuals @ law.fit.residuals)


def _second_order(signals: Signals, late: float) -> float:
    """(ω δ)²/2, what a latency does to the inertia by its square, as a share."""
    speed = signals.motion.speed
    power = np.mean(speed.acceleration(speed.grid) ** 2) / max(float(np.mean(speed.speed**2)), 1e-300)
    return float(power * late**2 / 2)


def _friction(law: WindowFit) -> tuple[str, ...]:
    return tuple(name for name in law.unknowns if name in law.rows.friction)


def _channel(rig: Rig) -> str:
    return "the wheel angle is read" if rig.drive.kind == "reaction-wheel" else "the angle is read"
