"""Motor calibration, the paper's preliminary identification: motor constants from voltage tests, by row (II).

    a12 q1'' + a22 q2'' = N (M − f2 N q2' − f3 sign q2'),  M = deadzone(η (c1 u − c2 q2'))

First on test functions, where the balance is linear and needs no start (`balance`), then by output error from there
(`output_error`). Everything is relative to a22, so the wheel's inertia sets the scale. Free swings with the wheel at
rest on the rod give b/a11 and the axis' friction by the momentum method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.calibration.motor.balance import BalanceFit, Separation, fit_balance, separate
from swingid.calibration.motor.channels import WheelLog, kind_of
from swingid.calibration.motor.constants import (
    UNITS,
    calibrated_rig,
    constants,
    declared_changes,
    evaluated,
    late_wheel,
)
from swingid.calibration.motor.output_error import OutputFit, fit_output
from swingid.calibration.motor.products import COUNT, COUPLING, GAIN, NEGATIVE, POSITIVE, products_of
from swingid.errors import InputError
from swingid.methods.momentum.method import momentum
from swingid.model.rig import Rig
from swingid.model.rig.fields import stated
from swingid.preparation.encoders import Encoders, corrected
from swingid.preparation.prepared import prepare
from swingid.recording.recording import Recording
from swingid.result.provenance import add_findings, exact_constants, provenance
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined, freedom_of
from swingid.uncertainty.budget import stated as source_of

SERIOUS = 0.005
"""Test functions and output error that differ by more than this share (and their uncertainties) give a warning."""

CLEAR = 10.0
"""Constants smaller than so many of their uncertainties are left out of that comparison."""

KINDS = {
    "clamped": "the axis is still while the wheel turns: the rod is clamped.",
    "driven": "axis and wheel both move: row (II) with the measured axis.",
}


RATIO = "gravity_per_inertia"


@dataclass(frozen=True)
class Calibration:
    """What `calibrate` found.

    result: parameters, budget, notes; method "calibrate". rig: the rig with the found constants and uncertainties;
    ``rig.text`` is its file, with the comments of the old one. first: motor constants by test functions alone, for
    comparison with those of `result`, which output error has refined.
    """

    result: Result
    rig: Rig
    first: dict[str, float]


@dataclass(frozen=True)
class _Motor:
    """The motor's part of a calibration: all constants (also those held), which of them are known, and why."""

    parameters: dict[str, Parameter]
    known: tuple[str, ...]
    budget: list[BudgetEntry]
    warnings: list[Message]
    notes: list[Message]
    split: Separation
    coupled: bool
    first: dict[str, float]


def calibrate(logs: Recording | Sequence[Recording], rig: Rig) -> Calibration:
    """Motor constants, the combinations that alone are identifiable, and b/a11 with friction from free swings.

    Parameters
    ----------
    logs : Recording or sequence of Recording
        Voltage tests with the rod clamped or free, and free swings with the wheel at rest; which is which is seen in
        the data and said in the notes. Load clamped logs with ``Recording.load(path, rig, still_axis=True)``.
    rig : Rig
        Must give the wheel's inertia and the gear ratio. Its motor constants serve as the start of a search, and
        where logs do not distinguish two, as the one that is kept.

    Raises
    ------
    InputError
        A log without voltage, a rig without reaction wheel, no log at all.
    UnanswerableError
        Nothing moves, the voltage excites too little to distinguish gain from damping, a wrong sign.
    """
    # a push on the axis does not enter row (II), so its rows stay in
    read = [corrected(log, rig) for log in ([logs] if isinstance(logs, Recording) else logs)]
    several = [log for log, _, _ in read]
    if not several:
        raise InputError("no log was given; calibrate needs at least one voltage test or free swing.", code="no-log")
    _require_wheel(rig)
    kinds = [kind_of(log, rig) for log in several]
    swings = [free_swing(log, rig) for log, kind in zip(several, kinds, strict=True) if kind == "free swing"]
    turning = [
        WheelLog.of(log, rig, kind, encoders)
        for (log, encoders, _), kind in zip(read, kinds, strict=True)
        if kind != "free swing"
    ]
    motor = _motor(turning, rig) if turning else None
    return _assembled(several, rig, motor, _best(swings), len(swings))


