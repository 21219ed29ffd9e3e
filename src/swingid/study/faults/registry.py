"""The registry of faults: what rigs, rig files and logs of labs have and nothing declares, one record each.

A record says how a fault is called, its grades from mild to severe, and what it does: to the constants of the twin, to
the conventions by which the log is written, to the rig file that the methods get, to the columns, or as a torque.
`campaign` (keys ``faults.NAME``) and `rehearse` take faults as "name: grade", or "name" for the middle grade.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from swingid.errors import UsageError
from swingid.model.rig import Rig
from swingid.study.changes import ABSENT, Times
from swingid.study.faults import effects
from swingid.study.faults.effects import Columns, Torque, torque_scale

WHEEL, DIRECT, FREE = ("reaction-wheel",), ("direct",), ("none",)
"""Kinds of drives that a fault can be on."""

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
    drives: tuple[str, ...] = WHEEL + DIRECT + FREE


UNITS = {"": 1.0, "%": 1e-2, "ppm": 1e-6, "Hz": 1.0, "ms": 1e-3, "mrad": 1e-3, "rad": 1.0, "°": np.pi / 180}
"""Units of grades, in SI."""


def _graded(text: str) -> dict[str, float]:
    """Severities (SI) by their texts with units, as "0.3 mrad, 5 mrad" or "x2, x4"."""
    severities = {}
    for grade in text.split(", "):
        number, unit = re.fullmatch(r"x?(-?[\d.]+) ?(\D*)", grade).groups()  # type: ignore[union-attr]
        severities[grade] = float(number) * UNITS[unit]
    return severities


def _fault(name: str, words: str, grades: str | Mapping[str, float], *effects: Any, **what: Any) -> Fault:
    """A record; its grades as their texts or by name; effects: `twin`, `written` and `stated` in this order."""
    return Fault(name, words, _graded(grades) if isinstance(grades, str) else grades, *effects, **what)


def _off(key: str) -> Keys:
    return lambda _rig, share: {key: Times(1 + share)}


def _tilted(key: str) -> Keys:
    return lambda _rig, angle: {key: Times(float(np.cos(angle)))}


def _set(key: str, sign: float = 1.0) -> Keys:
    return lambda _rig, value: {key: sign * value}


def _share(key: str) -> Keys:
    return lambda rig, share: {key: share * torque_scale(rig)}


def _always(**log: Any) -> Keys:
    return lambda _rig, _severity: {f"log.{key}": value for key, value in log.items()}


def _torque_gain(rig: Rig, share: float) -> Mapping[str, Any]:
    return {"log.torque_gain" if rig.drive.kind in DIRECT else "drive.motor.torque_per_volt": Times(1 + share)}


def _with_rotor(rig: Rig, _severity: float) -> Mapping[str, Any]:
    assert rig.drive.motor is not None
    rotor = rig.drive.motor.gear_ratio.value**2 * rig.drive.motor.rotor_inertia.value
    return {"drive.wheel.inertia": Times(rig.drive.a22 / (rig.drive.a22 - rotor))}


def _in_counts(rig: Rig, _severity: float) -> Mapping[str, Any]:
    wheel = {"log.wheel_angle_unit": "counts"} if rig.drive.kind in WHEEL else {}
    return {"sensors.counts_per_turn": 4096, "log.angle_unit": "counts", **wheel}


MOTOR = ("torque_per_volt", "back_emf", "viscous", "coulomb", "efficiency", "dead_zone")


def _absolute(_rig: Rig, without_motor: float) -> Mapping[str, Any]:
    unknown = {f"drive.motor.{key}": ABSENT for key in MOTOR} if without_motor else {}
    return {"log.wheel_angle_is": "absolute", **unknown}


def _cogging(order: int) -> Keys:
    def keys(rig: Rig, share: float) -> Mapping[str, Any]:
        return {"axis.cogging": {"order": order, "amplitude": share * torque_scale(rig), "phase": 0.3}}

    return keys


_ALWAYS = {"": 1.0}
_LATE = "0.3 ms, 1 ms, 5 ms"
_OFF = "0.3 %, 1 %, -3 %"
_TILT = "1°, 2°, 5°"
_PARTS = "0.3 %, 1 %, 5 %"
_SMALL = "0.1 %, 0.3 %, 1 %"
_TURNS = "0.02°, 0.1°, 0.5°"

_RECORDS = (
    _fault("none", "nothing wrong", {"": 0.0}),
    # The rig file.
    _fault("gravity torque", "gravity torque stated wrong", _OFF, stated=_off("axis.gravity_torque")),
    _fault(
        "wheel's mass",
        "gravity torque without the wheel's mass",
        "-20 %",
        stated=_off("axis.gravity_torque"),
        drives=WHEEL,
    ),
    _fault(
        "wheel inertia",
        "wheel inertia stated wrong",
        "1 %, 3 %, -10 %",
        stated=_off("drive.wheel.inertia"),
        drives=WHEEL,
    ),
    _fault(
        "rotor twice",
        "wheel inertia that includes the rotor's, stated beside it",
        _ALWAYS,
        stated=_with_rotor,
        drives=WHEEL,
    ),
    _fault(
        "rotor forgotten",
        "rotor inertia not stated",
        _ALWAYS,
        stated=lambda _r, _s: {"drive.motor.rotor_inertia": ABSENT},
        drives=WHEEL,
    ),
    _fault(
        "torque gain",
        "torque per volt, or gain of the logged torque, stated wrong",
        "2 %, -5 %, 20 %",
        stated=_torque_gain,
        drives=WHEEL + DIRECT,
    ),
    _fault(
        "counts",
        "counts per turn stated as 4000, and 4096 in truth",
        _ALWAYS,
        lambda _r, _s: {"sensors.counts_per_turn": 4096},
        _in_counts,
        lambda _r, _s: {"sensors.counts_per_turn": 4000},
    ),
    _fault(
        "angle scale",
        "edges of the angle's encoder counted wrong, or a gear forgotten",
        "x2, x4, x0.5",
        columns=effects.scaled("angle"),
    ),
    _fault(
        "wheel scale",
        "edges of the wheel's encoder counted wrong, or encoder on the rotor",
        "x2, x4, x4.4",
        columns=effects.scaled("wheel_angle"),
        drives=WHEEL,
    ),
    _fault("degrees stated", "degrees stated for a log in radians", _ALWAYS, stated=_always(angle_unit="deg")),
    _fault(
        "radians stated",
        "radians stated for a log in degrees",
        _ALWAYS,
        None,
        _always(angle_unit="deg"),
        _always(angle_unit="rad"),
    ),
    _fault(
        "absolute wheel",
        "wheel angle against the room, stated as relative",
        {"motor known": 0.0, "motor unknown": 1.0},
        None,
        _absolute,
        _always(wheel_angle_is=ABSENT),
        drives=WHEEL,
    ),
    # Sensors, clock, rows.
    _fault("noise", "white noise of both encoders", "0.3 mrad, 1 mrad, 5 mrad", _set("sensors.noise")),
    _fault(
        "correlated noise",
        "noise of the angle with a memory of 20 ms",
        "0.2 mrad, 1 mrad, 5 mrad",
        columns=effects.correlated_noise,
    ),
    _fault("low-pass", "angle through a filter of first order", "200 Hz, 50 Hz, 20 Hz", columns=effects.low_pass),
    _fault("latency", "both encoders late", _LATE, _set("sensors.latency", sign=-1.0)),
    _fault("wheel late", "wheel's encoder late", _LATE, _set("sensors.wheel.latency", sign=-1.0), drives=WHEEL),
    _fault("jitter", "rows read early or late by chance", "0.1 ms, 1 ms", _set("sensors.jitter")),
    _fault("clock", "clock fast", "50 ppm, 200 ppm, 1000 ppm", columns=effects.clock),
    _fault(
        "clock drifts", "clock whose rate changes over the run", "200 ppm, 0.1 %, 1 %", columns=effects.wandering_clock
    ),
    _fault("encoders nonlinear", "encoders mounted off centre", _TURNS, _set("sensors.nonlinearity")),
    _fault("lost rows", "rows lost, time made from the row number", "0.1 %, 0.5 %, 3 %", columns=effects.lost_rows),
    _fault("spikes", "single wrong readings", "2, 20, 200", columns=effects.spikes),
    _fault(
        "lost counts", "angle that jumps once and stays off", "1 mrad, 10 mrad, 0.1 rad", columns=effects.lost_counts
    ),
    _fault(
        "zero drift",
        "zero of the angle that drifts over the run",
        "0.1 mrad, 1 mrad, 5 mrad",
        columns=effects.zero_drift,
    ),
    _fault(
        "polled", "angles read slowly and repeated in rows of the log", "500 Hz, 200 Hz, 50 Hz", columns=effects.polled
    ),
    _fault(
        "slow rows",
        "rows of a slow log, drive said to be held between them",
        "200 Hz, 100 Hz, 50 Hz",
        columns=effects.slow_rows,
    ),
    # Mechanics.
    _fault(
        "wheel tilted", "wheel's axis not parallel to the swing's", _TILT, _tilted("drive.wheel.inertia"), drives=WHEEL
    ),
    _fault("axis tilted", "swing's axis not horizontal", _TILT, _tilted("axis.gravity_torque")),
    _fault(
        "spring",
        "cable that acts as a linear spring, share of the gravity torque per rad",
        _PARTS,
        _share("axis.stiffness"),
    ),
    _fault(
        "cubic spring",
        "cable that gets stiffer, share of the gravity torque at 1 rad",
        _PARTS,
        torque=effects.cubic_spring,
    ),
    _fault(
        "cable hysteresis",
        "cable between body and base whose torque lags the angle, share of the gravity torque where it slips",
        _PARTS,
        torque=effects.hysteresis,
    ),
    _fault("cogging", "cogging of seven periods per turn, share of the gravity torque", _PARTS, _cogging(7)),
    _fault("detent 2q", "torque with sin 2q", _PARTS, _cogging(2)),
    _fault("detent 3q", "torque with sin 3q", _PARTS, _cogging(3)),
    _fault(
        "stop",
        "something soft that is touched at one end of the motion",
        {"soft": 0.1, "medium": 0.3, "hard": 1.0},
        torque=effects.stop,
    ),
    _fault("soft base", "bearing that moves sideways", "40 Hz, 20 Hz, 8 Hz", torque=effects.soft_base),
    _fault(
        "rolling base",
        "base that rolls freely, square of the first moment over the mass as a share of the inertia",
        _SMALL,
        torque=effects.rolling_base,
    ),
    _fault("soft shaft", "encoder on a shaft that twists", "200 Hz, 60 Hz, 20 Hz", columns=effects.soft_shaft),
    _fault("backlash", "encoder driven with play", _TURNS, columns=effects.backlash),
    _fault(
        "motor backlash",
        "encoder on the motor, before a gear with play",
        _TURNS,
        columns=effects.motor_backlash,
        drives=DIRECT,
    ),
    _fault(
        "slipping wheel",
        "wheel that slips on the shaft of its encoder in one direction",
        _SMALL,
        columns=effects.slipping_wheel,
        drives=WHEEL,
    ),
    _fault("warming", "viscous friction that falls over the run", "10 %, 30 %, 70 %", torque=effects.warming),
    _fault("running in", "Coulomb friction that falls over the run", "2 %, 5 %, 20 %", torque=effects.running_in),
    _fault(
        "load friction",
        "Coulomb friction in proportion to the load, share of the gravity torque",
        _PARTS,
        _share("axis.friction.load"),
    ),
    # Hands.
    _fault("push", "one push of 0.3 s, share of the gravity torque", "5 %, 30 %, 300 %", torque=effects.push(0.3)),
    _fault(
        "lean", "a hand that rests against it for 4 s, share of the gravity torque", _PARTS, torque=effects.push(4.0)
    ),
    _fault(
        "pumped",
        "free swing kept going by hand for 70 % of the run",
        "0.5 %, 2 %, 5 %",
        torque=effects.pumped,
        drives=FREE,
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
