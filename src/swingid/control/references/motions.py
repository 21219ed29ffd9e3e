"""Reference motions with formulas: sine, multisine, chirp, strokes with dwells, rounded triangle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from swingid.control.references.base import crossings, inside, refused, require_positive
from swingid.numerics.arrays import Array


@dataclass(frozen=True)
class Sine:
    """A sin(omega t + phase): `amplitude` (rad or m), `frequency` omega (rad/s), `phase` (rad).
    `unit` is that of the amplitude, "rad" or "m".

    y_m1 = 0.8 sin(8.5 t) of section 5. Raises UsageError for an amplitude or frequency that is not positive.
    One frequency does not identify inertia and gravity torque separately: use a multisine for both.
    """

    amplitude: float
    frequency: float
    phase: float = 0.0
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Refuse a motion that does not move."""
        require_positive("sine", self.unit, amplitude=self.amplitude, frequency=self.frequency)

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self.amplitude * np.sin(self.frequency * np.asarray(t, dtype=float) + self.phase)

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the phase is an odd multiple of pi/2."""
        if not duration > 0.0:
            return np.empty(0)
        first = math.floor(self.phase / math.pi - 0.5) - 1
        last = math.ceil((self.phase + self.frequency * duration) / math.pi - 0.5) + 1
        times = ((np.arange(first, last + 1, dtype=float) + 0.5) * math.pi - self.phase) / self.frequency
        return inside(times, duration)

    def peak_speed(self, duration: float) -> float:
        """A omega (rad/s or m/s); over a `duration` (s) without passage through zero the larger speed of the ends."""
        full = self.amplitude * self.frequency
        end = self.phase + self.frequency * max(duration, 0.0)
        if math.floor(end / math.pi) >= math.ceil(self.phase / math.pi):
            return full
        return full * max(abs(math.cos(self.phase)), abs(math.cos(end)))

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return f"sine {self.words()}"

    def words(self) -> str:
        """Amplitude, frequency and phase with units."""
        phase = f" {self.phase!r} rad" if self.phase else ""
        return f"{self.amplitude!r} {self.unit} {self.frequency!r} rad/s{phase}"


@dataclass(frozen=True)
class Multisine:
    """The sum of `parts`, each a `Sine` in the same unit. Raises UsageError for no part, mixed units
    or two parts of one frequency.
    """

    parts: tuple[Sine, ...]

    def __post_init__(self) -> None:
        """Refuse an empty sum and a sum of angles and lengths."""
        object.__setattr__(self, "parts", tuple(self.parts))
        if not self.parts:
            raise refused("multisine", "give at least one part")
        if len({part.unit for part in self.parts}) > 1:
            raise refused("multisine", "rad and m cannot be added")
        if len({part.frequency for part in self.parts}) < len(self.parts):
            raise refused("multisine", "two parts have the same frequency; write them as one part")

    @property
    def unit(self) -> str:
        """Unit of the positions."""
        return self.parts[0].unit

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self._derivative(t, 0)

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the speed changes sign; all of them (see `crossings`)."""
        return self._crossings(1, duration)

    def peak_speed(self, duration: float) -> float:
        """Largest speed over [0, duration], at one of its ends or where the acceleration changes sign."""
        times = np.concatenate([[0.0, max(duration, 0.0)], self._crossings(2, duration)])
        return float(np.max(np.abs(self._derivative(times, 1))))

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return "multisine " + " + ".join(part.words() for part in self.parts)

    def _derivative(self, t: Array, order: int) -> Array:
        t = np.asarray(t, dtype=float)
        total = np.zeros_like(t)
        for part in self.parts:
            factor = part.amplitude * part.frequency**order
            total += factor * np.sin(part.frequency * t + part.phase + 0.5 * np.pi * order)
        return total

    def _crossings(self, order: int, duration: float) -> Array:
        """Sign changes of a derivative; its own derivatives are bounded by the sum of the parts'."""
        slope, bend = (sum(part.amplitude * part.frequency ** (order + more) for part in self.parts) for more in (1, 2))
        f, df = (partial(self._derivative, order=order + more) for more in (0, 1))
        return crossings(f, df, slope, bend, 0.0, duration)


