"""Output error of equation (II): simulated against logged angles of the wheel, on shots with their own initial values.

The wheel's angle integrates, so one simulation over a long log would accumulate the errors of the model; shots of about
a second, each with its own angle and speed at the start, do not (multiple shooting). Those are eliminated per shot.

The axis rests in the simulation, and the measured axis enters as straight lines between its samples: each change of its
speed kicks the wheel by −ρ times as much, so that q2 follows −ρ q1 exactly from sample to sample.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from swingid.balance.wheel_equation import (
    COULOMB,
    COUNT,
    COUPLING,
    DAMPING,
    EMF,
    GAIN,
    NEGATIVE,
    POSITIVE,
    allowed,
)
from swingid.calibration.motor.channels import GAP, WheelLog
from swingid.methods.output_error.along import Steps, read_along, slopes_along, steps_of
from swingid.methods.output_error.motion import READ_WHEEL
from swingid.methods.output_error.unknowns import entries_of
from swingid.model import parameters as at
from swingid.model.integrator import STEP_KERNEL
from swingid.model.sticking import BEGIN_KERNEL
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

STATES = 2
"""Initial values of a shot: angle and speed of the wheel."""

PLACES = {
    GAIN: ((at.C1, 1.0),),
    DAMPING: ((at.F2, 1.0),),
    EMF: ((at.C2, 1.0), (at.F2, -1.0)),
    POSITIVE: ((at.D1, 1.0),),
    NEGATIVE: ((at.D2, -1.0),),
    COULOMB: ((at.F3, 1.0), (at.WHEEL_STATIC, 1.0), (at.D1, -1.0), (at.D2, 1.0)),
    COUPLING: ((at.A12, 1.0),),
}
"""Places of the rig's vector that a product moves, of a wheel with a22 = 1 and without gear."""

NO_ZONE = -1e-300
"""Edges of a dead zone of no width, with which the sign of the torque gives the branch."""


def wheel_vector(values: Array) -> Array:
    """The rig's vector (SIZE,) of a wheel with these products (7,) on an axis that never moves."""
    p = np.zeros(at.SIZE)
    p[[at.A11, at.A22, at.GEAR, at.ETA, at.AXIS_STICKS]], p[[at.STATIC_P, at.STATIC_N]] = 1.0, np.inf
    for product, places in PLACES.items():
        for place, weight in places:
            p[place] += weight * values[product]
    p[at.D1], p[at.D2] = max(p[at.D1], 0.0), min(p[at.D2], 0.0)
    if p[at.D1] == p[at.D2]:
        p[[at.D1, at.D2]] = NO_ZONE
    return p


@dataclass(frozen=True)
class Shots:
    """The rows of logs in k shots. rows (k + 1,): first row of each; logs (k,): which log it is of.

    time (n,) in s, voltage (n,) from each row on in V, wheel (n,) in rad. angle (n,): the smoothed angle of the axis,
    from which the kicks come. rough (n,): what smoothing removed. It acted on the wheel too, and too fast for its
    damping to matter: q2 + ρ q1 is the same with it or without. starts (k, 2): angle and speed of the wheel.
    """

    rows: Ints
    logs: Ints
    time: Array
    wheel: Array
    angle: Array
    rough: Array
    voltage: Array
    starts: Array

    @classmethod
    def of(cls, logs: Sequence[WheelLog]) -> Shots:
        """Divide the logs into shots that each begin where the wheel turns fast, so not at rest."""
        places, starts, parts = [], [], []
        for place, log in enumerate(logs):
            time = log.nodes.time
            voltage = np.append(log.voltage_between(), 0.0)
            speed = log.speed.at(np.clip(time, log.speed.grid[0], log.speed.grid[-1]))
            for part in _parts(log):
                for first, last in pairwise(_cuts(time[part], np.abs(speed[part])) + part[0]):
                    if last - first >= FEWEST_ROWS:
                        channels = np.stack([time, log.wheel, log.smooth, log.angle - log.smooth, voltage])
                        parts.append(channels[:, first : last + 1])
                        places.append(place)
                        starts.append((log.wheel[first], speed[first]))
        rows = np.concatenate([[0], np.cumsum([part.shape[1] for part in parts])])
        time, wheel, angle, rough, voltage = np.hstack(parts)
        return cls(rows, np.array(places), time, wheel, angle, rough, voltage, np.array(starts))

    def __len__(self) -> int:
        return len(self.logs)

    @property
    def sizes(self) -> Ints:
        """Rows of each shot (k,)."""
        return np.diff(self.rows)

    def each(self, error: Callable[[Array, Array], Array], angle: Array) -> Array:
        """An error (n,) as a function of an angle (n,) and the time since the begin of the shot, shot by shot."""
        cuts = [slice(*cut) for cut in pairwise(self.rows)]
        return np.concatenate([error(angle[shot], self.time[shot] - self.time[shot.start]) for shot in cuts])

    def moved(self, values: Array, starts: Array, angle: Array | None = None) -> Prediction:
        """Angles (n,) of the wheel for products (7,); `angle` (of the axis) instead of its own."""
        kicks = _kicks(self.angle if angle is None else angle, self.time, self.rows)
        inputs = np.column_stack([self.voltage, kicks])
        flags = np.full(len(self.time), READ_WHEEL)
        states = np.hstack([np.zeros_like(starts), starts])
        p = wheel_vector(values)
        steps = steps_of(STEP_KERNEL, BEGIN_KERNEL, self.time, inputs, flags, self.rows, states, p)
        readings = read_along(steps, self.wheel)
        return replace(readings, outputs=readings.outputs - values[COUPLING] * self.rough)

    def slopes(self, values: Array, steps: Steps) -> Array:
        """Derivatives (n, 9) along the steps of a motion, by the initial values and the products (7,)."""
        entries = entries_of(list(PLACES.values()), STATES)
        initial, columns = np.array([-1, -1, 0, 1]), STATES + COUNT
        slopes = slopes_along(steps, initial, wheel_vector(values), entries, np.empty(0), columns)
        slopes[:, STATES + COUPLING] -= self.rough
        return slopes


