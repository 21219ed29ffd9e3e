"""The generated logs of the corpus: recipes of the paper's rig, of other drives, and of tests of the motor."""

from __future__ import annotations

from typing import Any

from compare_with import logs_terms
from compare_with.recipe import TWO_TONES, Recipe
from compare_with.rigs import DIRECT, FREE, INERTIA, LAWS, LINEAR, PAPER, STATED, changed, twin_of


def _wheel(name: str, law: str = "viscous", changes: dict[str, Any] | None = None, **how: Any) -> Recipe:
    """A closed loop of the paper's rig."""
    given = changed(PAPER, changes or {})
    return Recipe(name, twin_of(given, law), given, **how)


def _sensors() -> list[Recipe]:
    """One imperfection of the sensors each, known to the rig file or not."""
    known = {
        "perfect": {"sensors.counts_per_turn": None},
        "noise": {"sensors.counts_per_turn": None, "sensors.noise": 1e-3},
        "noise-14bit": {"sensors.noise": 1e-4},
        "coarse": {"sensors.counts_per_turn": 1024},
        "coarse-wheel": {"sensors.wheel.counts_per_turn": 512},
        "latency-doubtful": {"sensors.latency": "0 ± 1 ms"},
        "latency-stated": {"sensors.latency": "3 ms"},
        "latency-wheel": {"sensors.wheel.latency": "1 ms"},
        "nonlinear": {"sensors.nonlinearity": "0.1 deg"},
        "nonlinear-large": {"sensors.nonlinearity": "0.5 deg"},
        "nonlinear-parts": {
            "sensors.nonlinearity_cosine": "0.02 ± 0.01 deg",
            "sensors.nonlinearity_sine": "0.09 ± 0.01 deg",
        },
        "jitter": {"sensors.jitter": "100 us"},
        "stated": STATED,
    }
    quick = {"noise", "latency-stated", "nonlinear", "stated"}
    found = [_wheel(name, "stribeck", changes, quick=name in quick) for name, changes in known.items()]
    for name in ("nonlinear-large", "latency-wheel", "noise"):
        own = next(one for one in found if one.name == name)
        found.append(Recipe(f"{name}-untold", own.twin, PAPER))
    return found


def _motions() -> list[Recipe]:
    """Other motions, rates and controllers of the paper's rig."""
    unknown = {"axis.gravity_torque": "unknown"}
    given = changed(PAPER, unknown)
    return [
        Recipe("gravity-unknown", twin_of(PAPER, "viscous"), given, TWO_TONES, quick=True),
        Recipe("gravity-unknown-one-tone", twin_of(PAPER, "viscous"), given),
        Recipe("gravity-wrong", twin_of(PAPER, "coulomb"), changed(PAPER, {"axis.gravity_torque": 80e-3}), TWO_TONES),
        _wheel("strokes", "stribeck", None, reference="strokes 0.8 rad 0.5 s 0.2 s"),
        _wheel("triangle", "coulomb", None, reference="triangle 45 deg 1.3 Hz 0.1 s"),
        _wheel("chirp", "viscous", None, reference="chirp 0.5 rad 1 Hz 2 Hz 10 s"),
        _wheel("resonance", "coulomb", None, reference="sine 0.8 rad 5.1 rad/s"),
        _wheel("large-swing", "stribeck", None, reference="sine 1.4 rad 5 rad/s"),
        _wheel("slow", "stribeck", None, rate=200.0),
        _wheel("very-slow", "viscous", None, rate=50.0),
        _wheel("short", "viscous", None, duration=2.0),
        _wheel("tiny", "viscous", None, reference="sine 0.002 rad 8.5 rad/s"),
        _wheel("long-run", "coulomb", None, duration=60.0),
        _wheel("backstepping-control", "viscous", None, controller="backstepping"),
        _wheel("voltage-driven", "coulomb", None, reference=None, drive=((4.0, 8.5, 0.0), (2.0, 5.3, 1.0))),
        _wheel("decay-with-wheel", "stribeck", None, reference=None, initial_angle=1.2),
        _wheel("saturated", "stribeck", {"drive.motor.voltage_limit": 8}, quick=True),
        _wheel("saturated-more", "stribeck", {"drive.motor.voltage_limit": 6}),
        _wheel("pushed", "stribeck", None, duration=25.0, pushes=((11.3, 0.2, 0.08),), quick=True),
        _wheel("pushed-often", "stribeck", None, duration=25.0, pushes=((9.1, 0.05, 0.08), (15.3, 1.0, -0.016))),
        _wheel("not-held", "viscous", {"log.drive_held": False}),
        _wheel("a", "coulomb", STATED, quick=True),
        _wheel("b", "coulomb", STATED, reference="sine 0.81 rad 9 rad/s", quick=True),
        _wheel("c", "coulomb", STATED, reference="sine 0.82 rad 8.5 rad/s", seed=2),
        Recipe("other", twin_of(changed(PAPER, STATED), "coulomb", **{"axis.inertia": 1.02 * INERTIA}), PAPER),
    ]


