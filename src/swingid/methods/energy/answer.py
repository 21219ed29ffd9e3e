"""From a fit of energies to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from swingid.balance.fits import known_side
from swingid.balance.friction_laws import TERMS, Law, curve_speeds, parameters_of
from swingid.balance.perturbations import propagated
from swingid.methods.energy.chain import Chain
from swingid.methods.energy.effects import pass_errors
from swingid.methods.energy.fit import PassFit
from swingid.methods.energy.passes import Passes
from swingid.methods.energy.symmetry import EVEN, ODD
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import NEIGHBOURS, squared_distance
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
    and standard uncertainty of errors that are common to all swings. each: a11 of every pair of passes ("printed"),
    None for "better".
    """

    variant: str
    fit: PassFit
    passes: Passes
    others: dict[str, PassFit] = field(default_factory=dict)
    common: dict[tuple[str, str], float] = field(default_factory=dict)
    each: Array | None = None
    notes: tuple[Message, ...] = ()

    def beside(self, more: dict[tuple[str, str], float]) -> EnergyEstimate:
        """The estimate with more errors that are common to all swings."""
        return replace(self, common=self.common | more)


def energy_answer(estimate: EnergyEstimate, rig: Rig) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant, by its key."""
    fit, even = estimate.fit, EVEN if _depends_on_direction(estimate.fit) else ()
    values, weights = parameters_of(fit, tuple(name for name in (*ODD, *even) if name in fit.unknowns))
    combinations = np.array(list(weights.values()))
    declared = propagated(pass_errors(fit.rows, rig, fit.equation, fit.coefficients), fit.fit.influence, combinations)
    common = [(systematic(source), name, spread) for (name, source), spread in estimate.common.items()]
    unmodelled = rig.axis.model_uncertainty
    if not fit.has_scatter:
        noise = scatter("sensor noise"), "inertia", float(np.sqrt(fit.sensor))
        return evaluate(values, None, [noise, *common], declared, unknown=values, relative=unmodelled)
    widening = max(1.0, fit.sensor / max(fit.covariance[0, 0], 1e-300)) if fit.sensor > 0 else 1.0
    u = fit.u * np.sqrt(widening)
    for name, other in estimate.others.items():  # of the same log, so the variances differ by that of the difference
        dark = dark_uncertainty(other.a11 - fit.a11, abs(other.u**2 - u**2), u)
        common.append((systematic(f"disagreement: {name}"), "inertia", dark))
    blocks = fit.rows.blocks(np.square(combinations @ fit.fit.influence)).sum(axis=2)
    freedom = [scatter_freedom(np.sqrt(block), NEIGHBOURS, len(fit.unknowns)) for block in blocks]
    scattered = Scatter(
        "scatter of the swings and sensor noise",
        combinations @ fit.covariance @ combinations.T * widening,
        np.array(freedom),
    )
    return evaluate(values, scattered, common, declared, relative=unmodelled)


def _depends_on_direction(fit: PassFit) -> bool:
    """Return whether the even terms of friction are significant (chi-square of two, 99.9 %) and not negligible."""
    if "viscous_even" not in fit.unknowns or not fit.has_scatter:
        return False
    even = [fit.unknowns.index("offset"), fit.unknowns.index("viscous_even")]
    values, covariance = fit.fit.values[even], fit.covariance[np.ix_(even, even)]
    speed = float(np.sqrt(np.mean(fit.rows.course.axis.speed**2)))
    odd = fit.value("coulomb") + fit.value("viscous") * speed + fit.value("quadratic") * speed**2
    if max(abs(values[0]), abs(values[1]) * speed) < LEAST_EVEN * abs(odd):
        return False
    return squared_distance(values, covariance) > INDICATED_PAIR


def with_chain(
    estimate: EnergyEstimate, smoothed: EnergyEstimate, chain: Chain
) -> tuple[EnergyEstimate, list[Message]]:
    """The estimate with its difference to smoothed speeds as an uncertainty, and for W_f a warning."""
    fit, other = estimate.fit, smoothed.fit
    source = "what observers and filter move"
    moves = {name: abs(fit.value(name) - other.value(name)) for name in ("inertia", "viscous", "coulomb", "quadratic")}
    estimate = estimate.beside({(name, source): move for name, move in moves.items() if name in fit.unknowns})
    if chain.filter_time == 0 or not fit.equation.driven:
        return estimate, []
    share = (fit.a11 - other.a11) / other.inertia
    text = (
        f"W_f of {1e3 * chain.filter_time:g} ms attenuates the drive; with the observers it changes this inertia by "
        f"{share:+.2%} from that of smoothed speeds and the drive as it was held; filter_time=0 does not filter it."
    )
    return estimate, [Message("filtered-drive", text)]


def energy_details(estimate: EnergyEstimate, part: Part) -> Details:
    """What the report draws."""
    fit, better = estimate.fit, estimate.each is None
    travelled = np.abs(np.diff(fit.rows.blocks(fit.rows.angle), axis=1)).sum(axis=1)
    residuals = fit.rows.blocks(fit.fit.residuals)
    return Details(
        start=part.start,
        stop=part.stop,
        turning_times=part.motion.turning_times,
        turning_angles=part.motion.turning_angles,
        swings=_per_swing(estimate),
        friction=_curve(fit) if better else None,
        estimates={
            name: (variant.inertia, variant.u) for name, variant in {estimate.variant: fit, **estimate.others}.items()
        },
        residual_times=estimate.passes.turning if better else np.empty(0),
        residuals=(residuals[:, -1] - residuals[:, 0]) / travelled if better else np.empty(0),
    )


def _per_swing(estimate: EnergyEstimate) -> SwingSeries:
    """One inertia per turning point: that of its pair, or of its block less the fitted friction."""
    fit, rows, values = estimate.fit, estimate.fit.rows, estimate.each
    if values is None:
        remainder = known_side(rows, fit.equation) - rows.sum_of({name: fit.value(name) for name in fit.unknowns[1:]})
        energy, speed = (rows.blocks(rows.within(x)) for x in (remainder, rows["inertia"]))
        values = (energy * speed).sum(axis=1) / (speed * speed).sum(axis=1)
    expected = float(np.sqrt(fit.sensor * len(rows.instants)))
    return SwingSeries.of(estimate.passes.turning, estimate.passes.sides, values - fit.equation.carried, expected)


def _curve(fit: PassFit) -> FrictionCurve:
    """The fitted terms as a curve, with their uncertainty."""
    terms = tuple(name for name in fit.unknowns if name in TERMS)
    at = [fit.unknowns.index(name) for name in terms]
    covariance = fit.covariance[np.ix_(at, at)] if fit.has_scatter else np.zeros((len(at), len(at)))
    speeds = curve_speeds(float(np.max(np.abs(fit.rows.course.axis.speed))))
    return Law(LAW, terms, fit.fit.values[at], np.nan).curve_at(speeds, covariance)
