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
    found = {}
    for table, own in _tables(rig):
        if not _says_values(own):
            found[f"{table}.nonlinearity"] = f"0 ± {own.kind.once:g} deg"
        if _takes_second(own):
            found[f"{table}.second_harmonic"] = f"0 ± {own.kind.twice:g} deg"
    axis = {key.replace("sensors.", "sensors.wheel."): text for key, text in found.items()}
    found = {key: text for key, text in found.items() if axis.get(key) != text}
    found = {key: text for key, text in found.items() if not text.endswith(" 0 deg")}
    if rig.drive.channel is not None and not rig.sensors.says_latency:
        table = "sensors.wheel" if rig.drive.wheel is not None else "sensors"
        found[f"{table}.latency"] = f"0 ± {DELAY:.2f} samples"
    return found


def _tables(rig: Rig) -> Iterator[tuple[str, Encoder]]:
    """Table and keys of each encoder that may have a nonlinearity."""
    if rig.axis.kind == "rotary" and not rig.log.has_rate_alone:
        yield "sensors", rig.sensors
    if rig.drive.wheel is not None:
        yield "sensors.wheel", rig.sensors.of_wheel


def _says_values(own: Encoder) -> bool:
    return given(own.nonlinearity) or (given(own.nonlinearity_cosine) and given(own.nonlinearity_sine))


def _takes_second(own: Encoder) -> bool:
    return own.second_harmonic is None and (own.sensor is not None or not own.says_nonlinearity)


def encoders_cost(rig: Rig, budget: Sequence[BudgetEntry], parameters: Mapping[str, Parameter]) -> list[Message]:
    """The note that says how much of the inertia's uncertainty is that of unstated encoders, and what reduces it.

    A calibration leaves `CALIBRATED` of a part once per turn, to which its entry is proportional.
    """
    inertia = parameters.get("inertia")
    if inertia is None or not inertia.standard_uncertainty:
        return []
    taken = {table for table, own in _tables(rig) if not _says_values(own)}
    second = {table for table, own in _tables(rig) if _takes_second(own)}
    once = [one for one in budget if _table(one, ".nonlinearity.") in taken]
    twice = [one for one in budget if _table(one, ".second_harmonic.") in second]
    cost = combined([*once, *twice], "inertia")
    if cost < MATERIAL * inertia.standard_uncertainty:
        return []
    stds = {table: math.radians(own.kind.once) for table, own in _tables(rig)}
    left = math.hypot(
        *(
            one.standard_uncertainty * CALIBRATED / stds[_table(one, ".nonlinearity.")]
            for one in once
            if one.parameter == "inertia"
        )
    )
    size = abs(inertia.value)
    shares = [percent(one / size) for one in (cost, combined(once, "inertia"), left, combined(twice, "inertia"))]
    text = (
        "{} of the inertia is the standard uncertainty by encoders of which the rig file states nothing: {} by what "
        "they are off once per turn, of which a minute of two motions and swingid calibrate --encoders leave {}; {} "
        "by twice per turn. State sensor, its kind, or what is known."
    ).format(*shares)
    return [Message("encoders-not-stated", text)]


def _table(entry: BudgetEntry, key: str) -> str:
    """The table of the rig file whose encoder an entry is of, "" for other entries."""
    table, found, _ = (entry.origin.shared_id or "").partition(key)
    return table if found else ""
