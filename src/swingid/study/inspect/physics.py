"""Checks of a log against the rig: signs, zero, reading of the wheel, latency, encoders, by the log's own balance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from swingid.balance.choice import choose
from swingid.balance.errors import late_error
from swingid.balance.fits import WindowFit
from swingid.balance.motor import motor_balance
from swingid.balance.rows import Signals
from swingid.checks.answer import Fault, check_motor, check_sign
from swingid.checks.closure import CLOSES, share_left
from swingid.checks.hypothesis import matters
from swingid.checks.stated import gravity_off
from swingid.format import number, percent, plus_minus
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.preparation.encoders import corrected
from swingid.preparation.noise import Noise
from swingid.preparation.scale import equation_of, require_channels
from swingid.preparation.zero import HARMLESS, centre_of
from swingid.recording.inspect import Check, Level
from swingid.recording.recording import Recording
from swingid.study.inspect import extra_columns as small
from swingid.study.inspect.extra_columns import Extra
from swingid.study.inspect.motion import Swings
from swingid.uncertainty.significance import CERTAIN, INDICATED

SHORT = 0.05
"""Steps of the clock below which a latency does no harm."""

FEWEST = 20
"""Fewest rows of a fit from which small quantities are estimated."""

MOST_ROWS = 120_000
"""Rows of a log that these checks look at; more rows add little."""

CLEAR = 5e-3
"""Uncertainty (rad) of the angle's zero beside encoder errors up to which the two are distinguished."""

BENDS_GRAVITY = ("zero", "latency", "angle-encoder", "wheel-encoder")
"""Checks whose faults also look like a gravity torque other than the stated one."""

TITLES = {Fault.VOLTAGE_SIGN: "voltage sign", Fault.READING: "reading of the wheel"} | dict.fromkeys(
    (Fault.CONSTANTS, None), "motor"
)
"""Titles of what equation (II) shows."""


@dataclass(frozen=True)
class Balance:
    """The momentum balance of the part that was looked at: fits on windows of several lengths, the chosen one first."""

    used: Recording
    signals: Signals
    equation: Equation
    noise: Noise
    law: WindowFit
    fits: list[WindowFit]

    @property
    def left(self) -> float:
        """What the terms leave, see `share_left`."""
        return share_left(self.law)


def balance_of(log: Recording, rig: Rig, swings: Swings, noise: Noise) -> Balance:
    """The balance on at most MOST_ROWS rows from the middle of the useful part; errors as those of `identify`."""
    equation = equation_of(rig)
    require_channels(log, rig)
    used, encoders, _ = corrected(log.segment(swings.start, swings.stop), rig)
    if len(used) > MOST_ROWS:
        begin = (len(used) - MOST_ROWS) // 2
        used = used.segment(float(used.time[begin]), float(used.time[begin + MOST_ROWS - 1]))
    motion = swings.motion.within(float(used.time[0]), float(used.time[-1]))
    choice = choose(Signals.of(used, rig, motion, encoders), rig, equation, noise)
    law = choice.law
    check_sign(law, log.source.path or "the log", live=log.is_live)
    return Balance(used, choice.signals, equation, noise, law, list(choice.tried.values()))


def check_physics(balance: Balance, rig: Rig) -> list[Check]:
    """All checks that need the rig, on a balance whose signs are right."""
    checks = [_signs(balance, rig), *_model(balance)]
    fits = [fit for fit in balance.fits if len(fit.rows) >= FEWEST]
    checks += _wheel(balance, rig)
    turn = rig.log.wheel_scale.value if rig.drive.wheel is not None else 1.0
    extras = small.extras(fits, balance.signals, turn) if fits else {}
    if "zero" in extras:
        centre = centre_of(balance.signals.motion.turning_angles) if rig.drive.channel is None else None
        if centre is None:
            checks.append(_zero(extras["zero"], small.zero_of(fits, balance.signals)))
        else:
            checks.append(_zero(replace(extras["zero"], value=centre[0], uncertainty=centre[1]), None))
    if "latency" in extras:
        checks.append(_latency(extras["latency"], balance, rig))
    checks += _voltage(fits, balance, rig)
    for which, word, table in (("angle", "angle", "sensors"), ("wheel", "wheel", "sensors.wheel")):
        is_encoder = which == "wheel" or not rig.log.has_rate_alone
        if is_encoder and f"{which} 1 cosine" in extras:
            checks.append(_encoder(extras, which, word, table, rig))
    if not any(check.level in ("repair", "advice") and check.code in BENDS_GRAVITY for check in checks):
        checks += _gravity(balance, rig)
    return checks


