"""Consistency of an estimate with equations (I) and (II) on modulating functions, for methods that use speeds or the
motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swingid.balance.choice import FLAT
from swingid.balance.fits import BASIS, WindowFit, fit_rows
from swingid.balance.motor import MotorBalance, motor_balance
from swingid.balance.reversals import impulse_possible
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.checks.answer import Fault, check_answer, check_motor, check_sign, voltage_remedy, wrong_sign
from swingid.checks.ran import ran
from swingid.checks.rig_file import RigFileCheck
from swingid.errors import InputError, UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import stated_at
from swingid.numerics.arrays import median, quantile
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.recording.recording import Recording
from swingid.result.provenance import exact_constants
from swingid.result.result import Message
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter, combined
from swingid.uncertainty.significance import INDICATED
from swingid.units import Quantity

DISAGREES = "disagreement with the momentum balance"

CLOSE = 0.003
"""Relative difference to the momentum balance that is not worth a warning."""

SATURATED = 0.6
"""Share of rows with the voltage at its limits from which on the effect of its jumps on the energy is significant."""

JUMPS = 0.001
"""Effect of such jumps, relative to the inertia, at most: 0.05 % on the twin limited to 6 V (76 % of the rows)."""

FEWEST_PER_SWING = 10
"""Rows per swing below which the bias of smoothed speeds is some per cent, which the interval does not contain."""

MOTOR_KEYS = ("drive.motor.torque_per_volt", "drive.motor.efficiency", "drive.wheel.inertia", "drive.motor.gear_ratio")

SHARES = (1 / 2, 1 / 4, 1 / 8, 1 / 16)
"""Half-lengths, in swings, of the windows that are compared."""

LOUDER, FROM = 1.5, 0.3
"""Windows of half the length have at least so many times the relative uncertainty by noise of the sensors, from this
half-length (in swings) on: on even windows 4 times by white noise of an angle, twice by that of a rate."""

SWINGS = 12
"""Swings from which a wrong sign or wrong motor constants are detected."""


@dataclass(frozen=True)
class Consistency:
    """Equations (I) and (II) on modulating functions, more sensitive to signs and motor constants than energies are."""

    signals: Signals
    windows: WindowFit | None
    balance: MotorBalance | None


def consistency_check(
    log: Recording, rig: Rig, motion: Motion, equation: Equation, noise: Noise, encoders: Encoders
) -> Consistency:
    """Fit equation (I) and evaluate (II) on one set of windows over the first swings of a log.

    Raises InputError where wheel, torque or voltage has the wrong sign.
    """
    if len(motion.turning_times) > SWINGS:
        log = log.segment(float(log.time[0]), float(motion.turning_times[SWINGS]))
        motion = motion.within(float(log.time[0]), float(log.time[-1]))
    signals = Signals.of(log, rig, motion, encoders)
    speed = motion.speed
    quickest = quantile(np.abs(speed.acceleration(speed.grid)), 0.99)
    length = max(0.75 * float(np.max(np.abs(speed.speed))) / max(quickest, 1e-300), 5 * noise.step)
    longest = min(length, log.duration / 20)
    fit = best_windows(signals, equation, noise, (*BASIS, "memory"), longest)
    if fit is not None and not impulse_possible(equation, motion, abs(fit.value("memory")), fit.value("coulomb")):
        fit = best_windows(signals, equation, noise, BASIS, longest)
    where = log.source.path or "the log"
    if fit is None:
        return Consistency(signals, None, None)
    check_sign(fit, where, live=log.is_live)
    balance = motor_balance(log, rig, signals, fit.rows.windows, noise)
    if balance is not None and (reversed_sign := wrong_sign(balance)):
        text = f"{where}: voltage has {reversed_sign}; {voltage_remedy(log.is_live)}."
        raise InputError(text, code="wrong-sign")
    return Consistency(signals, fit, balance)


def best_windows(
    signals: Signals, equation: Equation, noise: Noise, terms: tuple[str, ...], first: float | None = None
) -> WindowFit | None:
    """The fit with about the least relative uncertainty of a11 on windows of several lengths; None for too few swings.

    Noise attenuates short windows, the lack of fit of the friction biases long ones. first: the half-length (s) that
    is taken if its uncertainty is about the least.
    """
    if len(signals.motion.turning_times) < 2:  # no swing, whose half-period would be the measure
        return None
    swing = signals.motion.half_period
    seen: list[WindowFit] = []
    least = np.inf
    for half in [*([] if first is None else [first]), *(share * swing for share in SHARES)]:
        fit = fit_rows(rows_of(signals.suited(half), law_windows(signals, half)), equation, noise, terms)
        if fit is None or not np.isfinite(fit.u):
            continue
        seen.append(fit)
        least = min(least, fit.relative(fit.u))
        if half != first and half < FROM * swing and LOUDER * fit.relative(fit.computed**0.5) >= least:
            break  # noise alone makes shorter ones worse
    return next((fit for fit in seen if fit.relative(fit.u) <= FLAT * least), None)


def check_energy(
    answer: Evaluated,
    consistency: Consistency,
    rig: Rig,
    equation: Equation,
    motion: Motion,
    compared: float | None,
    rig_file: RigFileCheck | None,
) -> tuple[list[Message], list[Message]]:
    """Warnings and notes; raises UnanswerableError where the data do not determine the inertia.

    compared: standard uncertainty with which the inertia is compared with the momentum balance, None where it is not.
    rig_file: the balance of all swings.
    """
    inertia, sensitivities = answer.parameters["inertia"], answer.sensitivities
    per_swing = motion.half_period / median(np.diff(consistency.signals.nodes.stamps))
    if per_swing < FEWEST_PER_SWING:
        raise UnanswerableError(
            f"the log has {per_swing:.1f} rows per swing, too few for speeds, on which the energy depends; log at "
            f"least {FEWEST_PER_SWING}, or use the momentum method.",
            code="slow-rows",
        )
    if inertia.value <= 0:
        raise UnanswerableError(
            f"the energy balance gives an inertia of {inertia.value:.3g} {inertia.unit}, which is not positive; check "
            "the signs and scales under [log] and the motor's constants, or use the momentum method.",
            code="not-identifiable",
        )
    warnings = rig_file.warnings(inertia) if rig_file else []
    notes = exact_constants([key for key in rig.constants_without_uncertainty() if key in sensitivities])
    near_resonance = None
    if consistency.windows is not None and inertia.standard_uncertainty is not None:
        amplitude = float(np.max(np.abs(motion.turning_angles), initial=0.0))
        alone = rig_file.alone(inertia) if rig_file else inertia
        checked = check_answer(
            answer.parameters | {"inertia": alone}, answer.budget, consistency.windows, amplitude, rig
        )
        wheel = equation.drive == "reaction-wheel"
        cause = "wrong motor constants" if wheel else "friction that does not depend on the speed alone"
        differs = [] if compared is None else against_momentum(inertia, compared, consistency.windows, cause)
        warnings += checked.warnings + differs
        notes += [checked.identifiability, *checked.notes]
        near_resonance = None if differs else checked.near_resonance
    motor = check_motor(consistency.balance, consistency.signals, uses_motor=True)
    notes += motor.notes
    if equation.drive == "reaction-wheel":
        text = f"{motor_sensitivities(rig, sensitivities, inertia)}; momentum needs no motor constant."
        notes.append(Message("leans-on-the-motor", text))
        warnings += motor.held
        # near resonance that is the cause of the residual of (II), or the wheel rests part of the time
        if motor.fault is Fault.CONSTANTS and near_resonance:
            notes.remove(near_resonance)
            warnings.append(near_resonance)
        else:
            warnings += motor.warnings
    return warnings, notes


def against_momentum(
    inertia: Parameter, compared: float, windows: WindowFit, cause: str, shift: float = 0.0
) -> list[Message]:
    """A warning where the momentum balance of a few swings gives another inertia than the uncertainties explain.

    shift: change of the inertia of the balance where constants are as estimated, not as stated.
    """
    ran("momentum")
    difference = inertia.value - shift - windows.inertia
    if not abs(difference) >= max(INDICATED * np.hypot(compared, windows.u), CLOSE * abs(inertia.value - shift)):
        return []
    share = inertia.value / (windows.inertia + shift) - 1
    text = (
        f"this inertia is {abs(share):.1%} {'more' if share > 0 else 'less'} than the momentum balance of the same "
        f"swings gives; the likely cause is {cause}, on which the momentum method depends less."
    )
    return [Message("disagrees-with-momentum", text)]


def without_momentum(budget: Sequence[BudgetEntry]) -> float:
    """Standard uncertainty of the inertia by all sources but the disagreement with the momentum balance."""
    return combined([entry for entry in budget if entry.source != DISAGREES], "inertia")


def motor_sensitivities(rig: Rig, sensitivities: dict[str, float], inertia: Parameter) -> str:
    """Relative changes of the inertia per 1 % of each constant of motor and wheel, in words."""
    quantities = {key: stated_at(rig, key) for key in MOTOR_KEYS if key in sensitivities}
    changes = [
        f"{key} by {sensitivities[key] * quantity.value / inertia.value:+.2g} %"
        for key, quantity in quantities.items()
        if isinstance(quantity, Quantity)
    ]
    return f"1 % more of a constant changes this inertia: {', '.join(changes)}"


def check_saturation(used: Recording, rig: Rig, inertia: Parameter) -> tuple[list[Message], list[Message]]:
    """A warning or a note where the voltage is mostly saturated: it is known there, but it jumps between its limits.

    At a jump the wheel's acceleration jumps too, which a smoothed speed does not follow. `momentum` needs no speed. A
    note where `JUMPS` of the inertia is less than its standard uncertainty.
    """
    if rig.drive.kind != "reaction-wheel" or used.voltage is None:
        return [], []
    ran("saturation")
    low, high = float(used.voltage.min()), float(used.voltage.max())
    near = 1e-3 * (high - low)
    share = float(np.mean((used.voltage <= low + near) | (used.voltage >= high - near)))
    if high <= low or share < SATURATED:
        return [], []
    text = (
        f"the voltage stands at its limits in {share:.0%} of the rows and jumps between them, which smoothed speeds do "
        "not follow (some 0.1 % of the inertia); use the momentum method, or record a smaller or slower motion."
    )
    found = [Message("voltage-saturated", text)]
    matters = JUMPS * inertia.value > (inertia.standard_uncertainty or 0.0)
    return (found, []) if matters else ([], found)
