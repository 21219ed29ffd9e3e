"""An independent motion of the rig: scipy's solve_ivp with events, modes by Gauss's principle. Slow, for tests.

It shares no code with the twin: constants by name, mass matrix solved by numpy, rest decided by minimising
1/2 a'Ma - a'r + sum of release torque |a| over the accelerations of what has no speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class Body:
    """Constants under the paper's letters; a12 = 0 and wheel = False without a wheel."""

    a11: float
    a12: float = 0.0
    a22: float = 1.0
    b: float = 0.0
    gear: float = 0.0
    c1: float = 0.0
    c2: float = 0.0
    eta: float = 1.0
    d1: float = 0.0
    d2: float = 0.0
    f2: float = 0.0
    f3: float = 0.0
    wheel: bool = True
    direct: bool = False
    viscous: float = 0.0
    coulomb: float = 0.0
    static: float = 0.0
    vs: float = 0.0
    quadratic: float = 0.0
    cubic: float = 0.0
    sigma0: float = 0.0
    sigma1: float = 0.0
    stiffness: float = 0.0
    zero: float = 0.0
    cogging: float = 0.0
    order: float = 1.0
    phase: float = 0.0
    load: float = 0.0
    drag: float = 0.0

    def release(self, q1):
        dry = max(self.static, self.coulomb) + self.load * abs(math.cos(q1))
        return (0.0 if self.sigma0 else dry), self.gear * self.f3

    def level(self, v):
        if self.static <= self.coulomb or self.vs == 0.0:
            return self.coulomb
        return self.coulomb + (self.static - self.coulomb) * math.exp(-((v / self.vs) ** 2))

    def motor(self, u, v2):
        m = self.eta * (self.c1 * u - self.c2 * v2)
        return m - self.d1 if m > self.d1 else m - self.d2 if m < self.d2 else 0.0

    def loads(self, y, u, s1, s2):
        """Right-hand sides of (I) and (II) without the dry friction of what rests."""
        q1, v1, _, v2, z = y
        r1 = (u if self.direct else 0.0) - self.b * math.sin(q1)
        r1 -= self.stiffness * (q1 - self.zero) + self.cogging * math.sin(self.order * q1 + self.phase)
        r1 -= s1 * self.load * abs(math.cos(q1))
        r1 -= self.viscous * v1 + self.quadratic * v1 * abs(v1) + self.cubic * v1**3
        r1 -= self.drag * v1 * math.sqrt(abs(v1))
        if self.sigma0:
            r1 -= self.sigma0 * z + self.sigma1 * self.bristle(v1, z)
        else:
            r1 -= s1 * self.level(v1)
        r2 = 0.0
        if self.wheel:
            r2 = self.gear * (self.motor(u, v2) - self.f2 * self.gear * v2 - self.f3 * s2)
        return np.array([r1, r2])

    def bristle(self, v1, z):
        return v1 - self.sigma0 * abs(v1) / self.level(v1) * z if self.sigma0 else 0.0

    def accelerations(self, y, u, s1, s2, rests):
        mass = np.array([[self.a11, self.a12], [self.a12, self.a22]])
        r, a = self.loads(y, u, s1, s2), np.zeros(2)
        free = [i for i in range(2) if not rests[i]]
        if free:
            a[free] = np.linalg.solve(mass[np.ix_(free, free)], r[free])
        return a, r - mass @ a

    def decide(self, y, u):
        """(s1, s2), 0 for rest: by Gauss's principle, coordinate by coordinate until nothing changes."""
        v = np.array([y[1], y[3]])
        s = np.sign(v)
        r = self.loads(y, u, *s)
        mass = np.array([[self.a11, self.a12], [self.a12, self.a22]])
        a = np.zeros(2)
        for _ in range(400):
            for i in range(2):
                if i == 1 and not self.wheel:
                    continue
                pull = r[i] - mass[i, 1 - i] * a[1 - i]
                slack = self.release(y[0])[i] if v[i] == 0.0 else 0.0
                a[i] = math.copysign(max(abs(pull) - slack, 0.0), pull) / mass[i, i]
        return tuple(int(s[i]) if v[i] != 0.0 else int(np.sign(a[i])) for i in range(2))


def motion(body, commands, period, y0, method="DOP853", rtol=1e-10):
    """States (n + 1, 5) at the instants 0, period, ... under held commands (n,); speeds are exactly 0 at rest."""
    y = np.array([*y0, 0.0])
    states = [y]
    for u in commands:
        y = _held(body, float(u), period, y, method, rtol)
        states.append(y)
    return np.array(states)


def _watched(body, u, sides, rests):
    """Terminal event functions by kind: speeds that pass zero, holding torques that pass their release."""

    def slack(i):
        return lambda _, x: body.release(x[0])[i] - abs(body.accelerations(x, u, *sides, rests)[1][i])

    def speed(i):
        return lambda _, x: x[2 * i + 1]

    watched = {}
    for i, name in enumerate(("axis", "wheel")):
        if sides[i] != 0:
            watched[f"stop {name}"] = speed(i)
            watched[f"stop {name}"].direction = -sides[i]
        elif rests[i] and (i == 0 or body.wheel):
            watched[f"release {name}"] = slack(i)
            watched[f"release {name}"].direction = -1
    for function in watched.values():
        function.terminal = True
    return watched


def _held(body, u, period, y, method, rtol):
    t, sides = 0.0, body.decide(y, u)
    while t < period:
        s1, s2 = sides
        rests = (s1 == 0 and body.release(y[0])[0] > 0.0, s2 == 0)

        def slope(_, x, s1=s1, s2=s2, rests=rests):
            a = body.accelerations(x, u, s1, s2, rests)[0]
            return [x[1], a[0], x[3], a[1], body.bristle(x[1], x[4])]

        watched = _watched(body, u, sides, rests)
        done = solve_ivp(slope, (t, period), y, method=method, rtol=rtol, atol=1e-13, events=list(watched.values()))
        t, y = float(done.t[-1]), done.y[:, -1].copy()
        if done.status != 1:
            return y
        kind = next(kind for kind, times in zip(watched, done.t_events, strict=True) if len(times))
        y[1], y[3] = (0.0 if kind == "stop axis" else y[1]), (0.0 if kind == "stop wheel" else y[3])
        hold = body.accelerations(y, u, s1, s2, rests)[1]
        sides = body.decide(y, u)
        # At the brink of release rounding decides; what was released goes where it was pulled.
        if kind == "release axis":
            sides = (int(np.sign(hold[0])), sides[1])
        if kind == "release wheel":
            sides = (sides[0], int(np.sign(hold[1])))
    return y