def _conventions() -> list[Recipe]:
    """Logs in other units, signs and readings, and logs that the rig file says wrong things about."""
    turned = {
        "log.angle_unit": "deg",
        "log.angle_zero": "up",
        "log.angle_sign": -1,
        "log.wheel_angle_unit": "turns",
        "log.wheel_angle_sign": -1,
        "log.voltage_sign": -1,
    }
    speed = {"log.wheel_angle": None, "log.wheel_speed": "w2", "log.drive_held": False}
    viscous = twin_of(PAPER, "viscous")
    wrong: dict[str, dict[str, Any]] = {
        "wheel-sign": {"log.wheel_angle_sign": -1},
        "angle-sign": {"log.angle_sign": -1},
        "zero": {"log.angle_zero": "up"},
        "voltage-sign": {"log.voltage_sign": -1},
        "absolute": {"log.wheel_angle_is": "absolute"},
        "wheel-degrees": {"log.wheel_angle_unit": "deg"},
        "motor": {"drive.motor.torque_per_volt": 60e-4},
        "column": {"log.angle": "theta"},
    }
    return [
        _wheel("units", "viscous", turned),
        _wheel("absolute-wheel", "stribeck", {"log.wheel_angle_is": "absolute"}),
        _wheel("counts", "viscous", {"log.angle_unit": "counts", "log.wheel_angle_unit": "counts"}),
        _wheel("wheel-speed", "stribeck", speed, quick=True),
        _wheel("wheel-speed-slow", "viscous", {**speed, "log.wheel_speed_unit": "rpm"}, rate=100.0),
        *(Recipe(f"wrong-{name}", viscous, PAPER, TWO_TONES, read_as=changes) for name, changes in wrong.items()),
    ]


def _other_drives() -> list[Recipe]:
    """Direct drive, no drive, linear axis."""
    direct, free = changed(PAPER, DIRECT), changed(PAPER, FREE)
    terms = ((0.12, 8.5, 0.3), (0.05, 5.0, 0.0))
    found = []
    for law in ("viscous", "stribeck", "lugre", "sticking", "direction-dependent"):
        rest: dict[str, Any] = {"reference": None, "quick": law == "stribeck"}
        found.append(Recipe(f"direct-{law}", twin_of(direct, law), direct, drive=terms, **rest))
        found.append(Recipe(f"free-{law}", twin_of(free, law), free, initial_angle=1.4, **rest))
    unknown = changed(direct, {"axis.gravity_torque": "unknown", "sensors.latency": "0 ± 0.5 ms"})
    found.append(Recipe("direct-unknown", twin_of(direct, "coulomb"), unknown, None, drive=terms))
    late = changed(direct, {"sensors.latency": "2 ms"})
    found.append(Recipe("direct-late", twin_of(late, "viscous"), late, None, drive=terms))
    slide = {"axis.inertia": 95.0, "axis.friction": {"coulomb": 20.0, "viscous": 200.0}}
    forces = ((600.0, 6.0, 0.0), (300.0, 2.7, 1.0))
    found.append(Recipe("linear", changed(LINEAR, slide), LINEAR, None, drive=forces, quick=True))
    dry = changed(LINEAR, {**slide, "axis.friction.static": 30.0, "axis.friction.stribeck_speed": 0.01})
    found.append(Recipe("linear-stribeck", dry, LINEAR, None, drive=forces))
    return found


def _motor_tests() -> list[Recipe]:
    """Voltage tests for the calibration of the motor: rod clamped, rod free, free swing."""
    terms = ((3.0, 1.1, 0.0), (2.5, 2.9, 1.7), (2.0, 7.3, 3.4), (1.0, 19.0, 5.1))
    clamped = changed(PAPER, {"axis.inertia": INERTIA, "axis.friction": {"coulomb": 10.0}})
    perfect = {"sensors.counts_per_turn": None}
    how: dict[str, Any] = {"reference": None, "duration": 10.0}
    return [
        Recipe("clamped", clamped, PAPER, drive=terms, quick=True, **how),
        Recipe("clamped-perfect", changed(clamped, perfect), changed(PAPER, perfect), drive=terms, **how),
        Recipe("clamped-up", clamped, PAPER, drive=((3.0, 3.0, 0.0), (2.5, 11.0, 0.5)), **how),
        _wheel("rod-free", "coulomb", None, drive=terms, **how),
        _wheel("rod-swing", "coulomb", None, initial_angle=0.8, **how),
    ]


def recipes() -> list[Recipe]:
    """All logs of the corpus."""
    laws = [_wheel(f"law-{law}", law, quick=law in ("viscous", "stribeck", "sticking")) for law in LAWS]
    return [*laws, *_sensors(), *_motions(), *_conventions(), *_other_drives(), *_motor_tests(), *logs_terms.recipes()]
