"""Output error of equation (II): simulated against logged angles of the wheel, on shots with their own initial values.

The wheel's angle integrates, so one simulation over a long log would accumulate the errors of the model; shots of about
a second, each with its own angle and speed at the start, do not (multiple shooting). Those are eliminated per shot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swingid.balance.wheel_equation import COUNT, COUPLING, allowed
from swingid.calibration.motor.channels import GAP, WheelLog
from swingid.calibration.motor.wheel_motion import STATES, simulate_wheel
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.progress import stepped

SHOT = 1.0
"""Length of a shot in s: some time constants of a damped wheel."""

FEWEST_ROWS, MOST_STEPS = 20, 30

USUAL_STEPS = 8
"""Steps of Gauss–Newton that are counted as progress; most fits end sooner."""

FEWEST_SPARE = 2
"""Shots beyond the number of products from which on the scores of shots are used instead of those of blocks."""

BLOCK = 0.1
"""Length of such blocks in s: longer than the correlation of a coarse encoder's rounding errors."""


@dataclass(frozen=True)
class Shot:
    """A part of a log: wheel (n,) in rad; steps, voltage, kicks (n−1,) as in `simulate_wheel`; start (q, q').

    angle (n,): the smoothed angle of the axis, from which the kicks come. rough (n,): what smoothing removed. It acted
    on the wheel too, and too fast for its damping to matter: q2 + ρ q1 is the same with it or without.
    """

    log: int
    wheel: Array
    angle: Array
    rough: Array
    steps: Array
    voltage: Array
    kicks: Array
    start: Array

    @property
    def time(self) -> Array:
        """Seconds (n,) from the begin of the shot."""
        return np.append(0.0, np.cumsum(self.steps))

    def simulated(self, values: Array, start: Array, angle: Array | None = None) -> tuple[Array, Array]:
        """Angles (n,) and their derivatives (n, 9) to products and start; `angle` (of the axis) instead of its own."""
        angles, slopes = np.empty(len(self.wheel)), np.empty((len(self.wheel), STATES))
        kicks = self.kicks if angle is None else kicks_of(angle, self.steps)
        simulate_wheel(values, self.steps, self.voltage, kicks, start[0], start[1], angles, slopes)
        slopes[:, COUPLING] -= self.rough
        return angles - values[COUPLING] * self.rough, slopes


@dataclass(frozen=True)
class OutputFit:
    """Products (7,) that the simulated angles fit best, with the covariance (7, 7) of the free ones.

    levels: root mean square of the residuals of each log (rad). influence: derivative of the products to every logged
    angle, per shot (see `shift`).
    """

    values: Array
    covariance: Array
    free: Bools
    shots: tuple[Shot, ...]
    starts: tuple[Array, ...]
    levels: Array
    influence: tuple[Array, ...]

    def shift(self, changes: Sequence[Array]) -> Array:
        """Change of the products (7,) when the logged angle of each shot changes by `changes` (rad)."""
        result = np.zeros(COUNT)
        result[self.free] = sum((k @ c for k, c in zip(self.influence, changes, strict=True)), 0.0)
        return result


def kicks_of(angle: Array, steps: Array) -> Array:
    """Changes (n−1,) of the speed of an angle (n,) that runs straight from sample to sample; the first is 0."""
    return np.append(0.0, np.diff(np.diff(angle) / steps))


def _shots(place: int, log: WheelLog) -> Iterator[Shot]:
    """Shots of a log, each begun where the wheel turns fast, so that it does not begin at rest."""
    time = log.nodes.time
    steps = np.diff(time)
    voltage = log.voltage_between()
    speed = log.speed.at(np.clip(time, log.speed.grid[0], log.speed.grid[-1]))
    for part in _parts(log):
        edges = _cuts(time[part], np.abs(speed[part])) + part[0]
        for first, last in pairwise(edges):
            if last - first < FEWEST_ROWS:
                continue
            rows, between = slice(first, last + 1), slice(first, last)
            yield Shot(
                log=place,
                wheel=log.wheel[rows],
                angle=log.smooth[rows],
                rough=log.angle[rows] - log.smooth[rows],
                steps=steps[between],
                voltage=voltage[between],
                kicks=kicks_of(log.smooth[rows], steps[between]),
                start=np.array([log.wheel[first], speed[first]]),
            )


def _parts(log: WheelLog) -> list[Ints]:
    """Rows between gaps; of a moving axis only the runs: there q1'' decides when a resting wheel breaks away."""
    time = log.nodes.time
    if log.kind == "driven":
        places = np.searchsorted(time, log.runs)
        return [np.arange(first, last) for first, last in places]
    gaps = np.flatnonzero(np.diff(time) > GAP * log.noise.step) + 1
    return np.split(np.arange(len(time)), gaps)


def _cuts(time: Array, speed: Array) -> Ints:
    """Rows at which shots begin, about `SHOT` apart, each where the speed is largest nearby; and the last row."""
    cuts = [0]
    while time[-1] - time[cuts[-1]] > 1.5 * SHOT:
        low, high = np.searchsorted(time, time[cuts[-1]] + np.array([0.6, 1.4]) * SHOT)
        cuts.append(int(low + np.argmax(speed[low:high])) if high > low else int(high))
    return np.array([*cuts, len(time) - 1])


