"""Motor calibration, the paper's preliminary identification: motor constants from voltage tests, by equation (II).

    a12 q1'' + a22 q2'' = N (M − f2 N q2' − f3 sign q2'),  M = deadzone(η (c1 u − c2 q2'))

First by modulating functions (test functions), where the balance is linear and requires no start (`balance`), then by
output error from there (`output_error`). Everything is relative to a22, so the wheel's inertia is the scale reference.
Free swings with the wheel at rest on the rod give b/a11 and the axis' friction by the momentum method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance import wheel_equation as at
from swingid.calibration.motor.balance import BalanceFit, Separation, fit_balance, separate
from swingid.calibration.motor.channels import Kind as LogKind
from swingid.calibration.motor.channels import WheelLog, kind_of
from swingid.calibration.motor.constants import (
    UNITS,
    Conversion,
    by_wheel,
    calibrated_rig,
    declared_changes,
    evaluated,
)
from swingid.calibration.motor.free_swing import RATIO, free_swing
from swingid.calibration.motor.output_error import OutputFit, fit_output
from swingid.calibration.outcome import Found, result_of
from swingid.errors import InputError, require_rig
from swingid.model.rig import Rig
from swingid.model.rig.fields import stated
from swingid.preparation.encoders import Correction, Encoders, corrected
from swingid.progress import stepped, stepwise
from swingid.recording.findings import Kind
from swingid.recording.recording import Recording, listed
from swingid.result.provenance import add_findings, exact_constants
from swingid.result.result import Message, Parameter, Result

SERIOUS = 0.005
"""Relative difference of modulating functions and output error above which (beside their uncertainties) it is a
warning."""

BALANCES = 2
"""Fits of the balance, one with all constants and one with those that are identifiable."""

Corrected = tuple[Recording, Encoders, tuple[Correction, ...]]

CLEAR = 10.0
"""Constants smaller than so many of their uncertainties are excluded from that comparison."""

KINDS = {
    "clamped": "the axis is at rest while the wheel turns: the rod is clamped.",
    "driven": "axis and wheel both move: equation (II) with the measured axis.",
}


@dataclass(frozen=True)
class Calibration:
    """What `calibrate` found.

    result: parameters, budget, notes; method "calibrate". rig: the rig with the found constants and uncertainties;
    ``rig.text`` is its file, with the comments of the old one. first: motor constants by modulating functions alone,
    for comparison with those of `result`, which output error has refined.
    """

    result: Result
    rig: Rig
    first: dict[str, float]


@dataclass(frozen=True)
class _Motor:
    """The motor's part of a calibration: what was found, all constants (also those held), what was fitted.

    first: the identifiable constants by modulating functions alone.
    """

    found: Found
    every: dict[str, Parameter]
    split: Separation
    coupled: bool
    first: dict[str, float]


def calibrate(logs: Recording | Sequence[Recording], rig: Rig) -> Calibration:
    """Motor constants, the combinations that alone are identifiable, and b/a11 with friction from free swings.

    Parameters
    ----------
    logs : Recording or sequence of Recording
        Voltage tests with the rod clamped or free, and free swings with the wheel at rest; the kind of each is found in
        the data and stated in the notes. Load clamped logs with ``Recording.load(path, rig, still_axis=True)``.
    rig : Rig
        Must give the wheel's inertia and the gear ratio. Its motor constants serve as the start of a search, and
        where logs do not distinguish two, as the one that is kept.

    Raises
    ------
    UsageError
        No log, no rig.
    InputError
        A log without voltage, a rig with a direct drive or a motor on the axis.
    UnanswerableError
        Nothing moves, the voltage excites too little to distinguish gain from damping, a wrong sign.
    """
    require_rig(rig)
    # a push on the axis does not enter equation (II), so its rows stay in
    read = [corrected(log, rig) for log in listed(logs)]
    several = [log for log, _, _ in read]
    if rig.drive.channel in ("torque", "voltage"):
        more = ", which finds the constants of a motor on the axis beside the inertia" * (
            rig.drive.channel == "voltage"
        )
        raise InputError(
            f"rig {rig.name}: drive.kind is {rig.drive.kind!r}, but calibrate is for the motor of a reaction wheel and "
            f"for free swings; use identify for this rig{more}.",
            code="no-wheel",
        )
    free = rig.drive.wheel is None
    kinds = ["free swing" if free else kind_of(log, rig) for log in several]
    turn = len(kinds) - kinds.count("free swing")
    with stepwise(len(several) + (BALANCES + 1 + (turn > 1) if turn else 0)):
        return _calibrated(read, kinds, rig)


def _calibrated(read: Sequence[Corrected], kinds: Sequence[LogKind], rig: Rig) -> Calibration:
    """The calibration by logs of which each is corrected and its kind is known."""
    several = [log for log, _, _ in read]
    swings = []
    for log, kind in zip(several, kinds, strict=True):
        stepped()
        if kind == "free swing":
            swings.append(free_swing(log, rig))
    turning = [
        WheelLog.of(log, rig, kind, encoders)
        for (log, encoders, _), kind in zip(read, kinds, strict=True)
        if kind != "free swing"
    ]
    motor = _motor(turning, rig) if turning else None
    best = min(swings, key=lambda s: s.parameters[RATIO].standard_uncertainty or np.inf, default=None)
    if best is not None and len(swings) > 1:
        text = f"of {len(swings)} free swings {best.name} has the least uncertainty and was used."
        best = replace(best, notes=(*best.notes, Message("best-swing", text)))
    return _assembled(several, rig, motor, best)


def _motor(logs: list[WheelLog], rig: Rig) -> _Motor:
    assert rig.drive.motor is not None
    gear = rig.drive.motor.gear_ratio.value
    moves = any(log.kind == "driven" for log in logs)
    coupled = moves and gear != 1 and not stated(rig.drive.motor, "rotor_inertia")
    to = Conversion(rig, coupled)
    free = np.ones(at.COUNT, bool)
    free[at.COUPLING] = coupled
    first = fit_balance(logs, at.products_of(rig), free)
    stepped()
    split = separate(first, rig, logs[0].name)
    if not (split.free == free).all():
        first = fit_balance(logs, split.values, split.free)
    stepped()
    refined = fit_output(logs, first.values, split.free)
    whole, differs = evaluated(refined, first, declared_changes(refined, logs, split, to), to)
    answered = Found("the voltage tests", whole).only(_identifiable(split, coupled=coupled))
    constants = dict(zip(UNITS, to.constants(first.values).tolist(), strict=True))
    warnings, notes = _compared(first, refined, answered.parameters, constants, differs)
    kinds = [Message("log-kind", f"{log.name}: {KINDS[log.kind]}") for log in logs]
    notes = [*kinds, *notes, *split.notes, *_delay(refined, logs[0].encoders), *_assumed(rig, coupled=coupled)]
    answered = replace(answered, warnings=tuple(warnings), notes=tuple(notes))
    return _Motor(answered, whole.parameters, split, coupled, {name: constants[name] for name in answered.parameters})


def _identifiable(split: Separation, *, coupled: bool) -> list[str]:
    """Names of the constants that the logs determine, not those that were held."""
    hidden = set() if split.emf else {"motor.back_emf", "motor.viscous"}
    if not split.coulomb:
        hidden |= {"motor.coulomb", "motor.dead_zone.positive", "motor.dead_zone.negative"}
    for place, side in ((at.POSITIVE, "positive"), (at.NEGATIVE, "negative")):
        if not split.free[place]:
            hidden |= {f"motor.breakaway_{side}", f"motor.dead_zone.{side}"}
    if not coupled:
        hidden.add("motor.rotor_inertia")
    return [name for name in UNITS if name not in hidden]


def _compared(
    first: BalanceFit,
    refined: OutputFit,
    parameters: dict[str, Parameter],
    constants: dict[str, float],
    differs: dict[str, bool],
) -> tuple[list[Message], list[Message]]:
    """Warnings and notes: the difference of both methods, the residuals of the simulation.

    own: constants by modulating functions. differs: whether a constant differs by more than the uncertainties.
    """
    products = {name: parameters[name] for name in list(UNITS)[:4] if name in parameters}
    clear = {name: p for name, p in products.items() if abs(p.value) > CLEAR * (p.standard_uncertainty or 0)}
    gaps = {name: abs(constants[name] / parameter.value - 1) for name, parameter in clear.items()}
    residual = f"the simulated wheel differs from the logged angle by {max(refined.levels):.3g} rad (RMS)."
    left_over = Message("left-over", residual)
    if not gaps:
        return [], [left_over]
    worst = max(gaps, key=lambda name: gaps[name])
    text = (
        f"modulating functions (±{first.half:.3g} s) and output error ({len(refined.shots)} shots) differ by "
        f"{100 * gaps[worst]:.2g} % at most, in {worst}."
    )
    notes = [Message("two-ways", text), left_over]
    serious = [name for name in gaps if differs[name] and gaps[name] > SERIOUS]
    if not serious:
        return [], notes
    text = (
        f"modulating functions and output error disagree on {', '.join(serious)} by up to "
        f"{100 * max(gaps[name] for name in serious):.2g} %: equation (II) does not describe the motor; check for "
        "other friction, a voltage that is not held, a latency."
    )
    return [Message("two-ways-disagree", text)], notes


def _delay(fit: OutputFit, encoders: Encoders) -> list[Message]:
    """The effect of a delay between voltage and wheel angle, where the rig states no uncertainty of it."""
    if encoders.wheel.latency.std is not None:
        return []
    change = float(fit.shift(by_wheel(fit, np.gradient, 1e-3))[at.GAIN] / fit.values[at.GAIN])
    text = (
        "taken as exact: the time between voltage and wheel angle; 1 ms more would change motor.gain by about "
        f"{100 * change:+.2g} % (state sensors.wheel.latency with its uncertainty)."
    )
    return [Message("delay", text)]


def _assumed(rig: Rig, *, coupled: bool) -> list[Message]:
    """What the result depends on: the wheel's inertia as the scale, efficiency as stated, the rotor."""
    motor = rig.drive.motor
    assert motor is not None
    used = {"drive.wheel.inertia", "drive.motor.gear_ratio"} | (set() if coupled else {"drive.motor.rotor_inertia"})
    notes = exact_constants([key for key in rig.constants_without_uncertainty() if key in used])
    text = (
        "efficiency acts only with torque_per_volt and back_emf: the products are identifiable, and the two constants "
        f"are given for efficiency = {motor.efficiency.value:g}."
    )
    notes.append(Message("efficiency-with-torque", text))
    if coupled:
        text = "the rig states no rotor_inertia; it was estimated from the wheel's reaction to the axis' motion."
        notes.append(Message("rotor-found", text))
    elif not stated(motor, "rotor_inertia"):
        text = "the rig states no rotor_inertia, so it counts as 0; a log with a free axis makes it identifiable."
        notes.append(Message("rotor-unknown", text))
    return notes


def _assembled(logs: list[Recording], rig: Rig, motor: _Motor | None, swing: Found | None) -> Calibration:
    """Motor and free swing in one result and one rig file."""
    parts = [*([motor.found] if motor else []), *([swing] if swing else [])]
    whole = parts[0] if len(parts) == 1 else parts[0].joined(parts[1])
    warnings, notes = [*whole.warnings], [*whole.notes]
    for log in logs:
        add_findings(log, warnings, notes, leave_out=Kind.WHEEL_STILL)
    every = (motor.every if motor else {}) | (swing.parameters if swing else {})
    split = None if motor is None else motor.split
    new, more = calibrated_rig(rig, every, split, coupled=motor is not None and motor.coupled)
    result = result_of("calibrate", logs, rig, whole.evaluated, warnings, [*notes, *more])
    return Calibration(result, new, {} if motor is None else motor.first)