def _signs(balance: Balance, rig: Rig) -> Check:
    law, equation = balance.law, balance.equation
    if not equation.driven:
        text = "nothing drives the axis, so no sign can be wrong; the decay gives a positive inertia."
        return Check("signs", "signs", "ok", text)
    what = "wheel angle" if "wheel" in equation.coefficients else "torque"
    turned = "" if not equation.value("gravity_torque") else " and gravity pulls towards 0"
    inertia = plus_minus(law.a11 - equation.carried, law.u, equation.shown(equation.unit))
    text = f"{what} and angle have signs that belong together{turned}: the balance gives the inertia {inertia}."
    return Check("signs", "signs", "ok", text, "", {"inertia": law.a11 - equation.carried, "uncertainty": law.u})


def _model(balance: Balance) -> Iterator[Check]:
    """Return whether the balance closes: what is left against what the terms are."""
    share = balance.left
    text = f"inertia, gravity, drive and friction leave {percent(share)} of the inertia's term"
    if share <= CLOSES:
        yield Check("balance", "balance", "ok", f"{text}: it closes.", "", {"left": share})
        return
    text += ": a term is missing, or a column is not what [log] states."
    remedy = "correct the column, sign, unit or constant that is not what the rig file states"
    yield Check("balance", "balance", "repair", text, remedy, {"left": share})


def _zero(joint: Extra, alone: Extra | None) -> Check:
    """The zero of the angle, beside the encoder's errors where the motion distinguishes them, else without them."""
    zero = joint if joint.uncertainty < CLEAR or alone is None else alone
    size = plus_minus(zero.value, zero.uncertainty, "rad")
    check = partial(Check, "zero", "zero of the angle", values={"zero": zero.value, "uncertainty": zero.uncertainty})
    if zero.uncertainty > 0.1:
        text = f"the motion does not determine where the body hangs (to within {zero.uncertainty:.2g} rad only)."
        return check("unknown", text)
    text = f"0 of the angle lies {size} beside hanging"
    if abs(zero.value) < max(CERTAIN * zero.uncertainty, 1e-3):
        return check("ok", f"{text}.")
    if zero is alone:
        text += ", unless it is the encoder's error or friction that differs by direction"
    if abs(zero.value) < HARMLESS:
        return check("note", f"{text}; upper and lower turning points make up for so little.")
    remedy = f"take {number(zero.value, 'rad', 3)} off the angle in the log"
    return check("advice", f"{text}.", remedy)


def _gravity(balance: Balance, rig: Rig) -> Iterator[Check]:
    """Return whether drive and gravity are of one scale, where the motion determines it; see `checks.stated`."""
    law = balance.law
    for finding in gravity_off(law, balance.fits, balance.signals, rig) or ():
        if not matters(finding.change, law.total, law.a11):
            continue
        drive = "log.torque_gain" if "torque" in balance.equation.coefficients else "drive.wheel.inertia"
        remedy = f"correct axis.gravity_torque or {drive}, or state the less certain one with its uncertainty"
        yield Check("gravity-torque-disagrees", "scale", "repair", f"{finding.text.rpartition('; ')[0]}.", remedy)


def _wheel(balance: Balance, rig: Rig) -> Iterator[Check]:
    """Relative or absolute wheel angle, and the voltage's sign, by the motor's balance (II)."""
    if balance.signals.wheel is None:
        return
    motor = motor_balance(balance.used, rig, balance.signals, balance.law.rows.windows, balance.noise)
    checked = check_motor(motor, balance.signals)
    values: dict[str, object] = {}
    if motor is not None:
        values = {"as_stated": motor.as_stated, "otherwise": motor.otherwise, "turned": motor.turned}
    other = "absolute" if rig.log.wheel_angle_is == "relative" else "relative"
    remedies = {
        Fault.VOLTAGE_SIGN: f"set voltage_sign = {-rig.log.voltage_sign} under [log]",
        Fault.READING: f'set wheel_angle_is = "{other}" under [log] if the sensor says so',
    }
    for message in checked.warnings:
        text = f"{message.message.rpartition('; ')[0]}."
        remedy = "" if checked.fault is None else remedies.get(checked.fault, "")
        yield Check(message.code, TITLES[checked.fault], "repair" if remedy else "note", text, remedy, values)
    level: Level = "unknown" if motor is None else "ok"
    for message in checked.notes:
        yield Check(message.code, TITLES[Fault.READING], level, message.message, "", values)
    for message in checked.held if checked.fault is None else []:
        yield Check(message.code, TITLES[None], level, message.message, "", values)
    if motor is None or checked.fault is Fault.VOLTAGE_SIGN:
        return
    turned = percent(motor.turned) if np.isfinite(motor.turned) else "nothing that can be compared"
    text = f"the motor's balance leaves {percent(motor.as_stated)} with the voltage as logged, {turned} with it turned."
    sure: Level = "ok" if motor.as_stated < 0.5 * motor.turned else "unknown"
    yield Check("voltage-sign", "voltage sign", sure, text, "", values)


