"""From a point of a plan to an experiment: the twin, the stated rig, motion, controller, methods."""

from __future__ import annotations

import string
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from swingid.control.backstepping import Backstepping
from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.errors import InputError, UsageError
from swingid.methods.table import method_of
from swingid.model.rig import Rig
from swingid.model.terms import stated_at
from swingid.study.campaign.plan import Point, flattened
from swingid.study.campaign.tables import BATCHED, KEYS_IN_WORDS, PLAIN_KEYS, is_key
from swingid.study.changes import ABSENT, changed
from swingid.study.experiment import Experiment, without_truth
from swingid.study.faults import parse_fault, with_faults
from swingid.units import Quantity, parse_quantity

if TYPE_CHECKING:
    from swingid.control.references.base import Reference
    from swingid.study.campaign.plan import Plan

GAINS = {"experiment": Compensator.paper, "simulation": Compensator.paper_simulation}


def experiment_of(plan: Plan, point: Point) -> Experiment:
    """The experiment of a point. Raises InputError or UsageError that names the key which cannot be."""
    base = plan.tables.base
    settings = {name: getattr(base, name) for name in PLAIN_KEYS}
    settings |= flattened({name: getattr(base, name) for name in ("both", "twin", "stated", "controller", "faults")})
    settings |= point.settings
    _check_keys(plan, point)
    source, text = plan.rigs[str(settings["rig"])]
    rig = changed(Rig.from_text(text, source), _under(settings, "both"))
    rig = _with_uncertainty(rig, settings["uncertainty"])
    twin = changed(rig, _under(settings, "twin"))
    stated = without_truth(changed(rig, _under(settings, "stated")))
    faults = [parse_fault(str(text)) for text in _under(settings, "faults").values()]
    if faults and plan.batched:
        raise InputError(f"{base.methods[0]} has no runs with faults; take another method", code="no-faults")
    if twin.axis.inertia is None:
        raise InputError("twin.axis.inertia is missing, but the twin needs it", code="no-inertia")
    if isinstance(twin.axis.gravity_torque, str):
        raise InputError(
            'twin.axis.gravity_torque is "unknown", but the twin needs it; set stated.axis.gravity_torque alone',
            code="unknown-gravity",
        )
    reference = _reference(settings)
    # a lab tunes its controller by the rig file
    controller = None if reference is None else _controller(stated, _under(settings, "controller"))
    if controller is None and _under(settings, "controller"):
        raise InputError("controller needs a reference to follow; give base.reference", code="no-reference")
    experiment = Experiment(
        twin,
        stated,
        reference,
        controller,
        _positive(settings, "duration"),
        _positive(settings, "rate"),
        _angle(settings["initial_angle"], twin),
        base.draw,
        tuple(_method(plan, name, _under(settings, f"methods.{name}")) for name in base.methods),
    )
    return with_faults(experiment, faults) if faults else experiment


def _with_uncertainty(rig: Rig, share: object) -> Rig:
    """The rig with this relative standard uncertainty of every constant that states none."""
    if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share < 1:
        raise InputError(f"uncertainty must be a share from 0 to 1, not {share!r}", code="wrong-value")
    if not share:
        return rig
    known = {key: q for key in rig.constants_without_uncertainty() if isinstance(q := stated_at(rig, key), Quantity)}
    return rig.changed({key: Quantity(q.value, share * abs(q.value)) for key, q in known.items() if q.value})


def _check_keys(plan: Plan, point: Point) -> None:
    """Raise InputError for a setting that has no effect."""
    for key in point.settings:
        if not is_key(key):
            raise InputError(f"{key} is nothing that can be set; {KEYS_IN_WORDS}", code="unknown-key")
        prefix, _, rest = key.partition(".")
        if prefix == "methods" and rest.partition(".")[0] not in plan.tables.base.methods:
            raise InputError(f"{key} belongs to a method that base.methods does not name", code="unknown-key")


def _under(settings: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """The settings whose key begins with a prefix, without it."""
    return {key[len(prefix) + 1 :]: value for key, value in settings.items() if key.startswith(f"{prefix}.")}


def _reference(settings: Mapping[str, Any]) -> Reference | None:
    """The motion, with the factors reference.NAME in the place of {NAME}."""
    text = settings["reference"]
    parts = _under(settings, "reference")
    if text is None or text == ABSENT:
        if parts:
            raise InputError("reference is missing, so it has no part that could be varied", code="no-reference")
        return None
    try:
        names = {name for _, name, _, _ in string.Formatter().parse(str(text)) if name is not None}
    except ValueError:
        raise InputError(f"reference {text!r} has a brace without its partner", code="bad-reference") from None
    if missing := sorted(names - parts.keys()):
        raise InputError(
            f"reference {text!r} contains {{{missing[0]}}}, and no factor has the key reference.{missing[0]}",
            code="bad-reference",
        )
    if idle := sorted(parts.keys() - names):
        raise InputError(f"reference {text!r} has no {{{idle[0]}}} for reference.{idle[0]}", code="bad-reference")
    return parse_reference(str(text).format(**{name: _plain(value) for name, value in parts.items()}))


def _plain(value: object) -> str:
    return f"{value:.12f}".rstrip("0") + "0" if isinstance(value, float) else str(value)


def _controller(rig: Rig, settings: dict[str, Any]) -> Compensator | Backstepping:
    """The compensator (by default with the gains of the paper's experiment) or backstepping, single gains replaced."""
    kind = settings.pop("kind", "compensator")
    made: Compensator | Backstepping
    if kind == "compensator":
        gains = settings.pop("gains", "experiment")
        if gains not in GAINS:
            raise InputError(f"controller.gains must be {' or '.join(GAINS)}, not {gains!r}", code="wrong-value")
        made = GAINS[gains](rig)
    elif kind == "backstepping":
        made = Backstepping.paper(rig)
    else:
        raise InputError(f"controller.kind must be compensator or backstepping, not {kind!r}", code="wrong-value")
    known = {field.name for field in fields(made)} - {"sample_time", "observers"}
    for key, value in settings.items():
        if key not in known:
            raise InputError(
                f"controller.{key} is no setting of the {kind}; it has {', '.join(sorted(known))}", code="unknown-key"
            )
        settings[key] = None if value == ABSENT else tuple(value) if isinstance(value, list) else value
    try:
        return replace(made, **settings)
    except TypeError:
        odd = next((k for k, v in settings.items() if not isinstance(v, int | float)), "kind")
        raise InputError(
            f"controller.{odd} cannot be {settings.get(odd)!r}; give a number", code="wrong-value"
        ) from None


def _method(plan: Plan, name: str, settings: dict[str, Any]) -> tuple[str, str, Mapping[str, object]]:
    table = dict(plan.tables.methods.get(name, {"method": name}))
    method = str(table.pop("method"))
    options: dict[str, object] = table | settings
    if method in BATCHED:
        if options:
            raise InputError(f"{method} has no options, such as {next(iter(options))}", code="unknown-option")
        return name, method, {}
    method_of(method).check_options(options)
    return name, method, options


def _positive(settings: Mapping[str, Any], key: str) -> float:
    value = settings[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < float("inf"):
        raise InputError(f"{key} must be a positive number, not {value!r}", code="wrong-value")
    return float(value)


def _angle(value: object, rig: Rig) -> float:
    unit = "rad" if rig.axis.kind == "rotary" else "m"
    angle = parse_quantity(value, unit, "initial_angle")
    if angle.std is not None:
        raise UsageError("initial_angle takes no uncertainty; give a number", code="uncertainty-unused")
    return angle.value
