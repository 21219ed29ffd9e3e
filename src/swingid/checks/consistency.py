"""Checks of an estimate that uses speeds or the motor: rows per swing, equation (II), saturation of the voltage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.checks.answer import (
    NEAR_RESONANCE,
    Fault,
    check_answer,
    identifiability_note,
    voltage_remedy,
    wrong_sign,
)
from swingid.checks.momentum import MomentumCheck
from swingid.errors import InputError, UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import stated_at
from swingid.preparation.motion import Motion
from swingid.recording.recording import Recording
from swingid.result.checked import Checked, noted, warned
from swingid.result.provenance import exact_constants
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, Parameter
from swingid.units import Quantity

SATURATED = 0.6
"""Share of rows with the voltage at its limits from which on the effect of its jumps on the energy is significant."""

JUMPS = 0.001
"""Effect of such jumps, relative to the inertia, at most: 0.05 % on the twin limited to 6 V (76 % of the rows)."""

FEWEST_PER_SWING = 10
"""Rows per swing below which the bias of smoothed speeds is some per cent, which the interval does not contain."""

SATURATION = "saturation"
"""Name of the check of saturation."""

MOTOR_KEYS = ("drive.motor.torque_per_volt", "drive.motor.efficiency", "drive.wheel.inertia", "drive.motor.gear_ratio")


def require_signs(check: MomentumCheck) -> None:
    """Raise InputError where equation (I) shows that a channel has the wrong sign, or (II) that the voltage has."""
    check.require_signs()
    balance, log = check.motor_balance, check.prepared.log
    if balance is not None and (reversed_sign := wrong_sign(balance)):
        text = f"{log.source.path or 'the log'}: voltage has {reversed_sign}; {voltage_remedy(log.is_live)}."
        raise InputError(text, code="wrong-sign")


def cause_of(equation: Equation) -> str:
    """The likely cause of a difference of the energies' inertia to momentum's."""
    wheel = "wheel" in equation.coefficients
    return "wrong motor constants" if wheel else "friction that does not depend on the speed alone"


def check_energy(
    answer: Evaluated, check: MomentumCheck, equation: Equation, motion: Motion, differs: Checked
) -> Checked:
    """The checks of an energy; raises UnanswerableError where the data do not determine the inertia.

    differs: from momentum's inertia.
    """
    inertia, sensitivities, rig = answer.parameters["inertia"], answer.sensitivities, check.prepared.rig
    per_swing = motion.half_period / check.prepared.noise.step
    if per_swing < FEWEST_PER_SWING:
        raise UnanswerableError(
            f"the log has {per_swing:.1f} rows per swing, too few for speeds, on which the energy depends; log at "
            f"least {FEWEST_PER_SWING}, or use the momentum method.",
            code="slow-rows",
        )
    if inertia.value <= 0:
        raise UnanswerableError(
            f"the energy balance gives an inertia of {inertia.value:.3g} {equation.shown(inertia.unit)}, which is not "
            "positive; check the signs and scales under [log] and the motor's constants, or use the momentum method.",
            code="not-identifiable",
        )
    alone = check.alone(answer)
    exact = exact_constants([key for key in rig.constants_without_uncertainty() if key in sensitivities])
    checked = check.tested(alone) + noted(*exact)
    near_resonance: list[Message] = []
    if check.evidence is not None and inertia.standard_uncertainty is not None:
        amplitude = float(np.max(np.abs(motion.turning_angles), initial=0.0))
        law = check.evidence.law
        of_answer = check_answer(answer.parameters | {"inertia": alone}, answer.budget, law, amplitude, rig)
        checked += noted(identifiability_note(law)) + of_answer + differs
        if not differs.warnings:
            near_resonance = [note for note in of_answer.notes if note.code == NEAR_RESONANCE]
    motor = check.motor(inertia, uses_motor=True)
    checked += Checked(notes=motor.notes, ran=motor.ran)
    if "wheel" not in equation.coefficients:
        return checked
    text = f"{motor_sensitivities(rig, sensitivities, inertia)}; momentum needs no motor constant."
    checked += noted(Message("leans-on-the-motor", text)) + warned(*motor.held)
    if motor.fault is not Fault.CONSTANTS or not near_resonance:
        return checked + warned(*motor.warnings)
    # near resonance that is the cause of the residual of (II), or the wheel rests part of the time
    notes = tuple(note for note in checked.notes if note not in near_resonance)
    return replace(checked, notes=notes) + warned(*near_resonance)


def motor_sensitivities(rig: Rig, sensitivities: dict[str, float], inertia: Parameter) -> str:
    """Relative changes of the inertia per 1 % of each constant of motor and wheel, in words."""
    quantities = {key: stated_at(rig, key) for key in MOTOR_KEYS if key in sensitivities}
    changes = [
        f"{key} by {sensitivities[key] * quantity.value / inertia.value:+.2g} %"
        for key, quantity in quantities.items()
        if isinstance(quantity, Quantity)
    ]
    return f"1 % more of a constant changes this inertia: {', '.join(changes)}"


def check_saturation(used: Recording, rig: Rig, inertia: Parameter) -> Checked:
    """A warning or a note where the voltage is mostly saturated: it is known there, but it jumps between its limits.

    At a jump the wheel's acceleration jumps too, which a smoothed speed does not follow. `momentum` needs no speed. A
    note where `JUMPS` of the inertia is less than its standard uncertainty.
    """
    if rig.drive.wheel is None or used.voltage is None:
        return Checked()
    low, high = float(used.voltage.min()), float(used.voltage.max())
    near = 1e-3 * (high - low)
    share = float(np.mean((used.voltage <= low + near) | (used.voltage >= high - near)))
    if high <= low or share < SATURATED:
        return Checked(ran=(SATURATION,))
    text = (
        f"the voltage stands at its limits in {share:.0%} of the rows and jumps between them, which smoothed speeds do "
        "not follow (some 0.1 % of the inertia); use the momentum method, or record a smaller or slower motion."
    )
    matters = JUMPS * inertia.value > (inertia.standard_uncertainty or 0.0)
    return (warned if matters else noted)(Message("voltage-saturated", text), ran=SATURATION)
