"""The result of a method for a rig in which nothing sets a scale: as ratios, or by a stated gravity torque."""

from __future__ import annotations

from dataclasses import replace

from swingid.model.rig import Rig
from swingid.preparation.reference import Reference
from swingid.result.provenance import constants, of_rig
from swingid.result.ratios import Scaling, converted, ratios_of, transformed
from swingid.result.result import Message, Result

SCALE_NOTES = {"scale-from-gravity", "scale-from-spring"}
"""Codes of notes that name what the inertia is proportional to, which is nothing to say of ratios."""


def unscaled(result: Result, reference: Reference, rig: Rig) -> Result:
    """A result in which `reference` is 1, as ratios to the inertia or scaled by what the rig states; rig: as stated."""
    if not result.parameters:
        return result
    name, by = reference.name, reference.scaled_by
    ratios = ratios_of(result, name, by)
    scaled = transformed(result, ratios)
    leading = next(ratio for ratio in ratios if "inertia" in ratio.powers)
    notes = tuple(note for note in result.notes if note.code not in SCALE_NOTES)
    return replace(
        scaled,
        ratios=by is None,
        notes=(*notes, _note(reference, rig)),
        details=converted(result.details, leading, result.parameters, _torque(result, by)),
        provenance=result.provenance | of_rig(rig) | {"constants": constants(rig)},
        per_log=tuple(unscaled(of_log, reference, rig) for of_log in result.per_log),
    )


def _torque(result: Result, by: Scaling | None) -> float:
    """Factor of torques in the result: over the inertia, or by the stated constant."""
    return 1 / result.inertia.value if by is None else by[2].value / result.parameters[by[0]].value


def _note(reference: Reference, rig: Rig) -> Message:
    """What sets the scale, or what to measure for one."""
    if reference.scaled_by is not None:
        key = reference.scaled_by[1]
        text = f"{reference.key} is unknown, so {key} sets the scale, and {reference.name} is identified too."
        return Message("scale", text)
    unit = "kg" if rig.axis.kind == "linear" else "kg m^2"
    text = (
        f"nothing in rig {rig.name} sets the scale ({reference.key} is unknown), so the parameters are ratios; for "
        f"{unit} {reference.remedy}."
    )
    return Message("no-scale", text)
