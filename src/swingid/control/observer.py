"""The velocity observers (23): a speed from sampled angles, causally or without delay.

    x2^ = p + sigma x1~,   p' = epsilon sign(x1~) + rho x1~,   x1~ = x1 - x1^,   x1^' = x2^

(23) prints sign(x1^); the stability argument of the observer (Xian et al. 2004) requires sign(x1~). Between two samples
the angle is taken to move on a straight line, so that over a sample everything but the sign is a linear system with
constant input, moved on exactly: stable at every rate, where explicit Euler needs sigma h < 2. With sigma h >> 1, as
the paper's sigma = 10000 1/s at 1 kHz, the observer is the backward difference. The sign is that at the sample's start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swingid.control.law import exponential
from swingid.errors import UsageError
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_helper, njit_inlined

# Places in the state of one observer: the angle before, x1~, p, and whether an angle was seen.
LAST, GAP, P, SEEN, OBSERVER_STATES = 0, 1, 2, 3, 4
# Places in its parameters: A and B of (x1~, p)+ = A (x1~, p) + B (slope of the angle, epsilon sign), row by row.
A, B, SIGMA, EPSILON, RHO, STEP, OBSERVER_PARAMETERS = 0, 4, 8, 9, 10, 11, 12


@njit_helper
def set_step(h: float, parameters: Array) -> None:
    """Put the move over a sample of h (s) into `parameters` (12,), whose sigma, epsilon and rho are there."""
    system = np.zeros((4, 4))  # the inputs as states that rest, so that one exponential gives A and B
    system[0, 0], system[0, 1], system[0, 2] = -parameters[SIGMA] * h, -h, h
    system[1, 0], system[1, 3] = parameters[RHO] * h, h
    move = exponential(system)
    for row in range(2):
        for column in range(2):
            parameters[A + 2 * row + column] = move[row, column]
            parameters[B + 2 * row + column] = move[row, 2 + column]
    parameters[STEP] = h


@njit_inlined
def observer_step(angle: float, state: Array, parameters: Array) -> float:
    """x2^ (rad/s or m/s) at this sample's `angle` (rad or m); moves `state` (4,) on in place. The first gives 0."""
    if state[SEEN] == 0.0:
        state[LAST], state[SEEN] = angle, 1.0
        return float(state[P] + parameters[SIGMA] * state[GAP])
    slope = (angle - state[LAST]) / parameters[STEP]
    gap, p = state[GAP], state[P]
    kick = parameters[EPSILON] * np.sign(gap)
    state[GAP] = parameters[A] * gap + parameters[A + 1] * p + parameters[B] * slope + parameters[B + 1] * kick
    state[P] = parameters[A + 2] * gap + parameters[A + 3] * p + parameters[B + 2] * slope + parameters[B + 3] * kick
    state[LAST] = angle
    return float(state[P] + parameters[SIGMA] * state[GAP])


@njit
def _observed(time: Array, angle: Array, parameters: Array, start: float) -> Array:
    """Speeds at all samples; the step is set again where the stamps are uneven."""
    speeds = np.empty(len(time))
    state = np.zeros(OBSERVER_STATES)
    state[P] = start
    for k in range(len(time)):
        if k > 0:
            h = time[k] - time[k - 1]
            if abs(h - parameters[STEP]) > 1e-6 * h:
                set_step(h, parameters)
        speeds[k] = observer_step(angle[k], state, parameters)
    return speeds


@dataclass(frozen=True)
class VelocityObserver:
    """The observer (23) with its gains sigma (1/s), epsilon (rad/s^2 or m/s^2) and rho (1/s^2); the paper's by default.

    Not for coarse encoders at high sigma: the speed's noise is that of a difference over max(h, 1/sigma). Raises
    UsageError for gains that are negative, or sigma that is not positive.
    """

    sigma: float = 1e4
    epsilon: float = 1.0
    rho: float = 1.0

    def __post_init__(self) -> None:
        """Refuse gains with which nothing is observed."""
        for name, least in (("sigma", math.ulp(0.0)), ("epsilon", 0.0), ("rho", 0.0)):
            if not least <= getattr(self, name) < math.inf:
                what = "positive" if least > 0.0 else "zero or positive"
                raise UsageError(
                    f"VelocityObserver: {name} must be {what}, not {getattr(self, name)}.", code="bad-gain"
                )

    def parameters(self, sample_time: float) -> Array:
        """Parameter array (12,) of `observer_step` for a sample time (s)."""
        parameters = np.zeros(OBSERVER_PARAMETERS)
        parameters[SIGMA], parameters[EPSILON], parameters[RHO] = self.sigma, self.epsilon, self.rho
        set_step(float(sample_time), parameters)
        return parameters

    def run(self, time: Array, angle: Array, start: float = 0.0) -> Array:
        """Speeds (n,) at rising stamps `time` (n,) (s) from `angle` (n,): causal. It is late by about
        1/sigma, for sigma h >> 1 by h/2.

        start: the speed before the first sample (rad/s or m/s).
        """
        parameters = self.parameters(float(time[1] - time[0]))
        return _observed(np.ascontiguousarray(time), np.ascontiguousarray(angle), parameters, start)

    def both_ways(self, time: Array, angle: Array) -> Array:
        """Mean (n,) of the observer run forward and backward in time, whose delays cancel. Not causal."""
        first, last = (float((angle[k + 1] - angle[k]) / (time[k + 1] - time[k])) for k in (0, len(time) - 2))
        backward = self.run(time[0] - time[::-1], angle[::-1], -last)[::-1]
        result: Array = (self.run(time, angle, first) - backward) / 2
        return result

    def noise_gain(self, sample_time: float) -> float:
        """Standard deviation of `both_ways` per standard deviation of white noise of the angle, 1/s."""
        width = 2 * math.ceil(5 / (self.sigma * sample_time)) + 3
        impulse = np.zeros(2 * width + 1)
        impulse[width] = 1.0
        plain = VelocityObserver(self.sigma, 0.0, self.rho)
        return float(np.linalg.norm(plain.both_ways(sample_time * np.arange(len(impulse), dtype=np.float64), impulse)))


@njit
def _filtered(time: Array, held: Array, constant: float) -> Array:
    """W_f at the stamps for a signal that keeps the value of row k up to row k + 1, from rest at the first value."""
    result = np.empty(len(held))
    result[0] = held[0]
    for k in range(len(held) - 1):
        decay = np.exp(-(time[k + 1] - time[k]) / constant)
        result[k + 1] = held[k] + (result[k] - held[k]) * decay
    return result


def filtered_both_ways(time: Array, held: Array, constant: float) -> Array:
    """Mean of W_f(p) = 1/(T p + 1) run forward and backward over a held signal, at its stamps.

    time (n,) (s) rising; held (n,): row k's value lasts to row k + 1, the last counts for nothing; constant: T (s). No
    delay, and the amplitude of a sine of frequency w becomes 1/(1 + (w T)^2) of what it was.
    """
    forward = _filtered(time, held, constant)
    backward = _filtered(time[0] - time[::-1], np.concatenate([held[-2::-1], held[:1]]), constant)[::-1]
    result: Array = (forward + backward) / 2
    return result
