"""Readings of a log in segments, and their prediction by the equations of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from swingid.methods.output_error.axis_motion import GAIN, TORQUE, axis_motion
from swingid.methods.output_error.motor_motion import (
    FIELDS,
    motor_steps,
    read_along,
    read_with_slopes,
)
from swingid.methods.output_error.partials import further_kernel
from swingid.methods.output_error.unknowns import ZERO, Entries, Unknowns
from swingid.model.integrator import STEP_KERNEL
from swingid.model.motion import LONGEST
from swingid.model.parameters import SIZE, STATIC_N, STATIC_P, STRIBECK_SPEED
from swingid.model.sticking import BEGIN_KERNEL
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.shooting import Prediction, Shooting
from swingid.preparation.encoders import Encoders

Input = Literal["voltage", "wheel", "torque", "none"]

LONGEST_STEP = 2e-3
"""Longest step (s) of the axis' integration; with 20 rad/s its error is 1e-9 of the motion."""

CHATTERS = 50
"""Times as many steps as one per knot and `LONGEST`, from about which on a motion counts as divergent: its friction
changes sides all the time. Motions that resemble a log take hardly more than once as many."""

NO_PEAKS = np.empty(0)

NO_ENTRIES: Entries = (np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))

LEAP = 0.4
"""Least ratio of the inertia after a step of a search to that before; its inverse is the greatest."""


@dataclass(frozen=True)
class Problem:
    """Segments of a log with their readings, in order of time; a reading is one angle of one channel at one instant.

    measured (r,), wheel (r,) true where the reading is the wheel's, sigma (r,) its standard deviation, times (r,).
    bounds (k + 1,): first knot of each segment; rows (k + 1,): its first reading. starts (k, 2 or 4): initial values
    from the angles. commands (n,) or courses (n, 3, 4): the input from each knot on.
    """

    input: Input
    knots: Array
    flags: Ints
    bounds: Ints
    rows: Ints
    commands: Array
    courses: Array
    measured: Array
    wheel: Bools
    sigma: Array
    times: Array
    starts: Array
    encoders: Encoders

    @property
    def states(self) -> int:
        """Initial values per segment."""
        return int(self.starts.shape[1])

    def predict(
        self,
        p: Array,
        entries: Entries,
        states: Array,
        unknowns: int,
        longest: float = LONGEST_STEP,
        same: Prediction | None = None,
    ) -> Prediction:
        """Readings under the constants p, and their derivatives by initial values and `unknowns` columns of entries.

        p (SIZE,), or (SIZE + 1,) with the gain of the torque as the last, which multiplies the torque. same: a
        prediction of the same motion, whose steps are used again.
        """
        courses, gain = self.courses, float(p[GAIN]) if len(p) > GAIN else 1.0
        if gain != 1.0:
            courses = courses.copy()
            courses[:, TORQUE] *= gain
            places, columns, weights = entries
            # the kernel's derivative by the gain is the torque that it is given
            entries = places, columns, np.where(places == GAIN, weights / gain, weights)
        if self.input == "voltage":
            steps = self._steps(p, states) if same is None else same.steps
            return self._read(steps, p, entries, NO_PEAKS, self.states + unknowns)
        outputs, rates, slopes = found = self._room(self.states + unknowns)
        finite = axis_motion(self.knots, courses, self.flags, self.bounds, states, p, entries, longest, found)
        return Prediction(outputs, slopes, bool(finite), rates)

    def _room(self, columns: int) -> tuple[Array, Array, Array]:
        """Zeros for outputs and rates (r,) and slopes (r, columns)."""
        count = len(self.measured)
        return np.zeros(count), np.zeros(count), np.zeros((count, columns))

    def _read(
        self, steps: tuple[Array, Ints] | None, p: Array, entries: Entries, peaks: Array, columns: int
    ) -> Prediction:
        """Readings and derivatives along the steps of a motion under the voltage; not finite without steps."""
        outputs, rates, slopes = found = self._room(columns)
        if steps is not None:
            read_with_slopes(further_kernel(p), steps, p, entries, peaks, *found)
        return Prediction(outputs, slopes, steps is not None, rates, steps)

    def with_peaks(
        self, p: Array, entries: Entries, states: Array, unknowns: int, same: Prediction, peaks: Array
    ) -> Prediction:
        """As `predict` of a motion that has no Stribeck's peak, with further slopes: by the heights of k peaks.

        same: a prediction of this motion; peaks (k,): their speeds (rad/s). One column of slopes is left at the end.
        """
        first = self.states + unknowns
        if same.steps is not None:
            places, columns = np.arange(SIZE, SIZE + len(peaks)), np.arange(first, first + len(peaks))
            more = places, columns, np.ones(len(peaks))
            both = [np.concatenate(pair) for pair in zip(entries, more, strict=True)]
            return self._read(same.steps, p, (both[0], both[1], both[2]), peaks, first + len(peaks) + 1)
        bare = self.predict(p, entries, states, unknowns)
        slopes = np.zeros((len(bare.slopes), first + len(peaks) + 1))
        slopes[:, :first] = bare.slopes
        for k, peak in enumerate(peaks):
            own = p.copy()
            own[STRIBECK_SPEED] = peak
            height = np.array([STATIC_P, STATIC_N]), np.array([self.states, self.states]), np.ones(2)
            slopes[:, first + k] = self.predict(own, height, states, 1).slopes[:, self.states]
        return replace(bare, slopes=slopes)

    def _steps(self, p: Array, states: Array) -> tuple[Array, Ints] | None:
        """The steps of the motion under the voltage, and the first of each segment; None where it diverges."""
        begins, states = np.zeros(len(self.bounds), dtype=np.int64), np.ascontiguousarray(states)
        time = float(np.sum(self.knots[self.bounds[1:] - 1] - self.knots[self.bounds[:-1]]))
        least = max(len(self.knots), int(time / LONGEST))
        room = least + least // 4 + 100
        while room <= CHATTERS * least:
            nodes = np.empty((room, FIELDS))
            ended = motor_steps(
                STEP_KERNEL, BEGIN_KERNEL, self.knots, self.commands, self.flags, self.bounds, states, p, nodes, begins
            )
            if ended >= 0:
                return (nodes, begins) if ended else None
            room *= 4
        return None

    def shooting(self, unknowns: Unknowns, loss: str = "linear") -> Shooting:
        """Least squares of these readings; `loss`: one of `LOSSES`."""
        low, high = unknowns.bounds

        def nearest(values: Array, before: Array) -> Array:
            found: Array = np.clip(values, low, high)
            # the inertia, the first of the unknowns, takes no leaps
            found[:1] = np.clip(found[:1], before[:1] * LEAP, before[:1] / LEAP)
            return found

        return Shooting(
            self.measured,
            self.sigma,
            self.rows,
            self.starts,
            partial(self.fitted, unknowns),
            (low, high),
            unknowns.power,
            nearest,
            partial(self.moved, unknowns),
            # under a voltage the motion is a step of its own, along which the sensitivities follow
            self.input == "voltage",
            loss,
        )

    def fitted(self, unknowns: Unknowns, values: Array, states: Array, same: Prediction | None = None) -> Prediction:
        """Readings and their derivatives for values (m,) of the unknowns; same: the motion, where it is known."""
        entries = unknowns.entries(self.states)
        prediction = self.predict(unknowns.vector(values), entries, states, len(unknowns), same=same)
        return as_read(prediction, self, unknowns.names, values)

    def moved(self, unknowns: Unknowns, values: Array, states: Array) -> Prediction:
        """The same readings without their derivatives (r, 0)."""
        p, none = unknowns.vector(values), np.empty((len(self.measured), 0))
        if self.input == "voltage":
            steps = self._steps(p, states)
            outputs, rates = (self.measured, self.measured) if steps is None else read_along(*steps)
            prediction = Prediction(outputs, none, steps is not None, rates, steps)
        else:
            prediction = replace(self.predict(p, NO_ENTRIES, states, 0), slopes=none)
        return as_read(prediction, self, unknowns.names, values)

    def part(self, chosen: list[int], most: int = 1 << 62) -> Problem:
        """The problem of some of the segments; most: knots of each, from its first one on."""
        ends = [min(self.bounds[s] + most, self.bounds[s + 1]) for s in chosen]
        knots = np.concatenate([np.arange(self.bounds[s], end) for s, end in zip(chosen, ends, strict=True)])
        read = np.concatenate([[0], np.cumsum(np.bitwise_count(self.flags))])
        lengths = [int(read[end] - read[self.bounds[s]]) for s, end in zip(chosen, ends, strict=True)]
        rows = np.concatenate([np.arange(self.rows[s], self.rows[s] + n) for s, n in zip(chosen, lengths, strict=True)])
        of_knots = {name: getattr(self, name)[knots] for name in ("knots", "flags", "commands", "courses")}
        of_rows = {name: getattr(self, name)[rows] for name in ("measured", "wheel", "sigma", "times")}
        bounds = ends_of([end - self.bounds[s] for s, end in zip(chosen, ends, strict=True)])
        return replace(self, bounds=bounds, rows=ends_of(lengths), starts=self.starts[chosen], **of_knots, **of_rows)


