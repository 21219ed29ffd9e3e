"""What small errors of the encoders do to the rows of the balance, per unit; see `momentum.imperfections`.

With the channels as read, and a11 and b known from the fit before (THEORY 4, self-calibration):

    δ of the wheel against the angle     a12 ∫φ'' q2'          (direct drive: of the angle against the torque, −∫φ' τ)
    α of the wheel's encoder             a12 ∫φ'' cos q2
    α of the axis' encoder               a11 ∫φ'' cos q1 + b ∫φ cos² q1
    δ of the angle's zero                b ∫φ cos q1
"""

from __future__ import annotations

from swingid.balance.imperfections import axis_bends, wheel_bends
from swingid.balance.rows import Rows, Signals
from swingid.calibration.encoders.parts import ANGLE, WHEEL
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import project
from swingid.preparation.scale import Scale


def encoder_columns(rows: Rows, signals: Signals, scale: Scale, a11: float, b: float) -> dict[str, Array]:
    """How much a unit of each part adds to the left side of every row, by its key (and "zero")."""
    result: dict[str, Array] = {}
    for name, effect in axis_bends(signals, rows, a11, b).items():
        result[f"{ANGLE}.nonlinearity_{name}"] = -effect
    for name, effect in wheel_bends(signals, rows, scale.a12).items():
        result[f"{WHEEL}.nonlinearity_{name}"] = -effect
    windows = rows.windows
    if not signals.linear:
        result["zero"] = b * project(signals.nodes, [(signals.cosine, 0)], windows.centres, windows.half)[:, 0]
    if signals.wheel_rate is not None:
        late = project(signals.nodes, [(signals.wheel_rate, 2)], windows.centres, windows.half)[:, 0]
        result[f"{WHEEL}.latency"] = scale.a12 * late
    elif signals.torque is not None:
        late = project(signals.nodes, [(signals.torque, 1)], windows.centres, windows.half)[:, 0]
        result[f"{ANGLE}.latency"] = -late
    return result
