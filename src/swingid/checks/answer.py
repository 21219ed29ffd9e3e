"""Checks of an estimate: signs, identifiability, and by equation (II) the wheel angle and the motor's constants."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from swingid.balance.fits import WindowFit
from swingid.balance.identifiability import HOPELESS, Identifiability, advice, advice_on_gravity, examine, require_seen
from swingid.balance.motor import MotorBalance, free_balance
from swingid.balance.rows import Signals
from swingid.errors import InputError, NotIdentifiableError, UnanswerableError
from swingid.format import left, number
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, is_spring, rig_terms, units_on
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.preparation.noise import Noise
from swingid.recording.findings import Kind
from swingid.result.checked import Checked
from swingid.result.result import BudgetEntry, Message, Parameter
from swingid.uncertainty.budget import combined
from swingid.uncertainty.significance import INDICATED, MATTERS
from swingid.units import Quantity

CLEARLY = 0.5
"""Ratio of residuals below which one reading of a channel fits clearly better than another."""

BAD_MOTOR = 0.1
"""Relative residual of equation (II) above which motor constants or wheel angle are inconsistent with the log."""

FORM = 0.01
"""Relative residual of equation (II) that the form of its right side may leave with every constant of the motor
fitted; a reading that leaves more, and far more than the other, is not the sensor's."""

LARGEST_SWING = 2.5
"""Amplitude in rad up to which the first correction of the free swing's frequency is used."""


IDENTIFIABILITY, NEAR_RESONANCE = "identifiability", "near-resonance"
"""A check and its note; a note."""

COMMISSION = "the journal has the signs that [device] stated at the run: find them by swingid commission, and run again"
"""What to do about a wrong sign in the journal of a live run, which does not read [log]."""


def voltage_remedy(live: bool) -> str:
    """What to do about a voltage of the wrong sign; live: in the journal of a live run."""
    return COMMISSION if live else "set voltage_sign = -1 under [log], or +1 if it is -1 already"


def check_sign(law: WindowFit, where: str, *, live: bool = False) -> None:
    """Raise InputError where a sign or the angle's zero is wrong, by equation (I) alone.

    live: whether the log is the journal of a live run.

    With the sign of the drive or of gravity reversed, the residuals are clearly smaller, or the inertia is negative.
    """
    equation = law.equation
    key = None if equation.channel == "voltage" else equation.channel
    if key is None:
        if law.a11 <= 0:
            raise UnanswerableError(
                f"{where}: the decay gives a negative inertia; is 0 the hanging position (angle_zero under [log])?",
                code="negative-inertia",
            )
        return
    if not np.any(_drive(law)) and law.a11 < 3 * law.u:
        raise UnanswerableError(
            f"{where}: {key} is constant, so no drive makes the inertia identifiable; record a driven motion, or set "
            f"{key} under [log] to the right column.",
            code="no-drive",
        )
    culprit = _wrong_by_gravity_found(law) if equation.seeks("gravity_torque") else _wrong_by_residuals(law)
    if culprit is None:
        return
    if live:
        raise InputError(f"{where}: {key} has the wrong sign against the angle; {COMMISSION}", code="wrong-sign")
    sign = f"set {key}_sign = -1 under [log], or angle_sign = -1 where it is the angle's that is wrong"
    zero = 'angle_zero = "up" where 0 is the top'
    inertia = f"(the inertia would be {law.a11:.3g} {equation.shown(equation.unit)})"
    raise InputError(
        f"{where}: "
        + {
            "drive": f"{key} has the wrong sign against the angle {inertia}; {sign} (+1 if it is -1 already).",
            "zero": f"gravity pulls the wrong way, so 0 of the angle seems to be the top {inertia}; set angle_zero = "
            '"up" under [log] ("down" if it is "up" already).',
            "both": f"{key} has the wrong sign against the angle and gravity pulls the wrong way {inertia}; {sign}, "
            f"and {zero}.",
            "either": f"{key} has the wrong sign against the angle, or the angle's zero is wrong {inertia}; {sign}, "
            f"or {zero}.",
        }[culprit],
        code="wrong-sign",
    )


def _drive(law: WindowFit) -> Array:
    """What drives the axis, on the known side of each row."""
    return -law.rows.sum_of({name: law.value(name) for name in ("wheel", "torque") if name in law.rows.columns})


def _wrong_by_residuals(law: WindowFit) -> str | None:
    """What is wrong where gravity is known: "drive", "zero", "both", "either", or None.

    Gravity reversed is the drive reversed, and inertia and friction with it, so one more fit decides.
    """
    equation = law.equation
    drive = _drive(law)
    turned = fit_linear(law.columns, law.known - 2 * drive)
    ratio = float(turned.residuals @ turned.residuals) / max(law.lost, 1e-300)
    if equation.value("gravity_torque") and ratio < 1 / 9:
        return "drive" if turned.values[0] > 0 else "zero"
    if law.a11 >= -3 * law.u:
        return None
    if not equation.value("gravity_torque"):
        return "drive"
    return "both" if ratio > 9 else "either"