def as_read(prediction: Prediction, problem: Problem, names: Sequence[str], values: Array) -> Prediction:
    """The measurement equation: zero offset, once-per-turn nonlinearity and latency added to the predicted angles.

    Each is proportional to one number that rig.toml states with an uncertainty, which is an unknown of the fit. names,
    values (m,): of all unknowns, in the order of the slopes' columns; the derivatives are written into the slopes.
    """
    ours = [k for k, name in enumerate(names) if name == ZERO or name.startswith("sensors.")]
    outputs = prediction.outputs.copy() if ours else prediction.outputs
    # the latency acts on the angle that the nonlinearity is a function of, so it comes first
    for k in sorted(ours, key=lambda k: not names[k].endswith("latency")):
        here = problem.wheel if names[k].startswith("sensors.wheel.") else ~problem.wheel
        column = prediction.slopes[:, problem.states + k] if prediction.slopes.size else np.empty(len(outputs))
        if names[k] == ZERO:
            column[:] = here
            outputs += float(values[k]) * here
            continue
        rates, times = prediction.rates[here], problem.times[here]
        added, slope = _effect(names[k], float(values[k]), outputs[here], rates, times)
        column[:] = 0.0
        column[here] = slope
        outputs[here] += added
    return replace(prediction, outputs=outputs)


def _effect(name: str, value: float, angle: Array, rate: Array, time: Array) -> tuple[Array, Array]:
    """Contribution of an unknown of a sensor to readings of an angle (n,), and its derivative."""
    last = name.rpartition(".")[2]
    if last == "latency":
        # to second order: in 0.3 ms the acceleration of a wheel moves it by more than a count
        gain = np.gradient(rate, time) if value else np.zeros_like(rate)
        return value * (rate + 0.5 * value * gain), rate + value * gain
    shape = np.cos(angle) if last == "cosine" else np.sin(angle)
    return value * shape, shape


def ends_of(lengths: list[int]) -> Ints:
    """Ends of parts of these lengths, from 0 on (k + 1,)."""
    return np.concatenate([[0], np.cumsum(np.array(lengths, dtype=np.int64))])
