"""The inertia of an added body: what the axis has with it less what it has without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from swingid.balance.identifiability import HOPELESS
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.format import plus_minus
from swingid.pooling.known_body import Found, calibrated, scaled_by_body
from swingid.pooling.runs import Runs
from swingid.result.provenance import exact_constants
from swingid.result.result import Message, Result
from swingid.result.sources import is_correlated
from swingid.uncertainty.budget import stated
from swingid.uncertainty.uncertain import Uncertain, evaluated
from swingid.units import Quantity, parse_quantity

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

    What both runs share (the wheel's inertia, encoders) enters with the difference of its sensitivities and so partly
    cancels; scatter and what differs add in squares. Do not use it where the body also changes the friction law at
    standstill or the way the axis is held: such changes are taken for inertia.

    Parameters
    ----------
    tare, loaded : Result or path
        Results, or the JSON files that hold them.
    mass, distance : numbers in SI, or text such as "68.0 ± 0.1 g"
        Of the body, and of its centre from the axis. With them `inertia` is about the body's own centre, J_c = J_e −
        m d² (Huygens–Steiner), and `inertia_about_axis` is J_e.
    known : number in SI, or text
        The body's inertia as known otherwise (about the axis; about its own centre where mass and distance are given).
        It calibrates the scale, see `known_body`: `scale_factor`, the constant that it corrects, `tare_inertia` and
        `loaded_inertia` are parameters too, and `inertia` stays what was measured with the scale of the rig. Of two
        results of ratios it gives the constant that is unknown (a wire's stiffness, the wheel's inertia, the gain of
        a torque) with `tare_inertia` and `loaded_inertia`; `inertia` is that of the body, as it was given.

    Raises
    ------
    InputError
        Files that hold no inertia or do not belong together.
    UnanswerableError
        The difference is lost in its uncertainty.
    UsageError
        Options that do not fit.

    Examples
    --------
    >>> import swingid as sw
    >>> motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    >>> rigs = sw.Rig.load("paper"), sw.Rig.load("paper-body")
    >>> tare, loaded = (sw.identify(sw.simulate(rig, motion, duration=25, seed=1), rig) for rig in rigs)
    >>> print(f"{sw.difference(tare, loaded).inertia.value:.3e}")  # 961e-6 in the twin
    9.610e-04
    """
    runs = Runs.of(tare, loaded, ratios=known is not None)
    options = {"mass": mass, "distance": distance, "known": known}
    if runs.tare.ratios and known is not None:
        what = _quantity(known, "kg*m^2", "known")
        target = _known(what, _body(runs, mass, distance))
        scaled, words = scaled_by_body(runs, target)
        values = {**scaled, "inertia": (target, "kg m^2")}
        return _result(runs, values, (), [*words, *_exact(known=what), *runs.notes], options)
    body = _body(runs, mass, distance)
    with_gravity = all(GRAVITY_TORQUE in result.parameters for result in runs.each)
    first, second = runs.values("inertia", *([GRAVITY_TORQUE] if with_gravity else []))
    about_axis = second["inertia"] - first["inertia"]
    _require_seen(about_axis, runs, calibrating=known is not None)
    values = {"inertia": (about_axis, runs.unit)}
    if body is not None:
        centred = _about_own_centre(about_axis, *body, runs.unit)
        values = {"inertia": (centred, runs.unit), "inertia_about_axis": (about_axis, runs.unit)}
    if with_gravity:
        unit = runs.tare.parameters[GRAVITY_TORQUE].unit
        values[GRAVITY_TORQUE] = second[GRAVITY_TORQUE] - first[GRAVITY_TORQUE], unit
    notes = [Message("difference", f"{runs.names[1]} less {runs.names[0]}.")]
    exact = (m for run in runs.each for m in run.notes if m.code in ("exact-constants", "no-uncertainty-inertia"))
    notes += [*_exact(mass=body and body[0], distance=body and body[1]), *dict.fromkeys(exact), *runs.notes]
    doubts: list[Message] = []
    if known is not None:
        what = _quantity(known, "kg" if runs.unit == "kg" else "kg*m^2", "known")
        scaled, doubts, words = calibrated(runs, (first["inertia"], second["inertia"]), _known(what, body))
        values |= scaled
        notes += [*words, *_exact(known=what)]
    return _result(runs, values, doubts, notes, options)


