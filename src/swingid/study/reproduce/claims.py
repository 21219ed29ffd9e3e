"""The claims of the paper's conclusion on identification, each with a test on the twin, a criterion and a verdict.

A verdict follows from the numbers by the criterion beside it; no verdict is written by hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swingid.control.references import Multisine, Sine, Strokes, Triangle
from swingid.control.references.base import Reference
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.study.reproduce import runs
from swingid.study.reproduce.experiment import settled_within, viscous
from swingid.study.reproduce.runs import Answer, Log

BAR = 1.4
"""Per cent: the accuracy required where a sentence of the paper names none: that of its own ideal simulation."""

HOLDS, PARTLY, FAILS = "holds", "holds in part", "does not hold"

Measured = list[tuple[str, float | None, str]]
"""(words, value, unit): "±%" for the size of an error; words before a colon are what several have in common."""

BEARING = 1.144e-3
"""Viscous coefficient of the twin's bearing, f1 times 4.4, N m s."""

LAWS: dict[str, dict[str, object]] = {
    "order 0 (Coulomb)": {"coulomb": 6.11e-3},
    "order 1 (viscous)": {"viscous": BEARING},
    "order 2 (quadratic)": {"quadratic": 1.98e-4},
    "order 3 (cubic)": {"cubic": 3.3e-5},
    "Stribeck (twice as much towards rest)": {"coulomb": 5.9e-3, "static": 11.8e-3, "stribeck_speed": 0.3},
    "by direction, ± 50 %": {"viscous_positive": 1.5 * BEARING, "viscous_negative": 0.5 * BEARING},
    "with memory (LuGre, 1 mrad)": {"coulomb": 6.11e-3, "lugre": {"bristle_stiffness": 6.11, "bristle_damping": 0.02}},
}
"""Laws that take as much energy from a swing of 0.8 rad at 8.5 rad/s as the paper's viscous friction, 9.8 mJ."""

STRONGER = 8.0
"""So many times the friction of `LAWS`, for the orders 0 to 3."""

MOTIONS: dict[str, Reference] = {
    "sine 8.5 rad/s": Sine(0.8, 8.5),
    "strokes, 0.37 s each, no rest": Strokes(0.8, 0.37),
    "strokes, 0.37 s each, rests of 0.1 s": Strokes(0.8, 0.37, 0.1),
    "triangle 8.5 rad/s, corners rounded over 0.2 s": Triangle(0.8, 8.5, 0.2),
    "triangle 7 rad/s, corners rounded over 0.1 s": Triangle(0.8, 7.0, 0.1),
    "multisine, 1st and 3rd harmonic of 6 rad/s": Multisine((Sine(0.7, 6.0), Sine(0.07, 18.0))),
}
"""Motions that are symmetric about every turning point."""

LATE = (15.0, 25.0)

IDEAL, REAL = "ideal angles at 10 kHz", "14 bit at 1 kHz, speeds by local cubics"

OBSERVED = "14 bit at 1 kHz, speeds by the observers (23)"

WORDS = {"printed": "paper's method", "better": "energy, solved together", "momentum": "momentum"}

MIRRORS = ("paper's method", "the same about the reference", "momentum")


@dataclass(frozen=True)
class Claim:
    """A claim in the paper's words, what was done, what was measured, the criterion and whether it is met."""

    claim: str
    test: str
    measured: Measured
    criterion: str
    verdict: str

    def to_dict(self) -> Answer:
        """Plain data."""
        return vars(self) | {"measured": [dict(zip(("what", "value", "unit"), m, strict=True)) for m in self.measured]}


def verdict(whole: bool, part: bool = False) -> str:
    """Return whether the criterion is met, only the part of it that is named, or neither."""
    return HOLDS if whole else PARTLY if part else FAILS


def _log(friction: dict[str, object], reference: Reference, seed: int) -> Log:
    twin = runs.with_friction(runs.rig_of("plain"), friction)
    return runs.read_back(runs.run_of(twin, reference, seed=seed), twin, span=LATE)


def no_acceleration(seed: int) -> Claim:
    """The log holds time, two angles and a voltage."""
    log = runs.experiment_log("plain", runs.with_friction(runs.rig_of("plain"), runs.HIDDEN), seed)
    recording = log.recording
    channels = 3 + (recording.torque is not None)
    errors = {estimator: runs.error_by(estimator, log) for estimator in ("printed", "observers", "momentum")}
    within = [abs(errors[estimator]) < BAR for estimator in ("printed", "observers")]
    return Claim(
        "it does not require measurement of acceleration, cumbersome calculations and linearization",
        "The experiment's log with hidden dry friction: time, two encoders, voltage. (6) is a closed formula in "
        "angles, speeds and works; the speeds by the paper's observers (23), and by local cubics.",
        [
            ("measured channels beside time", float(channels), ""),
            ("(6), speeds by the observers (23)", errors["observers"], "%"),
            ("(6), speeds by local cubics", errors["printed"], "%"),
            ("for comparison, momentum, which needs no speeds", errors["momentum"], "%"),
        ],
        f"J1 by (6) within {BAR:g} % with either speeds; in part: with one of them",
        verdict(all(within), any(within)),
    )


