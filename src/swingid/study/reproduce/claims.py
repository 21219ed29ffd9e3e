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
from swingid.study.reproduce.experiment import settled_within, viscous
from swingid.study.reproduce.runs import (
    HIDDEN,
    SPANS,
    Answer,
    Log,
    each_interval,
    error_by,
    experiment_log,
    experiment_run,
    ideal_rig,
    intervals,
    motion,
    read_back,
    reference_nodes,
    result_by,
    rig_of,
    run_of,
    simulation_run,
    with_friction,
)

BAR = 1.4
"""Per cent: the accuracy required where a sentence of the paper names none: that of its own ideal simulation."""

HOLDS, PARTLY, FAILS = "holds", "holds in part", "does not hold"


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

MIRRORS = ("paper's method", "the same about the reference", "momentum")


@dataclass(frozen=True)
class Claim:
    """A claim in the paper's words, what was done, what was measured, the criterion and the verdict.

    measured: (words, value, unit), "±%" for the size of an error; words before a colon are what several have in common.
    """

    claim: str
    test: str
    measured: tuple[tuple[str, float | None, str], ...]
    criterion: str
    verdict: str

    def to_dict(self) -> Answer:
        """Plain data."""
        measured = [{"what": what, "value": value, "unit": unit} for what, value, unit in self.measured]
        return vars(self) | {"measured": measured}


def judged(whole: bool, part: bool = False) -> str:
    """The verdict: the criterion is met, only the part of it that is named, or neither."""
    return HOLDS if whole else PARTLY if part else FAILS


def _log(friction: dict[str, object], reference: Reference, seed: int) -> Log:
    twin = with_friction(rig_of("plain"), friction)
    return read_back(run_of(twin, reference, seed=seed), twin, span=LATE)


def no_acceleration(seed: int) -> Claim:
    """The log holds time, two angles and a voltage."""
    log = experiment_log("plain", with_friction(rig_of("plain"), HIDDEN), seed)
    recording = log.recording
    extra = (recording.reference, recording.adaptive_gain, recording.torque)
    channels = 3 + sum(channel is not None for channel in extra[2:])
    errors = {way: error_by(way, log) for way in ("printed", "observers", "momentum")}
    own = [abs(errors[way]) < BAR for way in ("printed", "observers")]
    return Claim(
        "it does not require measurement of acceleration, cumbersome calculations and linearization",
        "The experiment's log with hidden dry friction: time, two encoders, voltage. (6) is a closed formula in "
        "angles, speeds and works; the speeds by the paper's observers (23), and by local cubics.",
        (
            ("measured channels beside time", float(channels), ""),
            ("(6), speeds by the observers (23)", errors["observers"], "%"),
            ("(6), speeds by local cubics", errors["printed"], "%"),
            ("for comparison, momentum, which needs no speeds", errors["momentum"], "%"),
        ),
        f"J1 by (6) within {BAR:g} % with either speeds; in part: with one of them",
        judged(all(own), any(own)),
    )


def one_interval(seed: int) -> Claim:
    """Every two-step interval by itself, ideal and with the paper's encoders."""
    ideal = read_back(simulation_run(), ideal_rig(), span=(6.0, 12.0))
    real = experiment_log("plain", rig_of("plain"), seed)
    observers: dict[str, object] = {"velocities": "observers", "filter_time": 0.0}
    j1 = {words: _worst_inertia(log, options) for words, log, options in (
        (IDEAL, ideal, {}), (REAL, real, {}), (OBSERVED, real, observers),
    )}  # fmt: skip
    f1 = {
        IDEAL: _worst_friction(ideal, {}),
        REAL: _worst_friction(real, {}),
        OBSERVED: _worst_friction(real, observers),
    }
    measured = [(f"{words}: {name}, worst interval", worst[words], "±%")
                for words in j1 for name, worst in (("J1", j1), ("f1", f1))]  # fmt: skip
    good = {words: max(j1[words], f1[words]) < BAR for words in j1}
    return Claim(
        "only one two-step symmetric interval is needed to identify the inertia and friction parameters",
        "J1 by (6) and f1 by (7) from every single interval, mirrored about its measured turning point.",
        tuple(measured),
        f"J1 and f1 within {BAR:g} % from every interval with 14-bit encoders, whichever way the speeds are found; in "
        "part: with ideal angles",
        judged(good[REAL] and good[OBSERVED], good[IDEAL]),
    )


def _worst_inertia(log: Log, options: dict[str, object]) -> float:
    """Largest error of J1^ from one interval, per cent."""
    return float(max(abs(100 * (each_interval(log, **options)[1] / log.truth - 1))))


def _worst_friction(log: Log, options: dict[str, object]) -> float:
    """Largest error of f1^ from one interval, per cent; NaN where an interval gives none."""
    results = [result_by("printed", log, nodes=nodes, **options) for nodes in intervals(log)]
    found = [None if isinstance(result, str) else viscous(result) for result in results]
    return float(max(abs(100 * ((math.nan if value is None else value) / BEARING - 1)) for value in found))


def any_dissipation(seed: int) -> Claim:
    """Friction laws of order 0 to 3 and more."""
    measured: list[tuple[str, float | None, str]] = []
    orders = {name: law for name, law in LAWS.items() if name.startswith("order")}
    strong = {f"{name}, {STRONGER:g} times": _stronger(law) for name, law in orders.items()}
    for name, law in (LAWS | strong).items():
        log = _log({"viscous": None} | law, motion("plain"), seed)
        nodes = reference_nodes(motion("plain"), log)
        errors = [error_by("printed", log), error_by("printed", log, nodes=nodes), error_by("momentum", log)]
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
        tuple(measured),
        f"the paper's method within {BAR:g} % for every law, about either turning points; in part: about the measured "
        "ones",
        judged(all(about[0]) and all(about[1]), all(about[0])),
    )


def _stronger(law: dict[str, object]) -> dict[str, object]:
    """A law with its coefficients `STRONGER` times as large."""
    return {key: STRONGER * value for key, value in law.items() if isinstance(value, float)}


def any_symmetric_motion(seed: int) -> Claim:
    """Motions of several shapes, whose derivatives nobody gives to the controller or to a method."""
    measured: list[tuple[str, float | None, str]] = []
    for name, reference in MOTIONS.items():
        log = _log(dict(HIDDEN), reference, seed)
        for way in ("printed", "better", "momentum"):
            words = {"printed": "paper's method", "better": "energy, solved together", "momentum": "momentum"}[way]
            measured.append((f"{name}: {words}", error_by(way, log), "%"))
    printed = [value for words, value, _ in measured if "paper" in words]
    good = [value is not None and abs(value) < BAR for value in printed]
    return Claim(
        "the program trajectory can have any convenient symmetric shape with unknown derivatives",
        "The experiment with hidden dry friction and other motions; the controller is given samples of the "
        "motion only.",
        tuple(measured),
        f"the paper's method within {BAR:g} % for every motion; in part: for some beside the sine",
        judged(all(good), any(good[1:])),
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
    good = np.abs(errors[late]) < BAR
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
        f"every interval within {BAR:g} % from 15 s on, where the paper begins; in part: half of them",
        judged(bool(good.all()), bool(np.mean(good) >= 0.5)),
    )


TESTS = (no_acceleration, one_interval, any_dissipation, any_symmetric_motion, discrete_online)
