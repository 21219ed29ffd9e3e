"""Claims on what is identified, and from how little."""

from __future__ import annotations

import numpy as np

from swingid.control.references import Multisine, Sine, Strokes, Triangle
from swingid.control.references.base import Reference
from swingid.identify.motion import find_motion
from swingid.identify.noise import channel_noise
from swingid.study.reproduce.claims import BAR, Claim, judged
from swingid.study.reproduce.estimates import each_interval, error_by, intervals, reference_nodes, result_by
from swingid.study.reproduce.experiment import settled_within, viscous
from swingid.study.reproduce.runs import (
    HIDDEN,
    SPANS,
    Log,
    experiment_log,
    experiment_run,
    ideal_rig,
    motion,
    read_back,
    rig_of,
    run_of,
    simulation_run,
    with_friction,
)

BEARING = 1.144e-3
"""Viscous coefficient of the twin's bearing, f1 times 4.4, N m s."""

LAWS: dict[str, dict[str, object]] = {
    "order 0 (Coulomb 2 mN m)": {"coulomb": 2e-3},
    "order 1 (viscous, 8 times as much)": {"viscous": 8 * BEARING},
    "order 2 (quadratic)": {"viscous": 2e-4, "quadratic": 4e-4},
    "order 3 (cubic)": {"viscous": 2e-4, "cubic": 6e-5},
    "Stribeck": dict(HIDDEN),
    "by direction, ± 50 %": {"viscous": None, "viscous_positive": 1.5 * BEARING, "viscous_negative": 0.5 * BEARING},
    "with memory (LuGre, 1 mrad)": {"coulomb": 3e-3, "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 0.01}},
}

MOTIONS: dict[str, Reference] = {
    "sine 8.5 rad/s": Sine(0.8, 8.5),
    "strokes, 0.37 s each, no dwell": Strokes(0.8, 0.37),
    "triangle 8.5 rad/s, corners rounded over 0.2 s": Triangle(0.8, 8.5, 0.2),
    "multisine, 1st and 3rd harmonic of 6 rad/s": Multisine((Sine(0.7, 6.0), Sine(0.07, 18.0))),
}
"""Motions that are symmetric about every turning point."""

LATE = (15.0, 25.0)

MIRRORS = ("paper's method", "the same about the reference", "momentum")


def _log(friction: dict[str, object], reference: Reference, seed: int) -> Log:
    twin = with_friction(rig_of("plain"), friction)
    return read_back(run_of(twin, reference, seed=seed), twin, span=LATE)


def no_acceleration(seed: int) -> Claim:
    """The log holds time, two angles and a voltage."""
    log = experiment_log("plain", with_friction(rig_of("plain"), HIDDEN), seed)
    recording = log.recording
    extra = (recording.reference, recording.adaptive_gain, recording.torque)
    channels = 3 + sum(channel is not None for channel in extra[2:])
    errors = {way: error_by(way, log) for way in ("printed", "better", "momentum")}
    return Claim(
        "it does not require measurement of acceleration, cumbersome calculations and linearization",
        "The experiment's log with hidden dry friction: time, two encoders, voltage; q1' and q2' by local cubics "
        "(momentum: not even these).",
        (
            ("measured channels beside time", float(channels), ""),
            ("paper's method", errors["printed"], "%"),
            ("energy, solved together", errors["better"], "%"),
            ("momentum", errors["momentum"], "%"),
        ),
        f"all within {BAR:g} %",
        judged(all(abs(error) < BAR for error in errors.values())),
    )


def one_interval(seed: int) -> Claim:
    """Every two-step interval by itself, ideal and with the paper's encoders."""
    ideal = read_back(simulation_run(), ideal_rig(), span=(6.0, 12.0))
    real = experiment_log("plain", rig_of("plain"), seed)
    worst = {}
    observers = {"velocities": "observers", "filter_time": 0.0}
    for name, log, options in (("ideal", ideal, {}), ("real", real, {}), ("observers", real, observers)):
        worst[name] = float(max(abs(100 * (each_interval(log, **options)[1] / log.truth - 1))))
    f1 = [result_by("printed", real, nodes=nodes) for nodes in intervals(real)]
    found = [viscous(result) for result in f1 if not isinstance(result, str)]
    worst_f1 = max(abs(100 * (value / BEARING - 1)) for value in found if value is not None)
    return Claim(
        "only one two-step symmetric interval is needed to identify the inertia and friction parameters",
        "J1 by (6) and f1 by (7) from every single interval, mirrored about its measured turning point.",
        (
            ("J1, worst interval, ideal angles at 10 kHz", worst["ideal"], "±%"),
            ("J1, worst interval, 14 bit at 1 kHz", worst["real"], "±%"),
            ("f1, worst interval, 14 bit at 1 kHz", worst_f1, "±%"),
            ("J1, worst interval, 14 bit at 1 kHz, speeds by the observers (23)", worst["observers"], "±%"),
        ),
        f"J1 within {BAR:g} % and f1 within 10 % from every interval, with the paper's observers too; in part: with "
        "speeds by local cubics",
        judged(max(worst.values()) < BAR and worst_f1 < 10, max(worst["ideal"], worst["real"]) < BAR),
    )


def any_dissipation(seed: int) -> Claim:
    """Friction laws of order 0 to 3 and more."""
    measured: list[tuple[str, float | None, str]] = []
    for name, law in LAWS.items():
        log = _log(law, motion("plain"), seed)
        nodes = reference_nodes(motion("plain"), log)
        errors = [error_by("printed", log), error_by("printed", log, nodes=nodes), error_by("momentum", log)]
        measured += [(f"{name}: {words}", error, "%") for words, error in zip(MIRRORS, errors, strict=True)]
    about = [[abs(value or 0.0) for words, value, _ in measured if words.endswith(mirror)] for mirror in MIRRORS[:2]]
    return Claim(
        "the dissipative function of any order can be separated from the MOIs",
        "One friction law after the other on the twin, known to no method. The paper does not say whether its "
        "intervals are mirrored about the turning points of the reference or about the measured ones.",
        tuple(measured),
        f"the paper's method within {BAR:g} % for every law and either mirror; in part: about the measured "
        "turning points",
        judged(max(map(max, about)) < BAR, max(about[0]) < BAR),
    )


def any_symmetric_motion(seed: int) -> Claim:
    """Motions of several shapes, whose derivatives nobody gives to the controller or to a method."""
    measured: list[tuple[str, float | None, str]] = []
    for name, reference in MOTIONS.items():
        log = _log(dict(HIDDEN), reference, seed)
        for way in ("printed", "better", "momentum"):
            words = {"printed": "paper's method", "better": "energy, solved together", "momentum": "momentum"}[way]
            measured.append((f"{name}: {words}", error_by(way, log), "%"))
    printed = [value for words, value, _ in measured if "paper" in words]
    others = [value for words, value, _ in measured if "paper" not in words]
    good = [value is not None and abs(value) < BAR for value in printed]
    return Claim(
        "the program trajectory can have any convenient symmetric shape with unknown derivatives",
        "The experiment with hidden dry friction and other motions; the controller is given samples of the "
        "motion only.",
        tuple(measured),
        f"the paper's method within {BAR:g} % for every motion; in part: the other two ways are",
        judged(all(good), all(value is not None and abs(value) < BAR for value in others)),
    )


def discrete_online(seed: int) -> Claim:
    """(6) on every oscillation from the start, while k tilde still grows."""
    twin = rig_of("plain")
    log = read_back(experiment_run("plain", twin, seed), twin)
    ends, values = each_interval(log)
    errors = 100 * (values / log.truth - 1)
    running = np.cumsum(errors) / np.arange(1, len(errors) + 1)
    late = ends > SPANS["plain"][0]
    noise = channel_noise(log.recording, log.rig)
    swings = len(find_motion(log.recording.time, log.recording.angle, noise.angle).turning_times)
    first = settled_within(ends, errors, BAR)
    return Claim(
        "the method can be also used as a discrete-online identification, where the formula is used for each "
        "oscillation",
        "(6) at every turning point from t = 0 on, each from the interval that has just ended.",
        (
            ("intervals used, of so many turning points", len(errors) / swings, ""),
            (f"single intervals within {BAR:g} % for good from", first, "s"),
            ("scatter of single intervals from 15 s on", float(np.std(errors[late])), "±%"),
            ("their running mean at the end", float(running[-1]), "%"),
        ),
        f"single intervals stay within {BAR:g} % from a time before 15 s on",
        judged(first is not None and first < SPANS["plain"][0]),
    )


TESTS = (no_acceleration, one_interval, any_dissipation, any_symmetric_motion, discrete_online)