def _require_wheel(rig: Rig) -> None:
    if rig.drive.kind != "reaction-wheel" or rig.drive.wheel is None:
        raise InputError(
            f"rig {rig.name}: drive.kind is {rig.drive.kind!r}, but calibrate is for the motor of a reaction wheel; "
            "use identify for this rig.",
            code="no-wheel",
        )


def _best(swings: list[FreeSwing]) -> FreeSwing | None:
    """The free swing whose ratio b/a11 is known best."""
    return min(swings, key=lambda s: s.parameters[RATIO].standard_uncertainty or np.inf, default=None)


def _motor(logs: list[WheelLog], rig: Rig) -> _Motor:
    assert rig.drive.motor is not None
    gear = rig.drive.motor.gear_ratio.value
    moves = any(log.kind == "driven" for log in logs)
    coupled = moves and gear != 1 and not stated(rig.drive.motor, "rotor_inertia")
    free = np.ones(COUNT, bool)
    free[COUPLING] = coupled
    first = fit_balance(logs, products_of(rig), free)
    split = separate(first, rig, logs[0].name)
    if not (split.free == free).all():
        first = fit_balance(logs, split.values, split.free)
    refined = fit_output(logs, first.values, split.free)
    changes = declared_changes(refined, logs, rig, split, coupled=coupled)
    answer, apart = evaluated(refined, first, changes, rig, coupled=coupled)
    parameters = answer.parameters
    known = _known(split, coupled=coupled)
    own = dict(zip(UNITS, constants(first.values, rig, coupled=coupled).tolist(), strict=True))
    warnings, notes = _judged(first, refined, parameters, own, known, logs, apart)
    return _Motor(
        parameters=parameters,
        known=known,
        budget=[entry for entry in answer.budget if entry.parameter in known],
        warnings=warnings,
        notes=[*notes, *split.notes, *_delay(refined, logs[0].encoders), *_assumed(rig, coupled=coupled)],
        split=split,
        coupled=coupled,
        first={name: own[name] for name in known},
    )


def _known(split: Separation, *, coupled: bool) -> tuple[str, ...]:
    """Names of the constants that the logs know, not those that were held."""
    hidden = set() if split.emf else {"motor.back_emf", "motor.viscous"}
    if not split.coulomb:
        hidden |= {"motor.coulomb", "motor.dead_zone.positive", "motor.dead_zone.negative"}
    for place, side in ((POSITIVE, "positive"), (NEGATIVE, "negative")):
        if not split.free[place]:
            hidden |= {f"motor.breakaway_{side}", f"motor.dead_zone.{side}"}
    if not coupled:
        hidden.add("motor.rotor_inertia")
    return tuple(name for name in UNITS if name not in hidden)


