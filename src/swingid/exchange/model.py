"""The identified rig as plain numbers with names: what every export writes, and the rig of a result."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.format import plus_minus
from swingid.model import parameters as at
from swingid.model.rig import Rig
from swingid.model.terms import rig_terms
from swingid.numerics.arrays import Array
from swingid.result.result import Result
from swingid.study.validate import model_vector

NAMES = {
    "a11": at.A11,
    "a12": at.A12,
    "a22": at.A22,
    "b": at.B,
    "direct": at.DIRECT,
    "gear": at.GEAR,
    "c1": at.C1,
    "c2": at.C2,
    "eta": at.ETA,
    "d1": at.D1,
    "d2": at.D2,
    "f2": at.F2,
    "f3": at.F3,
    "viscous_positive": at.VISCOUS_P,
    "viscous_negative": at.VISCOUS_N,
    "coulomb_positive": at.COULOMB_P,
    "coulomb_negative": at.COULOMB_N,
    "static_positive": at.STATIC_P,
    "static_negative": at.STATIC_N,
    "stribeck_speed": at.STRIBECK_SPEED,
    "quadratic": at.QUADRATIC,
    "cubic": at.CUBIC,
    "offset": at.OFFSET,
}
"""Constants by the names they have in an export, with their places in the vector of `model.parameters`."""

WHEEL_ALONE = ("a12", "a22", "gear", "c1", "c2", "eta", "d1", "d2", "f2", "f3")
"""Constants of a rig with a wheel."""


@dataclass(frozen=True)
class Further:
    """A further term of equation (I): coefficient (sgn v)^odd |v|^power g(q), with the numbers in g."""

    coefficient: float
    shift: float
    order: float
    kind: int
    power: float
    odd: bool


@dataclass(frozen=True)
class Model:
    """The identified rig: p, the vector of `model.parameters`, with the result's values in place.

    words: where the numbers come from, line by line, for a comment.
    """

    rig: Rig
    p: Array
    words: tuple[str, ...]

    @property
    def has_wheel(self) -> bool:
        """Return whether a reaction wheel drives the rig."""
        return self.rig.drive.wheel is not None

    @property
    def linear(self) -> bool:
        """Return whether the axis slides."""
        return self.rig.axis.kind == "linear"

    @property
    def limit(self) -> float | None:
        """Limit of the voltage (V), None where the rig states none."""
        motor = self.rig.drive.motor
        return None if motor is None or motor.voltage_limit is None else float(motor.voltage_limit)

    def value(self, name: str) -> float:
        """A constant by its name in `NAMES` (SI)."""
        return float(self.p[NAMES[name]])

    @property
    def constants(self) -> dict[str, float]:
        """The constants of this rig by name: without those of a wheel where there is none."""
        return {name: self.value(name) for name in NAMES if self.has_wheel or name not in WHEEL_ALONE}

    @property
    def drags(self) -> list[str]:
        """The further terms that grow with the speed, in words."""
        return [term.term.words for term in rig_terms(self.rig) if term.term.odd and term.term.power]

    @property
    def slots(self) -> list[Further]:
        """The further terms that the rig has."""
        count = int(self.p[at.FURTHER])
        slots = self.p[at.FIRST_SLOT : at.SIZE].reshape(-1, at.SLOT)[:count]
        return [
            Further(
                float(slot[at.COEFFICIENT]), float(slot[at.SHIFT]), float(slot[at.ORDER]), int(slot[at.KIND]),
                float(slot[at.POWER]), bool(slot[at.ODD]),
            )
            for slot in slots
        ]  # fmt: skip


def model_of(result: Result, rig: Rig) -> Model:
    """The rig with the values of a result.

    Raises InputError or UnanswerableError where the result does not determine the model, see `study.validate`.
    """
    p = model_vector(result, rig)
    if not np.isfinite(p[: at.WHEEL_STATIC]).all():
        raise UnanswerableError("the model of the result has a constant that is not finite.", code="no-model")
    words = [f"rig {rig.name}; identified with swingid by the method {result.method}; SI units"]
    words += [
        f"{name} = {plus_minus(parameter.value, parameter.standard_uncertainty, parameter.unit)}"
        for name, parameter in result.parameters.items()
    ]
    return Model(rig, p, tuple(" ".join(line.split()) for line in words))


def rig_of(result: Result, rig: str | None) -> Rig:
    """The rig at a path, or where none is given the one that the result names.

    Raises UsageError where that is not to be found or has changed since.
    """
    if rig is not None:
        return Rig.load(rig)
    source = result.provenance.get("rig_source")
    name = str(source).removeprefix("built-in ") if isinstance(source, str) else ""
    try:
        if not name or not (str(source).startswith("built-in ") or Path(name).is_file()):
            raise InputError("", code="missing-file")
        read = Rig.load(name)
    except InputError:
        message = "the rig file of the result is not to be read here; give it with --rig RIG.toml"
        raise UsageError(message, code="no-rig") from None
    if result.provenance.get("rig_sha256") not in (None, hashlib.sha256(read.text.encode()).hexdigest()):
        raise UsageError(f"{name} has changed since the result; give the rig file with --rig", code="other-rig")
    return read
