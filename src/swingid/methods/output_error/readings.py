"""What the sensors make of a predicted angle: a zero that is off, a nonlinearity once per turn, a latency.

Each is linear in one number that rig.toml knows to within an uncertainty, and so an unknown of the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swingid.methods.output_error.problem import Input, Prediction, Problem
from swingid.methods.output_error.unknowns import ZERO
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders


def uncertain_readings(encoders: Encoders, source: Input, *, rotary: bool) -> dict[str, float]:
    """What rig.toml leaves open of the sensors whose angles are compared: standard deviations by their keys.

    The wheel's sensor is not among them where its angle is the input; neither is a latency in a free decay, which has
    no other clock.
    """
    found: dict[str, float | None] = {}
    for channel, prefix in (("angle", "sensors."), ("wheel", "sensors.wheel.")):
        if channel == "wheel" and source != "voltage":
            continue
        sensor = encoders.angle if channel == "angle" else encoders.wheel
        if rotary:
            found |= {f"{prefix}nonlinearity.{name}": part.std for name, part in sensor.parts.items()}
        if source != "none":
            found[f"{prefix}latency"] = sensor.latency.std
    return {key: std for key, std in found.items() if std}


def as_read(prediction: Prediction, problem: Problem, names: Sequence[str], values: Array) -> Prediction:
    """The prediction as the sensors read it; names, values (m,): of all unknowns, in the order of the slopes' columns.

    Writes the derivatives by the unknowns of the sensors into the slopes.
    """
    ours = [k for k, name in enumerate(names) if name == ZERO or name.startswith("sensors.")]
    outputs = prediction.outputs.copy() if ours else prediction.outputs
    # what is late is the bent reading, so the latencies come first
    for k in sorted(ours, key=lambda k: not names[k].endswith("latency")):
        here = problem.wheel if names[k].startswith("sensors.wheel.") else ~problem.wheel
        rates, times = prediction.rates[here], problem.times[here]
        added, slope = _effect(names[k], float(values[k]), outputs[here], rates, times)
        prediction.slopes[:, problem.states + k] = 0.0
        prediction.slopes[here, problem.states + k] = slope
        outputs[here] += added
    return replace(prediction, outputs=outputs)


def _effect(name: str, value: float, angle: Array, rate: Array, time: Array) -> tuple[Array, Array]:
    """What an unknown of a sensor adds to readings of an angle (n,), and the derivative by it."""
    last = name.rpartition(".")[2]
    if last == "latency":
        # of second order, as a wheel in 0.3 ms gains more by its acceleration than a count
        gain = np.gradient(rate, time) if value else np.zeros_like(rate)
        return value * (rate + 0.5 * value * gain), rate + value * gain
    shapes = {"cosine": np.cos, "sine": np.sin}
    shape = shapes[last](angle) if last in shapes else np.ones_like(angle)
    return value * shape, shape
