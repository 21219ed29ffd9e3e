"""The registry of terms: every term of equation (I) and every constant of a rig, one record each.

    a11 q1'' + b sin q1 + Σ_k c_k f_k(q1, q1') = drive,    f(q, v) = (sgn v)^odd |v|^power g(q)

A record says how a term is called, where rig.toml states its coefficient c, and what its regressor f is: a power of the
speed, its parity in the speed, and a function g of the angle by an integer kind. Everything else follows from that: the
torque, its partial derivatives, the potential energy. The twin, the methods and the report read this table, so a
coefficient whose regressor has this form needs nothing but a record. The functions of angle and speed are in `shapes`.
(Kernels under njit have the kinds compiled in.)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.model import shapes
from swingid.model.shapes import DISPLACEMENT, ONE, STRINGS, WAVE, WEIGHT
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array


@dataclass(frozen=True, slots=True)
class Term:
    """A term or constant: its name in results, key in rig.toml, words, unit on a rotary and a linear axis, symbol.

    key: "" for what rig.toml does not state by itself. linear: None where the unit is the same, "" where a linear axis
    has no such term. power: of |v| in the regressor, 0, 1, 3/2 and so on by halves, None for a constant without a
    regressor of its own. odd: whether the regressor changes its sign with the speed. kind: of g(q). order, shift: keys
    of the numbers in g. parts: names of the sine and cosine part of a wave of unknown shift. signed: whether the
    coefficient may be negative.
    """

    name: str
    key: str
    words: str
    unit: str = ""
    linear: str | None = None
    symbol: str = ""
    power: float | None = None
    odd: bool = False
    kind: int = ONE
    order: str = ""
    shift: str = ""
    parts: tuple[str, ...] = ()
    signed: bool = False

    def __post_init__(self) -> None:
        if (self.power or 0.0) % 0.5 or (self.power or 0.0) < 0.0:
            raise ValueError(f"term {self.name}: power is {self.power}; give 0, 1/2, 1, 3/2 and so on")

    @property
    def is_dry(self) -> bool:
        """Return whether it is friction that holds a resting axis: odd in the speed, and no less at rest."""
        return self.odd and self.power == 0

    @property
    def is_conservative(self) -> bool:
        """Return whether its torque is a function of the angle alone, and so has a potential energy."""
        return not self.odd and self.power == 0 and self.kind != ONE

    def unit_on(self, *, linear: bool) -> str:
        """SI unit on this kind of axis."""
        return self.linear if linear and self.linear is not None else self.unit

    def of_speed(self, v: Array) -> Array:
        """The part of the regressor that the speed makes (rad/s or m/s), (sgn v)^odd |v|^power; 0 at rest if odd."""
        return self.of_motion(v, np.sign(v))

    def of_motion(self, v: Array, direction: Array) -> Array:
        """Evaluate as `of_speed`; direction: sgn v, which a noisy speed does not show near rest."""
        size = shapes.half_powers(np.abs(v), self.power or 0)
        return np.asarray(direction * size if self.odd else size)

    def of_angle(self, q: Array, order: float = 1.0, shift: float = 0.0) -> Array:
        """The part of the regressor that the angle makes, g(q) (rad or m)."""
        return np.asarray(shapes.angle_factor(self.kind, q, order, shift))

    def of_angle_integral(self, q: Array, order: float = 1.0, shift: float = 0.0) -> Array:
        """∫g dq from 0 to q of a conservative term, for its potential energy."""
        return np.asarray(shapes.angle_integral(self.kind, q, order, shift))

    def angle_slope(self, q: Array, order: float = 1.0, shift: float = 0.0) -> Array:
        """dg/dq."""
        return np.asarray(shapes.angle_slope(self.kind, q, order, shift))

    def shift_slope(self, q: Array, order: float = 1.0, shift: float = 0.0) -> Array:
        """∂g/∂shift."""
        return np.asarray(shapes.shift_slope(self.kind, q, order, shift))


_N = ("N m", "N")
_VISCOUS = ("N m s", "N s/m")
_QUADRATIC = ("N m s^2", "N s^2/m^2")
_CUBIC = ("N m s^3", "N s^3/m^3")
_DRAG = ("N m s^1.5", "N s^1.5/m^1.5")
_F, _M = "axis.friction", "drive.motor"

_RECORDS = (
    Term("inertia", "axis.inertia", "inertia", "kg m^2", "kg", "J₁"),
    Term("gravity_torque", "axis.gravity_torque", "gravity torque", *_N, "b", power=0, kind=WAVE),
    # Friction of the axis; those without a power are nonlinear (Stribeck, LuGre) or sums of others (directions).
    Term("viscous", f"{_F}.viscous", "viscous friction", *_VISCOUS, power=1, odd=True),
    Term("coulomb", f"{_F}.coulomb", "Coulomb friction", *_N, "Fc", power=0, odd=True),
    Term("static", f"{_F}.static", "static friction (brink of motion)", *_N, "Fs"),
    Term("stribeck_speed", f"{_F}.stribeck_speed", "Stribeck speed", "rad/s", "m/s", "vs"),
    Term("quadratic", f"{_F}.quadratic", "quadratic friction", *_QUADRATIC, power=2, odd=True),
    Term("cubic", f"{_F}.cubic", "cubic friction", *_CUBIC, power=3, odd=True),
    Term("viscous_positive", f"{_F}.viscous_positive", "viscous friction, speed > 0", *_VISCOUS),
    Term("viscous_negative", f"{_F}.viscous_negative", "viscous friction, speed < 0", *_VISCOUS),
    Term("coulomb_positive", f"{_F}.coulomb_positive", "Coulomb friction, speed > 0", *_N),
    Term("coulomb_negative", f"{_F}.coulomb_negative", "Coulomb friction, speed < 0", *_N),
    Term("offset", f"{_F}.offset", "constant torque", *_N, power=0, signed=True),
    Term("lugre.bristle_stiffness", f"{_F}.lugre.bristle_stiffness", "LuGre bristle stiffness", "N m/rad", "N/m", "σ₀"),
    Term("lugre.bristle_damping", f"{_F}.lugre.bristle_damping", "LuGre bristle damping", *_VISCOUS, "σ₁"),
    Term("viscous_even", "", "direction-dependent friction", *_VISCOUS, power=1, signed=True),
    Term("stribeck", "", "Stribeck's peak", *_N),
    Term("memory", "", "dynamic friction", "N m s", "N s", signed=True),
    Term("memory_equal", "", "dynamic friction alike at all reversals", "N m s", "N s", signed=True),
    # The drive.
    Term("wheel_inertia", "drive.wheel.inertia", "wheel inertia", "kg m^2", None, "J₂"),
    Term("rotor_inertia", f"{_M}.rotor_inertia", "rotor inertia", "kg m^2", None, "Jr"),
    Term("gear_ratio", f"{_M}.gear_ratio", "rotor turns per wheel turn", "", None, "N"),
    Term("torque_per_volt", f"{_M}.torque_per_volt", "motor torque per volt", "N m/V", "N/V", "c₁"),
    Term("back_emf", f"{_M}.back_emf", "motor torque lost per speed (back-EMF)", *_VISCOUS, "c₂"),
    Term("motor_viscous", f"{_M}.viscous", "viscous friction of motor and gear", "N m s", None, "f₂"),
    Term("motor_coulomb", f"{_M}.coulomb", "Coulomb friction of motor and gear", "N m", None, "f₃"),
    Term("efficiency", f"{_M}.efficiency", "efficiency", "", None, "η"),
    Term("gear_friction", "", "gear friction per volt at the motor", "N m/V", "N/V"),
)

_C, _S = "axis.cogging", "axis.suspension"

_SPRING = ("N m/rad", "N/m")

_FURTHER = (
    Term(
        "stiffness", "axis.stiffness", "spring stiffness", *_SPRING, "k", 0, kind=DISPLACEMENT, shift="axis.spring_zero"
    ),
    Term(
        "suspension_stiffness",
        f"{_S}.stiffness",
        "stiffness of the suspension",
        "N m/rad",
        "",
        "κ",
        0,
        kind=STRINGS,
        order=f"{_S}.shape",
    ),
    Term(
        "cogging_amplitude",
        f"{_C}.amplitude",
        "cogging amplitude",
        *_N,
        "A",
        0,
        kind=WAVE,
        order=f"{_C}.order",
        shift=f"{_C}.phase",
        parts=("cogging_sine", "cogging_cosine"),
        signed=True,
    ),
    Term("cogging_sine", "", "cogging, sine part", *_N, "A cos φ", 0, kind=WAVE, signed=True),
    Term("cogging_cosine", "", "cogging, cosine part", *_N, "A sin φ", 0, kind=WAVE, signed=True),
    Term("drag", f"{_F}.drag", "drag of power 3/2", *_DRAG, power=1.5, odd=True),
    Term("load", f"{_F}.load", "load-dependent Coulomb friction", "N m", "", "", 0, odd=True, kind=WEIGHT),
)

TERMS: dict[str, Term] = {term.name: term for term in (*_RECORDS, *_FURTHER)}
"""All terms by name."""

NAMED = frozenset(term.name for term in _RECORDS)
"""Terms that the equations of the model name one by one. The others, further terms, are known by their records."""

FRICTION_KEYS = tuple(term.name for term in _RECORDS if term.key.startswith(_F))
"""Keys of [axis.friction] that have a place of their own in the vector of constants."""

MOTOR_TERMS = ("torque_per_volt", "back_emf")
"""Constants of a motor on the axis that may be unknown."""

MOTOR_KEYS = tuple(term.key.rpartition(".")[2] for term in TERMS.values() if term.key.startswith(_M))


def is_spring(term: Term) -> bool:
    """Return whether its torque draws the axis back to one angle: a spring, or strings that a body hangs on."""
    return term.kind in (DISPLACEMENT, STRINGS)


def units_on(*, linear: bool) -> dict[str, str]:
    """Unit of every term by its name on a rotary or linear axis."""
    return {name: term.unit_on(linear=linear) for name, term in TERMS.items()}


def name_of(key: str) -> str:
    """Name of the constant at a key of rig.toml."""
    return next((name for name, term in TERMS.items() if term.key == key), key.rpartition(".")[2])


def power_of(name: str) -> float:
    """Power of the speed that a coefficient stands before; that of the two-sided one for one of a direction."""
    term = TERMS[name if TERMS[name].power is not None else name.partition("_")[0]]
    return term.power or 0


def words_of(name: str) -> str:
    """An unknown in words: its name where it is no term."""
    return TERMS[name].words if name in TERMS else name.replace("_", " ")


def stated_at(rig: object, key: str) -> Quantity | str | None:
    """What a Rig states at a dotted key: a Quantity (a plain number counts as exact), "unknown", or None."""
    value: object = rig
    for part in key.split("."):
        value = getattr(value, part, None)
    value = Quantity(value) if isinstance(value, float) else value
    return value if isinstance(value, Quantity | str) else None


def further_terms() -> Iterator[Term]:
    """The further terms that rig.toml can state."""
    return (term for name, term in TERMS.items() if name not in NAMED and term.key)


@dataclass(frozen=True, slots=True)
class RigTerm:
    """A term as a rig has it: its name as an unknown, and the numbers in g(q).

    value: what the rig states of the coefficient, None where it has to be identified.
    """

    name: str
    term: Term
    order: float
    shift: Quantity
    value: Quantity | None

    @property
    def at(self) -> tuple[float, float]:
        """Order and shift of g."""
        return self.order, self.shift.value

    def regressor(self, q: Array, v: Array, direction: Array) -> Array:
        """f(q, v) at angles q and speeds v; direction: sgn v, which a noisy speed does not show near rest."""
        if not (self.term.odd or self.term.power):
            return self.term.of_angle(q, *self.at)
        return np.asarray(self.term.of_motion(v, direction) * self.term.of_angle(q, *self.at))

    def stiffness(self, q: Array) -> Array:
        """How much a conservative torque grows with the angle, per unit of the coefficient; 0 of another term."""
        return self.term.angle_slope(q, *self.at) if self.term.is_conservative else np.zeros_like(q)


def gravity_term(rig: object) -> RigTerm:
    """Gravity, sin q; on a straight axis, on which it does not depend on the place, sin 0 q."""
    turns, stated = getattr(getattr(rig, "axis", None), "kind", "") == "rotary", stated_at(rig, "axis.gravity_torque")
    value = stated if isinstance(stated, Quantity) else None
    return RigTerm("gravity_torque", TERMS["gravity_torque"], float(turns), Quantity(0.0), value)


def rig_terms(rig: object) -> tuple[RigTerm, ...]:
    """The further terms that a Rig has, for the methods: of friction only that it is there, not the coefficient.

    A wave of unknown phase is two unknowns, those of its sine and its cosine.
    """
    terms: list[RigTerm] = []
    for term in further_terms():
        stated = stated_at(rig, term.key)
        if stated is None or (term.key.startswith(_F) and stated == Quantity(0.0)):
            continue
        value = stated if isinstance(stated, Quantity) and not term.key.startswith(_F) else None
        order = stated_at(rig, term.order) if term.order else None
        shift = stated_at(rig, term.shift) if term.shift else None
        number = order.value if isinstance(order, Quantity) else 1.0
        if isinstance(shift, str):
            for name, angle in zip(term.parts, (0.0, np.pi / 2), strict=True):
                terms.append(RigTerm(name, TERMS[name], number, Quantity(float(angle)), None))
        else:
            terms.append(RigTerm(term.name, term, number, shift or Quantity(0.0), value))
    return tuple(terms)


def motor_terms(rig: object) -> tuple[RigTerm, ...]:
    """The terms that a motor on the axis adds to the left of equation (I), −c1 u + c2 q1' (+ gear friction).

    Without a value where the constant is to be identified. Empty for a rig of another drive.
    """
    drive = getattr(rig, "drive", None)
    motor = getattr(drive, "motor", None)
    if motor is None or getattr(drive, "kind", "") != "motor":
        return ()
    stated = motor.model_fields_set
    names = [*MOTOR_TERMS, *(("gear_friction",) if motor.gear_friction is not None else ())]
    values = {name: getattr(motor, name) if name in stated else None for name in MOTOR_TERMS}
    return tuple(RigTerm(name, TERMS[name], 1.0, Quantity(0.0), values.get(name)) for name in names)


def values_by_key(identified: Mapping[str, float]) -> dict[str, float]:
    """Identified values by name, under their keys of rig.toml; sine and cosine part of a wave as amplitude and phase.

    Raises KeyError for a name that is no term.
    """
    values = {TERMS[name].key: value for name, value in identified.items() if TERMS[name].key}
    for term in further_terms():
        if term.parts and term.parts[0] in identified:
            sine, cosine = (identified[name] for name in term.parts)
            values |= {term.key: float(np.hypot(sine, cosine)), term.shift: float(np.arctan2(cosine, sine))}
    return values
