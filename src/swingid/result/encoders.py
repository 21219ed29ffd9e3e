"""What is taken of encoders of which the rig file states nothing, and what that costs a result."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from swingid.format import percent
from swingid.model.rig import Rig
from swingid.model.rig.encoder_kinds import DELAY
from swingid.model.rig.fields import given
from swingid.model.rig.sensors import Encoder
from swingid.result.result import Message
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined

MATERIAL = 0.5
"""Share of the standard uncertainty of the inertia from which it is said what unstated encoders cost: without them it
would be smaller by 13 % or more."""

CALIBRATED = math.radians(0.002)
"""Standard uncertainty (rad) of a part once per turn after a calibration by two motions of 25 s (docs/encoders.md)."""


def encoder_defaults(rig: Rig) -> dict[str, str]:
    """Keys of encoders that the rig file does not state and that a result depends on, and what they are taken as."""
    defaults = {}
    for table, encoder in _tables(rig):
        if not _says_values(encoder):
            defaults[f"{table}.nonlinearity"] = f"0 ± {encoder.kind.once:g} deg"
        if _takes_second(encoder):
            defaults[f"{table}.second_harmonic"] = f"0 ± {encoder.kind.twice:g} deg"
    axis = {key.replace("sensors.", "sensors.wheel."): text for key, text in defaults.items()}
    defaults = {key: text for key, text in defaults.items() if axis.get(key) != text}
    defaults = {key: text for key, text in defaults.items() if not text.endswith(" 0 deg")}
    if rig.drive.channel is not None and not rig.sensors.says_latency:
        table = "sensors.wheel" if rig.drive.wheel is not None else "sensors"
        defaults[f"{table}.latency"] = f"0 ± {DELAY:.2f} samples"
    return defaults


def _tables(rig: Rig) -> Iterator[tuple[str, Encoder]]:
    """Table and keys of each encoder that may have a nonlinearity."""
    if rig.axis.kind == "rotary" and not rig.log.has_rate_alone:
        yield "sensors", rig.sensors
    if rig.drive.wheel is not None:
        yield "sensors.wheel", rig.sensors.of_wheel


def _says_values(encoder: Encoder) -> bool:
    return given(encoder.nonlinearity) or (given(encoder.nonlinearity_cosine) and given(encoder.nonlinearity_sine))


def _takes_second(encoder: Encoder) -> bool:
    return encoder.second_harmonic is None and (encoder.sensor is not None or not encoder.says_nonlinearity)


def encoders_cost(rig: Rig, budget: Sequence[BudgetEntry], parameters: Mapping[str, Parameter]) -> list[Message]:
    """The note that says how much of the inertia's uncertainty is that of unstated encoders, and what reduces it.

    A calibration leaves `CALIBRATED` of a part once per turn, to which its entry is proportional.
    """
    inertia = parameters.get("inertia")
    if inertia is None or not inertia.standard_uncertainty:
        return []
    taken = {table for table, encoder in _tables(rig) if not _says_values(encoder)}
    second = {table for table, encoder in _tables(rig) if _takes_second(encoder)}
    once = [entry for entry in budget if _table(entry, ".nonlinearity.") in taken]
    twice = [entry for entry in budget if _table(entry, ".second_harmonic.") in second]
    cost = combined([*once, *twice], "inertia")
    if cost < MATERIAL * inertia.standard_uncertainty:
        return []
    stds = {table: math.radians(encoder.kind.once) for table, encoder in _tables(rig)}
    calibrated = math.hypot(
        *(
            entry.standard_uncertainty * CALIBRATED / stds[_table(entry, ".nonlinearity.")]
            for entry in once
            if entry.parameter == "inertia"
        )
    )
    size = abs(inertia.value)
    shares = [percent(u / size) for u in (cost, combined(once, "inertia"), calibrated, combined(twice, "inertia"))]
    text = (
        "{} of the inertia is the standard uncertainty by encoders of which the rig file states nothing: {} by what "
        "they are off once per turn, of which a minute of two motions and swingid calibrate --encoders leave {}; {} "
        "by twice per turn. State sensor, its kind, or what is known."
    ).format(*shares)
    return [Message("encoders-not-stated", text)]


def _table(entry: BudgetEntry, key: str) -> str:
    """The table of the rig file whose encoder an entry is of, "" for other entries."""
    table, separator, _ = (entry.origin.shared_id or "").partition(key)
    return table if separator else ""
