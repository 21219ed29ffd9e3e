"""What the sensors make of a predicted angle: a zero that is off, a nonlinearity once per turn, a latency.

Each is linear in one number that rig.toml knows to within an uncertainty, and so an unknown of the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swingid.identify.output_error.problem import Input, Prediction, Problem
from swingid.identify.output_error.unknowns import ZERO
from swingid.model.rig import Rig

Array = NDArray[np.float64]


def uncertain_readings(rig: Rig, source: Input) -> dict[str, float]:
    """What rig.toml leaves open of the sensors whose angles are compared: standard deviations by their keys.

    The wheel's sensor is not among them where its angle is the input; neither is a latency in a free decay, which has
    no other clock.
    """
    found: dict[str, float | None] = {}
    for channel, prefix in (("angle", "sensors."), ("wheel", "sensors.wheel.")):
        if channel == "wheel" and source != "voltage":
            continue
        sensor = rig.sensors.of("angle" if channel == "angle" else "wheel")
        if rig.axis.kind != "linear":
            found |= {f"{prefix}nonlinearity.{name}": part.std for name, part in sensor.parts.items()}
        if source != "none":
            found[f"{prefix}latency"] = sensor.latency.std
    return {key: std for key, std in found.items() if std}


def as_read(prediction: Prediction, problem: Problem, names: Sequence[str], values: Array) -> Prediction:
    """The prediction as the sensors read it; names, values (m,): of all unknowns, in the order of the slopes' columns.

    Writes the derivatives by the unknowns of the sensors into the slopes.
    """
    outputs = prediction.outputs
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        if name != ZERO and not name.startswith("sensors."):
            continue
        here = problem.wheel if name.startswith("sensors.wheel.") else ~problem.wheel
        effect = np.where(here, _shape(name, prediction), 0.0)
        prediction.slopes[:, problem.states + k] = effect
        outputs = outputs + value * effect
    return replace(prediction, outputs=outputs)


def _shape(name: str, prediction: Prediction) -> Array | float:
    """The derivative of a reading by an unknown of its sensor: 1, cos q, sin q or q'."""
    last = name.rpartition(".")[2]
    if last == "latency":
        return prediction.rates
    if last == "cosine":
        cosine: Array = np.cos(prediction.outputs)
        return cosine
    if last == "sine":
        sine: Array = np.sin(prediction.outputs)
        return sine
    return 1.0
