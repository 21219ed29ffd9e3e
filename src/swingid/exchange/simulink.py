"""A MATLAB function of the state derivative, for a MATLAB Function block of Simulink, `ode45` and `nlgreyest`."""

from __future__ import annotations

from swingid.exchange.equations import DRY, right_hand_side, states
from swingid.exchange.model import Model
from swingid.exchange.python_control import left_out

FILE = """function [dx, A, B] = {name}(x, u, p)
%{upper}  Derivative of the states {states} under the input u.
{words}
%
%   dx = {name}(x, u)          for a MATLAB Function block (an Integrator with the states behind it) and for ode45:
%                              [t, x] = ode45(@(t, x) {name}(x, 0), [0 5], [{start}])
%   p = {name}()               the constants as a struct
%   dx = {name}(x, u, p)       with changed constants
%   [dx, A, B] = {name}(x, 0)  the state space about x, with viscous friction only: sys = ss(A, B, eye({count}), 0)
    if nargin < 3
        p = constants();
    end
    if nargin == 0
        dx = p;
        return
    end
    dx = derivative(x, u, p);
    if nargout > 1
        {dry}
        step = 1e-6;
        A = zeros({count});
        for k = 1:{count}
            e = zeros({count}, 1);
            e(k) = step;
            A(:, k) = (derivative(x(:) + e, u, p) - derivative(x(:) - e, u, p)) / (2 * step);
        end
        B = (derivative(x, u + step, p) - derivative(x, u - step, p)) / (2 * step);
    end
end

function dx = derivative(x, u, p)
{unpack}
{lines}
    dx = [{derivative}];
end

function p = constants()
{constants}
end
"""


def simulink(model: Model, name: str) -> tuple[str, list[str]]:
    """The text of the function file and what it cannot express."""
    equations, constants = states(model), model.constants
    text = FILE.format(
        name=name,
        upper=name.upper(),
        states=", ".join(equations),
        words="\n".join(f"%   {line}" for line in model.words),
        start="; ".join(["0.5", *("0" for _ in equations[1:])]),
        count=len(equations),
        dry="\n        ".join(f"p.{key} = 0;" for key in DRY if key in constants),
        unpack="\n".join(
            [
                *(f"    {key} = x({k});" for k, key in enumerate(equations, 1)),
                *(f"    {key} = p.{key};" for key in constants),
            ]
        ),
        lines="\n".join(f"    {key} = {expression};" for key, expression in right_hand_side(model)),
        derivative="; ".join(["v1", "dv1", "v2", "dv2"] if model.has_wheel else ["v1", "dv1"]),
        constants="\n".join(f"    p.{key} = {value!r};" for key, value in constants.items()),
    )
    return text, left_out(model)