def fit_output(logs: Sequence[WheelLog], start: Array, free: Bools) -> OutputFit:
    """Refine the free products from `start` by Gauss–Newton with halved steps; requires a `start` near the estimate."""
    shots = [shot for place, log in enumerate(logs) for shot in _shots(place, log)]
    weights = np.array([1 / max(log.noise.wheel, 1e-12) for log in logs])
    values, starts = _descend(shots, start.copy(), [shot.start for shot in shots], free, weights)
    parts = _reduced(shots, values, starts, free)
    left = [[part.left for part, shot in zip(parts, shots, strict=True) if shot.log == k] for k in range(len(logs))]
    levels = np.array([float(np.sqrt(np.mean(np.concatenate(own or [np.zeros(1)]) ** 2))) for own in left])
    if len(logs) > 1:
        weights = 1 / np.maximum(levels, 1e-12)
        values, starts = _descend(shots, values, starts, free, weights)
        parts = _reduced(shots, values, starts, free)
    return _fitted(shots, parts, values, starts, free, weights, levels)


@dataclass(frozen=True)
class _Part:
    """One shot with its start eliminated: residuals, derivatives to the free products, change of the start."""

    left: Array
    slopes: Array
    follow: Callable[[Array], Array]


def _reduced(shots: list[Shot], values: Array, starts: list[Array], free: Bools) -> list[_Part]:
    return [_part(shot, values, start, free) for shot, start in zip(shots, starts, strict=True)]


def _part(shot: Shot, values: Array, start: Array, free: Bools) -> _Part:
    angles, slopes = shot.simulated(values, start)
    left = shot.wheel - angles
    own = slopes[:, COUNT:]
    q, r = np.linalg.qr(own)
    inverse = np.linalg.pinv(r)
    wanted = slopes[:, :COUNT][:, free]

    def follow(step: Array) -> Array:
        result: Array = inverse @ (q.T @ (left - wanted @ step))
        return result

    return _Part(left - q @ (q.T @ left), wanted - q @ (q.T @ wanted), follow)


def _loss(shots: list[Shot], values: Array, starts: list[Array], weights: Array) -> float:
    total = 0.0
    for shot, start in zip(shots, starts, strict=True):
        left = shot.wheel - shot.simulated(values, start)[0]
        total += float(left @ left) * weights[shot.log] ** 2
    return total


def _descend(
    shots: list[Shot], values: Array, starts: list[Array], free: Bools, weights: Array
) -> tuple[Array, list[Array]]:
    """Gauss–Newton over products and starts, with halved steps while the sum of squares does not fall."""
    least = _loss(shots, values, starts, weights)
    for k in range(MOST_STEPS):
        stepped(int(k < USUAL_STEPS))
        parts = _reduced(shots, values, starts, free)
        step, _ = _solve(shots, parts, weights)
        for _ in range(10):
            tried = values.copy()
            tried[free] += step
            tried = allowed(tried, free)
            taken = tried[free] - values[free]
            follow = [x + part.follow(taken) for x, part in zip(starts, parts, strict=True)]
            now = _loss(shots, tried, follow, weights)
            if now <= least:
                break
            step = step / 2
        else:
            break
        gained, values, starts, least = least - now, tried, follow, now
        if gained <= 1e-9 * least:
            break
    stepped(max(USUAL_STEPS - 1 - k, 0))
    return values, starts


def _solve(shots: list[Shot], parts: list[_Part], weights: Array) -> tuple[Array, Array]:
    """Gauss–Newton's step and the inverse of the information matrix."""
    slopes = np.concatenate([weights[s.log] * p.slopes for s, p in zip(shots, parts, strict=True)])
    left = np.concatenate([weights[s.log] * p.left for s, p in zip(shots, parts, strict=True)])
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0] = 1.0
    q, r = np.linalg.qr(slopes / scale)
    inverse = np.linalg.pinv(r, rcond=1e-12) / scale[:, None]
    return inverse @ (q.T @ left), inverse @ inverse.T


def _fitted(
    shots: list[Shot],
    parts: list[_Part],
    values: Array,
    starts: list[Array],
    free: Bools,
    weights: Array,
    levels: Array,
) -> OutputFit:
    """Covariance from the Jacobian, and from the scatter of the scores where that is larger (cluster-robust)."""
    _, inverse = _solve(shots, parts, weights)
    own = [weights[shot.log] ** 2 for shot in shots]
    count = sum(len(part.left) for part in parts)
    spare = max(count - len(inverse) - 2 * len(parts), 1)
    variance = sum(w * float(p.left @ p.left) for w, p in zip(own, parts, strict=True)) / spare
    scores, taken = _scores(shots, parts, own)
    clusters = len(scores) / max(len(scores) - len(inverse) - taken, 1)
    robust = inverse @ (scores.T @ scores) @ inverse * clusters
    classical = variance * inverse
    widen = np.sqrt(np.maximum(np.diag(robust) / np.maximum(np.diag(classical), 1e-300), 1.0))
    covariance = np.zeros((COUNT, COUNT))
    covariance[np.ix_(free, free)] = classical * np.outer(widen, widen)
    influence = tuple(w * inverse @ p.slopes.T for w, p in zip(own, parts, strict=True))
    return OutputFit(values, covariance, free, tuple(shots), tuple(starts), levels, influence)


def _scores(shots: list[Shot], parts: list[_Part], weights: list[float]) -> tuple[Array, int]:
    """Scores (clusters, free) of shots, or of blocks of shots where those are few; and unknowns fitted beside."""
    if len(parts) > parts[0].slopes.shape[1] + FEWEST_SPARE:
        return np.array([w * p.slopes.T @ p.left for w, p in zip(weights, parts, strict=True)]), 0
    found = []
    for shot, part, weight in zip(shots, parts, weights, strict=True):
        blocks = max(round(float(shot.steps.sum()) / BLOCK), 1)
        rows = zip(np.array_split(part.slopes, blocks), np.array_split(part.left, blocks), strict=True)
        found += [weight * slopes.T @ left for slopes, left in rows]
    return np.array(found), 2 * len(parts)
