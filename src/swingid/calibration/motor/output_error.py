"""Output error of equation (II): simulated against logged angles of the wheel, on shots with their own initial values.

The wheel's angle integrates, so one simulation over a long log would accumulate the errors of the model; shots of about
a second, each with its own angle and speed at the start, do not (multiple shooting). Those are eliminated per shot.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swingid.balance.wheel_equation import COUNT, COUPLING, allowed
from swingid.calibration.motor.channels import GAP, WheelLog
from swingid.calibration.motor.wheel_motion import STATES, simulate_wheel
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.gauss_newton import LEAST, STALLED, solve
from swingid.numerics.shooting import Fit, Prediction, Shooting, widened
from swingid.progress import stepped

SHOT = 1.0
"""Length of a shot in s: some time constants of a damped wheel."""

FEWEST_ROWS = 20

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

    fit: of the free products and the initial values of the shots. levels: root mean square of the residuals of each
    log (rad).
    """

    values: Array
    covariance: Array
    free: Bools
    shots: tuple[Shot, ...]
    fit: Fit
    levels: Array

    @property
    def starts(self) -> Array:
        """Angle and speed of the wheel at the begin of each shot (shots, 2)."""
        return self.fit.states

    def shift(self, changes: Sequence[Array]) -> Array:
        """Change of the products (7,) when the logged angle of each shot changes by `changes` (rad)."""
        result = np.zeros(COUNT)
        result[self.free] = self.fit.effect(np.concatenate(changes))
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
    """Refine the free products from `start`; requires a `start` near the estimate.

    Every log has the weight of its residuals, once these are known.
    """
    shots = [shot for place, log in enumerate(logs) for shot in _shots(place, log)]
    states = np.array([shot.start for shot in shots])
    levels = np.array([max(log.noise.wheel, 1e-12) for log in logs])
    fit = solve(_shooting(shots, levels, states, start, free), start[free], states, STALLED, LEAST)
    stepped()
    levels = _levels(fit, shots, len(logs))
    if len(logs) > 1:
        shooting = _shooting(shots, np.maximum(levels, 1e-12), states, start, free)
        fit = solve(shooting, fit.values, fit.states, STALLED, LEAST)
        stepped()
        levels = _levels(fit, shots, len(logs))
    values, covariance = start.copy(), np.zeros((COUNT, COUNT))
    values[free], covariance[np.ix_(free, free)] = fit.values, _covariance(fit, shots)
    return OutputFit(values, covariance, free, tuple(shots), fit, levels)


def _shooting(shots: list[Shot], levels: Array, states: Array, start: Array, free: Bools) -> Shooting:
    """Least squares of the shots with the free products; levels (logs,): standard deviation of the readings (rad)."""

    def whole(values: Array) -> Array:
        products = start.copy()
        products[free] = values
        return products

    def simulate(values: Array, states: Array, same: Prediction | None) -> Prediction:
        if same is not None:
            return same
        found = [shot.simulated(whole(values), state) for shot, state in zip(shots, states, strict=True)]
        outputs, slopes = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return Prediction(outputs, np.hstack([slopes[:, COUNT:], slopes[:, :COUNT][:, free]]))

    sizes = [len(shot.wheel) for shot in shots]
    anything = np.full(np.count_nonzero(free), np.inf)
    return Shooting(
        np.concatenate([shot.wheel for shot in shots]),
        np.repeat(levels[[shot.log for shot in shots]], sizes),
        np.concatenate([[0], np.cumsum(sizes)]),
        states,
        simulate,
        (-anything, anything),
        np.zeros(len(anything)),
        # what is physical of one product depends on the others
        lambda values, _: allowed(whole(values), free)[free],
    )


def _levels(fit: Fit, shots: list[Shot], count: int) -> Array:
    """Root mean square of the residuals of each of `count` logs, rad; 0 without shots."""
    place = np.repeat([shot.log for shot in shots], np.diff(fit.shooting.rows))
    squares = np.bincount(place, (fit.residuals * fit.shooting.sigma) ** 2, minlength=count)
    result: Array = np.sqrt(squares / np.maximum(np.bincount(place, minlength=count), 1))
    return result


def _covariance(fit: Fit, shots: list[Shot]) -> Array:
    """Covariance from the Jacobian, and from the scatter of the scores where that is larger (cluster-robust).

    Clusters are the shots, or blocks of these where they are few.
    """
    count, used = len(fit.values), 0
    blocks = [1] * len(shots)
    if len(shots) <= count + FEWEST_SPARE:
        blocks, used = [max(round(float(shot.steps.sum()) / BLOCK), 1) for shot in shots], fit.states.size
    parts = [len(part) for shot, own in zip(shots, blocks, strict=True) for part in np.array_split(shot.wheel, own)]
    scores = fit.scores(np.repeat(np.arange(len(parts)), parts))
    robust = scores @ scores.T * (len(parts) / max(len(parts) - count - used, 1))
    return widened(fit.white(), robust)[0]