def _wrong_by_gravity_found(law: WindowFit) -> str | None:
    """What is wrong where gravity is unknown too: by its sign and that of the inertia."""
    gravity, spread = law.value("gravity_torque"), law.uncertainty("gravity_torque")
    known = abs(gravity) > INDICATED * spread
    if law.a11 < -3 * law.u:
        return ("drive" if gravity < 0 else "both") if known else "either"
    return "zero" if known and gravity < 0 and law.a11 > INDICATED * law.u else None


def check_answer(
    parameters: dict[str, Parameter],
    budget: list[BudgetEntry],
    law: WindowFit,
    amplitude: float,
    rig: Rig,
) -> Checked:
    """Identifiability of the parameters; a note "near-resonance" where the inertia is nearly proportional to gravity.

    Raises NotIdentifiableError where the data do not determine the inertia.
    """
    inertia, equation = parameters["inertia"], law.equation
    relative = (inertia.standard_uncertainty or np.inf) / max(abs(inertia.value), 1e-300)
    seen, motion = identifiability_of(law), _main_frequency(law, amplitude)
    # beside a drive of unknown scale a stated torque of the angle is sought too, and sets the scale afterwards
    key = rig.reference if equation.driven else ""
    require_seen(seen, *motion, key=key)
    if inertia.value <= 0 or relative > HOPELESS or not np.isfinite(relative):
        raise NotIdentifiableError(_hopeless(inertia, relative, law, motion))
    warnings: list[Message] = []
    notes: list[Message] = []
    scattered = combined([entry for entry in budget if entry.type == "A"], "inertia")
    if len(equation.sought) > 1 and scattered > 0.02 * inertia.value:
        text = f"{seen.combination(law.values)}; {advice(seen, *motion, key=key)}."
        warnings.append(Message("gravity-and-inertia", text, Kind.GRAVITY_AND_INERTIA))
    b = equation.value("gravity_torque")
    if equation.driven and b:
        leverage = abs(float(law.fit.influence[0] @ law.rows["gravity_torque"]) * b) / law.a11
        if leverage > 0.8:
            gravity = rig.axis.gravity_torque
            budgeted = isinstance(gravity, Quantity) and gravity.std is not None
            text = _near_resonance(leverage, amplitude, b / law.a11, budgeted=budgeted)
            notes.append(Message(NEAR_RESONANCE, text))
    if not equation.driven:
        notes.append(scale_note(rig))
    return Checked(tuple(warnings), tuple(notes), (IDENTIFIABILITY,))


def identifiability_note(law: WindowFit) -> Message:
    """How well the rows determine the unknowns of a fit."""
    seen = identifiability_of(law)
    rank = f"rank {seen.rank} of {len(seen.names)}, condition {number(seen.condition, digits=2)}"
    return Message(IDENTIFIABILITY, f"{rank}; {seen.combination(law.values)}, and {seen.price}.")


def identifiability_of(law: WindowFit) -> Identifiability:
    """Identifiability of the unknowns of a fit by its rows, with its own uncertainty of the inertia."""
    units, equation = units_on(linear=law.equation.linear), law.equation
    seen = examine(law.unknowns, [equation.shown(units.get(name, "")) for name in law.unknowns], law.columns)
    return seen.scaled_to(law.u)


def _main_frequency(law: WindowFit, amplitude: float) -> tuple[float | None, float]:
    """Main frequency of the motion and of the free swing at its amplitude, rad/s, from the rows."""
    gravity = float(np.linalg.norm(law.rows["gravity_torque"]))
    if gravity == 0.0 or law.a11 <= 0:
        return None, 0.0
    amplitude = min(amplitude, LARGEST_SWING)
    sine = 1 - amplitude**2 / 8
    natural = np.sqrt(max(law.value("gravity_torque"), 0.0) / law.a11) * (1 - amplitude**2 / 16)
    return float(np.sqrt(np.linalg.norm(law.rows["inertia"]) / gravity * max(sine, 0.3))), float(natural)


