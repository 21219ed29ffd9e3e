"""From a fit of energies to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.friction_laws import TERMS, Law, curve_speeds
from swingid.balance.perturbations import propagated
from swingid.methods.energy.balance import Course, States
from swingid.methods.energy.chain import Chain
from swingid.methods.energy.effects import effects
from swingid.methods.energy.fit import NodeFit, columns_at, within_blocks
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array
from swingid.numerics.regression import NEIGHBOURS
from swingid.preparation.prepared import Part
from swingid.result.result import Details, FrictionCurve, Message, SwingSeries
from swingid.uncertainty.budget import Evaluated, Scatter, evaluate, scatter, systematic
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.freedom import scatter_freedom
from swingid.uncertainty.significance import INDICATED_PAIR

LAW = "coulomb + viscous + quadratic, direction-dependent"

LEAST_EVEN = 0.02
"""Least ratio of even to odd friction for coefficients by direction."""


@dataclass(frozen=True)
class EnergyEstimate:
    """A fit and what its uncertainty depends on.

    others: fits of the same log by other nodes or another law, which should be consistent. common: (parameter, source)
    and standard uncertainty of errors that are common to all swings. sensor: variance of a11 by the sensors' noise.
    each: a11 of every pair of passes ("printed"), None for "better".
    """

    variant: str
    fit: NodeFit
    course: Course
    states: States
    turning: Array
    sides: Array
    others: dict[str, NodeFit]
    common: dict[tuple[str, str], float]
    sensor: float
    each: Array | None
    notes: tuple[Message, ...]


def energy_answer(estimate: EnergyEstimate, rig: Rig, equation: Equation) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant, by its key."""
    fit, course = estimate.fit, estimate.course
    weights, units = _sought(fit, equation, float(np.sqrt(np.mean(course.axis.speed**2))))
    values = {name: (float(own @ fit.values), units[name]) for name, own in weights.items()}
    values["inertia"] = fit.a11 - equation.carried, units["inertia"]
    own = np.array(list(weights.values()))
    b = fit.value("gravity_torque") if equation.seeks("gravity_torque") else equation.value("gravity_torque")
    declared = propagated(effects(rig, course, estimate.states, equation, fit, b), fit.influence, own)
    common = [(systematic(source), name, spread) for (name, source), spread in estimate.common.items()]
    if fit.covariance is None:
        noise = scatter("sensor noise"), "inertia", float(np.sqrt(estimate.sensor))
        return evaluate(values, None, [noise, *common], declared, unknown=values, relative=rig.axis.model_uncertainty)
    widening = max(1.0, estimate.sensor / max(fit.covariance[0, 0], 1e-300)) if estimate.sensor > 0 else 1.0
    u = fit.u() * np.sqrt(widening)
    for name, other in estimate.others.items():  # of the same log, so the variances differ by that of the difference
        dark = dark_uncertainty(other.a11 - fit.a11, abs(other.u() ** 2 - u**2), u)
        common.append((systematic(f"disagreement: {name}"), "inertia", dark))
    blocks = np.square(own @ fit.influence).reshape(len(own), len(estimate.turning), -1).sum(axis=2)
    freedom = [scatter_freedom(np.sqrt(block), NEIGHBOURS, len(fit.unknowns)) for block in blocks]
    scattered = Scatter(
        "scatter of the swings and sensor noise", own @ fit.covariance @ own.T * widening, np.array(freedom)
    )
    return evaluate(values, scattered, common, declared, relative=rig.axis.model_uncertainty)


def _sought(fit: NodeFit, equation: Equation, speed: float) -> tuple[dict[str, Array], dict[str, str]]:
    """Weights of each parameter on the unknowns, and the units; `speed`: root mean square of the motion's."""
    unit = {name: np.eye(len(fit.unknowns))[k] for k, name in enumerate(fit.unknowns)}
    units = units_on(linear=equation.linear)
    plain: dict[str, Array] = {
        name: unit[name] for name in (*equation.sought, "coulomb", "viscous", "quadratic") if name in unit
    }
    if _depends_on_direction(fit, speed):
        for name, even in (("coulomb", "offset"), ("viscous", "viscous_even")):
            both = plain.pop(name)
            plain |= {f"{name}_positive": both + unit[even], f"{name}_negative": both - unit[even]}
    return plain, units


