"""Readings of a log in segments, and their prediction by the equations of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from swingid.methods.output_error.along import read_along, slopes_along, steps_of
from swingid.methods.output_error.axis_motion import AXIS_BEGIN, AXIS_STEP
from swingid.methods.output_error.motion import PLAIN
from swingid.methods.output_error.unknowns import ZERO, Entries, Unknowns
from swingid.model.integrator import STEP_KERNEL
from swingid.model.parameters import A12, D1, D2, DIRECT, GEAR, WHEEL_STATIC
from swingid.model.sticking import BEGIN_KERNEL
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.shooting import Prediction, Shooting
from swingid.preparation.encoders import Encoders

Input = Literal["voltage", "wheel", "torque", "none"]

INPUTS: dict[str | None, Input] = {"wheel_angle": "voltage", "torque": "torque", None: "none"}
"""What drives a simulation of all channels, by the channel by which the drive acts in equation (I)."""

NO_PEAKS = np.empty(0)

NO_ENTRIES: Entries = (np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))

LEAP = 0.4
"""Least ratio of the inertia after a step of a search to that before; its inverse is the greatest."""


@dataclass(frozen=True)
class Problem:
    """Segments of a log with their readings, in order of time; a reading is one angle of one channel at one instant.

    measured (r,), wheel (r,) true where the reading is the wheel's, sigma (r,) its standard deviation, times (r,).
    bounds (k + 1,): first knot of each segment; rows (k + 1,): its first reading. starts (k, 2 or 4): initial values
    from the angles. inputs (n, c): the input from each knot on, see `motion.motion_steps`.
    """

    input: Input
    knots: Array
    flags: Ints
    bounds: Ints
    rows: Ints
    inputs: Array
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
        same: Prediction | None = None,
        peaks: Array = NO_PEAKS,
    ) -> Prediction:
        """Readings under the constants p (SIZE,), and their derivatives by initial values and columns of entries.

        unknowns: how many such columns. same: a prediction of the same motion, whose steps are used again. peaks: see
        `motion.motion_readings`.
        """
        motion = self._motion(p, states) if same is None else same
        if motion.steps is None:
            return motion
        initial = np.where(np.arange(4) < self.states, np.arange(4), -1)
        columns = self.states + unknowns
        slopes = slopes_along(motion.steps, initial, self._constants(p), entries, peaks, columns)
        return replace(motion, slopes=slopes)

    def _constants(self, p: Array) -> Array:
        """The constants as the motion takes them: with another input than the voltage the motor does nothing."""
        if self.input == "voltage":
            return p
        constants = np.append(p, np.zeros(self.inputs.shape[1] - PLAIN))
        constants[[GEAR, D1, D2]], constants[WHEEL_STATIC] = 0.0, np.inf
        constants[A12] -= constants[DIRECT]
        return constants

    def _motion(self, p: Array, states: Array) -> Prediction:
        """What is read along the motion under the constants p (SIZE,), without derivatives."""
        whole = np.zeros((len(states), 4))
        whole[:, : self.states] = states
        step, begin = (STEP_KERNEL, BEGIN_KERNEL) if self.input == "voltage" else (AXIS_STEP, AXIS_BEGIN)
        constants = self._constants(p)
        steps = steps_of(step, begin, self.knots, self.inputs, self.flags, self.bounds, whole, constants)
        return read_along(steps, self.measured)

    def shooting(self, unknowns: Unknowns, loss: str = "linear") -> Shooting:
        """Least squares of these readings; `loss`: one of `LOSSES`."""
        low, high = unknowns.bounds

        def nearest(values: Array, before: Array) -> Array:
            clipped: Array = np.clip(values, low, high)
            # the inertia, the first of the unknowns, takes no leaps
            clipped[:1] = np.clip(clipped[:1], before[:1] * LEAP, before[:1] / LEAP)
            return clipped

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
            loss,
        )

    def fitted(self, unknowns: Unknowns, values: Array, states: Array, same: Prediction | None = None) -> Prediction:
        """Readings and their derivatives for values (m,) of the unknowns; same: the motion, where it is known."""
        same = self.moved(unknowns, values, states) if same is None else same
        entries = unknowns.entries(self.states)
        prediction = self.predict(unknowns.vector(values), entries, states, len(unknowns), same)
        for k, column in prediction.of_sensors.items():
            prediction.slopes[:, self.states + k] = column
        return prediction

    def moved(self, unknowns: Unknowns, values: Array, states: Array) -> Prediction:
        """The same readings without their derivatives (r, 0)."""
        return as_read(self._motion(unknowns.vector(values), states), self, unknowns.names, values)

    def part(self, chosen: list[int], most: int = 1 << 62) -> Problem:
        """The problem of some of the segments; most: knots of each, from its first one on."""
        ends = [min(self.bounds[s] + most, self.bounds[s + 1]) for s in chosen]
        knots = np.concatenate([np.arange(self.bounds[s], end) for s, end in zip(chosen, ends, strict=True)])
        read = np.concatenate([[0], np.cumsum(np.bitwise_count(self.flags))])
        lengths = [int(read[end] - read[self.bounds[s]]) for s, end in zip(chosen, ends, strict=True)]
        rows = np.concatenate([np.arange(self.rows[s], self.rows[s] + n) for s, n in zip(chosen, lengths, strict=True)])
        of_knots = {name: getattr(self, name)[knots] for name in ("knots", "flags", "inputs")}
        of_rows = {name: getattr(self, name)[rows] for name in ("measured", "wheel", "sigma", "times")}
        bounds = ends_of([end - self.bounds[s] for s, end in zip(chosen, ends, strict=True)])
        return replace(self, bounds=bounds, rows=ends_of(lengths), starts=self.starts[chosen], **of_knots, **of_rows)


def as_read(prediction: Prediction, problem: Problem, names: Sequence[str], values: Array) -> Prediction:
    """The measurement equation: zero offset, once-per-turn nonlinearity and latency added to the predicted angles.

    Each is proportional to one number that rig.toml states with an uncertainty, which is an unknown of the fit. names,
    values (m,): of all unknowns, by whose places `of_sensors` has the derivatives. A motion that diverged has no
    readings.
    """
    if not prediction.finite:
        return prediction
    ours = [k for k, name in enumerate(names) if name == ZERO or name.startswith("sensors.")]
    outputs, columns = prediction.outputs.copy() if ours else prediction.outputs, {}
    # the latency acts on the angle that the nonlinearity is a function of, so it comes first
    for k in sorted(ours, key=lambda k: not names[k].endswith("latency")):
        here = problem.wheel if names[k].startswith("sensors.wheel.") else ~problem.wheel
        if names[k] == ZERO:
            outputs[here] += values[k]
            columns[k] = here.astype(np.float64)
        else:
            columns[k], rates, times = np.zeros(len(outputs)), prediction.rates[here], problem.times[here]
            added, columns[k][here] = _effect(names[k], float(values[k]), outputs[here], rates, times)
            outputs[here] += added
    return replace(prediction, outputs=outputs, of_sensors=columns)


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