@dataclass(frozen=True)
class Chirp:
    """A sin(phase) with a frequency from `low` to `high` (rad/s) in `sweep` (s), and back, and so on.

    `amplitude` A in rad or m. The frequency is linear in time within a sweep and never leaves the band;
    phase and frequency are continuous. `low` may exceed `high` (downward first). Raises UsageError for
    values that are not positive. Its turning points are only nearly symmetric (the frequency changes): slow
    sweeps serve the momentum method better.
    """

    amplitude: float
    low: float
    high: float
    sweep: float
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Refuse a motion that does not move."""
        band = {"low_frequency": self.low, "high_frequency": self.high}
        require_positive("chirp", self.unit, amplitude=self.amplitude, **band, sweep=self.sweep)

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self.amplitude * np.sin(self._phase(t)[0])

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the phase is an odd multiple of pi/2, sweep by sweep."""
        times = []
        whole = 0.5 * (self.low + self.high) * self.sweep
        for number in range(math.ceil(max(duration, 0.0) / self.sweep)):
            first, last = (self.low, self.high) if number % 2 == 0 else (self.high, self.low)
            start = number * whole
            levels = np.arange(math.ceil(start / math.pi - 0.5), math.ceil((start + whole) / math.pi - 0.5))
            ahead = (levels + 0.5) * math.pi - start
            # start + first s + (last - first) s^2/(2 sweep), without cancellation for equal frequencies too
            reach = np.sqrt(first**2 + 2.0 * (last - first) / self.sweep * ahead)
            times.append(number * self.sweep + 2.0 * ahead / (first + reach))
        return inside(np.concatenate(times), duration) if times else np.empty(0)

    def peak_speed(self, duration: float) -> float:
        """Largest speed over [0, duration]: at an end, a joint of sweeps or zero acceleration."""
        rate, top = abs(self.high - self.low) / self.sweep, max(self.low, self.high)
        slope = self.amplitude * (3.0 * top * rate + top**3)
        bend = self.amplitude * (3.0 * rate**2 + 6.0 * top**2 * rate + top**4)
        candidates = [np.array([0.0, max(duration, 0.0)])]
        for number in range(math.ceil(max(duration, 0.0) / self.sweep)):
            start, stop = number * self.sweep, min((number + 1) * self.sweep, duration)
            inner = crossings(
                partial(self._acceleration, number), partial(self._jerk, number), slope, bend, start, stop
            )
            candidates += [inner, np.array([start, stop])]
        phase, frequency, _ = self._phase(np.concatenate(candidates))
        return float(np.max(np.abs(self.amplitude * frequency * np.cos(phase))))

    def describe(self) -> str:
        """Words for `parse_reference`."""
        band = f"{self.low!r} rad/s {self.high!r} rad/s"
        return f"chirp {self.amplitude!r} {self.unit} {band} {self.sweep!r} s"

    def _phase(self, t: Array, number: float | Array | None = None) -> tuple[Array, Array, Array]:
        """Phase (rad), frequency (rad/s) and its rate (rad/s^2) after the law of sweep `number`."""
        t = np.asarray(t, dtype=float)
        number = np.floor(t / self.sweep) if number is None else np.asarray(number, dtype=float)
        s = t - number * self.sweep
        up = number % 2 == 0
        rate = np.where(up, 1.0, -1.0) * (self.high - self.low) / self.sweep
        first = np.where(up, self.low, self.high)
        start = number * 0.5 * (self.low + self.high) * self.sweep
        return start + s * (first + 0.5 * rate * s), first + rate * s, rate

    def _acceleration(self, number: int, t: Array) -> Array:
        phase, frequency, rate = self._phase(t, number)
        return self.amplitude * (rate * np.cos(phase) - frequency**2 * np.sin(phase))

    def _jerk(self, number: int, t: Array) -> Array:
        phase, frequency, rate = self._phase(t, number)
        slow = 3.0 * rate * frequency * np.sin(phase)
        return -self.amplitude * (slow + frequency**3 * np.cos(phase))


PEAK = 15.0 / 8.0
"""Peak speed of the quintic 10 s^3 - 15 s^4 + 6 s^5, in the middle, in units of way per time."""


