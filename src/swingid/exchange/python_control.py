"""A Python module for python-control: the nonlinear system, and its linearisation about any angle."""

from __future__ import annotations

from swingid.exchange.equations import DRY, right_hand_side, states
from swingid.exchange.model import Model

LEFT_OUT = "rest: dry friction is a torque against the sign of the speed, so the model creeps where the rig sticks"

FILE = '''"""{words}

system: nonlinear, input u ({input}), states and outputs {states}.
linear(angle): about rest at an angle, with viscous friction only.
"""

import control
from numpy import abs, array, cos, exp, sign, sin, sqrt  # noqa: A004, F401

PARAMETERS = {parameters}
DRY = {dry}


def update(t, x, u, params):
    """Derivative of the states; params replaces constants of PARAMETERS."""
    p = {{**PARAMETERS, **params}}
    {unpack}
    {states_tuple} = x
    u = u[0]
{lines}
    return array([{derivative}])


system = control.nlsys(
    update,
    lambda t, x, u, params: x,
    inputs=["u"],
    outputs={states!r},
    states={states!r},
    params=PARAMETERS,
    name={name!r},
)


def linear(angle=0.0):
    """The state space about rest at an angle, as control.StateSpace: 0 hangs, pi stands upright."""
    params = {{**PARAMETERS, **{{key: 0.0 for key in DRY}}}}
    return control.linearize(system, [angle] + [0.0] * {others}, [0.0], params=params)
'''


def python_control(model: Model, name: str) -> tuple[str, list[str]]:
    """The text of the module and what it cannot express."""
    names = states(model)
    equations = right_hand_side(model)
    words = "\n".join(model.words).replace("\\", "/").replace('"""', "'''")
    constants = model.constants
    dry = [key for key in DRY if key in constants]
    text = FILE.format(
        words=words,
        input="V" if model.limit is not None or model.has_wheel else "torque, N m" if not model.linear else "N",
        states=names,
        states_tuple=", ".join(names),
        parameters="{\n" + "".join(f'    "{key}": {value!r},\n' for key, value in constants.items()) + "}",
        dry=dry,
        unpack="\n    ".join(f'{key} = p["{key}"]' for key in constants),
        lines="\n".join(f"    {key} = {expression}" for key, expression in equations),
        derivative=", ".join(["v1", "dv1", "v2", "dv2"] if model.has_wheel else ["v1", "dv1"]),
        name=name,
        others=len(names) - 1,
    )
    return text, left_out(model)


def left_out(model: Model) -> list[str]:
    """What the equations lack: rest, where the rig has dry friction."""
    return [LEFT_OUT] if any(model.constants.get(key) for key in DRY) else []
