"""Rigs, logs and results as they come out of identification, made up where the test needs no computation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.model.rig import Rig
from swingid.recording.recording import Recording, Source
from swingid.result.result import (
    Details,
    FrictionCurve,
    Message,
    Parameter,
    Result,
    SwingSeries,
)
from swingid.uncertainty.budget import BudgetEntry, scatter, stated

ROTARY = """
name = "bench"
[axis]
gravity_torque = "78 ± 0.2 mN*m"
inertia = 302.2e-5
[axis.friction]
viscous = 1.1e-3
[drive]
kind = "reaction-wheel"
[drive.wheel]
inertia = "113.4 ± 0.3 kg*mm^2"
[drive.motor]
rotor_inertia = 0.21e-5
gear_ratio = 4.4
torque_per_volt = 52.04e-4
dead_zone = [-2.996e-4, 5.485e-4]
voltage_limit = 10
[sensors]
counts_per_turn = 16384
latency = "0 ± 0.2 ms"
"""
LINEAR = """
name = "slide"
[axis]
kind = "linear"
[drive]
kind = "direct"
[sensors]
resolution = 5e-8
[log]
torque = "f"
torque_gain = "35.15 ± 0.1"
"""
FREE = """
name = "arm"
[axis]
gravity_torque = 0.204
[drive]
kind = "none"
"""


def rotary_rig() -> Rig:
    return Rig.from_text(ROTARY, "bench.toml")


def linear_rig() -> Rig:
    return Rig.from_text(LINEAR, "slide.toml")


def free_rig() -> Rig:
    return Rig.from_text(FREE, "arm.toml")


def rotary_log(duration: float = 10.0, rate: float = 500.0) -> Recording:
    """A swing of 0.8 rad at 8.5 rad/s whose wheel turns against it."""
    time = np.arange(int(duration * rate) + 1) / rate
    reference = 0.8 * np.sin(8.5 * time)
    angle = reference - 0.01 * np.cos(8.5 * time)
    return Recording(
        time=time,
        angle=angle,
        wheel_angle=-15 * angle,
        voltage=5 * np.sin(8.5 * time),
        reference=reference,
        adaptive_gain=13.3 * (1 - np.exp(-time)),
        source=Source("runs/a.csv", "0" * 64),
    )


def linear_log() -> Recording:
    time = np.arange(4001) / 400
    return Recording(time=time, angle=0.12 * (1 - np.cos(time * 2)), torque=60 * np.cos(time * 2))


def free_log() -> Recording:
    time = np.arange(4001) / 200
    return Recording(time=time, angle=np.exp(-time / 10) * np.cos(7.8 * time))


def clean_result(log: Recording | None = None) -> Result:
    """What momentum says of `rotary_log`."""
    log = rotary_log() if log is None else log
    budget = (
        BudgetEntry(stated("drive.wheel.inertia", "drive.wheel.inertia"), "inertia", 6e-6, 20.0),
        BudgetEntry(stated("axis.gravity_torque", "axis.gravity_torque"), "inertia", 2e-6, 0.01),
        BudgetEntry(scatter("scatter of the windows"), "inertia", 1e-6),
        BudgetEntry(scatter("scatter of the windows"), "viscous", 3e-5),
    )
    return Result(
        method="momentum",
        status="ok",
        parameters={
            "inertia": Parameter.of(3.0228e-3, float(np.sqrt(41e-12)), "kg m^2"),
            "viscous": Parameter.of(1.144e-3, 3e-5, "N m s"),
            "stribeck_speed": Parameter.of(0.3, None, "rad/s"),
        },
        notes=(Message("segment", "used the part from 1.2 to 10 s: after the transient."),),
        budget=budget,
        provenance={
            "log": log.source.path,
            "log_sha256": log.source.sha256,
            "rows": len(log),
            "rig": "bench",
            "rig_source": "bench.toml",
            "rig_sha256": "f" * 64,
            "options": {},
            "versions": {"swingid": "0.1.0", "numpy": "2.0"},
        },
        details=_details(log),
    )


def _details(log: Recording) -> Details:
    """Details of a log whose turning points are those of its samples from 1.2 s to 10 s."""
    rises = np.sign(np.diff(log.angle))
    at = np.nonzero(rises[1:] * rises[:-1] < 0)[0] + 1
    at = at[(log.time[at] > 1.2) & (log.time[at] < 10)]
    turning, sides = log.time[at], rises[at - 1]
    scatter = np.random.default_rng(0).standard_normal(len(turning))
    speeds = np.concatenate([-np.linspace(7, 1e-6, 8), np.linspace(1e-6, 7, 8)])
    law = 1.144e-3 * speeds
    return Details(
        start=1.2,
        stop=10.0,
        turning_times=turning,
        turning_angles=log.angle[at],
        window=0.18,
        swings=SwingSeries(turning, sides, 3.0228e-3 * (1 + 1e-4 * scatter), np.full(len(turning), 3e-7)),
        friction=FrictionCurve(
            speeds, law + 2e-5, np.full(16, 4e-5), "viscous", law, {"viscous": 0.0, "coulomb + viscous": 6.4}
        ),
        estimates={"law": (3.0228e-3, 1e-6), "swing": (3.0232e-3, 2e-6), "even": (3.0225e-3, 3e-6)},
        residual_times=turning,
        residuals=1e-5 * scatter,
        extra={"motor_balance_residual": 0.0031},
    )


def doubtful_result() -> Result:
    """With two warnings, and no uncertainty of the inertia."""
    result = clean_result()
    return replace(
        result,
        status="warning",
        parameters={"inertia": Parameter.of(3.0231e-3, None, "kg m^2")},
        budget=(),
        warnings=(
            Message("near-resonance", "the motion is near resonance; drive at 8.5 rad/s or more."),
            Message("spikes", "12 rows were spikes and were dropped; look at the encoder's cable."),
        ),
    )


def refused_result() -> Result:
    return Result(
        method="momentum",
        status="refused",
        error=Message("no-motion", "runs/a.csv: the angle moves by 0.0004 only; record a swing."),
        provenance={"log": "runs/a.csv", "log_sha256": "0" * 64},
    )


def linear_result() -> Result:
    """As momentum says of a linear axis: kg, N, m."""
    result = clean_result(linear_log())
    assert result.details is not None
    details = replace(
        result.details,
        swings=None,
        estimates={},
        extra={},
    )
    budget = (BudgetEntry(scatter("scatter of the windows"), "inertia", 0.5),)
    parameters = {
        "inertia": Parameter.of(95.1, 0.5, "kg"),
        "coulomb": Parameter.of(20.4, 0.3, "N"),
        "viscous": Parameter.of(203.0, 4.0, "N s/m"),
    }
    return replace(result, parameters=parameters, budget=budget, details=details)


def free_result() -> Result:
    """A free decay by the energy method: no voltage, no friction curve, no kinds."""
    result = clean_result(free_log())
    assert result.details is not None
    details = replace(
        result.details,
        friction=None,
        estimates={},
        window=None,
        residual_times=np.empty(0),
        residuals=np.empty(0),
        extra={},
    )
    return replace(result, method="energy", details=details)
