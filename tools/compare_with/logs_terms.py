"""Recipes of logs: a motor on the axis, bodies that spin down, rates, springs, cogging, strings, slow changes."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from compare_with.recipe import TWO_TONES, Recipe
from compare_with.rigs import (
    BIFILAR,
    DIRECT,
    FREE,
    GYRO,
    INERTIA,
    LINEAR,
    PAPER,
    SERVO,
    SERVO_CONSTANTS,
    SPINNING,
    STATED,
    TRIFILAR,
    UNTOLD,
    Tree,
    changed,
    twin_of,
)

Columns = dict[str, np.ndarray]
TERMS = ((0.12, 8.5, 0.3), (0.05, 5.0, 0.0))
WIDER = ((0.2, 8.5, 0.3), (0.1, 5.0, 0.0))
FORCES = ((600.0, 6.0, 0.0), (300.0, 2.7, 1.0))
RING = 1.2e-4
"""Inertia (kg m^2) of a known body on what spins down."""

BODY = 6e-4
"""Inertia (kg m^2) of a known body on the axis, its centre on it."""


def quick(*only: str) -> dict[str, Any]:
    """What of a recipe is for use while refactoring; with nothing named its log alone, for cases that read it."""
    return {"quick": True, "only": only or ("log",)}


def _servo_columns(opens: float, added: float, gravity: float) -> Columns:
    """The servo integrated here, since the twin's bridge is always closed; it opens at `opens` s."""
    rate, fine = 200.0, 20
    time = np.arange(1601) / rate
    voltage = np.sum(
        [a * np.sin(w * time + p) for a, w, p in ((3, 2.8, 0.3), (2.5, 10.7, 2.0), (1.2, 19.5, 4.0))], axis=0
    )
    inertia, angles, q, v = 5e-3 + added, np.zeros(len(time)), 0.0, 0.0
    for k in range(1, len(time)):
        for _ in range(fine):
            drive = 0.0963 * voltage[k - 1] - 0.0372 * v if time[k - 1] < opens else 0.0
            friction = 0.009 * np.tanh(v / 1e-2) + 0.0037 * v
            v += (drive - gravity * np.sin(q) - friction) / inertia / (rate * fine)
            q += v / (rate * fine)
        angles[k] = q
    step = 2 * np.pi / 4096
    return {"t": time, "q1": np.round(angles / step) * step, "u": voltage, "on": (time < opens).astype(float)}


def _slow_columns(share: float, drift: float) -> Columns:
    """Two tones that are prescribed, the torque by equation (I): friction that falls by a share, a zero that drifts."""
    time = np.arange(12_001) / 1000
    course, tones = time / time[-1], ((0.5, 8.5, 0.0), (0.4, 5.3, 1.0))
    q, v, a = (
        np.sum([size * w**n * np.sin(w * time + p + n * np.pi / 2) for size, w, p in tones], axis=0) for n in range(3)
    )
    torque = INERTIA * a + 78e-3 * np.sin(q) + 1.5e-3 * (1 - share * course) * v + 2e-4 * np.sign(v)
    return {"t": time, "q1": q + drift * course + np.random.default_rng(1).normal(0, 1e-4, len(q)), "tau": torque}


def _motors() -> list[Recipe]:
    """A motor on the axis: closed bridge by the twin, one that opens, and logs with and without a known body."""
    twin, terms = changed(SERVO, SERVO_CONSTANTS), ((3.0, 3.1, 0.3), (2.5, 10.7, 2.0), (1.2, 19.5, 4.0))
    how: dict[str, Any] = {"reference": None, "drive": terms, "duration": 6.0, "rate": 200.0}
    found = [
        Recipe("motor", twin, SERVO, **quick("momentum", "inspect", "simulate"), **how),
        Recipe("motor-second", twin, SERVO, **quick(), **how | {"seed": 2, "drive": terms[1:]}),
    ]
    logged = changed(SERVO, {"log.bridge": "on", "drive.motor.back_emf": None})
    balanced = changed(SERVO, {"axis.gravity_torque": 0})
    for name, given, opens, added, gravity in (
        ("motor-opens", logged, 5.0, 0.0, 0.4807),
        ("motor-balanced", balanced, 99.0, 0.0, 0.0),
        ("motor-balanced-loaded", balanced, 99.0, 4e-3, 0.0),
    ):
        columns, only = partial(_servo_columns, opens, added, gravity), ("momentum",) if given is logged else ()
        found.append(Recipe(name, given, given, columns=columns, **quick(*only)))
    return found