def _result(
    runs: Runs, values: Found, doubts: Sequence[Message], notes: Sequence[Message], options: Mapping[str, GIVEN | None]
) -> Result:
    """The result with these values; of one whose uncertainty a run does not state none is known."""
    renamed = {"inertia_about_axis": "inertia"}
    unsure = {
        name
        for name in values
        for run in runs.each
        if (stated := run.parameters.get(renamed.get(name, name))) is not None and stated.standard_uncertainty is None
    }
    correlated = all(is_correlated(run, ("inertia", GRAVITY_TORQUE)) for run in runs.each if not run.ratios)
    answer = evaluated(values, unsure, alone=() if correlated else (GRAVITY_TORQUE,))
    warnings = [*_of_runs(runs), *doubts]
    return Result(
        method="difference",
        status="warning" if warnings else "ok",
        parameters=answer.parameters,
        warnings=tuple(warnings),
        notes=tuple(notes),
        budget=tuple(answer.budget),
        provenance=_provenance(runs, options),
        correlation=answer.correlation,
    )


def _quantity(given: GIVEN, unit: str, key: str) -> Quantity:
    """A positive quantity from an option; UsageError where it is none."""
    try:
        quantity = parse_quantity(given, unit, key)
    except InputError as error:
        raise UsageError(error.message, code=error.code) from None
    if quantity.value < 0 or (quantity.value == 0 and key != "distance"):
        raise UsageError(f"{key} is {quantity.value:g}, but must be positive.", code="out-of-range")
    return quantity


def _body(runs: Runs, mass: GIVEN | None, distance: GIVEN | None) -> tuple[Quantity, Quantity] | None:
    """Mass (kg) and distance (m) of the body, None where not given."""
    if mass is None and distance is None:
        return None
    if mass is None or distance is None:
        raise UsageError("mass and distance go together; give both or none.", code="mass-and-distance")
    if runs.tare.main.unit == "kg":
        raise UsageError("mass and distance have no meaning on a linear axis; leave them out.", code="linear-axis")
    return _quantity(mass, "kg", "mass"), _quantity(distance, "m", "distance")


def _require_seen(value: Uncertain, runs: Runs, *, calibrating: bool) -> None:
    """Raise where the difference is not significant, or where the results are swapped.

    A known body may calibrate a scale that is too uncertain to measure it.
    """
    text = plus_minus(value.value, value.u, runs.unit)
    if value.value < -2 * value.u:
        raise InputError(
            f"{runs.names[1]} shows less inertia than {runs.names[0]} ({text}); give the run without the body first.",
            code="swapped",
        )
    if value.value <= 0 or (value.u > HOPELESS * value.value and not calibrating):
        raise UnanswerableError(
            f"the difference of {runs.names[1]} and {runs.names[0]}, {text}, is lost in its uncertainty; the body is "
            "too light for these runs.",
            code="not-identifiable",
        )


def _known(inertia: Quantity, body: tuple[Quantity, Quantity] | None) -> Uncertain:
    """The inertia about the axis of the known body: J_e = J_c + m d², J_c where mass and distance are given."""
    name = "inertia of the known body"
    value = Uncertain.of(inertia.value, inertia.std or 0.0, stated(name, name, inertia.std or None))
    return value if body is None else value + _steiner(*body)


def _steiner(mass: Quantity, distance: Quantity) -> Uncertain:
    """Mass times squared distance (Huygens–Steiner), with the sources that matter."""
    product = mass.uncertain("body.mass") * distance.uncertain("body.distance") ** 2
    return product.only(lambda key: product.shifts[key] != 0.0)


def _about_own_centre(about_axis: Uncertain, mass: Quantity, distance: Quantity, unit: str) -> Uncertain:
    """J_c = J_e − m d²."""
    value = about_axis - _steiner(mass, distance)
    if value.value <= 0:
        moved = plus_minus(about_axis.value - value.value, None, unit)
        raise InputError(
            f"mass and distance make m d^2 = {moved}, more than the body's inertia about the axis, "
            f"{plus_minus(about_axis.value, about_axis.u, unit)}; check both.",
            code="parallel-axis",
        )
    return value


def _of_runs(runs: Runs) -> list[Message]:
    """The warnings of both runs, each with the name of its run."""
    return [
        Message(m.code, f"{name}: {m.message}", m.kind)
        for result, name in zip(runs.each, runs.names, strict=True)
        for m in result.warnings
    ]


def _exact(**given: Quantity | None) -> list[Message]:
    names = [name for name, quantity in given.items() if quantity is not None and not quantity.std]
    return exact_constants(names, "no uncertainty was given")


def _provenance(runs: Runs, options: Mapping[str, GIVEN | None]) -> dict[str, object]:
    kept = ("log", "log_sha256", "logs", "logs_sha256", "rig", "rig_source", "rig_sha256")
    provenance: dict[str, object] = {}
    for role, result, name in zip(("tare", "loaded"), runs.each, runs.names, strict=True):
        provenance[role] = {"result": name} | {key: result.provenance[key] for key in kept if key in result.provenance}
    return provenance | {
        "method": runs.tare.method,
        "rig": runs.loaded.provenance.get("rig"),
        "options": {name: str(value) for name, value in options.items() if value is not None},
        "versions": runs.loaded.provenance.get("versions"),
    }
