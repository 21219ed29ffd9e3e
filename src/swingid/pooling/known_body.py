"""A body of known inertia as a second scale: what the two runs say of the constant that sets the first one.

The inertia of a run is linear in the constant c that sets its scale (a12 for momentum; η c1 where the motor's torque
does it): J_k(c (1 + δ)) = J_k + s_k δ with s_k = c ∂J_k/∂c. A body of known inertia J_e asks
(J_2 + s_2 δ) − (J_1 + s_1 δ) = J_e, which gives δ, and both runs are corrected by it. Errors of the constant itself
cancel in the corrected inertias; those of everything else are carried through.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from swingid.errors import UnanswerableError
from swingid.format import percent
from swingid.pooling.runs import GRAVITY, Runs
from swingid.pooling.shares import Estimate, sum_of
from swingid.result.result import COVERAGE_FACTOR, BudgetEntry, Message, Parameter

TORQUE, WHEEL, GAIN = "drive.motor.torque_per_volt", "drive.wheel.inertia", "log.torque_gain"
EFFICIENCY, ROTOR, GEAR = "drive.motor.efficiency", "drive.motor.rotor_inertia", "drive.motor.gear_ratio"

WEAK = 1e-3
"""A body whose difference leans on the scale by less than this share of itself calibrates nothing."""


@dataclass(frozen=True)
class Lever:
    """The constant that sets the scale: its name, its key and the unit of what is corrected, the corrected value.

    size: change of the constant `key` per unit of δ. slopes: s_1, s_2, change of each inertia per unit of δ. parts:
    keys whose errors are errors of the scale. stated: relative standard uncertainty by the rig file (0: exact).
    """

    name: str
    key: str
    parameter: str
    unit: str
    value: float
    size: float
    slopes: tuple[float, float]
    parts: tuple[str, ...]
    stated: float


@dataclass(frozen=True)
class ScaleCorrection:
    """What a known body adds to a difference."""

    parameters: dict[str, Parameter]
    budget: list[BudgetEntry]
    warnings: list[Message]
    notes: list[Message]


def calibrated(runs: Runs, inertias: tuple[Estimate, Estimate], known: Estimate) -> ScaleCorrection:
    """Correct the scale so that the difference of the `inertias` (tare, loaded) is the `known` one.

    Raises UnanswerableError where the results do not say what set their scale, or the difference does not feel it.
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
    delta = sum_of([known, loaded, tare], [1 / reach, -1 / reach, 1 / reach])
    own = Estimate(delta.value, {key: share for key, share in delta.shares.items() if key not in lever.parts})
    corrected = {
        "tare_inertia": sum_of([tare, delta], [1.0, lever.slopes[0]]),
        "loaded_inertia": sum_of([loaded, delta], [1.0, lever.slopes[1]]),
    }
    found = {
        "scale_factor": (Estimate(1 + own.value, own.shares), ""),
        lever.parameter: (sum_of([own], [lever.size], lever.value), lever.unit),
        **{name: (estimate, runs.unit) for name, estimate in corrected.items()},
    }
    warnings, notes = _verdict(lever, own)
    # what cancels leaves its rounding behind
    budget = [
        entry
        for name, (estimate, _) in found.items()
        for entry in estimate.entries(name)
        if entry.standard_uncertainty > 1e-9 * estimate.u
    ]
    parameters = {name: Parameter.of(estimate.value, estimate.u, unit) for name, (estimate, unit) in found.items()}
    return ScaleCorrection(parameters, budget, warnings, notes)


def _verdict(lever: Lever, delta: Estimate) -> tuple[list[Message], list[Message]]:
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
        text += ", which is more certain than this body makes it"
    return [], [Message("scale-correction", text + ".")]


def find_lever(runs: Runs) -> Lever:
    """What sets the scale of both runs."""
    slopes = {key: _slopes(runs, key) for key in (TORQUE, WHEEL, GAIN, GRAVITY)}
    if (pair := slopes[TORQUE]) is not None and (c1 := runs.constant(TORQUE)) is not None:
        eta = runs.constant(EFFICIENCY) or (1.0, 0.0)
        stated = math.hypot(c1[1] / c1[0], eta[1] / eta[0])
        pushes = (c1[0] * pair[0], c1[0] * pair[1])
        return Lever("eta c1", TORQUE, "torque_per_volt", "N m/V", c1[0], c1[0], pushes, (TORQUE, EFFICIENCY), stated)
    if (pair := slopes[WHEEL]) is not None and (wheel := runs.constant(WHEEL)) is not None:
        rotor, gear = runs.constant(ROTOR) or (0.0, 0.0), runs.constant(GEAR) or (1.0, 0.0)
        a12 = wheel[0] + gear[0] * rotor[0]
        stated = math.hypot(wheel[1], gear[0] * rotor[1], rotor[0] * gear[1]) / a12
        pushes = (a12 * pair[0], a12 * pair[1])
        return Lever("a12", WHEEL, "wheel_inertia", "kg m^2", wheel[0], a12, pushes, (WHEEL, ROTOR, GEAR), stated)
    for key, parameter, unit in ((GAIN, "torque_gain", ""), (GRAVITY, "axis_gravity_torque", "N m")):
        if (pair := slopes[key]) is not None and (constant := runs.constant(key)) is not None and constant[0]:
            if key == GRAVITY and key in runs.apart:
                continue
            pushes = (constant[0] * pair[0], constant[0] * pair[1])
            stated = constant[1] / constant[0]
            return Lever(key, key, parameter, unit, constant[0], constant[0], pushes, (key,), stated)
    raise UnanswerableError(
        f"{runs.names[0]} and {runs.names[1]} do not say how their scale was set, so a known body calibrates nothing; "
        "identify both again, with an uncertainty of drive.wheel.inertia in the rig file.",
        code="no-scale",
    )


def _slopes(runs: Runs, key: str) -> tuple[float, float] | None:
    """Change of the inertia of each run per unit of a constant; None where one of them does not say or not depend."""
    found = []
    for result in (runs.tare, runs.loaded):
        slope = result.sensitivities.get(key)
        for entry in result.budget:
            if slope is None and entry.parameter == "inertia" and entry.shared_id == key:
                slope = entry.sensitivity
        if not slope:
            return None
        found.append(slope)
    return found[0], found[1]
