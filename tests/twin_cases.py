"""The paper's rig with perfect sensors and one friction law or another, for tests of model and twin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import settings

from motion_by_events import Body
from swingid.control.compensator import Compensator
from swingid.model.rig import Rig

first_call_compiles = settings(deadline=None)
"""For property tests of kernels: the first example may have to wait for the compiler."""

LAWS = {
    "viscous": {"viscous": 1.144e-3},
    "coulomb": {"viscous": 5e-4, "coulomb": 3e-3},
    "stribeck": {"viscous": 5e-4, "coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.05},
    "quadratic": {"viscous": 2e-4, "quadratic": 3e-4},
    "cubic": {"viscous": 2e-4, "cubic": 5e-5},
    "lugre": {"viscous": 5e-4, "coulomb": 3e-3, "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 1e-3}},
    "sticking": {"viscous": 5e-4, "coulomb": 25e-3, "static": 30e-3, "stribeck_speed": 0.1},
}

FURTHER = {
    "spring": {"axis.stiffness": 0.05, "axis.spring_zero": 0.2},
    "cogging": {"axis.cogging": {"order": 7.0, "amplitude": 4e-3, "phase": 0.7}},
    "load": {"axis.friction.load": 6e-3},
    "drag": {"axis.friction.drag": 4e-4},
    "all": {
        "axis.stiffness": 0.05,
        "axis.cogging": {"order": 7.0, "amplitude": 4e-3, "phase": 0.7},
        "axis.friction.load": 25e-3,
        "axis.friction.drag": 4e-4,
    },
}
"""What rig.toml says of terms beyond gravity and friction of the speed."""

PERFECT = {"sensors.counts_per_turn": None}


def paper_rig(law="viscous", **changes):
    """The built-in rig with the friction law's constants, perfect sensors, and dotted `changes`."""
    friction = {"axis.friction.viscous": None} | {f"axis.friction.{k}": v for k, v in LAWS[law].items()}
    return Rig.builtin("paper").changed({**PERFECT, **friction, **changes})


def direct_rig(law="viscous", **changes):
    """The paper's axis with a torque on it in the wheel's place."""
    return paper_rig(law, drive={"kind": "direct"}, log={"torque": "tau"}, **changes)


def free_rig(law="viscous", **changes):
    """The paper's axis alone."""
    return paper_rig(law, drive={"kind": "none"}, log={"angle": "q1"}, **changes)


def warm_compensator(rig, k_tilde=12.0, **changes):
    """The gains of the experiment with k tilde already grown, so that motion begins at once."""
    return replace(Compensator.paper(rig), k_tilde0=k_tilde, **changes)


def sine(amplitude, omega):
    return lambda t: amplitude * np.sin(omega * np.asarray(t))


def body_of(rig):
    """The constants of a rig for `motion_by_events`."""
    friction = rig.axis.friction
    names = ("viscous", "coulomb", "static", "quadratic", "cubic")
    constants = {n: getattr(friction, n).value for n in names if getattr(friction, n) is not None}
    if friction.stribeck_speed is not None:
        constants["vs"] = friction.stribeck_speed.value
    if friction.lugre is not None:
        constants["sigma0"] = friction.lugre.bristle_stiffness.value
        constants["sigma1"] = friction.lugre.bristle_damping.value
    axis = rig.axis
    for name, holder, key in (
        ("stiffness", axis, "stiffness"),
        ("zero", axis, "spring_zero"),
        ("load", friction, "load"),
        ("drag", friction, "drag"),
        ("cogging", axis.cogging, "amplitude"),
        ("phase", axis.cogging, "phase"),
    ):
        constants[name] = float(getattr(holder, key, 0.0))
    constants["order"] = 1.0 if axis.cogging is None else axis.cogging.order
    j1, b = rig.axis.inertia.value, rig.axis.gravity_torque.value
    if rig.drive.kind != "reaction-wheel":
        return Body(a11=j1, b=b, wheel=False, direct=rig.drive.kind == "direct", **constants)
    motor, j2 = rig.drive.motor, rig.drive.wheel.inertia.value
    jr, n = motor.rotor_inertia.value, motor.gear_ratio.value
    return Body(
        a11=j1 + j2 + jr,
        a12=j2 + n * jr,
        a22=j2 + n**2 * jr,
        b=b,
        gear=n,
        c1=motor.torque_per_volt.value,
        c2=motor.back_emf.value,
        eta=motor.efficiency.value,
        d2=motor.dead_zone[0],
        d1=motor.dead_zone[1],
        f2=motor.viscous.value,
        f3=motor.coulomb.value,
        **constants,
    )
