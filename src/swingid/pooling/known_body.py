"""Two results of ratios, without and with a body of known inertia: the scale, and both inertias.

A result of ratios has the inertia in units of an unknown constant X (a wire's stiffness k, the wheel's inertia, the
gain of a torque): s = J/X. With the known body s2 − s1 = J_k/X, so X = J_k/(s2 − s1), J1 = s1 X and J2 = s2 X.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from swingid.balance.identifiability import HOPELESS
from swingid.errors import InputError, UnanswerableError
from swingid.format import percent
from swingid.model.terms import TERMS
from swingid.pooling.runs import GRAVITY, Runs
from swingid.result.data import TARE
from swingid.result.result import Message
from swingid.uncertainty.freedom import COVERAGE_FACTOR
from swingid.uncertainty.uncertain import Uncertain
from swingid.units import Quantity

TORQUE, WHEEL, GAIN = "drive.motor.torque_per_volt", "drive.wheel.inertia", "log.torque_gain"

EFFICIENCY, ROTOR, GEAR = "drive.motor.efficiency", "drive.motor.rotor_inertia", "drive.motor.gear_ratio"

GROWS = {"suspension_stiffness": "the stiffness of strings grows with the mass that hangs on them; weigh it instead"}
"""Constants that a body changes by being there, and what to do."""

WEIGHED = "gravity_torque"

WEAK = 1e-3
"""A body whose difference depends on the scale by less than this share of itself calibrates nothing."""

Found = dict[str, tuple[Uncertain, str]]
"""Values with their units, by name."""


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


def scaled_by_body(runs: Runs, known: Uncertain) -> tuple[Found, list[Message]]:
    """X and the inertias of both runs with their units, by name, and notes.

    known: the inertia of the body about the axis. Raises UnanswerableError where the difference is lost in its
    uncertainty, or where the body itself changes X.
    """
    name, unit = reference_in(runs), "kg m^2"
    if name in GROWS:
        raise UnanswerableError(f"a known body gives no scale here: {GROWS[name]}.", code="no-scale")
    leading = runs.tare.leading
    ratios = [values[leading] for values in runs.values(leading)]
    first, second = ratios if leading.startswith("inertia/") else [1 / ratio for ratio in ratios]
    apart = second - first
    if apart.value <= 0 or apart.u > HOPELESS * apart.value:
        raise UnanswerableError(
            f"the body changes {leading} by less than its uncertainty, or the wrong way; check which result "
            "is which, or add a body of more inertia.",
            code="difference-lost",
        )
    scale = known / apart
    results = {
        TARE: (first * scale, unit),
        name: (scale, TERMS[name].unit if name in TERMS else "N m"),
        "loaded_inertia": (second * scale, unit),
    }
    text = f"the body is {percent(known.value / results[TARE][0].value)} of the inertia without it"
    if name == WEIGHED:
        text += "; the gravity torque is taken as equal in both runs, so the body's centre must be on the axis"
    return results, [Message("scale-by-body", f"{text}.")]


LEVERS = {
    TORQUE: ("eta c1", "torque_per_volt", "N m/V", (TORQUE, EFFICIENCY)),
    WHEEL: ("a12", "wheel_inertia", "kg m^2", (WHEEL, ROTOR, GEAR, "drive.wheel.tilt")),
    GAIN: (GAIN, "torque_gain", "", (GAIN,)),
    GRAVITY: (GRAVITY, "axis_gravity_torque", "N m", (GRAVITY, "axis.tilt")),
}
"""Constants that can be the scale reference, the first that applies: name, parameter, unit, keys of its errors."""


@dataclass(frozen=True)
class Lever:
    """The scale reference: its name, its key and the unit of what is corrected, the corrected value.

    parts: keys whose errors are errors of the scale. size: change of the constant `key` per unit of δ. slopes: s_1,
    s_2, change of each inertia per unit of δ. stated: relative standard uncertainty by the rig file (0: exact).
    """

    key: str
    name: str
    parameter: str
    unit: str
    parts: tuple[str, ...]
    value: float
    size: float
    slopes: tuple[float, float]
    stated: float


def calibrated(
    runs: Runs, inertias: tuple[Uncertain, Uncertain], known: Uncertain
) -> tuple[Found, list[Message], list[Message]]:
    """The scale corrected so that the difference of the `inertias` (tare, loaded) is the `known` one.

    Returns values with their units by name; warnings and notes. Raises UnanswerableError where the results do not state
    their scale reference, or the difference does not depend on it.
    """
    lever = find_lever(runs)
    tare, loaded = inertias
    reach = lever.slopes[1] - lever.slopes[0]
    if abs(reach) < WEAK * abs(loaded.value - tare.value):
        raise UnanswerableError(
            f"the difference of the two runs hardly depends on {lever.name}, so a known body does not calibrate it; "
            "drive both runs away from resonance.",
            code="no-scale",
        )
    delta = (known - loaded + tare) / reach
    of_body = delta.only(lambda key: key not in lever.parts)
    values = {
        "scale_factor": (1 + of_body, ""),
        lever.parameter: (lever.value + lever.size * of_body, lever.unit),
        "tare_inertia": (tare + lever.slopes[0] * delta, runs.unit),
        "loaded_inertia": (loaded + lever.slopes[1] * delta, runs.unit),
    }
    return {name: (_seen(value), unit) for name, (value, unit) in values.items()}, *_size_of(lever, of_body)


def _seen(value: Uncertain) -> Uncertain:
    """The same without what cancels but for its rounding."""
    least = 1e-9 * value.u
    return value.only(lambda key: abs(value.shifts[key]) > least)


def _size_of(lever: Lever, delta: Uncertain) -> tuple[list[Message], list[Message]]:
    """The size of the correction, as a note, or as a warning where it is more than its uncertainties explain."""
    size = f"{percent(delta.value, sign=True)} ± {percent(delta.u)}"
    stated = f"stated to {percent(lever.stated)}" if lever.stated else "taken as exact"
    if abs(delta.value) > COVERAGE_FACTOR * math.hypot(lever.stated, delta.u):
        text = (
            f"the known body corrects {lever.name} by {size}, but rig.toml has it {stated}; check the body, its "
            f"place and {lever.key} before you use the corrected numbers."
        )
        return [Message("scale-correction", text)], []
    text = f"the known body corrects {lever.name} by {size}; rig.toml has it {stated}"
    if lever.stated and lever.stated < delta.u:
        text += ", which is a smaller uncertainty than this body gives"
    return [], [Message("scale-correction", text + ".")]


def find_lever(runs: Runs) -> Lever:
    """The scale reference of both runs."""
    constants = runs.tare.origin.constants
    for key, words in LEVERS.items():
        pair, known = _slopes(runs, key), constants.get(key)
        if pair is None or known is None or not known.value or (key == GRAVITY and key in runs.apart):
            continue
        stated = known.uncertain(key)
        size = stated.value
        if key == TORQUE:
            stated *= constants.get(EFFICIENCY, Quantity(1.0)).uncertain(EFFICIENCY)
        elif key == WHEEL:
            rotor, gear = constants.get(ROTOR, Quantity(0.0)), constants.get(GEAR, Quantity(1.0))
            stated += gear.uncertain(GEAR) * rotor.uncertain(ROTOR)
            size = stated.value
        return Lever(key, *words, known.value, size, (size * pair[0], size * pair[1]), stated.u / stated.value)
    raise UnanswerableError(
        f"{runs.names[0]} and {runs.names[1]} do not state their scale reference, so a known body calibrates nothing; "
        "identify both again, with an uncertainty of drive.wheel.inertia in the rig file.",
        code="no-scale",
    )


def _slopes(runs: Runs, key: str) -> tuple[float, float] | None:
    """Change of the inertia of each run per unit of a constant; None where one has none."""
    slopes = []
    for result in runs.each:
        slope = result.sensitivities.get(key)
        for entry in result.budget:
            if slope is None and entry.parameter == "inertia" and entry.shared_id == key:
                slope = entry.sensitivity
        if not slope:
            return None
        slopes.append(slope)
    return slopes[0], slopes[1]
