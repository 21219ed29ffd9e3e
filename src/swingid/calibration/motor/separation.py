"""Which constants the logs tell apart, and in words which they do not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.calibration.motor.balance import BalanceFit
from swingid.calibration.motor.channels import IDLE
from swingid.calibration.motor.products import (
    COULOMB,
    COUPLING,
    DAMPING,
    EMF,
    GAIN,
    NEGATIVE,
    POSITIVE,
    products_of,
)
from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.model.rig.fields import stated
from swingid.numerics.arrays import Array, Bools
from swingid.result.result import Message

APART = 0.2
"""A part of a sum counts as known when its own standard uncertainty is below this share of it."""

NEARLY = 3.0
"""… or when it is known as well as the sum, to this factor."""

KNOWN = 1 / 3
"""Gain and damping must be known to this share, or there is no answer."""

SIDES = {POSITIVE: "positive", NEGATIVE: "negative"}
WORDS = {
    GAIN: "efficiency * torque_per_volt",
    DAMPING: "efficiency * back_emf + gear_ratio * viscous",
    POSITIVE: "coulomb + dead_zone[1]",
    NEGATIVE: "coulomb - dead_zone[0]",
    COULOMB: "coulomb",
    EMF: "back_emf",
    COUPLING: "rotor_inertia",
}


@dataclass(frozen=True)
class Separation:
    """What is fitted and what is held: free (7,) products, values (7,) to start from and to hold, notes in words.

    emf, coulomb: whether back_emf and viscous, coulomb and dead zone, are known apart.
    """

    free: Bools
    values: Array
    emf: bool
    coulomb: bool
    notes: tuple[Message, ...]


def separate(fit: BalanceFit, rig: Rig, name: str) -> Separation:
    """What a fit of all products tells apart; the rest is held at what the rig states.

    Raises UnanswerableError where not even gain and damping are seen; `name` is the log's, for the message.
    """
    u = _uncertainties(fit)
    _refuse_blind(fit, u, name)
    free, values, notes = fit.free.copy(), fit.values.copy(), []
    stated_values = products_of(rig)
    sides = {k: side for k, side in SIDES.items() if not np.isfinite(u[k])}
    notes += [_side_note(k, side) for k, side in sides.items()]
    emf = _apart(fit.values[EMF], u[EMF], u[DAMPING])
    coulomb = _apart(fit.values[COULOMB], u[COULOMB], min(u[POSITIVE], u[NEGATIVE]))
    if not emf:
        free[EMF], values[EMF] = False, min(stated_values[EMF], max(fit.values[DAMPING], 0.0))
        notes.append(_emf_note(rig))
    if not coulomb:
        least = max(min((fit.values[k] for k in SIDES if k not in sides), default=0.0), 0.0)
        known = _states(rig, "coulomb")
        free[COULOMB], values[COULOMB] = False, min(stated_values[COULOMB], least) if known else least
        notes.append(_coulomb_note(known))
    for k in sides:
        free[k], values[k] = False, max(stated_values[k], values[COULOMB])
    return Separation(free, values, emf, coulomb, tuple(notes))


def _uncertainties(fit: BalanceFit) -> Array:
    """Standard uncertainty of each product; infinite for one whose column is empty."""
    result = np.sqrt(np.diag(fit.covariance))
    result[fit.free & ~fit.seen] = np.inf
    return np.asarray(result)


def _apart(value: float, own: float, of_sum: float) -> bool:
    return bool(np.isfinite(own) and (own <= APART * abs(value) or own <= NEARLY * of_sum))


def _refuse_blind(fit: BalanceFit, u: Array, name: str) -> None:
    voltage = max(float(np.abs(part.log.voltage).max()) for part in fit.rows)
    if voltage < IDLE:
        raise UnanswerableError(
            f"{name}: the voltage never drives the wheel, so torque_per_volt cannot be known; log a voltage test of "
            "several frequencies.",
            code="no-voltage",
        )
    blind = [k for k in (GAIN, DAMPING) if not u[k] <= KNOWN * abs(fit.values[k])]
    if blind:
        others = [k for k in (POSITIVE, NEGATIVE) if not u[k] <= KNOWN * abs(fit.values[k])]
        together = " and ".join(WORDS[k] for k in [*blind, *others])
        raise UnanswerableError(
            f"{name}: {together} cannot be told apart, because the voltage is too plain or too short; log a test of "
            "several frequencies that turns the wheel both ways.",
            code="not-identifiable",
        )
    if fit.values[GAIN] < 0:
        raise UnanswerableError(
            f"{name}: a positive voltage turns the wheel backwards, so a sign is wrong; check log.voltage_sign and "
            "log.wheel_angle_sign.",
            code="wrong-sign",
        )


def _side_note(place: int, side: str) -> Message:
    text = f"the motor never pushes the {side} way, so {WORDS[place]} is not seen and stays as the rig states it."
    return Message("not-seen", text)


def _states(rig: Rig, key: str) -> bool:
    return rig.drive.motor is not None and stated(rig.drive.motor, key)


def _emf_note(rig: Rig) -> Message:
    held = "the rig's back_emf is kept" if _states(rig, "back_emf") else "back_emf is taken as 0"
    return Message(
        "back-emf-with-viscous",
        "back_emf and viscous move together: only efficiency * back_emf + gear_ratio * viscous is known, because the "
        f"log hardly coasts inside the dead zone; {held} and viscous takes the rest (let the wheel coast at 0 V).",
    )


def _coulomb_note(known: bool) -> Message:
    held = "the rig's coulomb is kept" if known else "coulomb takes as much as it can"
    return Message(
        "coulomb-with-dead-zone",
        "coulomb and dead_zone move together: only coulomb + dead_zone[1] and coulomb - dead_zone[0] are known, "
        f"because the motor hardly brakes the wheel or lets it coast; {held} and dead_zone takes the rest.",
    )
