"""python-control: plant and compensator as nonlinear systems in discrete time, interconnected, input_output_response.

The package has no loops of mixed time, and interpolates inputs linearly; so the plant, too, is given in discrete time,
as one Runge-Kutta step under the held voltage.
"""

from __future__ import annotations

import numpy as np
from problem import motor, read, slope

import swingid as sw

NAME, PACKAGES = "python-control, discrete-time systems", ("control",)


def closed_loop(rig: sw.Rig, reference: np.ndarray, rate: float) -> np.ndarray:
    """Readings and voltage (rows, 3) of the loop."""
    import control as ct

    m, h, law = motor(rig), 1.0 / rate, rig.axis.friction
    coulomb = law.coulomb.value if law.coulomb else 0.0
    theta = (rig.axis.inertia.value, law.viscous.value, coulomb)

    def right(x: np.ndarray, u: float) -> np.ndarray:
        return np.array(slope(np, x, u, theta, m))

    def following(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        k1 = right(x, u[0])
        k2 = right(x + h / 2 * k1, u[0])
        k3 = right(x + h / 2 * k2, u[0])
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + right(x + h * k3, u[0]))

    controller = sw.Compensator.paper(rig)

    def command(t: float, state: np.ndarray, u: np.ndarray, params: dict) -> float:
        return controller.step(t, (u[0], u[1], u[2]), state)[0]

    def adapted(t: float, state: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        return controller.step(t, (u[0], u[1], u[2]), state)[1]

    first = controller.initial_state(0.0)
    plant = ct.nlsys(
        following, lambda t, x, u, params: read(x[[0, 2]], rig),
        name="plant", states=4, inputs=["u"], outputs=["q1", "q2"], dt=h,
    )  # fmt: skip
    compensator = ct.nlsys(
        adapted, command, name="compensator", states=len(first), inputs=["ym", "q1", "q2"], outputs=["u"], dt=h
    )
    loop = ct.interconnect([plant, compensator], inputs=["ym"], outputs=["q1", "q2", "u"])
    time = np.arange(len(reference)) * h
    response = ct.input_output_response(loop, time, reference, np.concatenate([np.zeros(4), first]))
    return response.outputs.T
