"""The unknowns of an encoder calibration: α and β of q + α cos q + β sin q of each encoder, the latency between them.

Each has a normal prior: the standard deviation that the rig file states, else one that is ten times what a rig has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from swingid.balance.perturbations import RowError
from swingid.checks.latency import LATEST, latency_spread
from swingid.model.rig import Rig
from swingid.model.rig.sensors import ONE_ENCODER
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Channel, Encoders
from swingid.units import Quantity

WIDE = float(np.radians(1.0))
"""Prior standard deviation (rad) of a nonlinearity where the rig file states nothing."""

ZERO = 0.02
"""Prior standard deviation (rad) of the zero of the angle, whose regressor is nearly that of α of the axis' encoder."""

ANGLE, WHEEL = "sensors", "sensors.wheel"


@dataclass(frozen=True)
class Part:
    """An unknown by its key in the rig file; prior: its prior standard deviation (rad, s).

    declared: whether the rig file states the prior. nuisance: estimated beside the others, and not written.
    """

    key: str
    prior: float
    declared: bool
    nuisance: bool = False

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return "s" if self.key.endswith("latency") else "rad"


def tables_of(rig: Rig) -> dict[Channel, str]:
    """Table in the rig file of each encoder that the balance depends on."""
    return {"angle": ANGLE, "wheel": WHEEL} if rig.drive.wheel is not None else {"angle": ANGLE}


def parts_of(rig: Rig) -> list[Part]:
    """The parts that logs of this rig may make identifiable."""
    parts = []
    if rig.axis.kind == "rotary":
        for table in tables_of(rig).values():
            spread = declared_spread(rig, table)
            parts += [Part(f"{table}.{key}", spread or WIDE, spread > 0) for key in ONE_ENCODER]
        parts.append(Part("zero", ZERO, False, nuisance=True))
    if rig.drive.channel is not None:
        spread = latency_spread(Encoders.of(rig), rig)
        parts.append(Part(latency_key(rig), spread or LATEST, spread > 0))
    return parts


def declared_spread(rig: Rig, table: str) -> float:
    """Stated sensors.nonlinearity (rad) of the encoder of `table`, 0 without one; not the calibrated values."""
    wheel = rig.sensors.wheel
    if table == WHEEL and wheel is not None and "nonlinearity" in wheel.model_fields_set:
        return wheel.nonlinearity or 0.0
    return rig.sensors.nonlinearity or 0.0


def bounded(rig: Rig) -> Rig:
    """The rig with the prior of every encoder whose nonlinearity it does not state; its latencies are exact."""
    rig = with_latencies(rig, lambda latency: latency.value)
    if rig.axis.kind != "rotary":
        return rig
    tables = tables_of(rig).values()
    missing = {f"{table}.nonlinearity": WIDE for table in tables if declared_spread(rig, table) == 0}
    return rig.changed(missing) if missing else rig


def latency_key(rig: Rig) -> str:
    """Return the key of the latency between the channels: the wheel's where there is one, else the angle's."""
    return f"{[*tables_of(rig).values()][-1]}.latency"


def stated_latency(rig: Rig) -> Quantity:
    """Stated latency of the channel of `latency_key`."""
    return rig.sensors.of([*tables_of(rig)][-1]).latency


def uncalibrated(rig: Rig) -> Rig:
    """The rig without values of an earlier calibration: every calibration starts from the readings."""
    tables = ((ANGLE, rig.sensors), (WHEEL, rig.sensors.wheel))
    keys = [
        f"{name}.{key}" for name, encoder in tables for key in ONE_ENCODER if getattr(encoder, key, None) is not None
    ]
    return rig.changed(dict.fromkeys(keys)) if keys else rig


def part_key(error: RowError) -> str:
    """Key in the rig file of what states an error, that of a part where it is one."""
    return (error.of.shared_id or error.source).replace(".nonlinearity.", ".nonlinearity_")


def with_latencies(rig: Rig, changed: Callable[[Quantity], object]) -> Rig:
    """The rig with each stated latency as `changed` makes it."""
    tables = ((ANGLE, rig.sensors), (WHEEL, rig.sensors.wheel))
    stated = [
        (table, encoder) for table, encoder in tables if encoder is not None and "latency" in encoder.model_fields_set
    ]
    return rig.changed({f"{table}.latency": changed(encoder.latency) for table, encoder in stated}) if stated else rig


def with_parts(rig: Rig, values: Array, parts: Sequence[Part]) -> Rig:
    """The rig with these values (parts,) of α and β, and added to the latency; as uncertain as before the logs."""
    late = stated_latency(rig).value
    values_of = [(part, float(value)) for part, value in zip(parts, values, strict=True) if not part.nuisance]
    changes = {part.key: Quantity(value + late * (part.unit == "s"), part.prior) for part, value in values_of}
    return with_latencies(rig, lambda latency: latency.value).changed(changes)
