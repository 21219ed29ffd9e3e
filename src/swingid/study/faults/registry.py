"""The registry of faults: what rigs, rig files and logs of labs have and nothing declares, one record each.

A record says how a fault is called, its grades from mild to severe, and what it does: to the constants of the twin, to
the conventions by which the log is written, to the rig file that the methods get, to the columns, or as a torque.
`campaign` (keys ``faults.NAME``) and `rehearse` take faults as "name: grade", or "name" for the middle grade.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from swingid.errors import UsageError
from swingid.model.rig import Rig
from swingid.study.changes import ABSENT, Times
from swingid.study.faults import effects
from swingid.study.faults.effects import Columns, Torque, torque_scale

WHEEL, DIRECT, FREE = "reaction-wheel", "direct", "none"
ALL = (WHEEL, DIRECT, FREE)

Keys = Callable[[Rig, float], Mapping[str, Any]]
"""Changes at dotted keys of a rig, by the rig and the severity; values as in `study.changes`."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: name, words, severities by grade from mild to severe, what it does, drive kinds that can have it.

    twin: changes of the twin. written: of the rig file, conventions by which the log is written. stated: further ones,
    which are mistakes. torque: on the axis, from outside. columns: of the log as it was written. severity: SI.
    """

    name: str
    words: str
    grades: Mapping[str, float]
    twin: Keys | None = None
    written: Keys | None = None
    stated: Keys | None = None
    torque: Torque | None = None
    columns: Columns | None = None
    drives: tuple[str, ...] = ALL


def _times(key: str) -> Keys:
    return lambda _rig, factor: {key: Times(factor)}


def _set(key: str, sign: float = 1.0) -> Keys:
    return lambda _rig, value: {key: sign * value}


def _torque_gain(rig: Rig, factor: float) -> Mapping[str, Any]:
    return {"log.torque_gain" if rig.drive.kind == DIRECT else "drive.motor.torque_per_volt": Times(factor)}


def _with_rotor(rig: Rig, _severity: float) -> Mapping[str, Any]:
    return {"drive.wheel.inertia": Times(rig.drive.a22 / (rig.drive.a22 - _rotor(rig)))}


def _rotor(rig: Rig) -> float:
    assert rig.drive.motor is not None
    return rig.drive.motor.gear_ratio.value**2 * rig.drive.motor.rotor_inertia.value


def _in_counts(rig: Rig, counts: float) -> Mapping[str, Any]:
    wheel = {"log.wheel_angle_unit": "counts"} if rig.drive.kind == WHEEL else {}
    return {"sensors.counts_per_turn": int(counts), "log.angle_unit": "counts", **wheel}


MOTOR = ("torque_per_volt", "back_emf", "viscous", "coulomb", "efficiency", "dead_zone")


def _absolute(_rig: Rig, without_motor: float) -> Mapping[str, Any]:
    unknown = {f"drive.motor.{key}": ABSENT for key in MOTOR} if without_motor else {}
    return {"log.wheel_angle_is": "absolute", **unknown}


def _cogging(order: int) -> Keys:
    def keys(rig: Rig, share: float) -> Mapping[str, Any]:
        return {"axis.cogging": {"order": order, "amplitude": share * torque_scale(rig), "phase": 0.3}}

    return keys


def _share(key: str) -> Keys:
    return lambda rig, share: {key: share * torque_scale(rig)}


_LATE = {"0.3 ms": 3e-4, "1 ms": 1e-3, "5 ms": 5e-3}
_OFF = {"0.3 %": 1.003, "1 %": 1.01, "-3 %": 0.97}
_TILT = {f"{degrees}°": float(np.cos(np.deg2rad(degrees))) for degrees in (1, 2, 5)}
_PARTS = {"0.3 %": 3e-3, "1 %": 1e-2, "5 %": 5e-2}

_RECORDS = (
    Fault("none", "nothing wrong", {"": 0.0}),
    # The rig file.
    Fault("gravity torque", "gravity torque stated wrong", _OFF, stated=_times("axis.gravity_torque")),
    Fault(
        "wheel's mass",
        "gravity torque without the wheel's mass",
        {"-20 %": 0.8},
        stated=_times("axis.gravity_torque"),
        drives=(WHEEL,),
    ),
    Fault(
        "wheel inertia",
        "wheel inertia stated wrong",
        {"1 %": 1.01, "3 %": 1.03, "-10 %": 0.9},
        stated=_times("drive.wheel.inertia"),
        drives=(WHEEL,),
    ),
    Fault(
        "rotor twice",
        "wheel inertia that includes the rotor's, stated beside it",
        {"": 1.0},
        stated=_with_rotor,
        drives=(WHEEL,),
    ),
    Fault(
        "rotor forgotten",
        "rotor inertia not stated",
        {"": 1.0},
        stated=lambda _r, _s: {"drive.motor.rotor_inertia": ABSENT},
        drives=(WHEEL,),
    ),
    Fault(
        "torque gain",
        "torque per volt, or gain of the logged torque, stated wrong",
        {"2 %": 1.02, "-5 %": 0.95, "20 %": 1.2},
        stated=_torque_gain,
        drives=(WHEEL, DIRECT),
    ),
    Fault(
        "counts",
        "counts per turn stated as 4000, and 4096 in truth",
        {"": 4000.0},
        lambda _r, _s: {"sensors.counts_per_turn": 4096},
        lambda r, _s: _in_counts(r, 4096),
        lambda _r, counts: {"sensors.counts_per_turn": int(counts)},
    ),
    Fault(
        "angle scale",
        "edges of the angle's encoder counted wrong, or a gear forgotten",
        {"x2": 2.0, "x4": 4.0, "x0.5": 0.5},
        columns=effects.scaled("angle"),
    ),
    Fault(
        "wheel scale",
        "edges of the wheel's encoder counted wrong, or encoder on the rotor",
        {"x2": 2.0, "x4": 4.0, "x4.4": 4.4},
        columns=effects.scaled("wheel_angle"),
        drives=(WHEEL,),
    ),
    Fault(
        "degrees stated",
        "degrees stated for a log in radians",
        {"": 1.0},
        stated=lambda _r, _s: {"log.angle_unit": "deg"},
    ),
    Fault(
        "radians stated",
        "radians stated for a log in degrees",
        {"": 1.0},
        None,
        lambda _r, _s: {"log.angle_unit": "deg"},
        lambda _r, _s: {"log.angle_unit": "rad"},
    ),
    Fault(
        "absolute wheel",
        "wheel angle against the room, stated as relative",
        {"motor known": 0.0, "motor unknown": 1.0},
        None,
        _absolute,
        lambda _r, _s: {"log.wheel_angle_is": ABSENT},
        drives=(WHEEL,),
    ),
    # Sensors, clock, rows.
    Fault(
        "noise",
        "white noise of both encoders",
        {"0.3 mrad": 3e-4, "1 mrad": 1e-3, "5 mrad": 5e-3},
        _set("sensors.noise"),
    ),
    Fault(
        "correlated noise",
        "noise of the angle with a memory of 20 ms",
        {"0.2 mrad": 2e-4, "1 mrad": 1e-3, "5 mrad": 5e-3},
        columns=effects.correlated_noise,
    ),
    Fault(
        "low-pass",
        "angle through a filter of first order",
        {"200 Hz": 200.0, "50 Hz": 50.0, "20 Hz": 20.0},
        columns=effects.low_pass,
    ),
    Fault("latency", "both encoders late", _LATE, _set("sensors.latency", sign=-1.0)),
    Fault("wheel late", "wheel's encoder late", _LATE, _set("sensors.wheel.latency", sign=-1.0), drives=(WHEEL,)),
    Fault("jitter", "rows read early or late by chance", {"0.1 ms": 1e-4, "1 ms": 1e-3}, _set("sensors.jitter")),
    Fault("clock", "clock fast", {"50 ppm": 5e-5, "200 ppm": 2e-4, "1000 ppm": 1e-3}, columns=effects.clock),
    Fault(
        "clock drifts",
        "clock whose rate changes over the run",
        {"200 ppm": 2e-4, "0.1 %": 1e-3, "1 %": 1e-2},
        columns=effects.wandering_clock,
    ),
    Fault(
        "encoders nonlinear",
        "encoders mounted off centre",
        {"0.02°": np.deg2rad(0.02), "0.1°": np.deg2rad(0.1), "0.5°": np.deg2rad(0.5)},
        _set("sensors.nonlinearity"),
    ),
    Fault(
        "lost rows",
        "rows lost, time made from the row number",
        {"0.1 %": 1e-3, "0.5 %": 5e-3, "3 %": 3e-2},
        columns=effects.lost_rows,
    ),
    Fault("spikes", "single wrong readings", {"2": 2.0, "20": 20.0, "200": 200.0}, columns=effects.spikes),
    Fault(
        "lost counts",
        "angle that jumps once and stays off",
        {"1 mrad": 1e-3, "10 mrad": 1e-2, "0.1 rad": 0.1},
        columns=effects.lost_counts,
    ),
    Fault(
        "zero drift",
        "zero of the angle that drifts over the run",
        {"0.1 mrad": 1e-4, "1 mrad": 1e-3, "5 mrad": 5e-3},
        columns=effects.zero_drift,
    ),
    Fault(
        "polled",
        "angles read slowly and repeated in rows of the log",
        {"500 Hz": 500.0, "200 Hz": 200.0, "50 Hz": 50.0},
        columns=effects.polled,
    ),
    Fault(
        "slow rows",
        "rows of a slow log, drive said to be held between them",
        {"200 Hz": 200.0, "100 Hz": 100.0, "50 Hz": 50.0},
        columns=effects.slow_rows,
    ),
    # Mechanics.
    Fault(
        "wheel tilted",
        "wheel's axis not parallel to the swing's",
        _TILT,
        _times("drive.wheel.inertia"),
        drives=(WHEEL,),
    ),
    Fault("axis tilted", "swing's axis not horizontal", _TILT, _times("axis.gravity_torque")),
    Fault(
        "spring",
        "cable that acts as a linear spring, share of the gravity torque per rad",
        _PARTS,
        _share("axis.stiffness"),
    ),
    Fault(
        "cubic spring",
        "cable that gets stiffer, share of the gravity torque at 1 rad",
        _PARTS,
        torque=effects.cubic_spring,
    ),
    Fault(
        "cable hysteresis",
        "cable between body and base whose torque lags the angle, share of the gravity torque where it slips",
        _PARTS,
        torque=effects.hysteresis,
    ),
    Fault("cogging", "cogging of seven periods per turn, share of the gravity torque", _PARTS, _cogging(7)),
    Fault("detent 2q", "torque with sin 2q", _PARTS, _cogging(2)),
    Fault("detent 3q", "torque with sin 3q", _PARTS, _cogging(3)),
    Fault(
        "stop",
        "something soft that is touched at one end of the motion",
        {"soft": 0.1, "medium": 0.3, "hard": 1.0},
        torque=effects.stop,
    ),
    Fault(
        "soft base",
        "bearing that moves sideways",
        {"40 Hz": 40.0, "20 Hz": 20.0, "8 Hz": 8.0},
        torque=effects.soft_base,
    ),
    Fault(
        "rolling base",
        "base that rolls freely, square of the first moment over the mass as a share of the inertia",
        {"0.1 %": 1e-3, "0.3 %": 3e-3, "1 %": 1e-2},
        torque=effects.rolling_base,
    ),
    Fault(
        "soft shaft",
        "encoder on a shaft that twists",
        {"200 Hz": 200.0, "60 Hz": 60.0, "20 Hz": 20.0},
        columns=effects.soft_shaft,
    ),
    Fault(
        "backlash",
        "encoder driven with play",
        {"0.02°": np.deg2rad(0.02), "0.1°": np.deg2rad(0.1), "0.5°": np.deg2rad(0.5)},
        columns=effects.backlash,
    ),
    Fault(
        "motor backlash",
        "encoder on the motor, before a gear with play",
        {"0.02°": np.deg2rad(0.02), "0.1°": np.deg2rad(0.1), "0.5°": np.deg2rad(0.5)},
        columns=effects.motor_backlash,
        drives=(DIRECT,),
    ),
    Fault(
        "slipping wheel",
        "wheel that slips on the shaft of its encoder in one direction",
        {"0.1 %": 1e-3, "0.3 %": 3e-3, "1 %": 1e-2},
        columns=effects.slipping_wheel,
        drives=(WHEEL,),
    ),
    Fault(
        "warming",
        "viscous friction that falls over the run",
        {"10 %": 0.1, "30 %": 0.3, "70 %": 0.7},
        torque=effects.warming,
    ),
    Fault(
        "running in",
        "Coulomb friction that falls over the run",
        {"2 %": 0.02, "5 %": 0.05, "20 %": 0.2},
        torque=effects.running_in,
    ),
    Fault(
        "load friction",
        "Coulomb friction in proportion to the load, share of the gravity torque",
        _PARTS,
        _share("axis.friction.load"),
    ),
    # Hands.
    Fault(
        "push",
        "one push of 0.3 s, share of the gravity torque",
        {"5 %": 0.05, "30 %": 0.3, "300 %": 3.0},
        torque=effects.push(0.3),
    ),
    Fault(
        "lean", "a hand that rests against it for 4 s, share of the gravity torque", _PARTS, torque=effects.push(4.0)
    ),
    Fault(
        "pumped",
        "free swing kept going by hand for 70 % of the run",
        {"0.5 %": 5e-3, "2 %": 2e-2, "5 %": 5e-2},
        torque=effects.pumped,
        drives=(FREE,),
    ),
)

FAULTS: dict[str, Fault] = {fault.name: fault for fault in _RECORDS}
"""All faults by name."""


@dataclass(frozen=True)
class Drawn:
    """A fault at one of its grades. It can be sent to another process."""

    name: str
    grade: str

    @property
    def fault(self) -> Fault:
        """Its record."""
        return FAULTS[self.name]

    @property
    def severity(self) -> float:
        """The number behind the grade, SI."""
        return self.fault.grades[self.grade]

    def __str__(self) -> str:
        return f"{self.name}: {self.grade}" if self.grade else self.name


def every_fault() -> list[str]:
    """All faults at all their grades, as `parse_fault` reads them."""
    return [str(Drawn(name, grade)) for name, fault in FAULTS.items() for grade in fault.grades]


def parse_fault(text: str) -> Drawn:
    """A fault from "name: grade", or "name" for the middle of its grades. Raises UsageError for one that is unknown."""
    name, _, grade = (part.strip() for part in text.partition(":"))
    if name not in FAULTS:
        raise UsageError(f"no fault {name!r}; choose one of {', '.join(FAULTS)}", code="unknown-fault")
    grades = list(FAULTS[name].grades)
    grade = grade or grades[(len(grades) - 1) // 2]
    if grade not in grades:
        raise UsageError(f"fault {name!r} has no grade {grade!r}; choose of {', '.join(grades)}", code="unknown-fault")
    return Drawn(name, grade)
