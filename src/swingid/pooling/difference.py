"""The inertia of an added body: what the axis has with it less what it has without."""

from __future__ import annotations

from pathlib import Path

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.format import plus_minus
from swingid.pooling.known_body import scaled_by_body
from swingid.pooling.runs import Runs, calibrated
from swingid.result.result import Message, Result
from swingid.result.sources import is_correlated
from swingid.uncertainty.budget import Parameter, correlation_of, stated
from swingid.uncertainty.uncertain import Uncertain, covariance
from swingid.units import Quantity, parse_quantity

HOPELESS = 0.3
"""Relative standard uncertainty above which the difference is refused."""

GRAVITY_TORQUE = "gravity_torque"

GIVEN = str | float | Quantity


def difference(
    tare: Result | str | Path,
    loaded: Result | str | Path,
    *,
    mass: GIVEN | None = None,
    distance: GIVEN | None = None,
    known: GIVEN | None = None,
) -> Result:
    """Inertia of the body that `loaded` has and `tare` has not, from two results of one method on one rig.

    tare, loaded: results, or the JSON files that hold them. What both runs share (the wheel's inertia, encoders)
    enters with the difference of its sensitivities and so partly cancels; scatter and what differs add in squares.

    mass, distance: of the body and of its centre from the axis, numbers in SI or text such as "68.0 ± 0.1 g"; with them
    `inertia` is about the body's own centre, J_c = J_e − m d² (Huygens–Steiner), and `inertia_about_axis` is J_e.

    known: the body's inertia as known otherwise (about the axis; about its own centre where mass and distance are
    given). It then calibrates the scale, see `known_body`: `scale_factor`, the constant that it corrects,
    `tare_inertia` and `loaded_inertia` are parameters too. `inertia` stays what was measured with the scale of the rig.
    Of two results of ratios it gives the constant that is unknown (a wire's stiffness, the wheel's inertia, the gain of
    a torque) with `tare_inertia` and `loaded_inertia`; `inertia` is that of the body, as it was given.

    Raises InputError for files that hold no inertia or do not belong together, UnanswerableError where the difference
    is lost in its uncertainty, UsageError for options that do not fit. Do not use it where the body also changes the
    friction law at standstill or the way the axis is held: such changes are taken for inertia.
    """
    runs = Runs.of(tare, loaded, ratios=known is not None)
    if runs.tare.ratios and known is not None:
        return _scaled(runs, known, mass, distance)
    body = _body(runs, mass, distance)
    with_gravity = all(GRAVITY_TORQUE in result.parameters for result in (runs.tare, runs.loaded))
    first, second = runs.values("inertia", *([GRAVITY_TORQUE] if with_gravity else []))
    about_axis = second["inertia"] - first["inertia"]
    _require_seen(about_axis, runs, calibrating=known is not None)
    estimates = {"inertia": about_axis}
    if body is not None:
        estimates = {"inertia": _about_own_centre(about_axis, *body, runs.unit), "inertia_about_axis": about_axis}
    if with_gravity:
        estimates[GRAVITY_TORQUE] = second[GRAVITY_TORQUE] - first[GRAVITY_TORQUE]
    warnings = _of_runs(runs)
    notes = [Message("difference", f"{runs.names[1]} less {runs.names[0]}.")]
    notes += [*_exact(mass=body and body[0], distance=body and body[1]), *_exact_in(runs), *runs.notes]
    parameters = _parameters(estimates, runs)
    budget = [entry for name, estimate in estimates.items() for entry in estimate.entries(name)]
    if known is not None:
        what = _quantity(known, "kg" if runs.unit == "kg" else "kg*m^2", "known")
        target = _known(what)
        if body is not None:  # J_e = J_c + m d²
            target += _steiner(*body)
        scaled, doubts, words = calibrated(runs, (first["inertia"], second["inertia"]), target)
        for name, (estimate, unit) in scaled.items():
            estimates[name], parameters[name] = estimate, estimate.parameter(unit)
            # what cancels leaves its rounding behind
            budget += [e for e in estimate.entries(name) if e.standard_uncertainty > 1e-9 * estimate.u]
        warnings += doubts
        notes += [*words, *_exact(known=what)]
    known_names = [name for name, parameter in parameters.items() if parameter.standard_uncertainty is not None]
    return Result(
        method="difference",
        status="warning" if warnings else "ok",
        parameters=parameters,
        warnings=tuple(warnings),
        notes=tuple(notes),
        budget=tuple(budget),
        provenance=_provenance(runs, {"mass": mass, "distance": distance, "known": known}),
        correlation=_correlation({name: estimates[name] for name in known_names}, runs),
    )


def _scaled(runs: Runs, known: GIVEN, mass: GIVEN | None, distance: GIVEN | None) -> Result:
    """Results of ratios on the scale of a known body, whose inertia is about the axis unless mass and distance say."""
    what = _quantity(known, "kg*m^2", "known")
    target = _known(what)
    if (mass is None) != (distance is None):
        raise UsageError("mass and distance go together; give both or none.", code="mass-and-distance")
    if mass is not None and distance is not None:
        target += _steiner(_quantity(mass, "kg", "mass"), _quantity(distance, "m", "distance"))
    found, notes = scaled_by_body(runs, target)
    found["inertia"] = target, "kg m^2"
    warnings = _of_runs(runs)
    return Result(
        method="difference",
        status="warning" if warnings else "ok",
        parameters={name: estimate.parameter(unit) for name, (estimate, unit) in found.items()},
        warnings=tuple(warnings),
        notes=(*notes, *_exact(known=what), *runs.notes),
        budget=tuple(entry for name, (estimate, _) in found.items() for entry in estimate.entries(name)),
        provenance=_provenance(runs, {"mass": mass, "distance": distance, "known": known}),
        correlation=correlation_of(list(found), covariance([estimate for estimate, _ in found.values()])),
    )