@dataclass(frozen=True)
class Strokes:
    """Rest to rest between +A and -A, with a dwell at each end.

    `amplitude` A in rad or m, `stroke_time` each way and `dwell` in s. Each stroke is the quintic of least
    jerk, at rest and without acceleration at both ends (Flash and Hogan 1985). The first stroke goes from 0
    to +A in the same time, so a body at rest is given no step at t = 0. `unit` of A is "rad" or "m". Raises
    UsageError for an amplitude or stroke time that is not positive, or a negative dwell. The axis may stick in a dwell:
    prefer a sine on a bearing with much static friction.
    """

    amplitude: float
    stroke_time: float
    dwell: float = 0.0
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Refuse a motion that does not move."""
        require_positive("strokes", self.unit, amplitude=self.amplitude, stroke_time=self.stroke_time)
        if not 0.0 <= self.dwell < math.inf:
            raise refused("strokes", f"the dwell must not be negative, and is {self.dwell}")

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        start, travel, s = self._phase(t)
        return start + travel * s**3 * (10.0 + s * (6.0 * s - 15.0))

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) of the middles of the dwells."""
        cycle = self.stroke_time + self.dwell
        count = math.ceil(max(duration, 0.0) / cycle) + 1
        return inside(self.stroke_time + 0.5 * self.dwell + cycle * np.arange(count, dtype=float), duration)

    def peak_speed(self, duration: float) -> float:
        """15/8 of the way per stroke time, once the middle of the second, longer stroke is reached."""
        middles = 0.5 * self.stroke_time + (self.stroke_time + self.dwell) * np.arange(2)
        times = np.concatenate([middles[middles < duration], [max(duration, 0.0)]])
        _, travel, s = self._phase(times)
        return float(np.max(np.abs(travel) * 30.0 * (s * (1.0 - s)) ** 2) / self.stroke_time)

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return f"strokes {self.amplitude!r} {self.unit} {self.stroke_time!r} s {self.dwell!r} s"

    def _phase(self, t: Array) -> tuple[Array, Array, Array]:
        """Return where the stroke of each time begins, its signed way, and the part 0 ... 1 of its time gone."""
        cycle = self.stroke_time + self.dwell
        t = np.maximum(np.asarray(t, dtype=float), 0.0)
        number = np.floor(t / cycle)
        s = np.minimum((t - number * cycle) / self.stroke_time, 1.0)
        sign = np.where(number % 2 == 0, 1.0, -1.0)
        start = np.where(number == 0, 0.0, -sign * self.amplitude)
        travel = sign * self.amplitude * np.where(number == 0, 1.0, 2.0)
        return start, travel, s


@dataclass(frozen=True)
class Triangle:
    """A triangle between +A and -A: `amplitude` A (rad or m), `frequency` (rad/s), `corner` (s) per corner.

    `unit` of A is "rad" or "m".
    In a corner the acceleration is constant, so speed is continuous and turning points are symmetric; on
    the flanks the speed is constant, v = 4 A/(T - corner) with T the period. It starts on the middle of a
    rising flank. `corner` None is a tenth of the period; at half a period the flanks are gone. Raises
    UsageError for values out of range. Shows friction at one speed well, and excites inertia only in the
    corners.
    """

    amplitude: float
    frequency: float
    corner: float | None = None
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Fill in the corner, refuse one that does not fit."""
        require_positive("triangle", self.unit, amplitude=self.amplitude, frequency=self.frequency)
        if self.corner is None:
            object.__setattr__(self, "corner", 0.1 * self.period)
        if not 0.0 < self._corner <= 0.5 * self.period:
            limits = f"between 0 and half a period ({0.5 * self.period:.6g} s)"
            raise refused("triangle", f"the corner must last {limits}, and is {self._corner} s")

    @property
    def period(self) -> float:
        """Time (s) of one stroke and its return."""
        return 2.0 * math.pi / self.frequency

    @property
    def _corner(self) -> float:
        return 0.0 if self.corner is None else self.corner

    @property
    def speed(self) -> float:
        """Speed (rad/s or m/s) on the flanks."""
        return 4.0 * self.amplitude / (self.period - self._corner)

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        half = 0.5 * self.period
        number = np.floor(np.asarray(t, dtype=float) / half + 0.5)
        from_middle = np.asarray(t, dtype=float) - number * half
        into_corner = np.maximum(np.abs(from_middle) - 0.5 * (half - self._corner), 0.0)
        travel = self.speed * (np.abs(from_middle) - into_corner**2 / self._corner)
        return np.where(number % 2 == 0, 1.0, -1.0) * np.sign(from_middle) * travel

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) of the corners' middles."""
        count = math.ceil(max(duration, 0.0) * 2.0 / self.period) + 1
        return inside((np.arange(count, dtype=float) + 0.5) * 0.5 * self.period, duration)

    def peak_speed(self, duration: float) -> float:
        """The speed of the flanks, which the motion starts with."""
        del duration
        return self.speed

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return f"triangle {self.amplitude!r} {self.unit} {self.frequency!r} rad/s {self._corner!r} s"
