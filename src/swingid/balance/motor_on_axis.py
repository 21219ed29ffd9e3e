"""The terms of a motor on the axis in the balance: torque per volt, back-EMF, friction of the gear by the torque.

    a11 ∫φ'' q1 + … − c1 ∫φ u + c2 ∫φ q1' s + c3 ∫φ |u| sgn q1' = 0

c1 = N k/R, c2 = N² k²/R; s = 1 where the bridge is closed and 0 where it is open, when no current flows and u counts as
0. Where it is always closed, c2 has the regressor of viscous friction.
"""

from __future__ import annotations

import numpy as np

from swingid.balance.rows import Rows, Signals, dry_column
from swingid.model.terms import MOTOR_TERMS
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import project
from swingid.preparation.encoders import moved
from swingid.recording.recording import Recording


def is_open(log: Recording) -> bool:
    """Return whether the bridge is open in a part of the log."""
    return log.bridge is not None and bool(np.any(log.bridge == 0))


def volts(log: Recording) -> Array:
    """Voltage at the motor (V), 0 while the bridge is open."""
    assert log.voltage is not None
    return log.voltage if log.bridge is None else np.where(log.bridge != 0, log.voltage, 0.0)


def with_motor(rows: Rows, signals: Signals) -> Rows:
    """The rows with the columns of a motor on the axis."""
    log, windows = signals.source[0], rows.windows
    late = signals.encoders.angle.latency.value
    voltage = volts(log)
    at_nodes = signals.nodes.hold(voltage, late)
    if not log.drive_held:
        at_nodes = signals.nodes.spline(moved(log.time, voltage, -late))
    closed = np.ones_like(log.time) if log.bridge is None else (log.bridge != 0).astype(np.float64)
    columns = [(-at_nodes, 0), (signals.speed * signals.nodes.hold(closed, late), 0)]
    part = project(signals.nodes, columns, windows.centres, windows.half)
    at_edges = np.interp(signals.edges[:-1], log.time, np.abs(voltage))
    by_name = dict(zip(MOTOR_TERMS, part.T, strict=True))
    by_name["gear_friction"] = dry_column(signals, windows, np.abs(at_nodes), at_edges)
    return rows.beside(by_name)
