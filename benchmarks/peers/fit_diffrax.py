"""JAX: diffrax steps under the held voltage in a scan, fitted by Levenberg-Marquardt of optimistix, derivatives by JAX.

The voltage jumps at every sample, so the steps are taken by hand from sample to sample, as the manual's "manual
stepping" shows, and the fit is that of the optimistix example on a parameterised ODE.
"""

from __future__ import annotations

import numpy as np
from problem import SCALE, START, Log, slope

NAME, PACKAGES = "JAX, diffrax and optimistix", ("jax", "diffrax", "optimistix")


def fit(log: Log) -> float:
    import jax

    jax.config.update("jax_enable_x64", True)
    import diffrax
    import jax.numpy as jnp
    import optimistix

    voltage, readings = jnp.asarray(log.voltage), jnp.asarray(log.angles)
    scale = jnp.asarray(SCALE)

    def right(t: float, x: object, args: tuple) -> object:
        theta, u = args
        return jnp.stack(slope(jnp, tuple(x), u, tuple(theta), log.motor))

    term, solver, h = diffrax.ODETerm(right), diffrax.Tsit5(scan_kind="lax"), log.step

    def predicted(unknown: object) -> object:
        theta, first = scale * unknown[:3], unknown[3:]

        def sample(x: object, u: object) -> tuple:
            args = (theta, u)
            state = solver.init(term, 0.0, h, x, args)
            following, _, _, _, _ = solver.step(term, 0.0, h, x, args, state, made_jump=True)
            return following, x

        return jax.lax.scan(sample, first, voltage)[1][:, jnp.array([0, 2])]

    def residuals(unknown: object, args: object) -> object:
        return ((predicted(unknown) - readings) / log.noise).ravel()

    first = jnp.concatenate([jnp.asarray(START) / scale, jnp.asarray(log.first_state)])
    search = optimistix.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    found = optimistix.least_squares(residuals, search, first, options={"jac": "fwd"}, max_steps=200, throw=False)
    return float(np.asarray(SCALE[0] * found.value[0]))
