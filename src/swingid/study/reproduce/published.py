"""What the paper prints: the numbers of section 5 beside which a reproduction stands; and what TOML files here state.

`J_E_PRINTED` of NLS, 118.4, is a misprint: 381.0 - 272.6 = 108.4, which is the 12 % of the text. 405.1 and 381.0 are
printed as a11', but 405.1 - 302.2 = 102.9 takes them for J1 + J_e (see docs/paper.md).
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

J1 = {"proposed": 302.2e-5, "nls": 272.6e-5}
"""J1^ without the body, kg m^2."""

A11_BODY = {"proposed": 405.1e-5, "nls": 381.0e-5}
"""Printed as a11'^, with the body, kg m^2."""

J_E_PRINTED = {"proposed": 102.9e-5, "nls": 118.4e-5}
"""Printed as J_e^, kg m^2 (the paper leaves out the 10^-5)."""

J_E = 96.1e-5
"""Known inertia of the test body about O, kg m^2."""

J_E_ERROR = {"proposed": 7.0, "nls": 12.0}
"""Errors of J_e^ in the text, per cent."""

F1 = 26e-5
"""f1 of the simulation, N m s; the bearing has f1 / i, 4.4 times that."""

SIMULATION_ERROR = 1.4
"""Average error of J1^ in the ideal simulation of Fig. 7, per cent."""

TIMES = (9.023, 9.413, 9.433, 9.823)
"""t10, t11, t20, t21 of the ideal simulation, s."""

SERIES = (15.0, 22.0)
"""Part of the experiment in which the intervals lie "in series", s."""

BACKSTEPPING = (5.0, 8.0)
"""Fig. 8: within so many per cent after so many seconds."""

FIG8 = 2.0
"""Frequency of the run that looks like Fig. 8, which the paper does not print (inferred), rad/s."""

AMPLITUDE, FREQUENCIES = 0.8, {"plain": 8.5, "body": 6.0, "balanced": 2.0}
"""Program motions y_m1, y_m2, y_m3: 0.8 rad, and rad/s."""


@cache
def stated_in(name: str) -> dict[str, Any]:
    """The tables of a TOML file beside this one: its words and its cases."""
    return tomllib.loads((files("swingid.study.reproduce") / f"{name}.toml").read_text(encoding="utf-8"))