def _correlation(estimates: dict[str, Uncertain], runs: Runs) -> dict[str, dict[str, float]]:
    """Correlation coefficients; without those of the gravity torque where a run does not give its own."""
    known = all(is_correlated(run, ("inertia", GRAVITY_TORQUE)) for run in (runs.tare, runs.loaded))
    names = [name for name in estimates if known or name != GRAVITY_TORQUE]
    return correlation_of(names, covariance([estimates[name] for name in names]))


def _quantity(given: GIVEN, unit: str, key: str) -> Quantity:
    """A positive quantity from an option; UsageError where it is none."""
    try:
        found = parse_quantity(given, unit, key)
    except InputError as error:
        raise UsageError(error.message, code=error.code) from None
    if found.value < 0 or (found.value == 0 and key != "distance"):
        raise UsageError(f"{key} is {found.value:g}, but must be positive.", code="out-of-range")
    return found


def _body(runs: Runs, mass: GIVEN | None, distance: GIVEN | None) -> tuple[Quantity, Quantity] | None:
    """Mass (kg) and distance (m) of the body, None where not given."""
    if mass is None and distance is None:
        return None
    if mass is None or distance is None:
        raise UsageError("mass and distance go together; give both or none.", code="mass-and-distance")
    if runs.unit == "kg":
        raise UsageError("mass and distance have no meaning on a linear axis; leave them out.", code="linear-axis")
    return _quantity(mass, "kg", "mass"), _quantity(distance, "m", "distance")


def _require_seen(found: Uncertain, runs: Runs, *, calibrating: bool) -> None:
    """Raise where the difference is not significant, or where the results are swapped.

    A known body may calibrate a scale that is too uncertain to measure it.
    """
    text = plus_minus(found.value, found.u, runs.unit)
    if found.value < -2 * found.u:
        raise InputError(
            f"{runs.names[1]} shows less inertia than {runs.names[0]} ({text}); give the run without the body first.",
            code="swapped",
        )
    if found.value <= 0 or (found.u > HOPELESS * found.value and not calibrating):
        raise UnanswerableError(
            f"the difference of {runs.names[1]} and {runs.names[0]}, {text}, is lost in its uncertainty; the body is "
            "too light for these runs.",
            code="not-identifiable",
        )


def _known(inertia: Quantity) -> Uncertain:
    """The inertia of the known body."""
    name = "inertia of the known body"
    return Uncertain.of(inertia.value, inertia.std or 0.0, stated(name, name, inertia.std or None))


def _steiner(mass: Quantity, distance: Quantity) -> Uncertain:
    """Mass times squared distance (Huygens–Steiner), with the sources that matter."""
    found = mass.uncertain("body.mass") * distance.uncertain("body.distance") ** 2
    return found.only(lambda key: found.shifts[key] != 0.0)


def _about_own_centre(about_axis: Uncertain, mass: Quantity, distance: Quantity, unit: str) -> Uncertain:
    """J_c = J_e − m d²."""
    found = about_axis - _steiner(mass, distance)
    if found.value <= 0:
        moved = plus_minus(about_axis.value - found.value, None, unit)
        raise InputError(
            f"mass and distance make m d^2 = {moved}, more than the body's inertia about the axis, "
            f"{plus_minus(about_axis.value, about_axis.u, unit)}; check both.",
            code="parallel-axis",
        )
    return found


def _parameters(estimates: dict[str, Uncertain], runs: Runs) -> dict[str, Parameter]:
    """Unknown uncertainty where one of the runs has none."""
    found = {}
    for name, estimate in estimates.items():
        pair = [run.parameters["inertia" if name.startswith("inertia") else name] for run in (runs.tare, runs.loaded)]
        known = all(parameter.standard_uncertainty is not None for parameter in pair)
        found[name] = Parameter.of(estimate.value, estimate.u if known else None, pair[0].unit, estimate.freedom)
    return found


def _of_runs(runs: Runs) -> list[Message]:
    """The warnings of both runs, each with the name of its run."""
    return [
        Message(m.code, f"{name}: {m.message}", m.kind)
        for result, name in zip((runs.tare, runs.loaded), runs.names, strict=True)
        for m in result.warnings
    ]


def _exact_in(runs: Runs) -> list[Message]:
    """Which constants of the rig the two runs took as exact."""
    codes = ("exact-constants", "no-uncertainty-inertia")
    return list(dict.fromkeys(m for result in (runs.tare, runs.loaded) for m in result.notes if m.code in codes))


def _exact(**given: Quantity | None) -> list[Message]:
    names = [name for name, quantity in given.items() if quantity is not None and not quantity.std]
    if not names:
        return []
    return [Message("exact-constants", f"taken as exact, because no uncertainty was given: {', '.join(names)}.")]


def _provenance(runs: Runs, options: dict[str, GIVEN | None]) -> dict[str, object]:
    kept = ("log", "log_sha256", "logs", "logs_sha256", "rig", "rig_source", "rig_sha256")
    found: dict[str, object] = {}
    for role, result, name in zip(("tare", "loaded"), (runs.tare, runs.loaded), runs.names, strict=True):
        found[role] = {"result": name} | {key: result.provenance[key] for key in kept if key in result.provenance}
    return found | {
        "method": runs.tare.method,
        "rig": runs.loaded.provenance.get("rig"),
        "options": {name: str(value) for name, value in options.items() if value is not None},
        "versions": runs.loaded.provenance.get("versions"),
    }
