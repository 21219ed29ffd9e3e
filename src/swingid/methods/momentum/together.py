"""Momentum on the windows of one or several logs at once: motors on the axis, and motions without turning points.

What the windows of a log are used for elsewhere (their kinds, the choice of a friction law) needs swings. Here there
is one kind of windows over all of the motion, one set of terms, and all logs are equations for the same unknowns; see
`balance.together`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swingid.balance.covariance import LAG
from swingid.balance.errors import sensitivities
from swingid.balance.fits import WindowFit
from swingid.balance.identifiability import HOPELESS, require_seen
from swingid.balance.systematics import drift_with_length
from swingid.balance.together import Run, Together, fit_together, friction_of, unit_of_friction
from swingid.checks.answer import check_sign, identifiability_note, identifiability_of
from swingid.errors import InputError, NotIdentifiableError, UnanswerableError
from swingid.format import number, percent
from swingid.methods.unscaled import unscaled
from swingid.model.equation import Coefficient
from swingid.model.rig import Rig
from swingid.model.terms import MOTOR_TERMS, units_on
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.preparation.decays import FEWEST_TURNS
from swingid.preparation.prepared import Part, Prepared
from swingid.preparation.reference import FRICTION, Reference, turns_freely
from swingid.preparation.scale import equation_of, refuse_rates
from swingid.preparation.segment import spin_down
from swingid.result.encoders import encoders_cost
from swingid.result.provenance import add_findings, defaults_taken, exact_in_row_one, of_several, provenance
from swingid.result.result import Details, Message, Result
from swingid.uncertainty.budget import Evaluated, Scatter, Source, evaluate, scatter, systematic
from swingid.uncertainty.dark import shrunk
from swingid.uncertainty.freedom import bartlett, effective_freedom, scatter_freedom
from swingid.uncertainty.significance import DETECTED
from swingid.units import Quantity

WORTH_A_NOTE = 0.05
"""Relative uncertainty of torque per volt and back-EMF up to which k and R, quotients of them, are worth a note."""

RANGES = 8
"""Of a motion that are left out one by one: their spread is then known to a quarter, and each has windows enough."""

BETWEEN_LOGS = "friction that differs between logs"
"""Source of the scatter of the friction between logs of equal inertia."""


def momentum_together(
    prepared: Sequence[Prepared], names: Sequence[str] | None = None, added: Sequence[Quantity] | None = None
) -> Result:
    """Identify inertia, friction and unknown constants of a motor on the axis from all logs in one fit.

    names: of the logs. added: inertia of the known body that was on the axis in each log, beside the one sought. A
    free body without them, on which nothing else acts, gets ratios: its largest friction term is the unit of the fit.
    Raises UnanswerableError where the logs do not determine the inertia, InputError where a sign is wrong.
    """
    rig, equation, friction = prepared[0].rig, prepared[0].equation, None
    names = names or [entry.log.source.path or f"log {k + 1}" for k, entry in enumerate(prepared)]
    parts = _parts(prepared)
    runs = [Run.of(*triple) for triple in zip(names, parts, added or [Quantity(0.0)] * len(parts), strict=True)]
    unit = None
    if turns_freely(rig) and added is None:
        if any(len(part.motion.turning_times) >= FEWEST_TURNS for part in parts):
            equation_of(rig)  # which raises: gravity or a spring acts, which the rig has to state
        unit = unit_of_friction(runs)
        equation = equation.but(**{unit: Coefficient(1.0)})
        friction = tuple(name for name in friction_of(runs) if name != unit)
    _require_scale(rig, runs, unit)
    together = fit_together(runs, equation, friction)
    _check(together, rig)
    scattered, notes = _friction_between(together) if unit is None else (0.0, [])
    evaluated = _evaluate(together, rig, scattered)
    _require_known(together, evaluated.parameters["inertia"].standard_uncertainty or 0.0)
    result = _result(together, prepared, evaluated, notes)
    return result if unit is None else unscaled(result, Reference(f"{FRICTION}{unit}", unit, rig), rig)


def _parts(prepared: Sequence[Prepared]) -> list[Part]:
    """The part of each log to use; UnanswerableError where the level of an angle is unknown, as of a logged rate."""
    if any(entry.encoders.level is not None for entry in prepared):
        refuse_rates(prepared[0].rig, "a fit without turning points, or to several logs,")
    return [part_of_run(entry) for entry in prepared]


def part_of_run(prepared: Prepared) -> Part:
    """The part of a log to use: all of a driven one, of another from its fastest instant to its rest."""
    part = prepared.part(whole=True, few=True)
    if prepared.log.selected or prepared.equation.driven or prepared.equation.value("gravity_torque"):
        return part
    start, stop, note = spin_down(part.motion, float(part.log.time[0]), float(part.log.time[-1]))
    log = part.log.segment(start, stop)
    motion = part.motion.within(float(log.time[0]), float(log.time[-1]))
    return replace(part, log=log, motion=motion, start=start, stop=stop, note=note)


def _require_scale(rig: Rig, runs: Sequence[Run], unit: str | None) -> None:
    """Raise UnanswerableError where only added bodies could set the scale, and they are equal in all logs."""
    if turns_freely(rig) and unit is None and len({run.added for run in runs}) == 1:
        raise UnanswerableError(
            f"rig {rig.name}: without a drive, gravity or spring only logs with different known bodies set the scale, "
            "and the inertia added is the same in all logs; give a log with and one without a known body.",
            code="no-scale",
        )


def _check(together: Together, rig: Rig) -> None:
    """Raise where a sign is wrong or the inertia is not identifiable."""
    law = together.law
    where = ", ".join(run.name for run in together.runs)
    seen = identifiability_of(law)
    require_seen(seen)
    if law.equation.coefficients.keys() & {"wheel", "torque"}:
        check_sign(law, where)
    per_volt = law.value("torque_per_volt")
    if per_volt < 0 and -per_volt > DETECTED * law.uncertainty("torque_per_volt"):
        raise InputError(
            f"{where}: the voltage has the wrong sign against the angle (torque per volt would be {per_volt:.3g}); set "
            'voltage_sign = -1 under [log] (+1 if it is -1 already), or angle_zero = "up" where 0 is the top.',
            code="wrong-sign",
        )
    _require_known(together, law.total)


def _require_known(together: Together, u: float) -> None:
    """Raise NotIdentifiableError where the inertia, of standard uncertainty u, is not known to `HOPELESS`."""
    law, where = together.law, ", ".join(run.name for run in together.runs)
    relative = u / max(abs(law.a11), 1e-300)
    if law.inertia <= 0 or relative > HOPELESS or not np.isfinite(relative):
        spread = "more than its value" if law.inertia <= 0 or relative > 1 else percent(relative)
        raise NotIdentifiableError(
            f"{where}: the motion does not determine the inertia (the balance gives {law.inertia:.3g} "
            f"{law.equation.shown(law.equation.unit)}, uncertain by {spread}); record a wider range of speeds"
            + (", or a known body that changes the inertia more." if not law.equation.driven else ".")
        )


def _evaluate(together: Together, rig: Rig, between_logs: float) -> Evaluated:
    """Parameters with their budget."""
    law = together.law
    units = units_on(linear=law.equation.linear)
    values = {"inertia": (law.inertia, law.equation.unit)}
    values |= {name: (law.value(name), units[name]) for name in law.unknowns[1:]}
    freedom = [scatter_freedom(row, bartlett(LAG), len(law.unknowns)) for row in law.fit.influence]
    freedom[0] = law.freedom
    between = _between_ranges(law)
    pairs = zip(np.diag(law.covariance), freedom, np.diag(between), strict=True)
    freedom = [effective_freedom(((variance**0.5, f), (more**0.5, RANGES - 1))) for variance, f, more in pairs]
    scattered = Scatter("scatter of the windows and sensor noise", law.covariance + between, np.array(freedom))
    common: list[tuple[Source, str, float]] = [
        (systematic("place of the encoder's grid"), "inertia", together.grid()),
        (
            systematic("drift with the length of the windows"),
            "inertia",
            drift_with_length(law, together.tried, None, together.variance_between),
        ),
        (scatter(BETWEEN_LOGS), "inertia", between_logs),
    ]
    declared = [effect.item.on(effect.shifts / effect.item.std) for effect in law.declared]
    return evaluate(values, scattered, common, declared, relative=rig.axis.model_uncertainty)


def _between_ranges(law: WindowFit) -> Array:
    """Covariance of the unknowns by a law of friction that does not fit all of the motion, beyond the scatter.

    Fits without one of the ranges of the motion, one after another in time and so mostly in speed, differ by it
    (jackknife that leaves out groups; Shao and Wu 1989). What its own few ranges leave open is not counted (`shrunk`).
    """
    count, nothing = len(law.rows), np.zeros_like(law.covariance)
    if count < RANGES * LAG or count * (1 - 1 / RANGES) / (LAG / 2) <= len(law.unknowns):
        return nothing
    target, each = law.known + law.explained, []
    for left_out in np.array_split(np.arange(count), RANGES):
        each.append(fit_linear(np.delete(law.columns, left_out, axis=0), np.delete(target, left_out)).values)
    off = np.array(each) - np.mean(each, axis=0)
    covariance = (RANGES - 1) / RANGES * off.T @ off
    scattered, all_of = np.diag(law.covariance), np.maximum(np.diag(covariance), 1e-300)
    excess = np.maximum(shrunk(np.maximum(all_of - scattered, 0.0), all_of * (2 / (RANGES - 1)) ** 0.5), 0.0)
    scale = np.sqrt(excess / all_of)
    result: Array = covariance * np.outer(scale, scale)
    return result


def _friction_between(together: Together) -> tuple[float, list[Message]]:
    """Standard uncertainty of a11 by friction that differs between logs, and a note on what depends on its constancy.

    Logs with the same body show whether the friction differs: each but the first of them gets a factor of its own.
    """
    law, runs = together.law, together.runs
    if len(runs) < 2 or law.equation.driven:
        return 0.0, []
    friction = law.rows.sum_of({name: law.value(name) for name in law.friction})  # N m s or N s
    effects, columns = [], []
    for k, at in enumerate(together.places(law.half)):
        column = np.zeros_like(friction)
        column[at] = friction[at]
        effects.append(-float(law.fit.influence[0] @ column))
        if any(other.added == runs[k].added for other in runs[:k]):
            columns.append(column)
    steepest = max(abs(effect) for effect in effects) / abs(law.a11)
    text = (
        f"friction is taken as one function of the speed in all logs: 1 % more of it in one of them changes the "
        f"inertia by up to {percent(0.01 * steepest)}"
    )
    if not columns:
        text += "; repeat a log with the same body to have its scatter estimated."
        return 0.0, [Message("common-friction", text)]
    spread = _factors(law.columns, law.known, columns)
    u = spread * float(np.hypot.reduce(effects))
    text += f"; logs with the same body show a scatter of {percent(spread)}, which the budget contains."
    return u, [Message("common-friction", text)]


def _factors(columns: Array, known: Array, extra: Sequence[Array]) -> float:
    """Standard deviation of the factors of the friction of single logs, beyond what the scatter of the rows gives."""
    fit = fit_linear(np.column_stack([columns, *extra]), known)
    spare = max(len(known) / (LAG / 2) - len(fit.values), 1.0)
    variances = float(fit.residuals @ fit.residuals) / spare * np.sum(fit.influence[-len(extra) :] ** 2, axis=1)
    factors = fit.values[-len(extra) :]
    # a factor is the difference of two logs
    return float(np.sqrt(max(np.mean(factors**2 - variances), 0.0) / 2))


def _motor_notes(together: Together) -> list[Message]:
    """What of the motor is inseparable, and its torque constant and resistance where both products were found."""
    law = together.law
    if "torque_per_volt" not in law.rows.columns:
        return []
    notes = []
    if "back_emf" not in law.equation.coefficients:
        text = (
            "viscous is the sum of viscous friction and back-EMF, which have the same regressor: give "
            "drive.motor.back_emf (or torque_constant and resistance), or a log in part of which the bridge is open "
            "([log] bridge)."
        )
        notes.append(Message("back-emf-in-viscous", text))
    if "torque_per_volt" in law.unknowns:
        text = "the scale is "
        text += "that of axis.gravity_torque" if law.value("gravity_torque") else "that of the known body"
        text += ": inertia, torque per volt and friction are proportional to it."
        notes.append(Message("scale-of-motor", text))
    products = {name: law.value(name) for name in MOTOR_TERMS}
    k_over_r, k2_over_r = products.values()
    found_at_all = [name for name in MOTOR_TERMS if name in law.unknowns]
    sure = all(law.uncertainty(name) < WORTH_A_NOTE * abs(law.value(name)) for name in found_at_all)
    if k_over_r > 0 and k2_over_r > 0 and found_at_all and sure:
        k, resistance = k2_over_r / k_over_r, k2_over_r / k_over_r**2
        text = (
            f"torque constant k = {number(k, 'N m/A', 3)} and resistance R = {number(resistance, 'ohm', 3)} as seen at "
            "the axis, from torque per volt k/R and back-EMF k²/R."
        )
        notes.append(Message("motor-windings", text))
    return notes


def _result(together: Together, prepared: Sequence[Prepared], evaluated: Evaluated, notes: list[Message]) -> Result:
    """The result with its messages and provenance."""
    law, rig = together.law, prepared[0].rig
    warnings: list[Message] = []
    part_notes = [run.part.note for run in together.runs]
    notes = [
        *dict.fromkeys(part_notes),
        *exact_in_row_one(rig),
        identifiability_note(law),
        *notes,
        *_motor_notes(together),
        *defaults_taken(rig),
        *encoders_cost(rig, evaluated.budget, evaluated.parameters),
    ]
    for run in together.runs:
        add_findings(run.part.log, warnings, notes, used=(run.part.start, run.part.stop))
    return Result(
        method="momentum",
        status="warning" if warnings else "ok",
        parameters=evaluated.parameters,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(dict.fromkeys(notes)),
        budget=tuple(evaluated.budget),
        provenance=_provenance(together, prepared),
        details=_details(together) if len(prepared) == 1 else None,
        sensitivities=sensitivities(law.rows, law.equation, law.fit.influence[0]),
        correlation=evaluated.correlation,
    )


def _details(together: Together) -> Details:
    """What the report draws of one log."""
    (run,), law = together.runs, together.law
    return Details(
        start=run.part.start,
        stop=run.part.stop,
        turning_times=run.signals.motion.turning_times,
        turning_angles=run.signals.motion.turning_angles,
        window=law.half,
        residual_times=run.rows(law.half).windows.centres,
        residuals=law.fit.residuals / (law.rows.windows.half * 32 / 35),
        checks=("signs",),
        left_out=run.part.log.left_out,
    )


def _provenance(together: Together, prepared: Sequence[Prepared]) -> dict[str, object]:
    """Return the provenance of the only log, or of the first with all logs in the place of one, and the inertias that
    were added.
    """
    rig = prepared[0].rig
    each = [provenance(run.part.log, rig) for run in together.runs]
    preparation = [
        {
            "corrections": [correction.as_dict() for correction in entry.corrections],
            "part": [run.part.start, run.part.stop],
            "noise": {"angle": run.part.noise.angle, "wheel": None},
        }
        for entry, run in zip(prepared, together.runs, strict=True)
    ]
    if len(each) == 1:
        return each[0] | {"preparation": preparation[0]}
    bodies = [{"value": run.added.value, "std": run.added.std} for run in together.runs]
    return of_several(each[0], each) | {"added": bodies, "preparation": preparation}
