"""The paper's own formulas: J1 by (6) and f1 by (7) on one forward pass and its mirror image, in series.

(6) is kept as printed except for two things. Its last term "− m2 l2²" counts twice: a11 = J1 + J2 + Jr contains it.
And each pass has the potential energies of its own nodes, as in (1) and (2); on equal angles that is the printed
4b (cos q12 − cos q11), while at the paper's times, 1.8 ms off the turning point, the passes' angles differ by 7 mrad,
which alone changed J1 by 3 %. Both formulas assume B1 = B2, that the two passes lose the same energy, and (7) that
the node speeds match as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swingid.balance.energies import GEAR
from swingid.balance.fits import known_side
from swingid.balance.motor import motor_drag, motor_torque
from swingid.errors import UnanswerableError, UsageError
from swingid.methods.energy.balance import MOTOR, PassRows
from swingid.methods.energy.fit import PassFit
from swingid.methods.energy.passes import Passes
from swingid.model.equation import Coefficient, Equation
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit, block_covariance
from swingid.recording.recording import Recording

Nodes = tuple[float, float, float, float]

DEPTHS = np.array([0.0056, 0.5])
"""Where the chosen passes begin and end, in shares of the swing from its turning point: near it, and half-way."""

SINGULAR = 0.02
"""Smallest denominator of (6), as a share of the largest it can be for that swing."""


def chosen_nodes(passes: Passes) -> Array:
    """(pairs, 4) instants t10, t11, t20, t21 of passes mirrored on `DEPTHS` about every turning point."""
    return passes.instants[:, [0, 1, 3, 4]]


def given_nodes(nodes: object, log: Recording) -> Array:
    """(pairs, 4) instants from one tuple of four or a list of them; UsageError for anything else."""
    try:
        rows = np.atleast_2d(np.array(nodes, dtype=np.float64))
    except (TypeError, ValueError):
        rows = np.empty((0, 0))
    if rows.ndim != 2 or rows.shape[1:] != (4,) or not np.isfinite(rows).all():
        raise UsageError("nodes must be four instants (t10, t11, t20, t21) or a list of such.", code="bad-nodes")
    inside = (rows >= log.time[0]) & (rows <= log.time[-1])
    if not inside.all() or not (np.diff(rows, axis=1) > 0).all():
        raise UsageError(
            f"nodes must rise and lie inside the log ({log.time[0]:.6g} to {log.time[-1]:.6g} s).", code="bad-nodes"
        )
    return rows[np.argsort(rows[:, 0])]


def with_trapezoid_work(rows: PassRows, log: Recording, equation: Equation) -> tuple[PassRows, Equation]:
    """Rows and equation with W by the trapezoid rule on samples, which averages a held voltage over its jump.

    Kept for comparison: it is some per cent off at 10 kHz and tens of per cent at 1 kHz.
    """
    course, motor = rows.course, rows.course.motor
    if motor is None:
        power = np.zeros(len(log)) if log.torque is None else log.torque * course.axis.at(log.time)
        return rows.beside({"torque": _trapezoid(rows, log, power)}), equation
    assert log.voltage is not None
    assert course.wheel is not None
    rate, gear = course.wheel.at(log.time), motor.gear_ratio.value
    power = gear * (motor_torque(motor, log.voltage, rate) - motor_drag(motor, rate)) * rate
    held = -rows.sum_of({name: equation.value(name) for name in MOTOR})
    more = {"trapezoid": _trapezoid(rows, log, power) - held}
    return rows.beside(more), equation.but(trapezoid=Coefficient(-1.0, {GEAR: -1.0 / gear}))


def _trapezoid(rows: PassRows, log: Recording, power: Array) -> Array:
    """Integral of a power at the stamps up to the nodes."""
    steps = np.diff(log.time) * (power[1:] + power[:-1]) / 2
    result: Array = np.interp(rows.windows.centres, log.time, np.concatenate([[0.0], np.cumsum(steps)]))
    return result


def printed_fit(rows: PassRows, equation: Equation) -> tuple[PassFit, Array]:
    """(6) and (7) on every pair of passes, and their mean; also the inertia a11 of each pair.

    Raises UnanswerableError where the denominator of (6) vanishes, which it does from turning point to turning point.
    """
    difference, total = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, 1.0, -1.0, 1.0])
    axis, speed, known = rows.course.axis, rows.blocks(rows.speed), rows.blocks(known_side(rows, equation))
    denominator = speed**2 @ difference
    spans = np.searchsorted(axis.grid, rows.instants[:, [0, 3]])
    largest = [np.max(axis.speed[first : last + 1] ** 2, initial=0.0) for first, last in spans]
    singular = np.abs(denominator) < SINGULAR * 2 * np.maximum(largest, np.max(speed**2, axis=1))
    if singular.any():
        at = ", ".join(f"{t:.6g}" for t in rows.instants[int(np.argmax(singular))])
        raise UnanswerableError(
            f"(6) divides by nearly zero for the passes with nodes at {at} s, which have equal speeds at both ends; "
            "let one end of each pass be near a turning point and the other half-way.",
            code="singular-passes",
        )
    of_inertia = 2 * difference / denominator[:, None]  # (6)
    of_viscous = total / (rows.blocks(rows["viscous"]) @ total)[:, None]  # (7)
    pairs = len(known)
    each = np.stack([(of_inertia * known).sum(axis=1), (of_viscous * known).sum(axis=1)])
    values, influence = each.mean(axis=1), np.stack([of_inertia.ravel(), of_viscous.ravel()]) / pairs
    fit = LinearFit(values, np.zeros(known.size), influence, float("nan"))
    covariance = block_covariance((each - values[:, None]) / pairs, 1) if pairs > 1 else np.full((2, 2), np.nan)
    return PassFit(("inertia", "viscous"), fit, covariance, rows, equation), each[0]


def unequal_speeds(fit: PassFit) -> float:
    """Error of f1 by the kinetic energy of the axis that (7) leaves out, with the inertia of (6)."""
    return float(fit.fit.influence[1] @ (fit.a11 * fit.rows["inertia"]))


def node_tuples(nodes: Sequence[Nodes] | Nodes) -> list[list[float]]:
    """Nodes as plain data for the provenance."""
    return [[float(t) for t in row] for row in np.atleast_2d(np.array(nodes, dtype=np.float64))]