def _hopeless(inertia: Parameter, relative: float, law: WindowFit, motion: tuple[float | None, float]) -> str:
    equation = law.equation
    if inertia.value <= 0 and not equation.seeks("gravity_torque"):
        return (
            f"the balance gives an inertia of {inertia.value:.3g} {equation.shown(inertia.unit)}, which is not "
            "positive; check the signs and scales under [log] and drive.wheel.inertia."
        )
    spread = f"{100 * relative:.0f} %" if inertia.value > 0 and relative < 100 else "more than its value"
    sought = equation.sought[1:]
    torques = [TERMS[name] for name in sought if TERMS[name].is_conservative]
    if torques:
        keys = [term.key or term.words for term in torques]
        return (
            f"inertia and {' and '.join(term.words for term in torques)} are correlated in this motion (the inertia is "
            f"uncertain by {spread}); {advice_on_gravity(*motion, keys, driven=equation.driven)}."
        )
    return (
        f"the motion does not determine the inertia (it is uncertain by {spread}); "
        "record larger or faster swings, or more of them."
    )


def scale_note(rig: Rig) -> Message:
    """The note that names what sets the scale of a free swing."""
    b = rig.axis.gravity_torque
    springs = [term.term.key for term in rig_terms(rig) if term.value is not None and is_spring(term.term)]
    key = springs[0] if springs and not (isinstance(b, Quantity) and b.value) else "axis.gravity_torque"
    code = "scale-from-gravity" if key == "axis.gravity_torque" else "scale-from-spring"
    return Message(code, f"the inertia is proportional to {key}.")


def _near_resonance(leverage: float, amplitude: float, stiffness: float, *, budgeted: bool) -> str:
    natural = np.sqrt(stiffness) * (1 - min(amplitude, LARGEST_SWING) ** 2 / 16)
    reason = "the motion is near resonance" if leverage < 1.5 else "the motion is slow against the free swing"
    stated = "; the interval contains its stated uncertainty" if budgeted else ""
    return (
        f"{reason} ({natural:.2g} rad/s), so the inertia is nearly proportional to the gravity torque (1 % "
        f"of axis.gravity_torque changes it by {leverage:.2g} %{stated}); drive at {1.7 * natural:.2g} rad/s or more."
    )


class Fault(Enum):
    """What is inconsistent with equation (II)."""

    VOLTAGE_SIGN = auto()
    READING = auto()
    CONSTANTS = auto()


@dataclass(frozen=True)
class MotorCheck(Checked):
    """Result of the check by equation (II): the fault of wheel angle or motor with its warning, else a note.

    held: a message where the voltage between the rows is not as drive_held states.
    """

    fault: Fault | None = None
    held: tuple[Message, ...] = ()

    def unused(self) -> Checked:
        """The check of a method that does not use the motor."""
        return Checked(self.warnings, self.notes + (self.held if self.fault is None else ()), self.ran)


def check_motor(
    balance: MotorBalance | None,
    signals: Signals,
    *,
    method: str = "momentum",
    uses_motor: bool = False,
    without: MotorCheck | None = None,
) -> MotorCheck:
    """Check the wheel angle by equation (II). Never refuses.

    An absolute wheel angle taken for a relative one is consistent with equation (I), but not with (II). Errors of some
    per cent of the motor constants leave equal residuals, so the readings are compared with these fitted too. method:
    its name in messages; uses_motor: whether its inertia depends on the motor's constants. without: the
    result where (II) cannot be evaluated, see `free_reading`.
    """
    if signals.wheel is None:
        return MotorCheck()
    if balance is None and without is not None:
        return without
    if balance is None:
        text = "the reading of wheel_angle is not checked: that takes a voltage and a motion that shows the difference."
        return MotorCheck(notes=(Message("wheel-angle-reading", text),))
    ran = ("motor",)
    if reversed_sign := wrong_sign(balance):
        remedy = voltage_remedy(signals.source[0].is_live)
        text = f"voltage seems to have {reversed_sign}; {method} does not use it, but {remedy}."
        return MotorCheck((Message("voltage-sign", text),), ran=ran, fault=Fault.VOLTAGE_SIGN)
    harm = "this inertia depends on it" if uses_motor else f"{method} does not use it"
    held = tuple(balance.hold_warning(harm=harm))
    stated, other = ("relative", "absolute") if balance.is_relative else ("absolute", "relative")
    finding = _reading(balance)
    if finding is not None:
        text = f"{finding.format(stated=stated, other=other)} ({_residuals(balance)}); " + (
            f'set wheel_angle_is = "{other}" under [log] if the sensor measures that, or check drive.motor.'
        )
        return MotorCheck((Message("wheel-angle-reading", text),), ran=ran, fault=Fault.READING, held=held)
    if balance.as_stated > BAD_MOTOR and not held:
        off = Message("motor-balance", _motor_off(balance, method, uses_motor))
        return MotorCheck((off,), ran=ran, fault=Fault.CONSTANTS)
    rest = (
        f"; the wheel rests {balance.rests:.0%} of the time, which determines nothing" if balance.rests > 0.05 else ""
    )
    text = f"wheel_angle taken as {stated} to the pendulum ({_residuals(balance)}{rest})."
    return MotorCheck(notes=(Message("wheel-angle-reading", text),), ran=ran, held=held)


