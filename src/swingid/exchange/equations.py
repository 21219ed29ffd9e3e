"""Equations (I) and (II) as text that Python and MATLAB read alike: + - * /, brackets, sin, cos, exp, sqrt, abs, sign.

Dry friction is a torque against the sign of the speed, 0 at rest: a rig that sticks creeps here.
"""

from __future__ import annotations

from swingid.exchange.model import Further, Model
from swingid.model.shapes import DISPLACEMENT, STRINGS, WAVE, WEIGHT

DRY = ("coulomb_positive", "coulomb_negative", "static_positive", "static_negative", "d1", "d2", "f3")
"""Constants that a linearisation takes as 0."""


def states(model: Model) -> list[str]:
    """Names of the states: angle and speed of the axis, then of the wheel (rad, rad/s; linear: m, m/s)."""
    return ["q1", "v1", "q2", "v2"] if model.has_wheel else ["q1", "v1"]


def right_hand_side(model: Model) -> list[tuple[str, str]]:
    """Assignments (name, expression), in order; the last ones are accelerations `dv1` and, of a wheel, `dv2`.

    They read the states, the input `u` and the names of `Model.constants`.
    """
    lines = [
        ("s1", "sign(v1)"),
        ("coulomb", _sided("coulomb")),
        ("static", _sided("static")),
        ("dry", "static" if model.value("stribeck_speed") == 0.0 else _STRIBECK),
        ("viscous", f"({_half('viscous', '+')} + {_half('viscous', '-')}*s1)*v1"),
        ("wet", "viscous + quadratic*v1*abs(v1) + cubic*v1*v1*v1 + offset"),
        ("more", " + ".join(map(_term, model.slots)) or "0"),
        ("r1", "direct*u - b*sin(q1) - s1*dry - wet - more" if not model.linear else "direct*u - s1*dry - wet - more"),
    ]
    if model.value("stribeck_speed") == 0.0:  # the peak is at rest alone
        lines = [(name, "coulomb" if name == "dry" else text) for name, text in lines if name != "static"]
    if not model.has_wheel:
        return [*lines, ("dv1", "r1/a11")]
    return [
        *lines,
        ("motor", "eta*(c1*u - c2*v2)"),
        ("above", "motor - d1"),
        ("below", "motor - d2"),
        ("torque", "(above + abs(above) + below - abs(below))/2" if _dead(model) else "motor"),
        ("r2", "gear*(torque - f2*gear*v2 - f3*sign(v2))"),
        ("determinant", "a11*a22 - a12*a12"),
        ("dv1", "(a22*r1 - a12*r2)/determinant"),
        ("dv2", "(a11*r2 - a12*r1)/determinant"),
    ]


def _dead(model: Model) -> bool:
    return bool(model.value("d1") or model.value("d2"))


_STRIBECK = "coulomb + (static - coulomb)*exp(-(v1/stribeck_speed)*(v1/stribeck_speed))"


def _half(name: str, sign: str) -> str:
    return f"({name}_positive {sign} {name}_negative)/2"


def _sided(name: str) -> str:
    """The value of a constant on the side to which the axis moves."""
    return f"{_half(name, '+')} + {_half(name, '-')}*s1"


def _term(further: Further) -> str:
    g = {
        DISPLACEMENT: f"(q1 - ({further.shift!r}))",
        WAVE: f"sin(({further.order!r})*q1 + ({further.shift!r}))",
        STRINGS: f"sin(q1)/sqrt(1 - ({further.order!r})*(1 - cos(q1)))",
        WEIGHT: "abs(cos(q1))",
    }.get(further.kind, "1")
    speed = "".join(
        ["*s1" if further.odd else "", "*abs(v1)" * int(further.power), "*sqrt(abs(v1))" if further.power % 1 else ""]
    )
    return f"({further.coefficient!r})*{g}{speed}"
