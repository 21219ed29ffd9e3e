"""The plan for many logs, chosen once from a few of them, and the result of an estimator for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swingid.checks.momentum import MomentumCheck
from swingid.errors import InputError
from swingid.methods.momentum.method import momentum
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import LATENCY, Encoders, moved
from swingid.preparation.noise import channel_noise
from swingid.preparation.prepared import prepare
from swingid.preparation.scale import refuse_rates, refuse_terms
from swingid.preparation.speed import SHARE, smooth_speed
from swingid.recording.recording import Recording
from swingid.result.result import Details


@dataclass(frozen=True)
class Plan:
    """What is chosen once for all logs.

    start, stop: the part used, s from the first row. half: half-length of the windows of momentum (s). width,
    wheel_width: half-widths of the local cubics that give the energy method its speeds (s). turns: expected number of
    turning points. noise, wheel_noise: standard deviations of one sample (rad). latency: whether known latencies are
    corrected; not where that is switched off for the logs.
    """

    start: float
    stop: float
    half: float
    width: float
    wheel_width: float
    turns: int
    noise: float
    wheel_noise: float
    latency: bool = True

    def encoders(self, rig: Rig) -> Encoders:
        """Encoders with the latencies that are to be corrected."""
        return Encoders.of(rig) if self.latency else Encoders.of(rig).on_time()


@dataclass(frozen=True)
class Batch:
    """Estimates of n logs: inertia J1 (n,) (kg m^2) with its standard uncertainty of type A `u` (n,).

    Terms of friction are fitted beside it, and are not given: on a periodic motion they are nearly collinear, and the
    effects of an encoder's zero and resolution and of a smoothed speed on each are not in their scatter. For friction
    use `identify`.
    """

    inertia: Array
    u: Array


def plan_batch(logs: Sequence[Recording], rig: Rig) -> Plan:
    """The plan for logs like these few, from what `momentum` and `energy` choose for each.

    The part common to all, the median length of windows and the narrowest smoothing, whose bias grows with the fourth
    power of its width: give logs that differ as the others will. Errors as `momentum`; InputError where the correction
    of latencies is switched off for some of the logs only.
    """
    switched_off = [LATENCY in log.repairs_off for log in logs]
    if any(switched_off) and not all(switched_off):
        text = 'the correction "latency" is switched off for some of the logs; switch it off for all or for none.'
        raise InputError(text, code="not-for-batches")
    noises = [channel_noise(log, rig) for log in logs]
    details: list[Details] = []
    widths, wheel_widths = [], []
    for log, noise in zip(logs, noises, strict=True):
        detail = MomentumCheck(prepare(log, rig), momentum).result().details
        assert detail is not None
        details.append(detail)
        used = log.segment(detail.start, detail.stop)
        widths.append(SHARE * smooth_speed(used.time, used.angle, noise.angle).half_width)
        if used.wheel_angle is not None:
            wheel_widths.append(SHARE * smooth_speed(used.time, used.wheel_angle, noise.wheel).half_width)
    return Plan(
        start=float(max(detail.start - log.time[0] for detail, log in zip(details, logs, strict=True))),
        stop=float(min(detail.stop - log.time[0] for detail, log in zip(details, logs, strict=True))),
        half=float(np.median([detail.window or 0.0 for detail in details])),
        width=float(min(widths)),
        wheel_width=float(min(wheel_widths or widths)),
        turns=max(len(detail.turning_times) for detail in details),
        noise=float(np.median([noise.angle for noise in noises])),
        wheel_noise=float(np.median([noise.wheel for noise in noises])),
        latency=not any(switched_off),
    )


def require_batch(rig: Rig, equation: Equation) -> None:
    """Raise InputError for rigs that the estimators of many logs exclude; UnanswerableError for terms beyond them."""
    refuse_terms(rig, "many logs at once")
    refuse_rates(rig, "many logs at once")
    if "torque" in equation.coefficients or equation.seeks("gravity_torque") or equation.linear:
        raise InputError(
            f"rig {rig.name}: many logs at once need a rotary axis with a known gravity torque and no direct drive; "
            "identify these logs one by one.",
            code="not-for-batches",
        )
    encoders = Encoders.of(rig)
    if any(part.value for sensor in (encoders.angle, encoders.wheel) for part in sensor.parts.values()):
        raise InputError(
            f"rig {rig.name}: many logs at once are not corrected, but sensors states a nonlinearity; "
            "identify these logs one by one.",
            code="not-for-batches",
        )


def channels_of(equation: Equation, angle: Array, **others: Array | None) -> tuple[Array, list[Array | None]]:
    """The angle (n, rows) and other channels as the kernels read them; None for one that the rig does without.

    Raises InputError for another shape than the angle's, and for a channel that is missing where there is a wheel.
    """
    angle = np.ascontiguousarray(angle, dtype=np.float64)
    channels: list[Array | None] = []
    for name, values in others.items():
        if values is None and "wheel" in equation.coefficients:
            text = f"many logs of a reaction wheel need {name}; record the wheel angle and the voltage."
            raise InputError(text, code="missing-channel")
        if values is None:
            channels.append(None)
            continue
        if angle.ndim != 2 or np.shape(values) != angle.shape:
            text = f"{name} has the shape {np.shape(values)} and angle {angle.shape}; give (logs, rows), both alike."
            raise InputError(text, code="unequal-length")
        channels.append(np.ascontiguousarray(values, dtype=np.float64))
    return angle, channels


def at_stamps(values: Array, rate: float, late: float) -> Array:
    """A channel of many logs (n, rows) that was read `late` seconds after its stamps, at the stamps."""
    if late == 0.0 or values.size == 0:
        return values
    time = np.arange(values.shape[1]) / rate
    return np.stack([moved(time, row, late) for row in values])