def one_interval(seed: int) -> Claim:
    """Every two-step interval by itself, ideal and with the paper's encoders."""
    ideal = runs.read_back(runs.simulation_run(), runs.ideal_rig(), span=(6.0, 12.0))
    real = runs.experiment_log("plain", runs.rig_of("plain"), seed)
    observers: dict[str, object] = {"velocities": "observers", "filter_time": 0.0}
    measured: Measured = []
    good: dict[str, bool] = {}
    for words, log, options in ((IDEAL, ideal, {}), (REAL, real, {}), (OBSERVED, real, observers)):
        j1, f1 = _worst_inertia(log, options), _worst_friction(log, options)
        measured += [(f"{words}: J1, worst interval", j1, "±%"), (f"{words}: f1, worst interval", f1, "±%")]
        good[words] = max(j1, f1) < BAR
    return Claim(
        "only one two-step symmetric interval is needed to identify the inertia and friction parameters",
        "J1 by (6) and f1 by (7) from every single interval, mirrored about its measured turning point.",
        measured,
        f"J1 and f1 within {BAR:g} % from every interval with 14-bit encoders, whichever way the speeds are found; in "
        "part: with ideal angles",
        verdict(good[REAL] and good[OBSERVED], good[IDEAL]),
    )


def _worst_inertia(log: Log, options: dict[str, object]) -> float:
    """Largest error of J1^ from one interval, per cent."""
    return float(max(abs(runs.interval_errors(log, **options)[1])))


def _worst_friction(log: Log, options: dict[str, object]) -> float:
    """Largest error of f1^ from one interval, per cent; NaN where an interval gives none."""
    results = [runs.result_by("printed", log, nodes=nodes, **options) for nodes in runs.intervals(log)]
    values = [None if isinstance(result, str) else viscous(result) for result in results]
    return float(max(abs(100 * ((math.nan if value is None else value) / BEARING - 1)) for value in values))


def any_dissipation(seed: int) -> Claim:
    """Friction laws of order 0 to 3 and more."""
    measured: Measured = []
    orders = {name: law for name, law in LAWS.items() if name.startswith("order")}
    strong: dict[str, dict[str, object]] = {
        f"{name}, {STRONGER:g} times": {key: STRONGER * value for key, value in law.items() if isinstance(value, float)}
        for name, law in orders.items()
    }
    for name, law in (LAWS | strong).items():
        log = _log({"viscous": None, **law}, runs.motion("plain"), seed)
        nodes = runs.reference_nodes(runs.motion("plain"), log)
        errors = [
            runs.error_by("printed", log),
            runs.error_by("printed", log, nodes=nodes),
            runs.error_by("momentum", log),
        ]
        measured += [(f"{name}: {words}", error, "%") for words, error in zip(MIRRORS, errors, strict=True)]
    about = [
        [value is not None and abs(value) < BAR for words, value, _ in measured if words.endswith(mirror)]
        for mirror in MIRRORS[:2]
    ]
    return Claim(
        "the dissipative function of any order can be separated from the MOIs",
        "One friction law after the other on the twin, known to no method: each with the energy per swing that the "
        f"paper's friction takes, orders 0 to 3 also with {STRONGER:g} times as much. The paper does not say whether "
        "its intervals are mirrored about the turning points of the reference or about the measured ones.",
        measured,
        f"the paper's method within {BAR:g} % for every law, about either turning points; in part: about the measured "
        "ones",
        verdict(all(about[0]) and all(about[1]), all(about[0])),
    )


def any_symmetric_motion(seed: int) -> Claim:
    """Motions of several shapes, whose derivatives nobody gives to the controller or to a method."""
    measured: Measured = []
    for name, reference in MOTIONS.items():
        log = _log(dict(runs.HIDDEN), reference, seed)
        for estimator, words in WORDS.items():
            measured.append((f"{name}: {words}", runs.error_by(estimator, log), "%"))
    printed = [value for words, value, _ in measured if "paper" in words]
    good = [value is not None and abs(value) < BAR for value in printed]
    return Claim(
        "the program trajectory can have any convenient symmetric shape with unknown derivatives",
        "The experiment with hidden dry friction and other motions; the controller is given samples of the "
        "motion only.",
        measured,
        f"the paper's method within {BAR:g} % for every motion; in part: for some beside the sine",
        verdict(all(good), any(good[1:])),
    )


def discrete_online(seed: int) -> Claim:
    """(6) on every oscillation from the start, while k tilde still grows."""
    twin = runs.rig_of("plain")
    log = runs.read_back(runs.experiment_run("plain", twin, seed), twin)
    ends, errors = runs.interval_errors(log)
    running = np.cumsum(errors) / np.arange(1, len(errors) + 1)
    late = ends > runs.SPANS["plain"][0]
    noise = channel_noise(log.recording, log.rig)
    swings = len(find_motion(log.recording.time, log.recording.angle, noise.angle).turning_times)
    first = settled_within(ends, errors, BAR)
    good = np.abs(errors[late]) < BAR
    return Claim(
        "the method can be also used as a discrete-online identification, where the formula is used for each "
        "oscillation",
        "(6) at every turning point from t = 0 on, each from the interval that has just ended.",
        [
            ("intervals used, of so many turning points", len(errors) / swings, ""),
            (f"single intervals within {BAR:g} % for good from", first, "s"),
            ("scatter of single intervals from 15 s on", float(np.std(errors[late])), "±%"),
            ("their running mean at the end", float(running[-1]), "%"),
        ],
        f"every interval within {BAR:g} % from 15 s on, where the paper begins; in part: half of them",
        verdict(bool(good.all()), bool(np.mean(good) >= 0.5)),
    )


TESTS = (no_acceleration, one_interval, any_dissipation, any_symmetric_motion, discrete_online)
