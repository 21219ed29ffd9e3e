"""Cases of a log read by another rig file: each declared quantity, unknowns, ratios, known bodies, several logs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from compare_with.case import METHODS, Case, command
from compare_with.logs import recipes
from compare_with.logs_terms import BODY, RING
from compare_with.outcomes import JSON, of_call
from compare_with.recipe import Recipe
from compare_with.rigs import Tree, changed, to_toml

BY_ROWS = ("momentum", "energy", "equation-error")
RIG = ["--rig", "{here}/rig.toml"]
UNKNOWN = {"axis.gravity_torque": "unknown"}

TIMES = {"log.clock": "20 ± 50 ppm", "axis.model_uncertainty": "0.01 %"}
ANGLES = {"log.angle_scale": "1 ± 0.001", "log.angle_offset": "0 ± 0.5 deg", "sensors.latency": "0 ± 0.2 ms"}
LENS = {"sensors.nonlinearity": "0.1 deg"}
PARTS = {"sensors.nonlinearity_cosine": "0.01 ± 0.02 deg", "sensors.nonlinearity_sine": "0 ± 0.02 deg"}
HUNG = {"axis.gravity_torque": "78 ± 0.2 mN*m", "axis.tilt": "1 ± 0.5 deg"}
WHEEL = {"drive.wheel.inertia": "113.4 ± 0.3 kg*mm^2", "drive.wheel.tilt": "0 ± 1 deg", "log.wheel_scale": "1 ± 0.001"}
MOTOR = {
    "drive.motor.rotor_inertia": "0.21e-5 ± 2 % kg*m^2",
    "drive.motor.gear_ratio": "4.4 ± 0.001",
    "drive.motor.torque_per_volt": "52.04e-4 ± 0.5 % N*m/V",
    "drive.motor.back_emf": "3.697e-6 ± 5 % N*m*s",
    "drive.motor.viscous": "3.687e-5 ± 5 % N*m*s",
    "drive.motor.coulomb": "302.02e-5 ± 1 % N*m",
    "drive.motor.efficiency": "0.9 ± 0.01",
    "log.voltage_scale": "1 ± 0.002",
}
LOOSE = {"drive.wheel.inertia": "unknown", "drive.motor": None}
"""A wheel whose inertia nobody states; it stands for wheel and rotor."""

GAIN = {"log.torque_gain": "1 ± 0.002"}
ALL_ANGLES = TIMES | ANGLES | LENS
ON_AXIS = {
    "axis.gravity_torque": "0.4807 ± 0.001 N*m",
    "drive.motor.back_emf": "0.0372 ± 2 % N*m*s",
    "drive.motor.rotor_inertia": "1e-7 ± 2e-9 kg*m^2",
    "drive.motor.gear_ratio": "100 ± 0.1",
    "log.voltage_scale": "1 ± 0.002",
}

Told = tuple[str, dict[str, Any], tuple[str, ...], tuple[str, ...]]
"""Log, changes of its rig, methods, and those of them that are quick."""

DECLARED: dict[str, Told] = {
    "wheel": ("law-stribeck", ALL_ANGLES | HUNG | WHEEL | MOTOR, METHODS, (*BY_ROWS, "output-error", "backstepping")),
    "wheel-parts": ("law-stribeck", PARTS | {f"sensors.wheel{key[7:]}": value for key, value in PARTS.items()}
                    | {"sensors.wheel.latency": "0 ± 0.1 ms"}, BY_ROWS, ("momentum",)),
    "wheel-two-tones": ("two-a", ALL_ANGLES | HUNG | WHEEL | MOTOR, METHODS, ()),
    "wheel-unknown": ("gravity-unknown", ALL_ANGLES | WHEEL | MOTOR, METHODS, BY_ROWS),
    "wheel-speed": ("wheel-speed", ALL_ANGLES | HUNG | WHEEL | MOTOR, METHODS, ("momentum",)),
    "direct": ("direct-a", ALL_ANGLES | HUNG | GAIN, METHODS, (*BY_ROWS, "output-error")),
    "direct-unknown": ("direct-a", ALL_ANGLES | UNKNOWN | GAIN, METHODS, ("momentum", "equation-error")),
    "direct-parts": ("direct-a", PARTS | {"axis.mass": "0.0795 ± 0.0001 kg", "axis.lever": "0.1 ± 0.0001 m",
                     "axis.gravity_torque": None}, BY_ROWS, ("momentum",)),
    "free": ("free-a", ALL_ANGLES | HUNG, METHODS, BY_ROWS),
    "free-parts": ("free-a", PARTS, BY_ROWS, ()),
    "linear": ("linear", TIMES | ANGLES | {"log.angle_offset": "0 ± 0.5 mm"}, METHODS, BY_ROWS),
    "motor": ("motor", ALL_ANGLES | ON_AXIS, ("momentum",), ("momentum",)),
    "motor-unknown": ("motor", ALL_ANGLES | UNKNOWN | {"drive.motor.torque_per_volt": "0.0963 ± 0.5 % N*m/V"},
                      ("momentum",), ("momentum",)),
    "motor-bare": ("motor", {"drive.motor": None}, ("momentum",), ("momentum",)),
    "motor-gear-friction": ("motor", {"drive.motor.gear_friction": "unknown"}, ("momentum",), ("momentum",)),
    "motor-windings": ("motor", {"drive.motor": {"torque_constant": "0.386 ± 0.5 % N*m/A",
                       "resistance": "4.0 ± 0.02 ohm"}}, ("momentum",), ("momentum",)),
    "motor-no-scale": ("motor-balanced", {}, ("momentum",), ()),
    "motor-opens": ("motor-opens", ALL_ANGLES | {"axis.gravity_torque": "0.4807 ± 0.001 N*m"}, ("momentum",),
                    ("momentum",)),
    "coast": ("coast", TIMES | {"log.angle_scale": "1 ± 0.001"}, BY_ROWS, ("momentum",)),
    "coast-unknown": ("coast", UNKNOWN, ("momentum",), ()),
    "spun-up": ("spun-up", TIMES | GAIN, BY_ROWS, ("momentum",)),
    "gyro": ("gyro-direct", TIMES | GAIN | {"log.angle_speed_scale": "1 ± 0.01",
             "axis.gravity_torque": "0.5 ± 0.001 N*m"}, BY_ROWS, ("momentum", "equation-error")),
    "gyro-unknown": ("gyro-direct", UNKNOWN, BY_ROWS, ("momentum",)),
    "late": ("direct-a", {"sensors.latency": "1 ± 0.1 ms"}, METHODS, ("momentum",)),
    "unlike": ("law-stribeck", {"axis.gravity_torque": "82 ± 0.2 mN*m"}, METHODS, ("momentum",)),
}  # fmt: skip

TERMS: dict[str, Told] = {
    "spring": ("spring", {"axis.stiffness": "50.3 ± 0.3 mN*m/rad", "axis.spring_zero": "0.21 ± 0.01 rad"}, METHODS,
               ("momentum", "equation-error")),
    "spring-unknown": ("spring", ALL_ANGLES | UNKNOWN, BY_ROWS, ("momentum",)),
    "spring-direct": ("spring-direct", {"axis.stiffness": "50.3 ± 0.3 mN*m/rad", "axis.spring_zero": "0.21 ± 0.01 rad"},
                      METHODS, ()),
    "spring-free": ("spring-free", {"axis.stiffness": "50.3 ± 0.3 mN*m/rad"}, METHODS, ("momentum",)),
    "cogging": ("cogging", {"axis.cogging": {"order": 7.0, "amplitude": "4.1 ± 0.1 mN*m", "phase": "0.68 ± 0.02 rad"}},
                METHODS, ("momentum", "equation-error")),
    "cogging-phase": ("cogging", {"axis.cogging": {"order": 7.0, "amplitude": "unknown", "phase": 0.7}}, METHODS,
                      ("momentum",)),
    "cogging-direct": ("cogging-direct", {"axis.cogging": {"order": 7.0, "amplitude": "4.1 ± 0.1 mN*m", "phase": 0.68}},
                       METHODS, ()),
    "load": ("load", {"axis.friction": {"load": 6e-3}}, METHODS, ()),
    "load-declared": ("load", ALL_ANGLES | HUNG | WHEEL, METHODS, ("momentum",)),
    "strings-shape": ("strings", {"axis.bifilar": None, "axis.suspension": {"stiffness": "0.3678 ± 0.0004 N*m/rad",
                      "shape": 0.085, "height": 0.598}}, BY_ROWS, ("momentum",)),
    "strings-declared": ("strings", ALL_ANGLES, METHODS, ("momentum",)),
    "linear-spring": ("linear-spring", {"axis.stiffness": "3000 ± 10 N/m"}, METHODS, ("momentum",)),
    "linear-cogging": ("linear-cogging", {"axis.cogging": {"order": 314.0, "amplitude": "15 ± 0.5 N", "phase": 0.1}},
                       METHODS, ("momentum",)),
}  # fmt: skip

RATIOS: dict[str, Told] = {
    "free": ("free-a", UNKNOWN, METHODS, ("momentum", "equation-error")),
    "free-declared": ("free-a", ALL_ANGLES | UNKNOWN, METHODS, ("momentum",)),
    "torsion": ("torsion", {"axis.stiffness": "unknown"}, METHODS, ("momentum",)),
    "strings": ("strings", {"axis.bifilar.mass": "unknown"}, METHODS, ("momentum",)),
    "gain": ("direct-a", UNKNOWN | {"log.torque_gain": "unknown"}, METHODS, ("momentum", "equation-error")),
    "gain-by-gravity": ("direct-a", HUNG | ALL_ANGLES | {"log.torque_gain": "unknown"}, METHODS, ("momentum",)),
    "gain-by-spring": ("spring-direct", {"axis.stiffness": "50.3 ± 0.3 mN*m/rad", "log.torque_gain": "unknown"},
                       BY_ROWS, ("momentum",)),
    "wheel": ("two-a", UNKNOWN | LOOSE, METHODS, ("momentum",)),
    "wheel-by-gravity": ("two-a", ALL_ANGLES | HUNG | LOOSE, METHODS, ("momentum",)),
    "linear": ("linear-plain", {"log.torque_gain": "unknown", "axis.stiffness": "unknown"}, BY_ROWS, ("momentum",)),
    "linear-by-spring": ("linear-plain", {"axis.stiffness": "3000 ± 10 N/m", "log.torque_gain": "unknown"},
                         BY_ROWS, ()),
    "gyro": ("gyro-free", UNKNOWN, BY_ROWS, ("momentum",)),
}  # fmt: skip

LIKELY = {"two": ["two-a", "two-b"], "direct": ["direct-a", "direct-b"], "free": ["free-a", "free-b"]}
"""Logs of one body, by drive."""


def _known() -> dict[str, Recipe]:
    return {recipe.name: recipe for recipe in recipes()}


def _told(group: str, table: dict[str, Told]) -> list[Case]:
    """Each of a table by its methods."""
    found, known = [], _known()
    for name, (log, changes, methods, quick) in table.items():
        for method in methods:
            arguments = ["identify", known[log].log, *RIG, "--method", method, "--json", JSON]
            rig = changed(known[log].given, changes)
            found.append(command(f"{group}/{name}/{method}", arguments, quick=method in quick, rig=rig))
    return found


def _one_by_one() -> list[Case]:
    """Each declared quantity alone, so that a difference names its source; the note of what was not declared too."""
    found, known = [], _known()
    for log, declared in (
        ("law-stribeck", ALL_ANGLES | HUNG | WHEEL | MOTOR),
        ("direct-a", ALL_ANGLES | HUNG | GAIN | PARTS),
        ("free-a", ALL_ANGLES | HUNG),
        ("motor", ALL_ANGLES | ON_AXIS),
    ):
        bare = changed(known[log].given, dict.fromkeys(("axis.tilt", "axis.model_uncertainty", "log.clock"), 0))
        if log == "law-stribeck":
            bare = changed(bare, {"drive.wheel.tilt": 0})
        for key, value in declared.items():
            for method in ("momentum",) if log == "motor" else BY_ROWS:
                arguments = ["identify", known[log].log, *RIG, "--method", method, "--json", JSON]
                found.append(command(f"alone/{log}/{key}/{method}", arguments, rig=changed(bare, {key: value})))
    return found


def _several() -> list[Case]:
    """Several logs of one body by every drive, and logs with and without a known body."""
    known = _known()

    def together(name: str, logs: list[str], changes: dict[str, Any], *more: str, quick: bool = False) -> Case:
        arguments = ["identify", *(known[log].log for log in logs), *RIG, "--json", JSON, *more]
        return command(f"together/{name}", arguments, quick=quick, rig=changed(known[logs[0]].given, changes))

    found = []
    shared, energy, rows = ["--option", "friction=shared"], ["--method", "energy"], ["--method", "equation-error"]
    for drive, logs in LIKELY.items():
        found += [
            together(drive, logs, ALL_ANGLES | HUNG, quick=True),
            together(f"{drive}-energy", logs, ALL_ANGLES | HUNG, *energy, quick=drive == "direct"),
            together(f"{drive}-equation-error", logs, ALL_ANGLES | HUNG, *rows, quick=drive == "direct"),
            together(f"{drive}-shared", logs, ALL_ANGLES | HUNG, *shared, quick=drive == "direct"),
            together(f"{drive}-unknown", logs, ALL_ANGLES | UNKNOWN, quick=True),
            together(f"{drive}-unknown-shared", logs, UNKNOWN, *shared),
            together(f"{drive}-unknown-energy", logs, UNKNOWN, *energy),
            together(f"{drive}-unknown-equation-error", logs, UNKNOWN, *rows),
        ]
    body, ring = ["--added", "0", "--added", f"{BODY} ± 1e-7 kg*m^2"], ["--added", f"{RING} ± 2.4e-7 kg*m^2"]
    for drive, pair, changes in (
        ("wheel", ["two-a", "two-loaded"], UNKNOWN),
        ("wheel-unscaled", ["two-a", "two-loaded"], UNKNOWN | LOOSE),
        ("direct", ["direct-a", "direct-loaded"], UNKNOWN | ALL_ANGLES),
        ("direct-unscaled", ["direct-a", "direct-loaded"], UNKNOWN | {"log.torque_gain": "unknown"}),
        ("free", ["free-a", "free-loaded"], UNKNOWN),
        ("free-stated", ["free-a", "free-loaded"], HUNG),
        ("motor", ["motor-balanced", "motor-balanced-loaded"], {}),
    ):
        given = body if drive != "motor" else ["--added", "0", "--added", "4e-3 ± 4e-6 kg*m^2"]
        found.append(
            together(f"added-{drive}", pair, changes, *given, quick=drive in ("wheel", "direct", "free", "motor"))
        )
    found += [
        together("added-energy", ["direct-a", "direct-loaded"], {}, *body, *energy),
        together("added-too-few", ["direct-a", "direct-loaded"], {}, *body[:2]),
        together("coast", ["coast", "coast-again"], TIMES),
        together("coast-ring", ["coast", "coast-ring"], TIMES, "--added", "0", *ring, quick=True),
        together(
            "coast-again", ["coast", "coast-ring", "coast-again"], {}, "--added", "0", *ring, "--added", "0", quick=True
        ),
        together("coast-unknown", ["coast", "coast-ring"], UNKNOWN, "--added", "0", *ring),
        together("motors", ["motor", "motor-second"], ALL_ANGLES | ON_AXIS, quick=True),
        together("motors-unknown", ["motor", "motor-second"], UNKNOWN | {"drive.motor.torque_per_volt": 0.0963}),
        together("gyros", ["gyro-free", "gyro-beside"], {}),
        together("unlike", ["two-a", "two-loaded"], HUNG),
    ]
    return found


def _differences() -> list[Case]:
    """Results without and with a body, by every drive, constants declared; ratios and a body of known inertia."""
    found, known = [], _known()
    held = f"{BODY} ± 1e-6 kg*m^2"
    for name, pair, changes, more in (
        ("direct", ("direct-a", "direct-loaded"), ALL_ANGLES | HUNG | GAIN, ["--known", held]),
        ("free", ("free-a", "free-loaded"), ALL_ANGLES | HUNG, []),
        (
            "wheel",
            ("two-a", "two-loaded"),
            ALL_ANGLES | HUNG | WHEEL,
            ["--mass", "30 ± 0.1 g", "--distance", "20 ± 0.1 mm"],
        ),
        ("ratios-free", ("free-a", "free-loaded"), UNKNOWN, ["--known", held]),
        ("ratios-wheel", ("two-a", "two-loaded"), UNKNOWN | LOOSE, ["--known", held]),
        ("ratios-gain", ("direct-a", "direct-loaded"), UNKNOWN | {"log.torque_gain": "unknown"}, ["--known", held]),
    ):
        steps = [["identify", known[log].log, *RIG, "--json", f"{{here}}/{log}.json"] for log in pair]
        files = [f"{{here}}/{log}.json" for log in pair]
        rig = changed(known[pair[0]].given, changes)
        quick = name in ("direct", "ratios-free")
        found.append(
            command(
                f"difference-of/{name}", *steps, ["difference", *files, *more, "--json", JSON], quick=quick, rig=rig
            )
        )
    return found


def _commands() -> list[Case]:
    """Other commands on rigs whose constants are declared or unknown."""
    known = _known()

    def told(name: str, log: str, changes: dict[str, Any], *arguments: str, quick: bool = False) -> Case:
        rig = changed(known[log].given, changes)
        return command(name, [arguments[0], known[log].log, *arguments[1:], *RIG, "--json", JSON], quick=quick, rig=rig)

    everything = ALL_ANGLES | HUNG | WHEEL | MOTOR
    return [
        told("calibrate/declared", "clamped", everything, "calibrate", quick=True),
        told("calibrate/motor-on-axis", "motor", {}, "calibrate"),
        told("calibrate-encoders/declared", "law-stribeck", everything, "calibrate", "--encoders"),
        told("calibrate-encoders/direct-declared", "direct-a", ALL_ANGLES | HUNG | GAIN, "calibrate", "--encoders"),
        told("calibrate-encoders/unknown", "two-a", UNKNOWN, "calibrate", "--encoders"),
        told("calibrate-encoders/ratios", "free-a", UNKNOWN, "calibrate", "--encoders"),
        told("compare/declared", "direct-a", ALL_ANGLES | HUNG | GAIN, "compare"),
        told("compare/ratios", "free-a", UNKNOWN, "compare"),
        told("compare/unknown", "two-a", UNKNOWN | ALL_ANGLES, "compare"),
        told("inspect-of/declared", "law-stribeck", everything, "inspect"),
        told("inspect-of/unknown", "direct-a", UNKNOWN, "inspect"),
        told("inspect-of/motor", "motor", ALL_ANGLES | ON_AXIS, "inspect"),
        told("draws/free", "free-a", ALL_ANGLES | HUNG, "identify", "--monte-carlo", "100"),
    ]


def _online(rig: Tree, log: str, folder: Path) -> Any:
    import swingid as sw

    own = sw.Rig.from_text(to_toml(rig), "rig.toml")
    return of_call(lambda: list(sw.online(own, sw.Recording.load(log, own))))


def _library(rig: Tree, log: str, folder: Path) -> Any:
    """What a result has beside its JSON: kinds of messages, and the covariance of everything by its sources."""
    import swingid as sw

    def answer() -> Any:
        own = sw.Rig.from_text(to_toml(rig), "rig.toml")
        result = sw.identify(sw.Recording.load(log, own), own)
        shares = {name: {str(source): size for source, size in one.error_components().items()}
                  for name, one in result.ufloats().items()}  # fmt: skip
        kinds = {one.code: one.kind for one in (*result.warnings, *result.notes)}
        return {"kinds": kinds, "ufloats": {name: sorted(one.values()) for name, one in shares.items()}}

    return of_call(answer)


def _calls() -> list[Case]:
    """Streams with unknowns and declared sensors; results in memory."""
    found, known = [], _known()
    for name, log, changes, quick in (
        ("wheel", "law-stribeck", ALL_ANGLES | HUNG | WHEEL, True),
        ("wheel-unknown", "two-a", ALL_ANGLES | UNKNOWN, True),
        ("direct-unknown", "direct-a", ALL_ANGLES | UNKNOWN | GAIN, True),
        ("free", "free-a", ALL_ANGLES | HUNG, False),
        ("spring", "spring", {"axis.stiffness": "50.3 ± 0.3 mN*m/rad"}, False),
        ("gyro", "gyro-free", {}, False),
        ("motor", "motor", {}, False),
    ):
        rig = changed(known[log].given, changes)
        found.append(Case(f"online-of/{name}", partial(_online, rig, known[log].log), quick))
        found.append(Case(f"memory-of/{name}", partial(_library, rig, known[log].log), quick and name == "wheel"))
    return found


def cases() -> list[Case]:
    """All of these cases."""
    tables = {"declared": DECLARED, "term": TERMS, "ratio": RATIOS}
    listed = [case for group, table in tables.items() for case in _told(group, table)]
    return [*listed, *_one_by_one(), *_several(), *_differences(), *_commands(), *_calls()]
