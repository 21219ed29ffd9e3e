"""CasADi: multiple shooting with a Gauss-Newton Hessian for IPOPT, after its manual's example on identification."""

from __future__ import annotations

import numpy as np
from problem import SCALE, START, Log, slope

NAME, PACKAGES = "CasADi, multiple shooting, Gauss–Newton in IPOPT", ("casadi",)

MOST = 30
"""Iterations: at the jumps of dry friction the gaps never close to IPOPT's tolerance; J1 stands still before these."""


def fit(log: Log) -> float:
    import casadi as ca

    x, u, theta = ca.MX.sym("x", 4), ca.MX.sym("u"), ca.MX.sym("theta", 3)
    scaled = [SCALE[k] * theta[k] for k in range(3)]
    right = ca.Function("right", [x, u, theta], [ca.vertcat(*slope(ca, ca.vertsplit(x), u, tuple(scaled), log.motor))])
    h = log.step
    k1 = right(x, u, theta)
    k2 = right(x + h / 2 * k1, u, theta)
    k3 = right(x + h / 2 * k2, u, theta)
    k4 = right(x + h * k3, u, theta)
    one = ca.Function("one", [x, u, theta], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)]).expand()

    rows = len(log.time)
    states = ca.MX.sym("X", 4, rows)
    ends = one.map(rows)(states, log.voltage[None, :], ca.repmat(theta, 1, rows))
    gaps = ends[:, :-1] - states[:, 1:]
    errors = ca.vec((states[[0, 2], :] - log.angles.T) / log.noise)
    unknown = ca.veccat(theta, states)
    nlp = {"x": unknown, "f": 0.5 * ca.dot(errors, errors), "g": ca.vec(gaps)}

    jacobian = ca.jacobian(errors, unknown)
    sigma, multipliers = ca.MX.sym("sigma"), ca.MX.sym("lambda", nlp["g"].size1())
    hessian = sigma * ca.triu(ca.mtimes(jacobian.T, jacobian))
    gauss_newton = ca.Function(
        "hess_lag", {"x": unknown, "lam_f": sigma, "lam_g": multipliers, "triu_hess_gamma_x_x": hessian},
        ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
    )  # fmt: skip
    options = {"hess_lag": gauss_newton, "ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
    options["ipopt.max_iter"] = MOST
    solver = ca.nlpsol("solver", "ipopt", nlp, options)
    speeds = np.gradient(log.angles, log.time, axis=0)
    first = np.column_stack([log.angles[:, 0], speeds[:, 0], log.angles[:, 1], speeds[:, 1]])
    found = solver(x0=np.concatenate([np.array(START) / SCALE, first.ravel()]), lbg=0, ubg=0)
    return float(SCALE[0] * found["x"][0])
