"""Consistency of an answer with equations (I) and (II) on test functions, for methods that use speeds or the motor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.fits import BASIS, WindowFit, fit_rows
from swingid.balance.motor import MotorBalance, motor_balance
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.checks.answer import BAD_MOTOR, CLEARLY, Fault, check_answer, check_motor, check_sign
from swingid.checks.gravity import check_gravity
from swingid.checks.zero import check_zero
from swingid.errors import InputError, UnanswerableError
from swingid.format import left
from swingid.model.rig import Rig
from swingid.numerics.arrays import median, quantile
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.recording.recording import Recording
from swingid.result.provenance import exact_constants
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, Parameter
from swingid.uncertainty.significance import INDICATED

DISAGREES = "disagreement with the momentum balance"

CLOSE = 0.003
"""Relative difference to the momentum balance that is not worth a warning."""

SATURATED = 0.6
"""Share of the rows with the voltage at its limits from which on what its jumps do to the energy is seen."""

FEWEST_PER_SWING = 10
"""Rows per swing below which smoothed speeds are per cents off, and the interval does not know of it."""

SWINGS = 12
"""Swings enough to see a wrong sign or a bad motor."""


@dataclass(frozen=True)
class Consistency:
    """Equations (I) and (II) on test functions, which show a wrong sign or a bad motor better than energies do.

    gravity: warnings where the balance contradicts the stated gravity torque, see `check_gravity`.
    """

    signals: Signals
    windows: WindowFit | None
    balance: MotorBalance | None
    gravity: tuple[Message, ...] = ()


def consistency_check(
    log: Recording, rig: Rig, motion: Motion, scale: Scale, noise: Noise, encoders: Encoders
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
    fit, shorter = (
        fit_rows(rows_of(signals, law_windows(signals, half)), scale, noise, (*BASIS, "memory"))
        for half in (longest, longest / np.sqrt(2))
    )
    where = log.source.path or "the log"
    if fit is None:
        return Consistency(signals, None, None)
    check_sign(fit, scale, where)
    balance = motor_balance(log, rig, signals, fit.rows.windows, noise)
    if balance is not None and balance.turned < CLEARLY * balance.as_stated and balance.turned < 2 * BAD_MOTOR:
        raise InputError(
            f"{where}: voltage has the wrong sign (the motor's balance leaves {left(balance.as_stated)}, with the "
            f"sign turned {left(balance.turned)}); set voltage_sign = -1 under [log], or +1 if it is -1 already.",
            code="wrong-sign",
        )
    others = () if shorter is None else (shorter,)
    return Consistency(
        signals, fit, balance, tuple(check_gravity(fit, others, signals, rig, scale, noise, least=CLOSE))
    )


def check_energy(
    answer: Evaluated,
    consistency: Consistency,
    rig: Rig,
    scale: Scale,
    motion: Motion,
    compared: float | None,
) -> tuple[list[Message], list[Message]]:
    """Warnings and notes; raises UnanswerableError where the data do not determine the inertia.

    compared: standard uncertainty with which the inertia is compared with the momentum balance, None where it is not.
    """
    inertia, sensitivities = answer.parameters["inertia"], answer.sensitivities
    per_swing = motion.half_period / median(np.diff(consistency.signals.nodes.stamps))
    if per_swing < FEWEST_PER_SWING:
        raise UnanswerableError(
            f"the log has {per_swing:.1f} rows per swing, too few to tell speeds, on which energy stands; log at least "
            f"{FEWEST_PER_SWING}, or use the momentum method.",
            code="slow-rows",
        )
    if inertia.value <= 0:
        raise UnanswerableError(
            f"the energy balance gives an inertia of {inertia.value:.3g} {inertia.unit}, which is not positive; check "
            "the signs and scales under [log] and the motor's constants, or use the momentum method.",
            code="not-identifiable",
        )
    warnings = list(consistency.gravity)
    notes = exact_constants([key for key in rig.constants_without_uncertainty() if key in sensitivities])
    only_resonance = False
    if consistency.windows is not None and inertia.standard_uncertainty is not None:
        amplitude = float(np.max(np.abs(motion.turning_angles), initial=0.0))
        checked = check_answer(answer.parameters, answer.budget, consistency.windows, scale, amplitude)
        apart = [] if compared is None else _against_momentum(inertia, compared, consistency.windows, scale)
        warnings += checked.warnings + apart
        notes += [checked.identifiability, *checked.notes]
        warnings += check_zero(consistency.windows, consistency.signals, scale, inertia.standard_uncertainty)
        only_resonance = checked.near_resonance and not apart
    motor = check_motor(consistency.balance, consistency.signals, uses_motor=True)
    notes += motor.notes
    if scale.drive == "reaction-wheel":
        notes.append(_leaning_on_motor(rig, sensitivities, inertia))
        warnings += motor.held
        # near resonance what (II) leaves is due to that, or the wheel rests part of the time, where it shows nothing
        if not (motor.fault is Fault.CONSTANTS and only_resonance):
            warnings += motor.warnings
    return warnings, notes


def differs_from_momentum(value: float, uncertainty: float, windows: WindowFit, scale: Scale) -> bool:
    """Whether an inertia differs from the momentum balance of a few swings by more than the uncertainties explain."""
    gap = abs(value - (windows.a11 - scale.carried))
    return bool(gap >= max(INDICATED * np.hypot(uncertainty, windows.u), CLOSE * abs(value)))


def _against_momentum(inertia: Parameter, compared: float, windows: WindowFit, scale: Scale) -> list[Message]:
    """A warning where the momentum balance of a few swings gives another inertia than the uncertainties explain."""
    if not differs_from_momentum(inertia.value, compared, windows, scale):
        return []
    difference = inertia.value / (windows.a11 - scale.carried) - 1
    cause = "motor constants that are off" if scale.drive == "reaction-wheel" else "friction that is not of speed alone"
    text = (
        f"this inertia is {abs(difference):.1%} {'more' if difference > 0 else 'less'} than the momentum balance of "
        f"the same swings gives; the likely cause is {cause}, and the momentum method leans less on that."
    )
    return [Message("disagrees-with-momentum", text)]


def _leaning_on_motor(rig: Rig, sensitivities: dict[str, float], inertia: Parameter) -> Message:
    assert rig.drive.motor is not None
    assert rig.drive.wheel is not None
    motor = rig.drive.motor
    shares = {
        "drive.motor.torque_per_volt": motor.torque_per_volt.value,
        "drive.motor.efficiency": motor.efficiency.value,
        "drive.wheel.inertia": rig.drive.wheel.inertia.value,
        "drive.motor.gear_ratio": motor.gear_ratio.value,
    }
    moves = [f"{key} by {sensitivities[key] * value / inertia.value:+.2g} %" for key, value in shares.items()]
    text = f"1 % more of a constant moves this inertia: {', '.join(moves)}; momentum needs no motor constant."
    return Message("leans-on-the-motor", text)


def check_saturation(used: Recording, rig: Rig) -> list[Message]:
    """A warning where the voltage mostly stands at its limits: it is known there, but it jumps from one to the other.

    At a jump the wheel's acceleration jumps too, which a smoothed speed does not follow. `momentum` needs no speed.
    """
    if rig.drive.kind != "reaction-wheel" or used.voltage is None:
        return []
    low, high = float(used.voltage.min()), float(used.voltage.max())
    near = 1e-3 * (high - low)
    share = float(np.mean((used.voltage <= low + near) | (used.voltage >= high - near)))
    if high <= low or share < SATURATED:
        return []
    text = (
        f"the voltage stands at its limits in {share:.0%} of the rows and jumps between them, which smoothed speeds do "
        "not follow (some 0.1 % of the inertia); use the momentum method, or record a smaller or slower motion."
    )
    return [Message("voltage-saturated", text)]
