"""The paper's energy method: inertia and friction from the energy of passes and their mirror images.

"printed" is the paper's (6) and (7). "better", the default, uses the same balance (1), (2), with the work of the
voltage as it was held, mirrors about the measured turning points, nodes at equal angles, every swing of the log, and
inertia and friction estimated together. Both need the motor's constants and are sensitive to them: at 8.5 rad/s 1 % of
torque per volt is 14 % of the inertia. `momentum` needs none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.choice import FLAT
from swingid.balance.energies import of_energy
from swingid.balance.fits import BASIS
from swingid.checks.consistency import cause_of, check_energy, check_saturation, require_signs
from swingid.checks.momentum import MomentumCheck
from swingid.checks.stated import CONFLICT
from swingid.errors import UnanswerableError, UsageError
from swingid.methods.energy.answer import EnergyEstimate, energy_answer, energy_details, with_chain
from swingid.methods.energy.balance import Course, PassRows
from swingid.methods.energy.chain import Chain
from swingid.methods.energy.fit import fit_passes
from swingid.methods.energy.jitter import find_jitter
from swingid.methods.energy.passes import Passes, mirrored_passes
from swingid.methods.energy.printed import (
    DEPTHS,
    Nodes,
    chosen_nodes,
    given_nodes,
    node_tuples,
    printed_fit,
    unequal_speeds,
    with_trapezoid_work,
)
from swingid.methods.energy.symmetry import Symmetry, asymmetry_bound, friction_profile
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.preparation.prepared import Part
from swingid.preparation.scale import require_motor
from swingid.result.checked import noted, warned
from swingid.result.result import Message, Result
from swingid.uncertainty.significance import INDICATED

LEVELS = (1 - np.cos(np.linspace(0.1, 1.55, 24))) / 2
"""Depths of the nodes in shares of a swing: evenly spread in time over the half that is next to its turning point."""

FEWEST_BLOCKS = 3

CLOSE = 0.003
"""Relative difference of the estimates with and without instruments that is no sign of attenuation."""


def energy(
    check: MomentumCheck,
    *,
    variant: str = "better",
    nodes: Sequence[Nodes] | Nodes | None = None,
    work: str = "held",
    velocities: str = "smoothed",
    filter_time: float | None = None,
) -> Result:
    """Identify inertia and friction from the energy balance of mirrored passes.

    variant: "better" or "printed". nodes: for "printed", instants (t10, t11, t20, t21) in s or a list of such, in place
    of those found in the motion. work: for "printed", "held" (the voltage constant from row to row) or "trapezoid" (on
    the samples, as a user of the printed formula might do; for comparison only). velocities: "smoothed", or
    "observers" for the paper's post-processing, observers (23) both ways and the drive through W_f of `filter_time`
    (0.0125 s if not given, 0 for none), for comparison only.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motor's constants are missing or the motion does not determine the inertia.
    """
    how = _How(variant, nodes, work, Chain.of(velocities, filter_time))
    prepared, rig = check.prepared, check.prepared.rig
    log, equation = prepared.log, of_energy(rig, prepared.equation)
    require_motor(log, rig, equation, "energy")
    jitter = find_jitter(log, prepared.noise)
    part = prepared.part(whole=nodes is not None, few=nodes is not None, at_stamps=True, noise=jitter.noise)
    require_signs(check)
    plain = estimate = _estimate(part, equation, how, jittery=jitter.spread > 0)
    more: list[Message] = []
    if how.chain.observers:  # whose noise is like asymmetry
        plain = _estimate(part, equation, replace(how, chain=Chain()), jittery=jitter.spread > 0)
        estimate, more = with_chain(estimate, plain, how.chain)
    symmetry = _symmetry(plain, part, equation)
    common = {("inertia", CONFLICT): check.conflict} | ({} if symmetry is None else symmetry.entry())
    answer, differs = check.compared(energy_answer(estimate.beside(common), rig), cause_of(equation))
    inertia = answer.parameters["inertia"]
    checked = warned(*more) + noted(*estimate.notes)
    if jitter.spread > 0 and not how.chain.observers:
        other = _estimate(part, equation, how, jittery=False)
        checked += jitter.words(inertia, other.fit.inertia, equation.shown(inertia.unit))
    if variant == "better":
        checked += check_saturation(part.log, rig, inertia)
    checked += check_energy(answer, check, equation, part.motion, differs)
    answer = check.widened(answer)
    if inertia.standard_uncertainty is None:
        text = "one pair of passes has no scatter, so the inertia has no uncertainty; leave nodes out."
        checked += noted(Message("no-uncertainty-inertia", text))
    extra = {}
    if symmetry is not None:
        extra["symmetry_bound"] = symmetry.bound
        checked += noted(symmetry.note(inertia.value))
    if check.motor_balance is not None:
        extra["motor_balance_residual"] = check.motor_balance.as_stated
    details = replace(energy_details(estimate, part), extra=extra)
    return prepared.result("energy", answer, part, checked, details, how.options())


@dataclass(frozen=True)
class _How:
    """The options. Raises UsageError for other values."""

    variant: str
    nodes: Sequence[Nodes] | Nodes | None
    work: str
    chain: Chain

    def __post_init__(self) -> None:
        if self.variant not in ("better", "printed"):
            text = f'unknown variant {self.variant!r} of "energy"; choose "better" or "printed".'
            raise UsageError(text, code="no-variant")
        if self.work not in ("held", "trapezoid"):
            text = f'unknown work {self.work!r} of "energy"; choose "held" or "trapezoid".'
            raise UsageError(text, code="no-work-rule")
        if self.variant == "better" and (self.nodes is not None or self.work != "held"):
            raise UsageError('nodes and work belong to variant="printed"; leave them out.', code="printed-only")

    def options(self) -> dict[str, object]:
        """The options that are not the default, and the variant, for the provenance."""
        options: dict[str, object] = {"variant": self.variant}
        if self.nodes is not None:
            options["nodes"] = node_tuples(self.nodes)
        if self.work != "held":
            options["work"] = self.work
        if self.chain.observers:
            options |= {"velocities": "observers", "filter_time": self.chain.filter_time}
        return options


def _estimate(part: Part, equation: Equation, how: _How, *, jittery: bool) -> EnergyEstimate:
    course = Course.of(part.log, part.rig, part.motion, part.noise, part.encoders, how.chain, measured=not jittery)
    if how.variant == "printed":
        return _printed(part, equation, course, how.nodes, how.work)
    passes = _passes(part, LEVELS)
    rows = PassRows.of(course, passes.instants, equation)
    fit = fit_passes(rows, equation)
    instruments = False
    if "wheel" not in equation.coefficients:  # whose wheel has a kinetic energy, too, with errors of its own
        other = fit_passes(rows, equation, instruments=True)
        # both are consistent but for attenuation, which lowers least squares (Hausman 1978)
        apart, spread = other.a11 - fit.a11, abs(other.u**2 - fit.u**2) ** 0.5
        better = FLAT * other.u * abs(fit.a11) < fit.u * abs(other.a11)
        instruments = apart > CLOSE * abs(fit.a11) and (better or apart > INDICATED * spread)
        fit = other if instruments else fit
    # nodes within two thirds of each half swing, counted in time from the turning point
    inner = rows.inner(len(LEVELS) // 3)
    linear = tuple(term for term in BASIS if term != "quadratic")
    others = {
        "without the quadratic term": fit_passes(rows, equation, linear, instruments=instruments),
        "nodes near the turning points": fit_passes(inner, equation, instruments=instruments),
    }
    notes: tuple[Message, ...] = ()
    if instruments:
        text = "noise attenuates the estimate by least squares; squared speeds of the next swing are its instruments."
        notes = (Message("instruments", text),)
    return EnergyEstimate("better", fit, passes, others, notes=notes)


def _passes(part: Part, depths: Array) -> Passes:
    passes = mirrored_passes(part.motion, depths, part.log.time, part.longest_gap)
    if len(passes.turning) < FEWEST_BLOCKS:
        raise UnanswerableError(
            f"a whole pass stands before and after {len(passes.turning)} of the turning points, and at least "
            f"{FEWEST_BLOCKS} are needed; record more swings.",
            code="too-short",
        )
    return passes


def _symmetry(estimate: EnergyEstimate, part: Part, equation: Equation) -> Symmetry | None:
    """Bound of the effect of the asymmetry of the passes; None with too few swings for the friction."""
    fit, rows = estimate.fit, estimate.fit.rows
    if estimate.variant != "better":  # whose nodes are at the same places
        mirrored = mirrored_passes(part.motion, LEVELS, part.log.time, part.longest_gap)
        if len(mirrored.turning) < FEWEST_BLOCKS:
            return None
        rows = PassRows.of(rows.course, mirrored.instants, equation)
    return asymmetry_bound(fit, friction_profile(rows, equation))


def _printed(
    part: Part, equation: Equation, course: Course, nodes: Sequence[Nodes] | Nodes | None, work: str
) -> EnergyEstimate:
    if equation.seeks("gravity_torque"):
        raise UnanswerableError(
            f"rig {part.rig.name}: axis.gravity_torque is unknown, but (6) needs it; give it, or use variant better.",
            code="no-gravity-torque",
        )
    if nodes is None:
        passes = _passes(part, DEPTHS)
        instants = chosen_nodes(passes)
    else:
        instants = given_nodes(nodes, part.log)
        sides = np.sign(course.axis.at(instants[:, 0]) - course.axis.at(instants[:, 3]))
        passes = Passes((instants[:, 1] + instants[:, 2]) / 2, sides, instants)
    rows = PassRows.of(course, instants, equation)
    notes: tuple[Message, ...] = ()
    if work == "trapezoid":
        rows, equation = with_trapezoid_work(rows, part.log, equation)
        text = "the work is a trapezoid on samples, with errors of per cents under a held voltage; use held work."
        notes = (Message("trapezoid-work", text),)
    fit, each = printed_fit(rows, equation)
    common = {("viscous", "unequal speeds of the two passes"): abs(unequal_speeds(fit))}
    return EnergyEstimate("printed", fit, passes, common=common, each=each, notes=notes)