def _latency(latency: Extra, balance: Balance, rig: Rig) -> Check:
    """Latency between the channels, beyond what the rig file declares."""
    wheel = rig.drive.wheel is not None
    total = rig.sensors.of("wheel" if wheel else "angle").latency.value + latency.value
    text = ""
    if total < 0 and not wheel:
        text = "; a negative one means that the torque acts later than it is logged"
    place = "[sensors.wheel]" if wheel else "[sensors]"
    where = "the wheel angle is read {} after the angle" if wheel else "the angle is read {} after the torque acts"
    law, signals = balance.law, balance.signals
    effect = float(law.fit.influence[0] @ late_error(law.rows, signals, law.coefficients)) * latency.value
    # what the standard uncertainty of the inertia contains is no reason to change the rig file
    level: Level = "repair" if abs(effect) > law.total else "note"
    text += f"; it changes the inertia by {percent(effect / law.a11, sign=True)}"
    check = Check("latency", "latency", level, f"{text}.", place)
    return _delay(latency, total, check, balance, ("the latency between the channels", where))


def _voltage(fits: list[WindowFit], balance: Balance, rig: Rig) -> Iterator[Check]:
    """Latency of both angles against the voltage, where the rig file has the motor's constants."""
    windows = [fit.rows.windows for fit in fits]
    latencies = [small.voltage_latency(balance.used, rig, balance.signals, each, balance.noise) for each in windows]
    known = sorted((u, value) for value, u in (latency for latency in latencies if latency is not None))
    if not known:
        return
    late = small.pooled("voltage latency", known, small.PRIOR_LATENCY)
    total = rig.sensors.of("angle").latency.value + late.value
    text = ". It affects methods that need the motor, and not momentum."
    if late.value < 0:
        text = "; negative: the voltage acts later than it is logged (a delay, or the coil's inductance)" + text
    check = Check("voltage-latency", "latency of the voltage", "note", text, "[sensors], for both encoders")
    yield _delay(
        late, total, check, balance, ("when the voltage acts", "both angles are read {} after the voltage acts")
    )


def _delay(late: Extra, total: float, check: Check, balance: Balance, words: tuple[str, str]) -> Check:
    """The check of a latency: as given where it is significant, with size and remedy; else "ok" or "unknown".

    total: with what the rig file declares (s). check: what its evidence ends in, and the table to state it in. words:
    what is sought, and the finding with {} for its size.
    """
    sought, finding = words
    values: dict[str, object] = {"latency": late.value, "uncertainty": late.uncertainty}
    within = f"{1e3 * late.uncertainty:.2g} ms"
    if not late.identifiable:
        text = f"the motion does not determine {sought} (to within {within} only)."
        return replace(check, level="unknown", evidence=text, remedy="", values=values)
    size = plus_minus(1e3 * late.value, 1e3 * late.uncertainty, "ms")
    text = f"{finding.format(size)}, beyond what the rig file states"
    if abs(late.value) < max(CERTAIN * late.uncertainty, SHORT * balance.noise.step):
        return replace(check, level="ok", evidence=f"{text}: nothing to be seen.", remedy="", values=values)
    remedy = f'state latency = "{1e3 * total:.4g} ± {within}" under {check.remedy}'
    return replace(check, evidence=text + check.evidence, remedy=remedy, values=values)


def _encoder(extras: dict[str, Extra], which: str, word: str, table: str, rig: Rig) -> Check:
    """Once and twice per turn of one encoder."""
    parts: list[str] = []
    values: dict[str, object] = {}
    level: Level = "ok"
    remedy, known_any = "", False
    declared = rig.sensors.of("wheel" if which == "wheel" else "angle").nonlinearity
    for k, often in ((1, "once"), (2, "twice")):
        size, spread, known = small.amplitude(extras, f"{which} {k}")
        known_any |= known
        values |= {f"amplitude_{often}": size, f"uncertainty_{often}": spread, f"told_{often}": known}
        degrees = plus_minus(np.degrees(size), np.degrees(spread), "°") if known else "not identifiable"
        parts.append(f"{degrees} {often} per turn")
        if known and size > CERTAIN * spread and not (k == 1 and size < INDICATED * declared):
            level = "repair" if k == 1 else "note" if level == "ok" else level
            state = f'state nonlinearity = "{np.degrees(size) / np.sqrt(2):.2g} deg" under [{table}]'
            remedy = remedy or f"{state}, or run swingid calibrate --encoders"
    if level == "note":
        remedy = ""
    code, title = f"{which}-encoder", f"{word} encoder"
    if not known_any:
        text = f"the motion does not determine the nonlinearity of the {word}'s encoder."
        return Check(code, title, "unknown", text, "", values)
    text = f"nonlinearity of the {word}'s encoder: {' and '.join(parts)}."
    return Check(code, title, level, text, remedy, values)