@dataclass(frozen=True)
class OutputFit:
    """Products (7,) that the simulated angles fit best, with the covariance (7, 7) of the free ones.

    fit: of the free products and the initial values of the shots. levels: root mean square of the residuals of each
    log (rad).
    """

    values: Array
    covariance: Array
    free: Bools
    shots: Shots
    fit: Fit
    levels: Array

    @cached_property
    def motion(self) -> Prediction:
        """The motion of the fit."""
        return self.shots.moved(self.values, self.fit.states)

    def shift(self, changes: Array) -> Array:
        """Change of the products (7,) when the logged angles change by `changes` (n,) (rad)."""
        result = np.zeros(COUNT)
        result[self.free] = self.fit.effect(changes)
        return result


def _kicks(angle: Array, time: Array, rows: Ints) -> Array:
    """Change (n,) at each row of the speed of an angle (n,) that runs straight from row to row; 0 at a shot's ends."""
    steps = np.diff(time)
    steps[rows[1:-1] - 1] = 1.0  # between shots
    speed = np.diff(angle) / steps
    kicks = np.concatenate([[0.0], np.diff(speed), [0.0]])
    kicks[rows[:-1]] = kicks[rows[1:] - 1] = 0.0
    return kicks


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
    shots = Shots.of(logs)
    levels = np.array([max(log.noise.wheel, 1e-12) for log in logs])
    fit = solve(_shooting(shots, levels, start, free), start[free], shots.starts, STALLED, LEAST)
    stepped()
    levels = _levels(fit, shots, len(logs))
    if len(logs) > 1:
        shooting = _shooting(shots, np.maximum(levels, 1e-12), start, free)
        fit = solve(shooting, fit.values, fit.states, STALLED, LEAST)
        stepped()
        levels = _levels(fit, shots, len(logs))
    values, covariance = start.copy(), np.zeros((COUNT, COUNT))
    values[free], covariance[np.ix_(free, free)] = fit.values, _covariance(fit, shots)
    return OutputFit(values, covariance, free, shots, fit, levels)


def _shooting(shots: Shots, levels: Array, start: Array, free: Bools) -> Shooting:
    """Least squares of the shots with the free products; levels (logs,): standard deviation of the readings (rad)."""
    columns = np.append(np.ones(STATES, dtype=bool), free)

    def whole(values: Array) -> Array:
        products = start.copy()
        products[free] = values
        return products

    def move(values: Array, states: Array) -> Prediction:
        return shots.moved(whole(values), states)

    def simulate(values: Array, states: Array, same: Prediction | None) -> Prediction:
        motion = move(values, states) if same is None else same
        if motion.steps is None:
            return motion
        return replace(motion, slopes=shots.slopes(whole(values), motion.steps)[:, columns])

    anything = np.full(np.count_nonzero(free), np.inf)
    return Shooting(
        shots.wheel,
        np.repeat(levels[shots.logs], shots.sizes),
        shots.rows,
        shots.starts,
        simulate,
        (-anything, anything),
        np.zeros(len(anything)),
        # what is physical of one product depends on the others
        lambda values, _: allowed(whole(values), free)[free],
        move,
    )


def _levels(fit: Fit, shots: Shots, count: int) -> Array:
    """Root mean square of the residuals of each of `count` logs, rad; 0 without shots."""
    place = np.repeat(shots.logs, shots.sizes)
    squares = np.bincount(place, (fit.residuals * fit.shooting.sigma) ** 2, minlength=count)
    result: Array = np.sqrt(squares / np.maximum(np.bincount(place, minlength=count), 1))
    return result


def _covariance(fit: Fit, shots: Shots) -> Array:
    """Covariance from the Jacobian, and from the scatter of the scores where that is larger (cluster-robust).

    Clusters are the shots, or blocks of these where they are few.
    """
    count, used = len(fit.values), 0
    blocks = np.ones(len(shots), dtype=np.int64)
    if len(shots) <= count + FEWEST_SPARE:
        lengths = shots.time[shots.rows[1:] - 1] - shots.time[shots.rows[:-1]]
        blocks, used = np.maximum(np.rint(lengths / BLOCK).astype(np.int64), 1), fit.states.size
    parts = [
        len(part) for n, shot in zip(shots.sizes, blocks, strict=True) for part in np.array_split(np.empty(n), shot)
    ]
    scores = fit.scores(np.repeat(np.arange(len(parts)), parts))
    robust = scores @ scores.T * (len(parts) / max(len(parts) - count - used, 1))
    return widened(fit.white(), robust)[0]
