"""J/b of a pendulum on a servo that lets go: simulation error of the free part, three laws of friction.

    python drop_fit.py LOG.json [B]

LOG.json is a log of the Better Actuator Models format ("entries" with timestamp, position, torque_enable). From 30 ms
after torque_enable falls to the last turning point that stands out of the rest, q'' = -(sin(q - q0) + F(q'))/(J/b) is
simulated; unknown are J/b, q0, the start and the friction: Coulomb and viscous; the same with Coulomb friction in
proportion to |cos q|; Coulomb and quadratic. Prints J/b in s^2 of each and, with b in N m, J in kg m^2.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import odeint
from scipy.optimize import least_squares

G = "coulomb+viscous", "coulomb+viscous+load", "coulomb+quadratic"


def free_part(path):
    rows = json.loads(Path(path).read_text())["entries"]
    t = np.array([r["timestamp"] for r in rows])
    q = np.array([r["position"] for r in rows])
    on = np.array([r["torque_enable"] for r in rows])
    keep = (~on) & (t > t[~on][0] + 0.03) & (np.abs(q) < 2.5)
    t, q = t[keep], q[keep]
    rest = np.median(q[t > t[-1] - 0.5])
    still = np.flatnonzero(np.abs(q - rest) > 0.02)[-1]
    return t[: still + 1] - t[0], q[: still + 1]


def fit(t, q, law):
    def run(p):
        k, q0, c0, c1, c2, a, v = p
        fine = np.arange(0, t[-1] + 2e-3, 2e-3)

        def rate(y, _):
            s = np.tanh(y[1] / 0.02)
            f = c0 * s
            f += {0: c1 * y[1], 1: c1 * y[1] + c2 * abs(np.cos(y[0])) * s, 2: c1 * y[1] * abs(y[1])}[law]
            return y[1], -(np.sin(y[0] - q0) + f) / k

        return np.interp(t, fine, odeint(rate, (a, v), fine, hmax=4e-3)[:, 0]) - q

    start = (0.015, 0.0, 0.02, 0.02, 0.0, q[0], 0.0)
    low = (0.003, -0.3, 0, 0, 0, -4, -20)
    high = (0.2, 0.3, 0.6, 1, 0.6 if law == 1 else 1e-9, 4, 20)
    return least_squares(run, start, bounds=(low, high), x_scale=(0.005, 0.05, 0.05, 0.05, 0.05, 0.1, 1))


if __name__ == "__main__":
    t, q = free_part(sys.argv[1])
    b = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    for law in range(3):
        s = fit(t, q, law)
        print(f"{G[law]:22s} J/b {s.x[0]:.5f} s^2  J {b * s.x[0]:.5f}  rms {np.sqrt(2 * s.cost / len(t)):.4f} rad")
