"""MJCF of MuJoCo: body and wheel as two joints whose mass matrix is a11, a12, a22.

The rotor turns N times as fast as the wheel. The inertia a11 - a12 of the body, a12 of the wheel and an armature of
a22 - a12 on the wheel's joint give equations (I) and (II) exactly. MuJoCo's `frictionloss` is a soft constraint: it
creeps where the rig sticks. Its damping has up to three coefficients since version 3.6: v, v|v| and v³.
"""

from __future__ import annotations

import re

from swingid.errors import UnanswerableError
from swingid.exchange.model import Model
from swingid.model.shapes import DISPLACEMENT

GRAVITY, LEVER = 9.80665, 0.1
"""Gravity (m/s²) and lever (m) of a point mass that makes the gravity torque; both are conventions of the file."""

TIMESTEP = 1e-3
ZERO = 1e-12
"""Mass (kg) of what has inertia only."""


def mass_and_lever(model: Model, inertia: float) -> tuple[float, float]:
    """Mass (kg) and lever (m) of a body with the gravity torque b whose own inertia stays positive: m l² <= own/2.

    own: moment of inertia about the axis (kg m²).
    """
    b = model.value("b")
    if b <= 0.0:
        return max(inertia, 1e-6), 0.0
    lever = min(LEVER, 0.5 * inertia * GRAVITY / b)
    return b / (GRAVITY * lever), lever


def comment(model: Model, left_out: list[str]) -> str:
    """The words of the model, and what is left out, as an XML comment."""
    lines = [*model.words, *(f"not in it: {omitted}" for omitted in left_out)]
    text = "\n  ".join(re.sub(r"-(?=-)", "- ", line) for line in lines)
    return f"<!--\n  {text}\n-->"


def body_inertia(model: Model) -> float:
    """a11 - a12 (kg m²), the inertia of the body without what turns with the wheel; positive."""
    inertia = model.value("a11") - (model.value("a12") if model.has_wheel else 0.0)
    if not inertia > 0.0:
        raise UnanswerableError(
            "the wheel with its gear has more inertia than the whole axis (a12 > a11), which no model of two bodies "
            "has; take python-control or simulink-m.",
            code="no-two-bodies",
        )
    return inertia


def unlike(model: Model) -> list[str]:
    """What neither MJCF nor URDF has of friction and motor."""
    p = model.value
    differing = []
    if p("static_positive") > p("coulomb_positive") or p("static_negative") > p("coulomb_negative"):
        differing.append("Stribeck's peak of the friction at rest")
    if p("viscous_positive") != p("viscous_negative") or p("coulomb_positive") != p("coulomb_negative"):
        differing.append("the difference of the friction between the directions (their mean is taken)")
    if p("offset"):
        differing.append(f"the constant torque of {p('offset'):.6g} (axis.friction.offset)")
    if model.has_wheel and (p("d1") or p("d2")):
        differing.append("the dead zone of the motor (8)")
    return differing


def mean_friction(model: Model) -> tuple[float, float]:
    """(viscous, Coulomb) friction of the axis, the mean of both directions."""
    p = model.value
    viscous = (p("viscous_positive") + p("viscous_negative")) / 2
    return viscous, (p("coulomb_positive") + p("coulomb_negative")) / 2


def _axis_joint(model: Model, left_out: list[str]) -> str:
    viscous, coulomb = mean_friction(model)
    damping = [viscous, model.value("quadratic"), model.value("cubic")]
    if any(coefficient < 0 for coefficient in damping):
        left_out.append("negative friction coefficients (0 is taken)")
        damping = [max(coefficient, 0.0) for coefficient in damping]
    while len(damping) > 1 and damping[-1] == 0.0:
        damping.pop()
    springs = [slot for slot in model.slots if slot.kind == DISPLACEMENT and slot.power == 0 and not slot.odd]
    left_out += model.drags
    if len(model.slots) - len(model.drags) > len(springs) or len(springs) > 1:
        left_out.append("further torques of the angle: cogging, strings, load-dependent friction")
    spring = f' stiffness="{springs[0].coefficient!r}" springref="{springs[0].shift!r}"' if springs else ""
    kind = 'type="slide" axis="1 0 0"' if model.linear else 'type="hinge" axis="0 -1 0"'
    return (
        f'<joint name="axis" {kind} damping="{" ".join(map(repr, damping))}" '
        f'frictionloss="{max(coulomb, 0.0)!r}"{spring}{_hard(coulomb)}/>'
    )


