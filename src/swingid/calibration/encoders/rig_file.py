"""The rig file with what a calibration of the encoders found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from swingid.calibration.encoders.parts import ANGLE, WHEEL, latency_key
from swingid.calibration.motor.constants import rounded
from swingid.model.rig import Rig
from swingid.model.rig.edit import edited
from swingid.result.result import Message, Parameter
from swingid.units import Quantity


def with_encoders(rig: Rig, found: Mapping[str, Parameter], told: Iterable[str]) -> tuple[Rig, list[Message]]:
    """The rig with the parts `told` (keys of `found`) and their uncertainties; what was stated of the others goes.

    A latency is one between two channels: it is written at the wheel (at the angle of a direct drive) with the whole
    uncertainty, and the other channel then counts as exact.
    """
    told = list(told)
    values: dict[str, object] = {}
    for table in (ANGLE, WHEEL):
        for name in ("cosine", "sine"):
            key = f"{table}.nonlinearity_{name}"
            values[key] = _quantity(found[key]) if key in told else None
    key = latency_key(rig)
    if key in told:
        values[key] = _quantity(found[key])
        if key.startswith(WHEEL) and rig.sensors.latency.std is not None:
            values[f"{ANGLE}.latency"] = rig.sensors.latency.value
    text, kept = edited(rig.text, values)
    notes = []
    if not kept:
        message = "the rig file is written in a way whose comments could not be kept; its tables were written anew."
        notes.append(Message("comments-lost", message))
    return Rig.from_text(text, rig.source, default_name=rig.name), notes


def _quantity(parameter: Parameter) -> Quantity:
    u = parameter.standard_uncertainty
    return Quantity(rounded(parameter), None if u is None else float(f"{u:.3g}"))
