"""Checks of an answer: signs, conditioning, and by equation (II) the wheel angle and the motor's constants."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto

import numpy as np

from swingid.balance.fits import WindowFit, columns_of, known_side
from swingid.balance.identifiability import HOPELESS, Identifiability, advice, advice_on_gravity, examine, require_seen
from swingid.balance.motor import MotorBalance
from swingid.balance.rows import Signals
from swingid.errors import InputError, NotIdentifiableError, UnanswerableError
from swingid.format import left, number
from swingid.model.terms import TERMS, units_on
from swingid.numerics.regression import fit_linear
from swingid.preparation.scale import Scale
from swingid.recording.findings import Kind
from swingid.result.result import BudgetEntry, Message, Parameter
from swingid.uncertainty.significance import INDICATED

CLEARLY = 0.5
"""A reading of the wheel fits clearly better when its residual is smaller by this factor."""

LEAST = 1e-4
"""Share of a11 below which a doubt is none: without noise, anything small looks like something."""

BAD_MOTOR = 0.1
"""Relative residual of row (II) above which the motor constants, or the wheel angle, are doubtful."""


LARGEST_SWING = 2.5
"""Amplitude in rad up to which the frequency of the free swing is told by its first correction."""


def check_sign(law: WindowFit, scale: Scale, where: str) -> None:
    """Raise InputError where a sign or the angle's zero is wrong, which row (I) shows by itself.

    With the drive turned, or gravity, the balance must leave clearly less, or the inertia come out negative as it is.
    """
    key = {"reaction-wheel": "wheel_angle", "direct": "torque"}.get(scale.drive)
    if key is None:
        if law.a11 <= 0:
            raise UnanswerableError(
                f"{where}: the decay gives a negative inertia; is 0 the hanging position (angle_zero under [log])?",
                code="negative-inertia",
            )
        return
    if not np.any(scale.a12 * law.rows.wheel - law.rows.torque) and law.a11 < 3 * law.u:
        raise UnanswerableError(
            f"{where}: {key} is the same throughout, so nothing drives the axis that could tell its inertia; record a "
            f"driven motion, or set {key} under [log] to the right column.",
            code="no-drive",
        )
    culprit = _wrong_by_gravity_found(law) if scale.b is None else _wrong_by_residuals(law, scale)
    if culprit is None:
        return
    sign = f"set {key}_sign = -1 under [log], or angle_sign = -1 where it is the angle's that is wrong"
    zero = 'angle_zero = "up" where 0 is the top'
    found = f"(the inertia would be {law.a11:.3g} {scale.unit})"
    raise InputError(
        f"{where}: "
        + {
            "drive": f"{key} has the wrong sign against the angle {found}; {sign} (+1 if it is -1 already).",
            "zero": f"gravity pulls the wrong way, so 0 of the angle seems to be the top {found}; set angle_zero = "
            '"up" under [log] ("down" if it is "up" already).',
            "both": f"{key} has the wrong sign against the angle and gravity pulls the wrong way {found}; {sign}, and "
            f"{zero}.",
            "either": f"{key} has the wrong sign against the angle, or the angle's zero is wrong {found}; {sign}, or "
            f"{zero}.",
        }[culprit],
        code="wrong-sign",
    )


def _wrong_by_residuals(law: WindowFit, scale: Scale) -> str | None:
    """What is wrong where gravity is known: "drive", "zero", "both", "either", or None.

    To turn gravity is to turn the drive, and inertia and friction with it, so one more fit tells all.
    """
    rows = law.rows
    drive = -scale.a12 * rows.wheel + rows.torque
    _, columns = columns_of(rows, scale, tuple(name for name in law.unknowns if name in rows.friction))
    turned = fit_linear(columns, known_side(rows, scale) - 2 * drive)
    ratio = float(turned.residuals @ turned.residuals) / max(float(law.fit.residuals @ law.fit.residuals), 1e-300)
    if scale.b and ratio < 1 / 9:
        return "drive" if turned.values[0] > 0 else "zero"
    if law.a11 >= -3 * law.u:
        return None
    if not scale.b:
        return "drive"
    return "both" if ratio > 9 else "either"


def _wrong_by_gravity_found(law: WindowFit) -> str | None:
    """What is wrong where gravity was sought too: its sign and that of the inertia tell."""
    gravity, spread = law.value("gravity_torque"), law.uncertainty("gravity_torque")
    known = abs(gravity) > INDICATED * spread
    if law.a11 < -3 * law.u:
        return ("drive" if gravity < 0 else "both") if known else "either"
    return "zero" if known and gravity < 0 and law.a11 > INDICATED * law.u else None


@dataclass(frozen=True)
class AnswerCheck:
    """Conditioning of an answer: warnings and notes; what the rows see of the unknowns.

    near_resonance: the inertia is mostly the gravity torque rescaled.
    """

    warnings: list[Message]
    notes: list[Message]
    identifiability: Message
    near_resonance: bool


def check_answer(
    parameters: dict[str, Parameter],
    budget: list[BudgetEntry],
    law: WindowFit,
    scale: Scale,
    amplitude: float,
) -> AnswerCheck:
    """The conditioning of the answer. Raises NotIdentifiableError where the data do not determine the inertia."""
    inertia = parameters["inertia"]
    relative = (inertia.standard_uncertainty or np.inf) / max(abs(inertia.value), 1e-300)
    seen, motion = identifiability_of(law, scale), _main_frequency(law, scale, amplitude)
    require_seen(seen, *motion)
    if inertia.value <= 0 or relative > HOPELESS or not np.isfinite(relative):
        raise NotIdentifiableError(_hopeless(inertia, relative, scale, motion))
    warnings: list[Message] = []
    notes: list[Message] = []
    if (scale.b is None or scale.unknown) and _share(budget, inertia) > 0.02:
        text = f"{seen.combination(_values(law))}; {advice(seen, *motion)}."
        warnings.append(Message("gravity-and-inertia", text, Kind.GRAVITY_AND_INERTIA))
    near_resonance = False
    if scale.drive != "none" and scale.b:
        lean = abs(float(law.fit.influence[0] @ law.rows.gravity)) * abs(scale.b) / law.a11
        near_resonance = lean > 0.8
        if near_resonance:
            warnings.append(Message("near-resonance", _leaning(lean, amplitude, scale.b / law.a11)))
    if scale.drive == "none":
        notes.append(Message("scale-from-gravity", "the scale is that of axis.gravity_torque, in proportion."))
    return AnswerCheck(warnings, notes, _how_identifiable(seen, law), near_resonance)


def _share(budget: list[BudgetEntry], inertia: Parameter) -> float:
    spread = sum(e.standard_uncertainty**2 for e in budget if e.parameter == "inertia" and e.type == "A")
    return float(np.sqrt(spread)) / inertia.value


def identifiability_of(law: WindowFit, scale: Scale) -> Identifiability:
    """What the rows of a fit see of its unknowns, with its own uncertainty of the inertia."""
    units = units_on(linear=scale.linear)
    _, columns = columns_of(law.rows, scale, tuple(name for name in law.unknowns if name in law.rows.friction))
    seen = examine(law.unknowns, [units.get(name, "") for name in law.unknowns], columns)
    return seen.scaled_to(law.u)


def _values(law: WindowFit) -> dict[str, float]:
    return {name: law.value(name) for name in law.unknowns}


def _how_identifiable(seen: Identifiability, law: WindowFit) -> Message:
    text = (
        f"rank {seen.rank} of {len(seen.names)}, condition {number(seen.condition, digits=2)}; "
        f"{seen.combination(_values(law))}, and {seen.price}."
    )
    return Message("identifiability", text)


def _main_frequency(law: WindowFit, scale: Scale, amplitude: float) -> tuple[float | None, float]:
    """Main frequency of the motion and of the free swing at its amplitude, rad/s, as the rows show them."""
    gravity = float(np.linalg.norm(law.rows.gravity))
    b = law.value("gravity_torque") if scale.b is None else scale.b
    if gravity == 0.0 or law.a11 <= 0:
        return None, 0.0
    amplitude = min(amplitude, LARGEST_SWING)
    sine = 1 - amplitude**2 / 8
    natural = np.sqrt(max(b, 0.0) / law.a11) * (1 - amplitude**2 / 16)
    return float(np.sqrt(np.linalg.norm(law.rows.inertia) / gravity * max(sine, 0.3))), float(natural)


def _hopeless(inertia: Parameter, relative: float, scale: Scale, motion: tuple[float | None, float]) -> str:
    if inertia.value <= 0 and scale.b is not None:
        return (
            f"the balance gives an inertia of {inertia.value:.3g} {inertia.unit}, which is not positive; "
            "check the signs and scales under [log] and drive.wheel.inertia."
        )
    spread = f"{100 * relative:.0f} %" if inertia.value > 0 and relative < 100 else "more than its value"
    sought = (*(("gravity_torque",) if scale.b is None else ()), *scale.unknown)
    torques = [TERMS[name] for name in sought if TERMS[name].is_conservative]
    if torques:
        return (
            f"inertia and {' and '.join(term.words for term in torques)} move together in this motion (the inertia is "
            f"uncertain by {spread}); {advice_on_gravity(*motion, [term.key or term.words for term in torques])}."
        )
    return (
        f"the motion does not determine the inertia (it is uncertain by {spread}); "
        "record larger or faster swings, or more of them."
    )


def _leaning(lean: float, amplitude: float, stiffness: float) -> str:
    natural = np.sqrt(stiffness) * (1 - min(amplitude, LARGEST_SWING) ** 2 / 16)
    reason = "the motion is near resonance" if lean < 1.5 else "the motion is slow against the free swing"
    return (
        f"{reason} ({natural:.2g} rad/s), so the inertia is mostly the gravity torque rescaled (1 % of "
        f"axis.gravity_torque moves it by {lean:.2g} %); drive at {1.7 * natural:.2g} rad/s or more."
    )


class Fault(Enum):
    """What equation (II) shows to be wrong."""

    VOLTAGE_SIGN = auto()
    READING = auto()
    CONSTANTS = auto()


@dataclass(frozen=True)
class MotorCheck:
    """What equation (II) shows of the wheel angle and the motor: the fault with its warning, else a note.

    held: a message where the voltage between the rows is not what drive_held says.
    """

    fault: Fault | None = None
    warnings: list[Message] = field(default_factory=list)
    notes: list[Message] = field(default_factory=list)
    held: list[Message] = field(default_factory=list)

    def all_notes(self) -> list[Message]:
        """The notes of a method that does not use the motor."""
        return self.notes if self.fault is not None else [*self.notes, *self.held]


def check_motor(
    balance: MotorBalance | None, signals: Signals, *, method: str = "momentum", uses_motor: bool = False
) -> MotorCheck:
    """Check the wheel angle by equation (II). Never refuses.

    An absolute wheel angle taken for a relative one cannot be seen in equation (I); (II) shows it. Motor constants some
    per cent off leave as much, so the readings are compared with these left free too. method: what messages call it;
    uses_motor: whether its inertia depends on the motor's constants.
    """
    if signals.wheel is None:
        return MotorCheck()
    if balance is None:
        text = "wheel_angle was taken as [log] says; without voltage and motor constants nothing checks that."
        return MotorCheck(notes=[Message("wheel-angle-reading", text)])
    if balance.turned < CLEARLY * balance.as_stated and balance.turned < 2 * BAD_MOTOR:
        text = (
            f"voltage seems to have the wrong sign (the motor's balance leaves {left(balance.as_stated)}, with the "
            f"sign turned {left(balance.turned)}); {method} does not use it, but set voltage_sign under [log]."
        )
        return MotorCheck(Fault.VOLTAGE_SIGN, [Message("voltage-sign", text)])
    held = balance.hold_doubt(harm="this inertia depends on it" if uses_motor else f"{method} does not use it")
    stated, other = ("relative", "absolute") if balance.is_relative else ("absolute", "relative")
    verdict = _reading(balance)
    if verdict is not None:
        text = f"{verdict.format(stated=stated, other=other)} ({_residuals(balance)}); " + (
            f'set wheel_angle_is = "{other}" under [log] if the sensor says so, or check drive.motor.'
        )
        return MotorCheck(Fault.READING, [Message("wheel-angle-reading", text)], held=held)
    if balance.as_stated > BAD_MOTOR and not held:
        return MotorCheck(Fault.CONSTANTS, [Message("motor-balance", _motor_off(balance, method, uses_motor))])
    rest = f"; the wheel rests {balance.rests:.0%} of the time, and shows nothing then" if balance.rests > 0.05 else ""
    text = f"wheel_angle taken as {stated} to the pendulum ({_residuals(balance)}{rest})."
    return MotorCheck(notes=[Message("wheel-angle-reading", text)], held=held)


def _motor_off(balance: MotorBalance, method: str, uses_motor: bool) -> str:
    text = f"the motor's balance leaves {left(balance.as_stated)}: the motor constants do not fit this log, or the "
    if uses_motor:
        return (
            f"{text}wheel angle is not what [log] says; this inertia depends on them and is wrong by several times as "
            "much, so use the momentum method or calibrate the motor."
        )
    return (
        f"{text}wheel angle is not what wheel_angle_unit and wheel_angle_is under [log] say; {method} does not use the "
        "motor, but check both."
    )


def _reading(balance: MotorBalance) -> str | None:
    """What to say where the other reading of the wheel angle fits clearly better, with {stated} and {other}."""
    refitted, otherwise = balance.refitted, balance.refitted_otherwise
    if refitted is None or otherwise is None:
        refitted = otherwise = 1.0
    if otherwise < CLEARLY * refitted and otherwise < BAD_MOTOR:
        return "wheel_angle looks {other}, not {stated}, which motor constants that are off hardly explain"
    undecided = refitted > CLEARLY * otherwise
    if undecided and balance.otherwise < CLEARLY * balance.as_stated and balance.otherwise < BAD_MOTOR:
        return "either wheel_angle is {other}, not {stated}, or the motor constants are some per cent off"
    return None


def _residuals(balance: MotorBalance) -> str:
    told = (
        f"the motor's balance leaves {left(balance.as_stated)} with it and {left(balance.otherwise)} with the "
        "other reading"
    )
    if balance.refitted is None or balance.refitted_otherwise is None:
        return told
    return (
        f"{told}, {left(balance.refitted)} and {left(balance.refitted_otherwise)} with the motor's strength and "
        "friction left free"
    )