def _spinning() -> list[Recipe]:
    """Coast-downs without and with a ring, and a torque in one direction."""
    found = []
    for name, added, speed, seed in (
        ("coast", 0.0, 150.0, 1),
        ("coast-ring", RING, 140.0, 2),
        ("coast-again", 0.0, 145.0, 3),
    ):
        twin = changed(SPINNING, {"axis.inertia": 1.134e-4 + added})
        how: dict[str, Any] = {"duration": 45.0, "rate": 200.0, "initial_speed": speed, "seed": seed}
        found.append(Recipe(name, twin, SPINNING, None, **quick(), **how))
    driven = changed(SPINNING, {"drive.kind": "direct", "sensors.counts_per_turn": 4096, "log": {"torque_gain": 1}})
    torques = ((1e-3, 0.0, np.pi / 2), (0.8e-3, 0.9, 0.0))
    twin = changed(driven, {"axis.inertia": 1.134e-4})
    return [*found, Recipe("spun-up", twin, driven, None, torques, 20.0, 200.0, **quick())]


def _rates() -> list[Recipe]:
    """The rate of the angle (gyroscope) in its place, or beside it."""
    direct = changed(GYRO, {"drive.kind": "direct", "log.torque_gain": 1})
    beside = {"log.angle": "q1", "sensors.noise": 5e-3}
    free: dict[str, Any] = {"initial_angle": 0.6, "duration": 20.0, "rate": 200.0}
    driven: dict[str, Any] = {"drive": ((0.15, 9.3, 1.0), (0.1, 13.0, 0.0)), "duration": 20.0, "rate": 200.0}
    wheel = {
        "log.angle": None,
        "log.angle_speed": "gz",
        "sensors.nonlinearity": None,
        "sensors.wheel": {"nonlinearity": 0},
        "sensors.angle_speed": {"noise": "0.05 deg/s", "bias": "0 ± 0.5 deg/s"},
    }
    made: tuple[tuple[str, Tree, dict[str, Any], dict[str, Any]], ...] = (
        ("gyro-free", GYRO, free, quick("momentum")),
        ("gyro-direct", direct, driven, quick("momentum", "equation-error", "simulate")),
        ("gyro-mean", changed(GYRO, {"log.angle_speed_is": "mean"}), free, {}),
        ("gyro-held", changed(direct, {"log.angle_speed_is": "held"}), driven, {}),
        ("gyro-beside", changed(GYRO, beside), free, quick("momentum")),
        ("gyro-scale", changed(direct, {"log.angle_speed_scale": "1 ± 0.01"}), driven, {}),
    )
    found = [Recipe(name, rig, changed(rig, UNTOLD), None, **how, **level) for name, rig, how, level in made]
    given = changed(PAPER, wheel)
    return [*found, Recipe("gyro-wheel", twin_of(given, "coulomb"), given, TWO_TONES)]


