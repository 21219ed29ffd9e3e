"""URDF: links with mass, centre of mass and inertia, joints with viscous and Coulomb friction.

Only the inertia about the axis is identified. The other elements of the tensor are set equal to it, which a motion
about this axis does not see.
"""

from __future__ import annotations

from swingid.exchange.mjcf import body_inertia, comment, mass_and_lever, mean_friction, unlike
from swingid.exchange.model import Model

SMALL = 1e-6
"""Mass (kg) of the wheel: its true one is part of the gravity torque."""


def urdf(model: Model, name: str) -> tuple[str, list[str]]:
    """The URDF text and what it cannot express."""
    left_out = unlike(model)
    inertia = body_inertia(model)
    mass, lever = (inertia, 0.0) if model.linear else mass_and_lever(model, inertia)
    viscous, coulomb = mean_friction(model)
    for word, key in (("quadratic", "quadratic"), ("cubic", "cubic")):
        if model.value(key):
            left_out.append(f"{word} friction")
    left_out += model.drags
    if len(model.slots) > len(model.drags):
        left_out.append("further torques of the angle: springs, cogging, strings, load-dependent friction")
    left_out.append("elements of the inertia tensor about other axes: they are set equal to the identified one")
    kind = "prismatic" if model.linear else "continuous"
    limit = '\n    <limit lower="-1" upper="1" effort="1000" velocity="100"/>' if model.linear else ""
    axis = "1 0 0" if model.linear else "0 -1 0"
    parts = [
        '<link name="base"/>',
        _link("body", mass, lever, inertia - mass * lever**2),
        f'<joint name="axis" type="{kind}">\n    <parent link="base"/>\n    <child link="body"/>\n'
        f'    <axis xyz="{axis}"/>{limit}\n    <dynamics damping="{max(viscous, 0.0)!r}" '
        f'friction="{max(coulomb, 0.0)!r}"/>\n  </joint>',
    ]
    if model.has_wheel:
        p = model.value
        gear = p("gear")
        if p("a22") != p("a12"):
            left_out.append(
                f"the rotor behind its gear: an inertia of {p('a22') - p('a12'):.6g} kg m^2 on the wheel's joint "
                "(armature)"
            )
        left_out.append("the motor: torque on the wheel's joint is N (eta (c1 u - c2 q2')), see the comment")
        parts += [
            _link("wheel", SMALL, 0.0, p("a12")),
            f'<joint name="wheel" type="continuous">\n    <parent link="body"/>\n    <child link="wheel"/>\n'
            f'    <axis xyz="{axis}"/>\n    <dynamics damping="{gear**2 * p("f2")!r}" '
            f'friction="{abs(gear) * p("f3")!r}"/>\n  </joint>',
        ]
    constants = ", ".join(f"{key} = {value!r}" for key, value in model.constants.items())
    head = comment(model, left_out).replace("-->", f"  constants: {constants}\n-->")
    body = "\n  ".join(parts)
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n{head}\n  {body}\n</robot>\n', left_out


def _link(name: str, mass: float, lever: float, inertia: float) -> str:
    return (
        f'<link name="{name}">\n    <inertial>\n      <origin xyz="0 0 {-lever!r}"/>\n      <mass value="{mass!r}"/>\n'
        f'      <inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/>\n'
        "    </inertial>\n  </link>"
    )