def free_reading(rig: Rig, signals: Signals, noise: Noise, inertia: Parameter) -> MotorCheck | None:
    """What to say of how the wheel's angle is read, without constants of the motor; None where it cannot matter.

    An angle against the room that is taken for one against the pendulum gives a11 − a12 in the place of a11, with the
    same residuals of equation (I). Where there is a voltage, equation (II) with every constant of the motor fitted
    compares the readings. A log of the twin has metadata, and is as its rig.
    """
    log = signals.source[0]
    if rig.drive.wheel is None or log.metadata or not log.source.read:
        return None
    if rig.drive.a12 <= MATTERS * (inertia.standard_uncertainty or 0.0):
        return None
    stated = "wheel_angle_is" in rig.log.model_fields_set
    taken, other = ("relative", "absolute") if rig.log.wheel_angle_is == "relative" else ("absolute", "relative")
    free = free_balance(rig, signals, noise)
    residuals, prefers, sure = "", "", False
    if free is not None:
        residuals = (
            "the residual of the motor's balance with its constants fitted is "
            f"{left(free.as_stated)} if it is {taken} and {left(free.otherwise)} if it is {other}"
        )
        rejected = max(free.as_stated, free.otherwise)
        sure = rejected > FORM
        if min(free.as_stated, free.otherwise) < CLEARLY * rejected:
            prefers = taken if free.as_stated < free.otherwise else other
    if prefers == taken and sure:
        note = Message("wheel-angle-reading", f"wheel_angle taken as {taken}: {residuals}.")
        return MotorCheck(notes=(note,))
    if stated and not (prefers == other and sure):
        return None
    unit = Equation.of(rig).shown(inertia.unit)
    turned = inertia.value + (rig.drive.a12 if taken == "relative" else -rig.drive.a12)
    readings = (
        f"inertia is {number(inertia.value, unit)} if the wheel's angle is {taken}, as "
        f"{'stated' if stated else 'assumed'}, and {number(turned, unit)} if it is {other}; "
    )
    if stated:
        text = f"wheel_angle seems to be {other}, not {taken}: {residuals}; the {readings}"
        text += "check wheel_angle_is under [log]."
        return MotorCheck((Message("wheel-angle-reading", text),), fault=Fault.READING)
    text = "wheel_angle_is is not stated under [log] and cannot be verified without voltage and motor constants: the "
    text += readings
    text += f"{residuals}, which makes {prefers} the likelier; state which." if prefers else "state which."
    return MotorCheck((Message("wheel-angle-reading", text),), fault=Fault.READING)


def wrong_sign(balance: MotorBalance) -> str:
    """Clause on a voltage whose sign is wrong by equation (II); empty where it is not."""
    if balance.turned >= CLEARLY * balance.as_stated or balance.turned >= 2 * BAD_MOTOR:
        return ""
    return (
        f"the wrong sign (the residual of the motor's balance is {left(balance.as_stated)}, with the sign reversed "
        f"{left(balance.turned)})"
    )


def _motor_off(balance: MotorBalance, method: str, uses_motor: bool) -> str:
    text = f"the residual of the motor's balance is {left(balance.as_stated)}: the motor constants or the wheel angle "
    if uses_motor:
        return (
            f"{text}under [log] are inconsistent with this log; this inertia depends on them and is wrong by several "
            "times as much, so use the momentum method or calibrate the motor."
        )
    return (
        f"{text}(wheel_angle_unit and wheel_angle_is under [log]) are inconsistent with this log; {method} does not "
        "use the motor, but check both."
    )


def _reading(balance: MotorBalance) -> str | None:
    """Clause where the other reading of the wheel angle fits clearly better, with {stated} and {other} to fill in."""
    refitted, otherwise = balance.refitted, balance.refitted_otherwise
    if refitted is None or otherwise is None:
        refitted = otherwise = 1.0
    if otherwise < CLEARLY * refitted and otherwise < BAD_MOTOR:
        return "wheel_angle seems to be {other}, not {stated}, which errors of the motor constants hardly explain"
    undecided = refitted > CLEARLY * otherwise
    if undecided and balance.otherwise < CLEARLY * balance.as_stated and balance.otherwise < BAD_MOTOR:
        return "either wheel_angle is {other}, not {stated}, or the motor constants are some per cent off"
    return None


def _residuals(balance: MotorBalance) -> str:
    stated, other = left(balance.as_stated), left(balance.otherwise)
    text = f"the residual of the motor's balance is {stated} with it and {other} with the other reading"
    if balance.refitted is None or balance.refitted_otherwise is None:
        return text
    stated, other = left(balance.refitted), left(balance.refitted_otherwise)
    return f"{text}, {stated} and {other} with the motor's strength and friction fitted"