def _hard(dry: float) -> str:
    """The hardest dry friction that MuJoCo allows at this step."""
    return f' solreffriction="{2 * TIMESTEP!r} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"' if dry > 0 else ""


def mjcf(model: Model, name: str) -> tuple[str, list[str]]:
    """The MJCF text and what it cannot express."""
    left_out = unlike(model)
    inertia = body_inertia(model)
    mass, lever = (inertia, 0.0) if model.linear else mass_and_lever(model, inertia)
    centre = inertia - mass * lever**2
    joint = _axis_joint(model, left_out)
    dry = mean_friction(model)[1] > 0 or (model.has_wheel and model.value("f3") > 0)
    if dry:
        left_out.append("rest: frictionloss creeps where the rig sticks, and is close to Coulomb's law, not exact")
    inner = f"{centre!r} {centre!r} {centre!r}"
    limit = f' ctrllimited="true" ctrlrange="{-model.limit!r} {model.limit!r}"' if model.limit else ""
    wheel, drive = _wheel(model, limit)
    if model.rig.drive.channel in ("torque", "voltage"):
        drive = f'<general name="drive" joint="axis" gainprm="{model.value("direct")!r}"{limit}/>'
    lines = [
        f'<mujoco model="{name}">',
        comment(model, left_out),
        f'  <option timestep="{TIMESTEP!r}" integrator="RK4" gravity="0 0 -{GRAVITY!r}" tolerance="1e-14">',
        '    <flag contact="disable"/>',
        "  </option>",
        '  <compiler angle="radian" autolimits="true"/>',
        "  <worldbody>",
        '    <body name="body">',
        f"      {joint}",
        f'      <inertial pos="0 0 {-lever!r}" mass="{mass!r}" diaginertia="{inner}"/>',
        f'      <geom type="capsule" fromto="0 0 0 0 0 -{LEVER}" size="0.005" mass="0" contype="0" conaffinity="0"/>',
        *wheel,
        "    </body>",
        "  </worldbody>",
        *(["  <actuator>", f"    {drive}", "  </actuator>"] if drive else []),
        "  <sensor>",
        '    <jointpos name="angle" joint="axis"/>',
        *(['    <jointpos name="wheel_angle" joint="wheel"/>'] if wheel else []),
        "  </sensor>",
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n", left_out


def _wheel(model: Model, limit: str) -> tuple[list[str], str]:
    """The wheel as lines inside the body, and its motor, whose control is the voltage."""
    if not model.has_wheel:
        return [], ""
    p = model.value
    gear, a12 = p("gear"), p("a12")
    dry = abs(gear) * p("f3")
    lines = [
        '      <body name="wheel">',
        f'        <joint name="wheel" type="hinge" axis="0 -1 0" armature="{p("a22") - a12!r}" '
        f'damping="{gear**2 * p("f2")!r}" frictionloss="{dry!r}"{_hard(dry)}/>',
        f'        <inertial pos="0 0 0" mass="{ZERO!r}" diaginertia="{a12!r} {a12!r} {a12!r}"/>',
        '        <geom type="cylinder" size="0.03 0.003" euler="1.5707963267948966 0 0" mass="0" contype="0" '
        'conaffinity="0"/>',
        "      </body>",
    ]
    force, back = gear * p("eta") * p("c1"), gear * p("eta") * p("c2")
    drive = (
        f'<general name="voltage" joint="wheel" gainprm="{force!r}" biastype="affine" biasprm="0 0 {-back!r}"{limit}/>'
    )
    return lines, drive
