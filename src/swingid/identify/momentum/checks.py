"""Does the answer make sense? Signs, conditioning, and the motor's own balance as a second opinion on the wheel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.errors import InputError, UnanswerableError
from swingid.identify.momentum.balance import Signals
from swingid.identify.momentum.fits import WindowFit, columns_of, known_side
from swingid.identify.motor_balance import MotorBalance
from swingid.identify.result import BudgetEntry, Message, Parameter
from swingid.identify.scale import Scale
from swingid.numerics.regression import fit_linear

Array = NDArray[np.float64]

HOPELESS = 0.3
"""Relative standard uncertainty of the inertia above which there is no answer."""

CLEARLY = 0.5
"""A reading of the wheel fits clearly better when its residual is smaller by this factor."""

BAD_MOTOR = 0.1
"""Relative residual of row (II) above which the motor constants, or the wheel angle, are doubtful."""


def check_sign(law: WindowFit, scale: Scale, where: str) -> None:
    """Raise InputError where the drive's channel has the wrong sign, which row (I) shows by itself.

    With the sign turned the balance must leave clearly less, or the inertia come out negative as it is.
    """
    key = {"reaction-wheel": "wheel_angle", "direct": "torque"}.get(scale.drive)
    if key is None:
        if law.a11 <= 0:
            raise UnanswerableError(
                f"{where}: the decay gives a negative inertia; is 0 the hanging position (angle_zero under [log])?",
                code="negative-inertia",
            )
        return
    rows = law.rows
    drive = -scale.a12 * rows.wheel + rows.torque
    turned = known_side(rows, scale) - 2 * drive
    _, columns = columns_of(rows, scale, tuple(name for name in law.unknowns if name in rows.friction))
    left = fit_linear(columns, turned).residuals
    better = left @ left < law.fit.residuals @ law.fit.residuals / 9
    if law.a11 < -3 * law.u or better:
        raise InputError(
            f"{where}: {key} has the wrong sign against the angle (the inertia would be {law.a11:.3g} {scale.unit}); "
            f"set {key}_sign = -1 under [log], or +1 if it is -1 already.",
            code="wrong-sign",
        )


def check_answer(
    parameters: dict[str, Parameter],
    budget: list[BudgetEntry],
    law: WindowFit,
    scale: Scale,
    amplitude: float,
) -> tuple[list[Message], list[Message]]:
    """Warnings and notes on the conditioning of the answer.

    Raises UnanswerableError where the data do not determine the inertia.
    """
    inertia = parameters["inertia"]
    relative = (inertia.standard_uncertainty or np.inf) / max(abs(inertia.value), 1e-300)
    if inertia.value <= 0 or relative > HOPELESS or not np.isfinite(relative):
        raise UnanswerableError(_hopeless(inertia, relative, scale), code="not-identifiable")
    warnings: list[Message] = []
    notes: list[Message] = []
    if scale.b is None and _share(budget, inertia) > 0.02:
        text = (
            "inertia and gravity torque can hardly be told apart in this motion; add a second frequency "
            "or give axis.gravity_torque."
        )
        warnings.append(Message("gravity-and-inertia", text))
    if scale.drive != "none" and scale.b:
        lean = abs(float(law.fit.influence[0] @ law.rows.gravity)) * abs(scale.b) / law.a11
        if lean > 0.8:
            warnings.append(Message("near-resonance", _leaning(lean, amplitude, scale.b / law.a11)))
    if scale.drive == "none":
        notes.append(Message("scale-from-gravity", "the scale is that of axis.gravity_torque, in proportion."))
    return warnings, notes


def _share(budget: list[BudgetEntry], inertia: Parameter) -> float:
    spread = sum(e.standard_uncertainty**2 for e in budget if e.parameter == "inertia" and e.type == "A")
    return float(np.sqrt(spread)) / inertia.value


def _hopeless(inertia: Parameter, relative: float, scale: Scale) -> str:
    if inertia.value <= 0 and scale.b is not None:
        return (
            f"the balance gives an inertia of {inertia.value:.3g} {inertia.unit}, which is not positive; "
            "check the signs and scales under [log] and drive.wheel.inertia."
        )
    spread = f"{100 * relative:.0f} %" if inertia.value > 0 and relative < 100 else "more than its value"
    if scale.b is None:
        return (
            f"inertia and gravity torque move together in this motion (the inertia is uncertain by {spread}); "
            "add a second frequency, or give axis.gravity_torque."
        )
    return (
        f"the motion does not determine the inertia (it is uncertain by {spread}); "
        "record larger or faster swings, or more of them."
    )


def _leaning(lean: float, amplitude: float, stiffness: float) -> str:
    natural = np.sqrt(stiffness) * (1 - amplitude**2 / 16)
    reason = "the motion is near resonance" if lean < 1.5 else "the motion is slow against the free swing"
    return (
        f"{reason} ({natural:.2g} rad/s), so the inertia is mostly the gravity torque rescaled (1 % of "
        f"axis.gravity_torque moves it by {lean:.2g} %); drive at {1.7 * natural:.2g} rad/s or more."
    )


def check_motor(balance: MotorBalance | None, signals: Signals) -> tuple[list[Message], list[Message]]:
    """What row (II) says of the wheel angle: warnings and notes.

    An absolute wheel angle taken for a relative one cannot be seen in row (I); row (II) shows it when the motor
    constants are right. A bad balance alone never refuses: motor constants 5 % off look the same.
    """
    if signals.wheel is None:
        return [], []
    if balance is None:
        text = "wheel_angle was taken as [log] says; without voltage and motor constants nothing checks that."
        return [], [Message("wheel-angle-reading", text)]
    stated, other = ("relative", "absolute") if balance.is_relative else ("absolute", "relative")
    residuals = (
        f"the motor's balance leaves {balance.as_stated:.1%} with it and {balance.otherwise:.1%} with the other reading"
    )
    if balance.otherwise < CLEARLY * balance.as_stated and balance.otherwise < BAD_MOTOR:
        text = f'wheel_angle looks {other}, not {stated}: {residuals}; set wheel_angle_is = "{other}" under [log].'
        return [Message("wheel-angle-reading", text)], []
    if balance.turned < CLEARLY * balance.as_stated and balance.turned < 2 * BAD_MOTOR:
        text = (
            f"voltage seems to have the wrong sign (the motor's balance leaves {balance.as_stated:.1%}, with the sign "
            f"turned {balance.turned:.1%}); momentum does not use it, but set voltage_sign under [log]."
        )
        return [Message("voltage-sign", text)], []
    if balance.as_stated > BAD_MOTOR:
        text = (
            f"the motor's balance leaves {balance.as_stated:.1%}: the motor constants do not fit this log, or the "
            "wheel angle is not what [log] says; momentum does not use the motor, but check both."
        )
        return [Message("motor-balance", text)], []
    return [], [Message("wheel-angle-reading", f"wheel_angle taken as {stated} to the pendulum: {residuals}.")]
