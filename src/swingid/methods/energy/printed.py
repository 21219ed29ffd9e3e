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

from swingid.balance.motor import motor_drag, motor_torque
from swingid.errors import UnanswerableError, UsageError
from swingid.methods.energy.balance import Course, States, states_at
from swingid.methods.energy.fit import NodeFit
from swingid.methods.energy.passes import Passes
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import RigTerm
from swingid.numerics.arrays import Array
from swingid.numerics.regression import block_covariance
from swingid.preparation.speed import Speed
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


def states_of_pairs(course: Course, instants: Array, *, linear: bool, further: tuple[RigTerm, ...] = ()) -> States:
    """States at (pairs, 4) instants; pairs may overlap, so that all instants need not rise from pair to pair."""
    order = np.argsort(instants.ravel(), kind="stable")
    back = np.argsort(order)
    sorted_states = states_at(course, instants.ravel()[order][None, :], linear=linear, further=further)

    def again(values: Array) -> Array:
        result: Array = values.ravel()[back].reshape(instants.shape)
        return result

    return sorted_states.each(again)


def trapezoid_work(log: Recording, rig: Rig, course: Course, instants: Array) -> Array:
    """W by the trapezoid rule on samples of torque and speed, which averages a held voltage over its jump.

    Kept for comparison: it is some per cent off at 10 kHz and tens of per cent at 1 kHz.
    """
    motor, wheel = rig.drive.motor, course.wheel
    if wheel is not None and motor is not None and log.voltage is not None:
        rate = wheel.at(log.time)
        power = motor.gear_ratio.value * (motor_torque(motor, log.voltage, rate) - motor_drag(motor, rate)) * rate
    elif log.torque is not None:
        power = log.torque * course.axis.at(log.time)
    else:
        power = np.zeros(len(log))
    steps = np.diff(log.time) * (power[1:] + power[:-1]) / 2
    running = np.concatenate([[0.0], np.cumsum(steps)])
    result: Array = np.interp(instants, log.time, running)
    return result


def printed_fit(states: States, rig: Rig, equation: Equation, axis: Speed) -> tuple[NodeFit, Array]:
    """(6) and (7) on every pair of passes, and their mean; also the inertia a11 of each pair.

    Raises UnanswerableError where the denominator of (6) vanishes, which it does from turning point to turning point.
    """
    difference, total = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, 1.0, -1.0, 1.0])
    denominator = states.speed**2 @ difference
    spans = np.searchsorted(axis.grid, states.instants[:, [0, 3]])
    largest = [np.max(axis.speed[first : last + 1] ** 2, initial=0.0) for first, last in spans]
    singular = np.abs(denominator) < SINGULAR * 2 * np.maximum(largest, np.max(states.speed**2, axis=1))
    if singular.any():
        at = ", ".join(f"{t:.6g}" for t in states.instants[int(np.argmax(singular))])
        raise UnanswerableError(
            f"(6) divides by nearly zero for the passes with nodes at {at} s, which have equal speeds at both ends; "
            "let one end of each pass be near a turning point and the other half-way.",
            code="singular-passes",
        )
    of_inertia = 2 * difference / denominator[:, None]
    of_viscous = total / (states.friction["viscous"] @ total)[:, None]
    known = states.known(rig, equation)
    pairs = len(known)
    each = np.stack([(of_inertia * known).sum(axis=1), (of_viscous * known).sum(axis=1)])
    values = each.mean(axis=1)
    scores = (each - values[:, None]) / pairs
    fit = NodeFit(
        unknowns=("inertia", "viscous"),
        values=values,
        influence=np.stack([of_inertia.ravel(), of_viscous.ravel()]) / pairs,
        covariance=block_covariance(scores, 1) if pairs > 1 else None,
        residuals=known * 0.0,
    )
    return fit, each[0]


def unequal_speeds(fit: NodeFit, states: States) -> float:
    """Error of f1 by the kinetic energy of the axis that (7) leaves out, with the inertia of (6)."""
    return float(fit.influence[1] @ (0.5 * fit.a11 * states.speed**2).ravel())


def node_tuples(nodes: Sequence[Nodes] | Nodes) -> list[list[float]]:
    """Nodes as plain data for the provenance."""
    return [[float(t) for t in row] for row in np.atleast_2d(np.array(nodes, dtype=np.float64))]
