"""What is asked of the encoders: α and β of each in q + α cos q + β sin q, the latency between the channels.

Each has a bound, a normal prior: the spread that the rig file declares, else one that is no knowledge but ten times
what a rig has.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from swingid.model.rig import Rig

WIDE = float(np.radians(1.0))
LATEST = 0.01
"""Bounds (rad, s) where the rig file declares nothing."""

ZERO = 0.02
"""Bound (rad) of the zero of the angle, which the cosine part of the axis' encoder looks like."""

ANGLE, WHEEL = "sensors", "sensors.wheel"


@dataclass(frozen=True)
class Part:
    """A small quantity by its key in the rig file; prior: its standard deviation before the logs are seen (rad, s).

    declared: whether the rig file says so. nuisance: fitted beside the others, and not written.
    """

    key: str
    prior: float
    declared: bool
    nuisance: bool = False

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return "s" if self.key.endswith("latency") else "rad"


def parts_of(rig: Rig) -> list[Part]:
    """The parts that logs of this rig may tell."""
    found = []
    tables = {"angle": ANGLE, "wheel": WHEEL} if rig.drive.kind == "reaction-wheel" else {"angle": ANGLE}
    if rig.axis.kind == "rotary":
        for table in tables.values():
            spread = declared_spread(rig, table)
            for name in ("cosine", "sine"):
                found.append(Part(f"{table}.nonlinearity_{name}", spread or WIDE, spread > 0))
        found.append(Part("zero", ZERO, False, nuisance=True))
    if rig.drive.kind != "none":
        stds = [rig.sensors.of("angle").latency.std or 0.0]
        if rig.drive.kind == "reaction-wheel":
            stds.append(rig.sensors.of("wheel").latency.std or 0.0)
        spread = float(np.hypot.reduce(stds))
        found.append(Part(latency_key(rig), spread or LATEST, spread > 0))
    return found


def declared_spread(rig: Rig, table: str) -> float:
    """What sensors.nonlinearity says (rad) of the encoder of `table`, 0 where nothing; not what was calibrated."""
    own = rig.sensors.wheel
    if table == WHEEL and own is not None and "nonlinearity" in own.model_fields_set:
        return own.nonlinearity
    return rig.sensors.nonlinearity


def bounded(rig: Rig) -> Rig:
    """The rig as if it declared the bound of every encoder of which it says nothing; its latencies are exact."""
    rig = latencies_exact(rig)
    if rig.axis.kind != "rotary":
        return rig
    wheel = rig.drive.kind == "reaction-wheel"
    unsaid = {f"{ANGLE}.nonlinearity": WIDE} if declared_spread(rig, ANGLE) == 0 else {}
    if wheel and declared_spread(rig, WHEEL) == 0:
        unsaid[f"{WHEEL}.nonlinearity"] = WIDE
    return rig.changed(unsaid) if unsaid else rig


def latency_key(rig: Rig) -> str:
    """Where the latency between the channels is written: at the wheel where there is one, else at the angle."""
    return f"{WHEEL if rig.drive.kind == 'reaction-wheel' else ANGLE}.latency"


def uncalibrated(rig: Rig) -> Rig:
    """The rig without what an earlier calibration of its encoders wrote: every calibration starts from the readings."""
    keys = [f"{table}.nonlinearity_{name}" for table in (ANGLE, WHEEL) for name in ("cosine", "sine")]
    stated = [key for key in keys if _stated(rig, key)]
    return rig.changed(dict.fromkeys(stated)) if stated else rig


def latencies_exact(rig: Rig) -> Rig:
    """The rig with its latencies taken for exact."""
    changes: dict[str, object] = {f"{ANGLE}.latency": rig.sensors.latency.value}
    if rig.sensors.wheel is not None and "latency" in rig.sensors.wheel.model_fields_set:
        changes[f"{WHEEL}.latency"] = rig.sensors.wheel.latency.value
    return rig.changed(changes)


def _stated(rig: Rig, key: str) -> bool:
    table = rig.sensors.wheel if key.startswith(WHEEL) else rig.sensors
    return table is not None and getattr(table, key.rpartition(".")[2]) is not None


def with_parts(rig: Rig, values: Mapping[str, float], parts: Iterable[Part]) -> Rig:
    """The rig with these values (by key) in the place of α and β, and added to the latency."""
    changes: dict[str, object] = {}
    for part in parts:
        if part.nuisance:
            continue
        value = values[part.key]
        if part.unit == "s":
            channel = rig.sensors.of("wheel" if part.key.startswith(WHEEL) else "angle")
            value += channel.latency.value
        changes[part.key] = value
    return rig.changed(changes)
