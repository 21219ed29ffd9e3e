"""The angle of a log with a rate (gyroscope): its integral less bias and start, which the swings themselves give first.

An integral of a rate with the bias β, begun at an unknown angle, is q + z + β t. Swings about a fixed centre have that
line as the centre of their turning angles; what is left of z and β is unknown in every method, see `Level`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import UnanswerableError
from swingid.format import plus_minus
from swingid.model.terms import rig_terms
from swingid.numerics.spline import spline_slopes
from swingid.preparation.motion import Motion, find_motion
from swingid.preparation.noise import channel_noise, equivalent
from swingid.preparation.reference import turns_freely
from swingid.preparation.segment import part_of
from swingid.recording.findings import Finding, Kind
from swingid.recording.rates import RateIs, integral, line_of, without_line
from swingid.units import Quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.recording import Recording

ROUNDS = 3
"""Of finding the swings about a line, and the line through their centres."""

FEWEST = 5
"""Turning points that show a line of centres; of fewer the line of least squares through the whole motion is taken."""

WIDE = 10.0
"""Standard uncertainties of the line of centres that the balance may correct it by: a prior without influence."""

LEAST = 5e-3
"""Prior of the zero (rad) about where constant torques vanish, and the least one of what the bias makes in half the
log; the effect of 5 mrad on the inertia of swings to both sides is below 0.01 %."""


ZERO, BIAS, WALK, BETWEEN = "zero", "bias", "walk", "between"
"""What is unknown of the integral of a rate; of the walk its parts, "walk 1", "walk 2" and so on."""

MOST, SWINGS = 12, 3
"""Parts of the walk that are unknowns: at most, and turning points for each; of the rest √(2/π²/12), 13 %, is left."""

KINKED = 2.0
"""What a drive may accelerate, as one standard deviation, in accelerations of the motion: without gravity it is 1, near
resonance more, for there gravity acts against it."""


@dataclass(frozen=True, eq=False)
class Unknown:
    """One unknown of the angle: standard deviation of its prior, its shape over the time (rad or m per unit), and how
    much of it was subtracted from the angle.
    """

    std: float
    shape: Array
    taken: float = 0.0


@dataclass(frozen=True, eq=False)
class Level:
    """What is unknown of an angle that is the integral of a rate with white noise: zero, bias and a random walk.

    bias: of the rate (rad/s or m/s), which was subtracted, with the uncertainty that the centres of the swings show.
    start, length: of the log (s). zero_std, bias_std: standard deviations of the priors of what is left of zero (rad or
    m) and bias; 0 where an angle beside the rate gives both. walk: standard deviation of the walk after 1 s; parts: how
    many of its parts are unknowns. between: stamps (s) and error (rad or m) by kinks of the rate at the rows, see
    `between_rows`; None where it is smooth. taken: what was subtracted of each.
    """

    bias: Quantity
    start: float
    length: float
    zero_std: float
    bias_std: float
    walk: float = 0.0
    parts: int = 0
    between: tuple[Array, Array] | None = None
    taken: Mapping[str, float] = field(default_factory=dict)

    def unknowns(self, time: Array) -> dict[str, Unknown]:
        """All unknowns at instants (s).

        A random walk is Σ a_k √2 sin((k − ½) π t/T) with independent a_k, of standard deviation walk √T/((k − ½) π)
        (Karhunen and Loève).
        """
        along = (time - self.start) / self.length
        entries = {ZERO: (self.zero_std, np.ones_like(time)), BIAS: (self.bias_std, (along - 0.5) * self.length)}
        for k in range(1, self.parts + 1):
            turns = (k - 0.5) * np.pi
            size = self.walk * np.sqrt(self.length) / turns
            entries[f"{WALK} {k}"] = float(size), np.sqrt(2) * np.sin(turns * along)
        if self.between is not None:
            entries[BETWEEN] = 1.0, np.interp(time.ravel(), *self.between).reshape(time.shape)
        kept = {name: self.taken.get(name, 0.0) for name in entries if name not in (ZERO, BIAS)}
        return {name: Unknown(std, shape, kept.get(name, 0.0)) for name, (std, shape) in entries.items() if std > 0}

    def less(self, log: Recording, amounts: Mapping[str, float]) -> tuple[Recording, Level]:
        """The log with these amounts of the unknowns subtracted from its angle, too."""
        unknowns = self.unknowns(log.time)
        angle = log.angle - sum((amount * unknowns[name].shape for name, amount in amounts.items()), np.zeros(len(log)))
        bias = Quantity(self.bias.value + amounts.get(BIAS, 0.0), self.bias.std)
        taken = {name: self.taken.get(name, 0.0) + amount for name, amount in amounts.items()}
        return replace(log, angle=angle), replace(self, bias=bias, taken=taken)


def between_rows(log: Recording, rate_is: RateIs) -> tuple[Array, Array] | None:
    """Stamps and error of the angle (rad or m) by a cubic spline through a rate that has kinks at the rows.

    A drive that is held from row to row changes the acceleration there by steps. The spline takes them for curvature
    between the rows, so its integral is off by h²/12 of what the drive accelerates: of a sine of ω by up to (ω h)²/12.
    How much the drive accelerates is unknown; the error is that of an acceleration `KINKED` times the whole one.
    """
    command = log.torque if log.torque is not None else log.voltage
    rate = log.angle_speed
    if not log.drive_held or rate_is != "instant" or command is None or rate is None or not np.ptp(command) > 0:
        return None
    steps = np.diff(log.time)
    slopes = spline_slopes(log.time, rate)
    size = KINKED * float(np.std(slopes)) / float(np.std(command))
    kinks = np.concatenate(([0.0], np.cumsum(steps**2 * np.diff(command) / 12)))
    return log.time, size * without_line(log.time, kinks)


def levelled(log: Recording, rig: Rig) -> tuple[Recording, Level | None]:
    """The log with its angle from the rate, where it has one, about the centre of its swings; what of it is unknown.

    Of a body that spins in one direction the bias cannot be separated from the speed: it is taken as stated, and the
    angle counts from the first row. Beside an angle the rate is used where its noise is less in the speeds of the
    motion; then zero and bias are those of the angle.
    """
    if log.angle_speed is None:
        return log, None
    turned = integral(log.time, log.angle_speed, rig.log.angle_speed_is)
    between = between_rows(log, rig.log.angle_speed_is)
    if not rig.log.has_rate_alone:
        return _beside(log, rig, turned, between)
    middle = float(log.time[0] + log.time[-1]) / 2
    if spins(log.angle_speed, rig):
        bias = rig.sensors.of_rate("angle").bias.value
        return replace(log, angle=turned - bias * (log.time - log.time[0])), None
    zero, bias = line_of(log.time, turned)
    for _ in range(ROUNDS):
        current = replace(log, angle=turned - zero - bias * (log.time - middle))
        series = _centres(current, rig)
        if series is None:
            break
        times, centres = series
        more, slope = line_of(times, centres)
        more -= slope * float((times[0] + times[-1]) / 2 - middle) + _rests_at(rig)
        zero, bias = zero + more, bias + slope
    at = turned - zero - bias * (log.time - middle)
    level = _level(log, rig, replace(log, angle=at), bias, series)
    return replace(log, angle=at), replace(level, between=between)


def spins(rate: Array, rig: Rig) -> bool:
    """Return whether a body turns in one direction all the time, as in a coast-down, but for a twentieth of the rows.

    Not a free one that is drawn back and whose rate swings less and less about one mean, which is the bias, as of a
    gyroscope in volts: what gravity changes in the speed of a body that turns over grows as it slows down.
    """
    if turns_freely(rig):
        return True
    low, high = np.quantile(rate, (0.05, 0.95))
    if low * high <= 0:
        return False
    first, second = np.array_split(rate, 2)
    shrinks = float(np.std(second)) < float(np.std(first))
    stays = abs(float(np.mean(first) - np.mean(second))) < float(np.std(second))
    return not (rig.drive.channel is None and shrinks and stays)


def _level(log: Recording, rig: Rig, at: Recording, bias: float, rest: tuple[Array, Array] | None) -> Level:
    """What is left unknown; at: the log with its angle levelled, rest: centres of the swings."""
    slope_spread, wander = _spread(at, rest)
    half, noise = log.duration / 2, channel_noise(at, rig)
    stated = rig.sensors.of_rate("angle").bias.std
    turns = 0 if rest is None else len(rest[0]) + 3
    walk = noise.rate * np.sqrt(noise.step)
    if rig.drive.channel is None:  # a drive moves the centres; a free body shows drift of the bias by them, too
        # a random walk about the line nearest to it has the standard deviation walk √(T/15)
        walk = max(walk, wander / np.sqrt(log.duration / 15))
    return Level(
        bias=Quantity(bias, slope_spread),
        start=float(log.time[0]),
        length=log.duration,
        zero_std=LEAST,
        bias_std=max(WIDE * slope_spread if stated is None else stated, LEAST / half),
        walk=float(walk),
        parts=min(MOST, turns // SWINGS),
    )


def _rests_at(rig: Rig) -> float:
    """The angle (rad or m) about which the swings are: where a spring is relaxed that nothing else pulls at."""
    b = rig.axis.gravity_torque
    springs = [term.shift.value for term in rig_terms(rig) if term.name == "stiffness"]
    return springs[0] if springs and isinstance(b, Quantity) and b.value == 0 else 0.0


def _centres(log: Recording, rig: Rig) -> tuple[Array, Array] | None:
    """Instants and centres of the swings of the part to use, from four turning points each; None of too few."""
    motion = _motion(log, rig)
    if motion is None or len(motion.turning_times) < FEWEST:
        return None
    t, q = motion.turning_times, motion.turning_angles
    return (t[1:-2] + t[2:-1]) / 2, (q[:-3] + 3 * (q[1:-2] + q[2:-1]) + q[3:]) / 8


def _motion(log: Recording, rig: Rig) -> Motion | None:
    try:
        motion = find_motion(log.time, log.angle, channel_noise(log, rig).angle)
    except UnanswerableError:
        return None
    try:
        start, stop, _ = part_of(log, motion, rig.drive.channel)
    except UnanswerableError:
        return motion
    return motion.within(start, stop)


def _spread(log: Recording, rest: tuple[Array, Array] | None) -> tuple[float, float]:
    """Standard uncertainty of the slope (rad/s) of the line through the centres, and their scatter about it (rad)."""
    if rest is None:
        size = float(np.std(log.angle))
        return size / log.duration, 0.0
    times, centres = rest
    value, slope = line_of(times, centres)
    residuals = centres - value - slope * (times - (times[0] + times[-1]) / 2)
    # means of four turning angles share three with the next one: a fourth of them is independent
    independent = max(len(centres) / 4, 3.0)
    scatter = float(np.sqrt(np.sum(residuals**2) / max(len(residuals) - 2, 1)))
    return scatter / np.sqrt(independent) / max(float(np.std(times)), 1e-300), scatter


def _beside(
    log: Recording, rig: Rig, turned: Array, between: tuple[Array, Array] | None
) -> tuple[Recording, Level | None]:
    """An angle and its rate: the one with less noise in the speeds, with a note."""
    assert log.angle_speed is not None
    plain, rate = channel_noise(replace(log, angle_speed=None), rig), channel_noise(log, rig)
    if plain.angle <= equivalent(log.angle, log.angle_speed, rate.rate):
        text = "the angle was used, which has less noise than the rate beside it has in the speeds of this motion."
        return _noted(replace(log, angle_speed=None), text), None
    middle = float(log.time[0] + log.time[-1]) / 2
    value, bias = line_of(log.time, turned - log.angle)
    independent = max(len(log) / 4, 3.0)
    spread = float(np.std(turned - log.angle)) / np.sqrt(independent)
    drift = Quantity(bias, spread / max(float(np.std(log.time)), 1e-300))
    text = (
        f"the rate was used, with the zero of the angle beside it; its bias is {plus_minus(bias, drift.std, 'rad/s')}."
    )
    log = replace(log, angle=turned - value - bias * (log.time - middle))
    return _noted(log, text), Level(drift, float(log.time[0]), log.duration, 0.0, 0.0, between=between)


def _noted(log: Recording, text: str) -> Recording:
    if any(finding.kind is Kind.ANGLE_BESIDE and finding.code == "angle-or-rate" for finding in log.findings):
        return log
    return replace(log, findings=(*log.findings, Finding("angle-or-rate", text, "note", kind=Kind.ANGLE_BESIDE)))