def _judged(
    first: BalanceFit,
    refined: OutputFit,
    parameters: dict[str, Parameter],
    own: dict[str, float],
    known: tuple[str, ...],
    logs: list[WheelLog],
    apart: dict[str, bool],
) -> tuple[list[Message], list[Message]]:
    """Warnings and notes: kinds of logs, how well both ways agree, what the simulation leaves."""
    notes = [Message("log-kind", f"{log.name}: {KINDS[log.kind]}") for log in logs]
    products = [name for name in list(UNITS)[:4] if name in known]
    clear = [
        name for name in products if abs(parameters[name].value) > CLEAR * (parameters[name].standard_uncertainty or 0)
    ]
    gaps = {name: abs(own[name] / parameters[name].value - 1) for name in clear}
    worst = max(gaps, key=lambda name: gaps[name])
    text = (
        f"test functions (±{first.half:.3g} s) and output error ({len(refined.shots)} shots) differ by "
        f"{100 * gaps[worst]:.2g} % at most, in {worst}."
    )
    notes.append(Message("two-ways", text))
    left = max(refined.levels)
    notes.append(Message("left-over", f"the simulated wheel leaves {left:.3g} rad of the logged angle."))
    doubtful = [name for name in UNITS if name in gaps and apart[name] and gaps[name] > SERIOUS]
    warnings = []
    if doubtful:
        text = (
            f"test functions and output error disagree on {', '.join(doubtful)} by up to "
            f"{100 * max(gaps[name] for name in doubtful):.2g} %: the motor does not behave as row (II) says "
            "(other friction, a voltage that is not held, a late channel?)."
        )
        warnings.append(Message("two-ways-disagree", text))
    return warnings, notes


def _delay(fit: OutputFit, encoders: Encoders) -> list[Message]:
    """What a delay between voltage and wheel angle would do, where the rig says nothing of it."""
    if encoders.wheel.latency.std is not None:
        return []
    change = float(fit.shift(late_wheel(fit, 1e-3))[GAIN] / fit.values[GAIN])
    text = (
        "taken as exact: the time between voltage and wheel angle; 1 ms more would change motor.gain by about "
        f"{100 * change:+.2g} % (state sensors.wheel.latency with its uncertainty)."
    )
    return [Message("delay", text)]


def _assumed(rig: Rig, *, coupled: bool) -> list[Message]:
    """What the answer stands on: the wheel's inertia as the scale, efficiency as stated, the rotor."""
    motor = rig.drive.motor
    assert motor is not None
    used = {"drive.wheel.inertia", "drive.motor.gear_ratio"} | (set() if coupled else {"drive.motor.rotor_inertia"})
    notes = exact_constants([key for key in rig.constants_without_uncertainty() if key in used])
    notes.append(
        Message(
            "efficiency-with-torque",
            "efficiency acts only with torque_per_volt and back_emf: the products are known, and the two constants are "
            f"given for efficiency = {motor.efficiency.value:g}.",
        )
    )
    if coupled:
        text = "the rig states no rotor_inertia; it was found from how the axis' motion turns the wheel."
        notes.append(Message("rotor-found", text))
    elif not stated(motor, "rotor_inertia"):
        text = "the rig states no rotor_inertia, so it counts as 0; a log with a free axis would show it."
        notes.append(Message("rotor-unknown", text))
    return notes


def _assembled(
    logs: list[Recording], rig: Rig, motor: _Motor | None, swing: FreeSwing | None, swings: int
) -> Calibration:
    parameters: dict[str, Parameter] = {}
    every: dict[str, Parameter] = {}
    budget: list[BudgetEntry] = []
    warnings: list[Message] = []
    notes: list[Message] = []
    if motor is not None:
        parameters |= {name: motor.parameters[name] for name in motor.known}
        every |= motor.parameters
        budget, warnings, notes = [*motor.budget], [*motor.warnings], [*motor.notes]
    if swing is not None:
        parameters |= swing.parameters
        every |= swing.parameters
        budget += swing.budget
        warnings += swing.warnings
        notes += swing.notes
        if swings > 1:
            notes.append(
                Message("best-swing", f"of {swings} free swings {swing.name} is the most certain and was used.")
            )
    for log in logs:
        add_findings(log, warnings, notes, leave_out="wheel-still")
    split = None if motor is None else motor.split
    new, more = calibrated_rig(rig, every, split, coupled=motor is not None and motor.coupled)
    names = [log.source.path for log in logs]
    origin = provenance(logs[0], rig) | ({"logs": names} if len(logs) > 1 else {})
    result = Result(
        method="calibrate",
        status="warning" if warnings else "ok",
        parameters=parameters,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(dict.fromkeys([*notes, *more])),
        budget=tuple(budget),
        provenance=origin,
    )
    return Calibration(result, new, {} if motor is None else motor.first)