def _depends_on_direction(fit: NodeFit, speed: float) -> bool:
    """Whether the even terms of friction are significant (chi-square of two, 99.9 %) and not negligible."""
    if "viscous_even" not in fit.unknowns or fit.covariance is None:
        return False
    even = [fit.unknowns.index("offset"), fit.unknowns.index("viscous_even")]
    values, covariance = fit.values[even], fit.covariance[np.ix_(even, even)]
    odd = fit.value("coulomb") + fit.value("viscous") * speed + fit.value("quadratic") * speed**2
    if max(abs(values[0]), abs(values[1]) * speed) < LEAST_EVEN * abs(odd):
        return False
    return bool(values @ np.linalg.pinv(covariance) @ values > INDICATED_PAIR)


def with_chain(
    estimate: EnergyEstimate, smoothed: EnergyEstimate, chain: Chain, equation: Equation
) -> tuple[EnergyEstimate, list[Message]]:
    """The estimate with its difference to smoothed speeds as an uncertainty, and for W_f a warning."""
    fit, other = estimate.fit, smoothed.fit
    source = "what observers and filter move"
    moves = {name: abs(fit.value(name) - other.value(name)) for name in ("inertia", "viscous", "coulomb", "quadratic")}
    common = {(name, source): move for name, move in moves.items() if name in fit.unknowns}
    estimate = replace(estimate, common=estimate.common | common)
    if chain.filter_time == 0 or equation.drive == "none":
        return estimate, []
    share = (fit.a11 - other.a11) / (other.a11 - equation.carried)
    text = (
        f"W_f of {1e3 * chain.filter_time:g} ms attenuates the drive; with the observers it changes this inertia by "
        f"{share:+.2%} from that of smoothed speeds and the drive as it was held; filter_time=0 does not filter it."
    )
    return estimate, [Message("filtered-drive", text)]


def energy_details(estimate: EnergyEstimate, rig: Rig, equation: Equation, part: Part) -> Details:
    """What the report draws."""
    fit, states, carried = estimate.fit, estimate.states, equation.carried
    travelled = np.abs(np.diff(states.angle, axis=1)).sum(axis=1)
    estimates = {estimate.variant: (fit.a11 - carried, fit.u())}
    estimates |= {name: (other.a11 - carried, other.u()) for name, other in estimate.others.items()}
    better = estimate.each is None
    return Details(
        start=part.start,
        stop=part.stop,
        turning_times=part.motion.turning_times,
        turning_angles=part.motion.turning_angles,
        swings=_per_swing(estimate, rig, equation),
        friction=_curve(fit, float(np.max(np.abs(estimate.course.axis.speed)))) if better else None,
        estimates=estimates,
        residual_times=estimate.turning if better else np.empty(0),
        residuals=(fit.residuals[:, -1] - fit.residuals[:, 0]) / travelled if better else np.empty(0),
    )


def _per_swing(estimate: EnergyEstimate, rig: Rig, equation: Equation) -> SwingSeries:
    """One inertia per turning point: that of its pair, or of its block less the fitted friction."""
    fit, states, values = estimate.fit, estimate.states, estimate.each
    blocks = len(states.instants)
    if values is None:
        columns = columns_at(states, equation, tuple(name for name in fit.unknowns if name in states.friction))
        left = states.known(rig, equation) - sum(fit.value(name) * columns[name] for name in fit.unknowns[1:])
        energy, speed = (within_blocks(x).reshape(blocks, -1) for x in (left, columns["inertia"]))
        values = (energy * speed).sum(axis=1) / (speed * speed).sum(axis=1)
    expected = float(np.sqrt(estimate.sensor * blocks))
    return SwingSeries.of(estimate.turning, estimate.sides, values - equation.carried, expected)


def _curve(fit: NodeFit, fastest: float) -> FrictionCurve:
    """The fitted terms as a curve, with their uncertainty."""
    terms = tuple(name for name in fit.unknowns if name in TERMS)
    at = [fit.unknowns.index(name) for name in terms]
    covariance = np.zeros((len(at), len(at))) if fit.covariance is None else fit.covariance[np.ix_(at, at)]
    return Law(LAW, terms, fit.values[at], np.nan).curve_at(curve_speeds(fastest), covariance)
