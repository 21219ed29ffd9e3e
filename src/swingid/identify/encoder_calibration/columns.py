"""What small errors of the encoders do to the rows of the balance, per unit; see `momentum.imperfections`.

With the channels as read, and a11 and b known from the fit before (THEORY 4, self-calibration):

    δ of the wheel against the angle     a12 ∫φ'' q2'          (direct drive: of the angle against the torque, −∫φ' τ)
    α of the wheel's encoder             a12 ∫φ'' cos q2
    α of the axis' encoder               a11 ∫φ'' cos q1 + b ∫φ cos² q1
    δ of the angle's zero                b ∫φ cos q1
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.identify.encoder_calibration.parts import ANGLE, WHEEL
from swingid.identify.momentum.balance import Rows, Signals
from swingid.identify.scale import Scale
from swingid.numerics.test_functions import project

Array = NDArray[np.float64]


def encoder_columns(rows: Rows, signals: Signals, scale: Scale, a11: float, b: float) -> dict[str, Array]:
    """How much a unit of each part adds to the left side of every row, by its key (and "zero")."""
    nodes, windows = signals.nodes, rows.windows
    pairs: list[tuple[Array, int]] = []
    if not signals.linear:
        cosine, sine = np.cos(signals.angle), signals.sine
        pairs += [(cosine, 2), (cosine * cosine, 0), (sine, 2), (sine * cosine, 0), (cosine, 0)]
    if signals.wheel is not None and signals.wheel_values is not None:
        pairs += [(nodes.spline(signals.wheel_values, derivative=1), 2)]
        pairs += [(np.cos(signals.wheel), 2), (np.sin(signals.wheel), 2)]
    elif signals.torque is not None:
        pairs.append((signals.torque, 1))
    found = project(nodes, pairs, windows.centres, windows.half).T
    result: dict[str, Array] = {}
    if not signals.linear:
        result[f"{ANGLE}.nonlinearity_cosine"] = a11 * found[0] + b * found[1]
        result[f"{ANGLE}.nonlinearity_sine"] = a11 * found[2] + b * found[3]
        result["zero"] = b * found[4]
        found = found[5:]
    if signals.wheel is not None:
        result[f"{WHEEL}.latency"] = scale.a12 * found[0]
        result[f"{WHEEL}.nonlinearity_cosine"] = scale.a12 * found[1]
        result[f"{WHEEL}.nonlinearity_sine"] = scale.a12 * found[2]
    elif signals.torque is not None:
        result[f"{ANGLE}.latency"] = -found[0]
    return result
