"""The paper's energy method: inertia and friction from the energy of passes and their mirror images.

"printed" is the paper's (6) and (7). "better", the default, stands on the same balance (1), (2), with the work of the
voltage as it was held, mirrors about the measured turning points, nodes at equal angles, every swing of the log, and
inertia and friction solved for together. Both need the motor's constants, on which they lean hard: at
8.5 rad/s 1 % of torque per volt is 14 % of the inertia. `momentum` needs none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.checks.consistency import (
    CLOSE,
    DISAGREES,
    Consistency,
    check_energy,
    check_saturation,
    consistency_check,
)
from swingid.errors import UnanswerableError, UsageError
from swingid.methods.energy.answer import EnergyEstimate, energy_answer, energy_details, judged_chain
from swingid.methods.energy.balance import Course, States, states_at
from swingid.methods.energy.chain import Chain
from swingid.methods.energy.fit import BASIS, fit_nodes, sensor_variance
from swingid.methods.energy.jitter import find_jitter
from swingid.methods.energy.passes import Passes, mirrored_passes
from swingid.methods.energy.printed import (
    DEPTHS,
    Nodes,
    chosen_nodes,
    given_nodes,
    node_tuples,
    printed_fit,
    states_of_pairs,
    trapezoid_work,
    unequal_speeds,
)
from swingid.methods.energy.symmetry import Symmetry, asymmetry_bound, friction_profile
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.prepared import Part, Prepared
from swingid.preparation.scale import Scale, require_motor
from swingid.result.result import Message, Result
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import INDICATED

LEVELS = (1 - np.cos(np.linspace(0.1, 1.55, 24))) / 2
"""Depths of the nodes in shares of a swing: evenly spread in time over the half that is next to its turning point."""

FEWEST_BLOCKS = 3


def energy(
    prepared: Prepared,
    *,
    variant: str = "better",
    nodes: Sequence[Nodes] | Nodes | None = None,
    work: str = "held",
    velocities: str = "smoothed",
    filter_time: float | None = None,
) -> Result:
    """Identify inertia and friction from the energy balance of mirrored passes.

    variant: "better" or "printed". nodes: for "printed", instants (t10, t11, t20, t21) in s or a list of such, in the
    place of those found in the motion. work: for "printed", "held" (the voltage constant from row to row) or
    "trapezoid" (on the samples, as a user of the printed formula might do; for comparison only). velocities:
    "smoothed", or "observers" for the paper's post-processing, observers (23) both ways and the drive through W_f of
    `filter_time` (0.0125 s if not given, 0 for none), for comparison only.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motor's constants are missing or the motion cannot tell.
    """
    _check_options(variant, nodes, work)
    how = _How(variant, nodes, work, Chain.of(velocities, filter_time))
    log, rig, scale = prepared.log, prepared.rig, prepared.scale
    require_motor(log, rig, scale, "energy")
    jitter = find_jitter(log, prepared.noise)
    part = prepared.part(whole=nodes is not None, few=nodes is not None, at_stamps=True, noise=jitter.noise)
    as_read = log.segment(part.start, part.stop)
    consistency = consistency_check(as_read, rig, part.motion, scale, part.noise, prepared.encoders)
    estimate, course = _estimate(part, rig, scale, how, jittery=jitter.spread > 0)
    plain, plain_course = estimate, course
    doubts: list[Message] = []
    if how.chain.observers:  # whose noise would pass for asymmetry
        plain, plain_course = _estimate(part, rig, scale, replace(how, chain=Chain()), jittery=jitter.spread > 0)
        estimate, doubts = judged_chain(estimate, plain, how.chain, scale)
    estimate = _judged(estimate, consistency, scale)
    symmetry = _symmetry(plain, part, rig, scale, plain_course)
    if symmetry is not None:
        estimate = replace(estimate, common=estimate.common | symmetry.entry())
    answer = energy_answer(estimate, rig, scale, course)
    parameters = answer.parameters
    # without a motor what the momentum balance differs by is in the budget
    compared = parameters["inertia"].standard_uncertainty if scale.drive == "reaction-wheel" else estimate.fit.u()
    warnings, notes = check_energy(answer, consistency, rig, scale, part.motion, compared)
    if jitter.spread > 0 and not how.chain.observers:
        other, _ = _estimate(part, rig, scale, how, jittery=False)
        jittery, told = jitter.words(parameters["inertia"], other.fit.a11 - scale.carried)
        doubts += jittery
        notes += told
    doubts += check_saturation(part.log, rig) if variant == "better" else []
    warnings, notes = [*doubts, *warnings], [part.note, *estimate.notes, *notes]
    if parameters["inertia"].standard_uncertainty is None:
        text = "one pair of passes has no scatter, so the inertia has no uncertainty; let the method use every swing."
        notes.append(Message("no-uncertainty-inertia", text))
    details = energy_details(estimate, rig, scale, course, part)
    if symmetry is not None:
        notes.append(symmetry.note(parameters["inertia"].value))
        details = replace(details, extra=details.extra | {"symmetry_bound": symmetry.bound})
    if consistency.balance is not None:
        details = replace(details, extra=details.extra | {"motor_balance_residual": consistency.balance.as_stated})
    return prepared.result("energy", answer, part, warnings, notes, details, how.options())


@dataclass(frozen=True)
class _How:
    """The options."""

    variant: str
    nodes: Sequence[Nodes] | Nodes | None
    work: str
    chain: Chain

    def options(self) -> dict[str, object]:
        """Those that are not the default, and the variant, for the provenance."""
        options: dict[str, object] = {"variant": self.variant}
        if self.nodes is not None:
            options["nodes"] = node_tuples(self.nodes)
        if self.work != "held":
            options["work"] = self.work
        if self.chain.observers:
            options |= {"velocities": "observers", "filter_time": self.chain.filter_time}
        return options


def _estimate(part: Part, rig: Rig, scale: Scale, how: _How, *, jittery: bool) -> tuple[EnergyEstimate, Course]:
    course = Course.of(part.log, rig, part.motion, part.noise, part.encoders, how.chain, measured=not jittery)
    if how.variant == "printed":
        return _printed(part, rig, scale, course, how.nodes, how.work), course
    return _better(part, rig, scale, course), course


def _check_options(variant: str, nodes: object, work: str) -> None:
    if variant not in ("better", "printed"):
        raise UsageError(f'unknown variant {variant!r} of "energy"; choose "better" or "printed".', code="no-variant")
    if work not in ("held", "trapezoid"):
        raise UsageError(f'unknown work {work!r} of "energy"; choose "held" or "trapezoid".', code="no-work-rule")
    if variant == "better" and (nodes is not None or work != "held"):
        raise UsageError('nodes and work belong to variant="printed"; leave them out.', code="printed-only")


def _passes(part: Part, depths: Array) -> Passes:
    passes = mirrored_passes(part.motion, depths, part.log.time, part.longest_gap)
    if len(passes.turning) < FEWEST_BLOCKS:
        raise UnanswerableError(
            f"the log holds {len(passes.turning)} turning points with a whole pass before and after, at least "
            f"{FEWEST_BLOCKS} are needed; record more swings.",
            code="too-short",
        )
    return passes


def _better(part: Part, rig: Rig, scale: Scale, course: Course) -> EnergyEstimate:
    passes = _passes(part, LEVELS)
    states = states_at(course, passes.instants, linear=scale.linear)
    fit = fit_nodes(states, rig, scale, BASIS)
    others = {
        "without the quadratic term": fit_nodes(states, rig, scale, tuple(t for t in BASIS if t != "quadratic")),
        "nodes near the turning points": fit_nodes(_inner(states), rig, scale, BASIS),
    }
    sensor = sensor_variance(fit, states, course, rig)
    return EnergyEstimate("better", fit, states, passes.turning, passes.sides, others, {}, sensor, None, ())


def _symmetry(estimate: EnergyEstimate, part: Part, rig: Rig, scale: Scale, course: Course) -> Symmetry | None:
    """What the asymmetry of the passes can do; None where too few swings show the friction."""
    states = estimate.states
    if estimate.variant != "better":  # whose states are at the same places
        mirrored = mirrored_passes(part.motion, LEVELS, part.log.time, part.longest_gap)
        if len(mirrored.turning) < FEWEST_BLOCKS:
            return None
        states = states_at(course, mirrored.instants, linear=scale.linear)
    return asymmetry_bound(estimate.fit, estimate.states, course, friction_profile(course, states, rig, scale))


def _inner(states: States) -> States:
    """The states at the nodes within two thirds of each half swing, counted in time from the turning point."""
    cut = len(LEVELS) // 3
    names = ("instants", "angle", "height", "speed", "acceleration", "wheel_speed", "wheel_acceleration", "work")
    plain = {name: getattr(states, name)[:, cut:-cut] for name in names}
    friction = {name: column[:, cut:-cut] for name, column in states.friction.items()}
    motor = {name: column[:, cut:-cut] for name, column in states.motor.items()}
    return States(**plain, friction=friction, motor=motor)


def _judged(estimate: EnergyEstimate, consistency: Consistency, scale: Scale) -> EnergyEstimate:
    """Without a motor energy and momentum stand on the same constants, so what they differ by is uncertainty."""
    if scale.drive == "reaction-wheel" or consistency.windows is None or estimate.fit.covariance is None:
        return estimate
    value, fit, windows = estimate.fit.a11 - scale.carried, estimate.fit, consistency.windows
    # the balance of a few swings is not meant to be closer than this
    variance = fit.u() ** 2 + windows.u**2 + (CLOSE / INDICATED * value) ** 2
    dark = dark_uncertainty(fit.a11 - windows.a11, variance, fit.u())
    return replace(estimate, common=estimate.common | {("inertia", DISAGREES): dark})


def _printed(
    part: Part, rig: Rig, scale: Scale, course: Course, nodes: Sequence[Nodes] | Nodes | None, work: str
) -> EnergyEstimate:
    if scale.b is None:
        raise UnanswerableError(
            f"rig {rig.name}: axis.gravity_torque is unknown, but (6) needs it; give it, or use variant better.",
            code="no-gravity-torque",
        )
    if nodes is None:
        passes = _passes(part, DEPTHS)
        instants, turning, sides = chosen_nodes(passes), passes.turning, passes.sides
    else:
        instants = given_nodes(nodes, part.log)
        turning = (instants[:, 1] + instants[:, 2]) / 2
        sides = np.sign(course.axis.at(instants[:, 0]) - course.axis.at(instants[:, 3]))
    states = states_of_pairs(course, instants, linear=scale.linear)
    notes: tuple[Message, ...] = ()
    if work == "trapezoid":
        states = replace(states, work=trapezoid_work(part.log, rig, course, instants))
        text = "the work is a trapezoid on samples, which a held voltage makes wrong by per cents; use held work."
        notes = (Message("trapezoid-work", text),)
    fit, each = printed_fit(states, rig, scale, course.axis)
    sensor = sensor_variance(fit, states, course, rig)
    common = {("viscous", "unequal speeds of the two passes"): abs(unequal_speeds(fit, states))}
    return EnergyEstimate("printed", fit, states, turning, sides, {}, common, sensor, each, notes)
