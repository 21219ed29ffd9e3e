"""The motion by the measured angle alone: speed, turning points, swings, rests; without reference or controller."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swingid.errors import UnanswerableError
from swingid.numerics.arrays import Array, Ints, median, quantile
from swingid.numerics.reversals import reversals
from swingid.numerics.spline import local_cubic
from swingid.preparation.speed import NARROWEST, Speed, smooth_speed, typical_step

FEWEST_ROWS = 20

DIFFERENCES = 10_000
"""Sixth differences, all over a signal, from which its noise is estimated, to 1 %."""

SMALLEST_SWING = 0.02
"""A swing below this share of the largest one is noise or rest, not a swing."""

WHITE = 0.7
"""Share of the noise that the samples show from one to the next, from which on it is white: 1, known to some per cent;
steps of an encoder that are seldom passed show none."""

LOUD = 80
"""Times the noise of a sample that a motion is larger: then a swing of a tenth of it is seen without smoothing, and
reversals below are noise (with them the inertia of two tones in noise of 10 mrad scatters 1.2 times as much)."""

FLATTEST = 0.05
"""Share of the mean acceleration at the reversals below which that of one is not known, see `Motion.reversals`."""


@dataclass(frozen=True)
class Motion:
    """Speed, and the turning points between swings of some size: instants (s), angles, +1 upper / −1 lower.

    `rests` (k, 2): begin and end of the intervals in which the axis stands still longer than a reversal takes.
    `reach`: half-width (s) of the local cubics that give the turning points. `ripples`: instants (s) of the other
    reversals, around swings that are larger than the noise but smaller than `SMALLEST_SWING`.
    """

    speed: Speed
    turning_times: Array
    turning_angles: Array
    sides: Array
    rests: Array
    reach: float
    ripples: Array

    @property
    def swing_sizes(self) -> Array:
        """Angle covered between successive turning points."""
        return np.abs(np.diff(self.turning_angles))

    @cached_property
    def half_period(self) -> float:
        """Median time between turning points in s."""
        return median(np.diff(self.turning_times))

    @cached_property
    def quickest(self) -> float:
        """Time (s) in which the quickest turn of the motion passes: its speed through its acceleration; 1/ω of a sine.

        The acceleration is its quantile 0.99 over the grid.
        """
        grid, speed = self.speed.grid, self.speed.speed
        acceleration = quantile(np.abs(np.diff(speed) / np.diff(grid)), 0.99)
        return float(np.max(np.abs(speed))) / max(acceleration, 1e-300)

    @cached_property
    def reversals(self) -> tuple[Array, Array, Array]:
        """All reversals, ripples among them: instants (s), new directions (±1), and weights of an impulse there.

        Friction keeps its old direction over a small way x (bristles, a gap), which takes √(2x/A) after a reversal of
        acceleration A: the weights are in proportion to A^(−1/2), 1 in the mean. Empty without a turning point.
        """
        if not len(self.turning_times):
            return (np.empty(0),) * 3
        instants = np.sort(np.concatenate([self.turning_times, self.ripples]))
        place = np.arange(len(instants)) - np.searchsorted(instants, self.turning_times[0])
        size = np.abs(self.speed.acceleration(instants))
        weights = 1.0 / np.sqrt(np.maximum(size, FLATTEST * np.mean(size) + 1e-300))
        return instants, -self.sides[0] * (1.0 - 2.0 * (place % 2)), weights / np.mean(weights)

    def reread(self, time: Array, angle: Array, reach: float) -> Motion:
        """The same motion with its turning points from cubics over ±`reach` s, by samples of the whole log."""
        reach = max(reach, NARROWEST * typical_step(time))
        times, angles = _refined(time, angle, self.speed, self.turning_times, reach)
        return replace(self, turning_times=times, turning_angles=angles, reach=reach)

    def earlier(self, late: Array) -> Motion:
        """The same motion with every turning point `late` seconds earlier (one value each)."""
        return replace(self, turning_times=self.turning_times - late)

    def within(self, start: float, stop: float) -> Motion:
        """The same motion with the turning points and rests between two instants only."""
        inside = (self.turning_times > start) & (self.turning_times < stop)
        rests = self.rests[(self.rests[:, 1] > start) & (self.rests[:, 0] < stop)].clip(start, stop)
        times, angles, sides = self.turning_times[inside], self.turning_angles[inside], self.sides[inside]
        ripples = self.ripples[(self.ripples > start) & (self.ripples < stop)]
        return Motion(self.speed, times, angles, sides, rests, self.reach, ripples)

    def directions(self, start: float, stop: float) -> tuple[Array, Array]:
        """Edges (s) of swings and ripples from `start` to `stop`, and the signs of the speed, for `project_steps`.

        Intervals of rest have 0: friction at rest is not determined by the speed.
        """
        edges = np.concatenate([[start], np.sort(np.concatenate([self.turning_times, self.ripples])), [stop]])
        if len(self.sides):
            # the sign alternates from edge to edge, and rises to an upper turning point
            place = np.arange(len(edges) - 1) - np.searchsorted(edges[1:], self.turning_times[0])
            signs = self.sides[0] * (1.0 - 2.0 * (place % 2))
        else:
            signs = np.array([np.sign(np.mean(self.speed.speed))])
        for begin, end in self.rests:
            before = int(np.searchsorted(edges, begin, side="right")) - 1
            after = int(np.searchsorted(edges, end, side="right")) - 1
            edges = np.concatenate([edges[: before + 1], [begin, end], edges[after + 1 :]])
            signs = np.concatenate([signs[: before + 1], [0.0], signs[after:]])
        return edges, signs


def sample_noise(values: Array) -> float:
    """Standard deviation of white noise in a smooth sampled signal, from its sixth differences (robust).

    From about `DIFFERENCES` of them, all over the signal.
    """
    if len(values) < 20:
        return 0.0
    every = max(1, (len(values) - 6) // DIFFERENCES)
    sixth = sixth_differences([values[k : len(values) - 6 + k : every] for k in range(7)])
    return float(median(np.abs(sixth)) / (0.6745 * np.sqrt(924)))


def sixth_differences(seven: list[Array]) -> Array:
    """Sixth differences of seven successive samples each; white noise makes √924 times its own of them."""
    result: Array = seven[0] - 6 * (seven[1] + seven[5]) + 15 * (seven[2] + seven[4]) - 20 * seven[3] + seven[6]
    return result


def grid_step(values: Array) -> float:
    """Step of the grid on which `values` lie, 0 where there is none: the change of which all are multiples."""
    changes = np.abs(np.diff(values))
    changes = changes[changes > 1e-7 * (np.ptp(values) + 1e-300)]
    if len(changes) < 10:
        return 0.0
    smallest = float(changes.min())
    multiples = changes[:2000] / smallest
    return smallest if np.mean(np.abs(multiples - np.round(multiples)) < 0.01) > 0.99 else 0.0


def find_motion(time: Array, angle: Array, noise: float) -> Motion:
    """Speed and turning points of a log; noise: standard deviation of one angle sample.

    A reversal counts as a turning point when the swings on both sides are larger than the noise and than
    2 % of the largest swing, so that a noisy axis at rest has none. Noise is that of the smoothed angle, in which that
    of many samples of a slow swing averages out. Raises UnanswerableError without motion.
    """
    if len(time) < FEWEST_ROWS:
        raise UnanswerableError(
            f"{len(time)} rows are too few to see a motion, at least {FEWEST_ROWS} are needed; log a longer run.",
            code="too-short",
        )
    speed = smooth_speed(time, angle, noise)
    fine = np.linspace(speed.grid[0], speed.grid[-1], 4 * len(speed.grid))
    v = speed.at(fine)
    q = speed.angle_at(fine)
    size = float(q.max() - q.min())
    level = noise if size > LOUD * noise else _after_smoothing(speed, angle, noise)
    if not size > 12 * level or size == 0.0:
        raise UnanswerableError(
            f"the angle moves by {size:.2g} only, not more than its noise and resolution; record a swing.",
            code="no-motion",
        )
    crossings = np.nonzero(np.sign(v[:-1]) * np.sign(v[1:]) < 0)[0]
    instants = fine[crossings] + (fine[1] - fine[0]) * v[crossings] / (v[crossings] - v[crossings + 1])
    reach = max(speed.half_width / 2, NARROWEST * typical_step(time))
    instants, angles = _refined(time, angle, speed, instants, reach)
    path = np.concatenate([[q[0]], angles, [q[-1]]])
    keep = _inner(reversals(path, max(SMALLEST_SWING * size, 8 * level)), len(angles))
    small = np.zeros(len(angles), dtype=bool)
    small[_inner(reversals(path, 8 * noise), len(angles))] = True
    small[keep] = False
    sides = np.sign(v[crossings[keep]])
    return Motion(speed, instants[keep], angles[keep], sides, _rests(speed, fine, v), reach, instants[small])


def _after_smoothing(speed: Speed, angle: Array, noise: float) -> float:
    """Noise of the smoothed angle; that of a sample where it is no noise, as the steps of an encoder at low speed."""
    return speed.angle_noise if sample_noise(angle) > WHITE * noise else noise


def _inner(extremes: Ints, count: int) -> Ints:
    """Indices into `count` reversals of extremes of the path that has its two ends beside them."""
    return extremes[(extremes > 0) & (extremes <= count)] - 1


def _refined(time: Array, angle: Array, speed: Speed, instants: Array, reach: float) -> tuple[Array, Array]:
    """Turning points by one Newton step on a cubic over ±`reach`, and the angles there.

    A jump of the acceleration there delays them (`balance/delays.py`).
    """
    acceleration = speed.acceleration(instants)
    fitted = local_cubic(time, angle, instants, reach)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = -fitted[:, 1] / acceleration
    shift = np.where(np.isfinite(shift) & (np.abs(shift) < speed.half_width / 2), shift, 0.0)
    refined = np.maximum.accumulate(instants + shift)
    return refined, speed.angle_at(refined)


def _rests(speed: Speed, instants: Array, v: Array) -> Array:
    """Intervals in which |v| stays within its noise for longer than three passages through zero take."""
    threshold = max(4 * speed.noise, 2e-3 * float(np.abs(v).max()))
    still = np.concatenate([[False], np.abs(v) < threshold, [False]])
    begins, ends = np.nonzero(~still[:-1] & still[1:])[0], np.nonzero(still[:-1] & ~still[1:])[0] - 1
    acceleration = np.sqrt(np.mean(np.gradient(v, instants[1] - instants[0]) ** 2))
    passage = 2 * threshold / max(acceleration, 1e-300)
    long = instants[ends] - instants[begins] > 3 * passage + 2 * speed.half_width
    result: Array = np.column_stack([instants[begins[long]], instants[ends[long]]])
    return result
