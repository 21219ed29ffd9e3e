"""Two results of ratios, without and with a body of known inertia: the scale, and both inertias.

A result of ratios has the inertia in units of an unknown constant X (a wire's stiffness k, the wheel's inertia, the
gain of a torque): s = J/X. With the known body s2 − s1 = J_k/X, so X = J_k/(s2 − s1), J1 = s1 X and J2 = s2 X.
"""

from __future__ import annotations

from swingid.errors import InputError, UnanswerableError
from swingid.format import percent
from swingid.model.terms import TERMS
from swingid.pooling.runs import Runs
from swingid.result.result import Message
from swingid.uncertainty.uncertain import Uncertain

GROWS = {"suspension_stiffness": "the stiffness of strings grows with the mass that hangs on them; weigh it instead"}
"""Constants that a body changes by being there, and what to do."""

WEIGHED = "gravity_torque"

HOPELESS = 0.3
"""Relative standard uncertainty of the difference above which it gives no scale."""


def reference_in(runs: Runs) -> str:
    """Name of the unknown constant X. Raises InputError where the two results have different ones."""
    first, second = runs.tare.leading, runs.loaded.leading
    if first != second:
        raise InputError(
            f"{runs.names[0]} gives {first} and {runs.names[1]} gives {second}; identify both logs with one rig.",
            code="different-rigs",
        )
    over, _, under = first.partition("/")
    return over if under == "inertia" else under


def scaled_by_body(runs: Runs, known: Uncertain) -> tuple[dict[str, tuple[Uncertain, str]], list[Message]]:
    """X and the inertias of both runs with their units, by name, and notes.

    known: the inertia of the body about the axis. Raises UnanswerableError where the difference is lost in its
    uncertainty, or where the body itself changes X.
    """
    name, unit = reference_in(runs), "kg m^2"
    if name in GROWS:
        raise UnanswerableError(f"a known body gives no scale here: {GROWS[name]}.", code="no-scale")
    leading = runs.tare.leading
    ratios = [values[leading] for values in runs.values(leading)]
    one, two = ratios if leading.startswith("inertia/") else [1 / ratio for ratio in ratios]
    apart = two - one
    if apart.value <= 0 or apart.u > HOPELESS * apart.value:
        raise UnanswerableError(
            f"the body changes {leading} by less than its uncertainty, or the wrong way; check which result "
            "is which, or add a body of more inertia.",
            code="difference-lost",
        )
    scale = known / apart
    found = {
        name: (scale, TERMS[name].unit if name in TERMS else "N m"),
        "tare_inertia": (one * scale, unit),
        "loaded_inertia": (two * scale, unit),
    }
    text = f"the body is {percent(known.value / found['tare_inertia'][0].value)} of the inertia without it"
    if name == WEIGHED:
        text += "; the gravity torque is taken as equal in both runs, so the body's centre must be on the axis"
    return found, [Message("scale-by-body", f"{text}.")]