@dataclass(frozen=True)
class FreeSwing:
    """What a free swing determines: parameters with their budget, warnings, notes; the rest of momentum's result.

    ``gravity_per_inertia`` = b/a11 in 1/s² needs no constant. With b known, ``axis.inertia`` (J1, the wheel and the
    rotor taken off) and ``axis.friction.NAME`` follow.
    """

    name: str
    parameters: dict[str, Parameter]
    budget: tuple[BudgetEntry, ...]
    warnings: tuple[Message, ...]
    notes: tuple[Message, ...]
    result: Result


def without_drive(rig: Rig) -> Rig:
    """The rig as it swings when nothing drives it and the wheel rests on the rod; b = 1 where it is unknown."""
    changes: dict[str, object] = {"drive": {"kind": "none"}, "sensors.wheel": None, "axis.inertia": None}
    for key in rig.log.model_fields_set:
        if key.startswith(("wheel", "voltage", "torque")):
            changes[f"log.{key}"] = None
    if isinstance(rig.axis.gravity_torque, str):
        changes["axis.gravity_torque"] = 1.0
    return rig.changed(changes)


def free_swing(log: Recording, rig: Rig) -> FreeSwing:
    """Identify a free swing; errors as `momentum`."""
    found = momentum(prepare(log, without_drive(rig)))
    known = not isinstance(rig.axis.gravity_torque, str)
    b = rig.axis.gravity_torque.value if not isinstance(rig.axis.gravity_torque, str) else 1.0
    inertia = found.parameters["inertia"]
    own = [e for e in found.budget if e.parameter == "inertia" and e.shared_id != "axis.gravity_torque"]
    ratio = b / inertia.value
    by = ratio / inertia.value
    slopes = [None if e.sensitivity is None else -e.sensitivity * by for e in own]
    budget = [BudgetEntry(e.origin, RATIO, e.standard_uncertainty * by, s) for e, s in zip(own, slopes, strict=True)]
    parameters = {RATIO: Parameter.of(ratio, combined(budget, RATIO), "1/s^2", freedom_of(budget, RATIO))}
    if known:
        own_parameters, own_budget = _with_torques(found, rig)
        parameters |= own_parameters
        budget += own_budget
    name = log.source.path or "the log"
    text = f"{name}: nothing drives the axis and the wheel rests on the rod: a free swing."
    wheel = {"wheel-still"}  # that the wheel rests on the rod is as it should be
    warnings = tuple(w for w in found.warnings if w.code not in wheel)
    return FreeSwing(name, parameters, tuple(budget), warnings, (Message("log-kind", text), *found.notes), found)


def _with_torques(found: Result, rig: Rig) -> tuple[dict[str, Parameter], list[BudgetEntry]]:
    """J1 and the friction of the axis, as rig.toml names them: the wheel and the rotor ride on the rod."""
    wheel, motor = rig.drive.wheel, rig.drive.motor
    names = {name: f"axis.friction.{name}" for name in found.parameters} | {"inertia": "axis.inertia"}
    budget = [replace(entry, parameter=names[entry.parameter]) for entry in found.budget]
    carried = 0.0
    if wheel is not None and motor is not None:
        for key, mass in (("drive.wheel.inertia", wheel.inertia), ("drive.motor.rotor_inertia", motor.rotor_inertia)):
            carried += mass.value
            if mass.std:
                budget.append(BudgetEntry(source_of(key, key), "axis.inertia", mass.std, -1.0))
    parameters = {names[name]: parameter for name, parameter in found.parameters.items()}
    inertia = found.parameters["inertia"]
    u, freedom = combined(budget, "axis.inertia"), freedom_of(budget, "axis.inertia")
    parameters["axis.inertia"] = Parameter.of(inertia.value - carried, u, inertia.unit, freedom)
    return parameters, budget