def _further() -> list[Recipe]:
    """Springs, cogging, friction by load and strings, unknown and stated, on every drive that has them."""
    direct, free = changed(PAPER, DIRECT), changed(PAPER, FREE)
    terms = {
        "spring": {"axis.stiffness": 0.05, "axis.spring_zero": 0.2},
        "cogging": {"axis.cogging": {"order": 7.0, "amplitude": 4e-3, "phase": 0.7}},
        "load": {"axis.friction.load": 6e-3},
    }
    sought: dict[str, dict[str, Any]] = {
        "spring": {"axis.stiffness": "unknown", "axis.spring_zero": None},
        "cogging": {"axis.cogging": {"order": 7.0, "amplitude": "unknown"}},
        "load": {"axis.friction": {"load": "unknown"}},
    }
    free_too = {"reference": None, "initial_angle": 1.3}
    found = []
    for name, keys in terms.items():
        law, methods = ("coulomb", ("energy",)) if name == "load" else ("viscous", ("energy", "equation-error"))
        for drive, rig, how in (
            ("", PAPER, {"reference": TWO_TONES, **quick("momentum", "simulate", *methods)}),
            ("-direct", direct, {"reference": None, "drive": WIDER, **quick(*["momentum"] * (name == "spring"))}),
            *([("-free", free, free_too | quick("momentum"))] if name == "spring" else []),
        ):
            twin = changed(twin_of(rig, law), keys)
            found.append(Recipe(f"{name}{drive}", twin, changed(rig, sought[name]), **how))
    wound = changed(free, {"axis.gravity_torque": 0, "axis.stiffness": "0.05 ± 0.0001 N*m/rad"})
    found.append(Recipe("torsion", twin_of(wound), wound, None, initial_angle=0.9, **quick("momentum", "energy")))
    for name, strings in (("strings", BIFILAR), ("strings-three", TRIFILAR)):
        hung = changed(free, {"axis.gravity_torque": 0, **strings})
        twin = changed(twin_of(hung), {"axis.inertia": 2e-2})
        level = quick("momentum", "energy", "simulate") if name == "strings" else {}
        found.append(Recipe(name, twin, hung, None, initial_angle=0.9, rate=200.0, **level))
    slide = {"axis.inertia": 95.0, "axis.friction": {"coulomb": 20.0, "viscous": 200.0}}
    for name, stated, unknown in (
        ("linear-spring", {"axis.stiffness": 3000.0}, {"axis.stiffness": "unknown"}),
        ("linear-cogging", {"axis.cogging": {"order": 314.0, "amplitude": 15.0}},
         {"axis.cogging": {"order": 314.0, "amplitude": "unknown"}}),
    ):  # fmt: skip
        twin = changed(LINEAR, slide | stated)
        found.append(Recipe(name, twin, changed(LINEAR, unknown), None, FORCES, **quick("momentum", "energy")))
    plain = changed(LINEAR, {"log.torque_gain": None})
    found.append(
        Recipe("linear-plain", changed(plain, slide | {"axis.stiffness": 3000.0}), plain, None, FORCES, **quick())
    )
    return found


def _slow() -> list[Recipe]:
    """Friction and zeros that change within a log."""
    direct = changed(PAPER, DIRECT | {"log.torque_gain": 1, "log.drive_held": False, "sensors.counts_per_turn": None})
    found = [Recipe(f"slow-{name}", direct, direct, columns=partial(_slow_columns, share, drift),
                    **quick("momentum", "equation-error"))
             for name, share, drift in (("friction", 0.4, 0.0), ("zero", 0.0, 2e-3))]  # fmt: skip
    warm: dict[str, Any] = {"duration": 25.0, "warming": 5e-4}
    return [*found, Recipe("slow-wheel", twin_of(PAPER, "coulomb"), PAPER, TWO_TONES, **warm, **quick("momentum"))]


def _several() -> list[Recipe]:
    """Logs that belong together: of one body by direct and free drive, and with a known body on the axis."""
    direct, free = (changed(PAPER, drive | {key: STATED[key] for key in ("axis.gravity_torque", "sensors.latency")})
                    for drive in (DIRECT, FREE))  # fmt: skip
    loaded = {"axis.inertia": INERTIA + BODY}
    second = ((0.1, 9.5, 0.0), (0.06, 4.4, 1.0))
    coulomb = partial(twin_of, law="coulomb")
    found = [
        Recipe("direct-a", coulomb(direct), direct, None, TERMS, **quick()),
        Recipe("direct-b", coulomb(direct), direct, None, second, seed=2, **quick()),
        Recipe("direct-loaded", changed(coulomb(direct), loaded), direct, None, TERMS, seed=3, **quick()),
        Recipe("free-a", coulomb(free), free, None, initial_angle=1.3, **quick()),
        Recipe("free-b", coulomb(free), free, None, initial_angle=1.1, seed=2, **quick()),
        Recipe("free-loaded", changed(coulomb(free), loaded), free, None, initial_angle=1.3, seed=3, **quick()),
    ]
    wheel = changed(PAPER, STATED)
    for name, changes, seed in (("two-a", {}, 1), ("two-b", {}, 2), ("two-loaded", loaded, 3)):
        twin = changed(twin_of(wheel, "coulomb"), changes)
        found.append(Recipe(name, twin, wheel, TWO_TONES, seed=seed, **quick()))
    return found


def recipes() -> list[Recipe]:
    """All of these logs."""
    return [*_motors(), *_spinning(), *_rates(), *_further(), *_slow(), *_several()]
