"""Faults that logs of labs have, each at three severities on the twin: error of J1, is it in the interval, or refusal.

    python benchmarks/robustness.py [FAULT...] [--draws 5]

The twin: the paper's rig with Stribeck friction and the gains of its experiment, 0.8 sin 8.5 t, 25 s, 14-bit encoders,
1 kHz. The fault is put into the columns of the log, which is then read as any log is; the rig file says of encoders and
friction what a user could say: counts per turn, nothing else, except where "declared" is added. The columns of the
printed table: the largest error of the draws and the median uncertainty in per cent, how many 95 % intervals hold the
truth, the codes of refusals, warnings and repairs, and a verdict: "right" is within 0.1 % or covered.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import swingid as sw
from accuracy import STRIBECK, TRUTH, rigs
from swingid.control.compensator import Compensator
from swingid.errors import SwingidError
from swingid.numerics.spline import spline_at, spline_slopes

Array = NDArray[np.float64]
Push = tuple[float, float, float]
"""When a push begins (s), how long it takes (s), and its peak (N m)."""
TURN = 2 * np.pi
WITHIN = 0.1
"""Per cent: the target for mild and medium faults, unless the interval holds the truth."""

GRAVITY = 78e-3
"""Gravity torque of the paper's rig, N m."""

PERFECT = {"counts_per_turn": None, "nonlinearity": 0}
GRADES = ("mild", "medium", "severe")


@dataclass
class Log:
    """What a fault may change: the motion as it was, every how many rows it is logged, columns, and the rig."""

    run: sw.Recording
    rng: np.random.Generator
    every: int = 1
    counts: int = 16384
    late: float = 0.0
    moments: Array | None = None
    bend: tuple[Array, Array] | None = None
    rig: dict[str, object] = field(default_factory=dict)
    options: dict[str, object] = field(default_factory=dict)
    spoil: list[Callable[[dict[str, Array]], dict[str, Array]]] = field(default_factory=list)

    def columns(self) -> dict[str, Array]:
        """The table as the rig would have written it: encoders read at `moments`, the wheel `late`."""
        rows = np.arange(0, len(self.run), self.every)
        stamps = np.array(self.run.time[rows])
        moments = stamps if self.moments is None else np.clip(self.moments[: len(rows)], 0, self.run.time[-1])
        count = TURN / self.counts
        found = {"t": stamps}
        for k, (name, late) in enumerate((("q1", 0.0), ("q2", self.late))):
            values = _read(self.run, name, moments + late)
            if self.bend is not None:
                values = values + self.bend[k][0] * np.cos(values) + self.bend[k][1] * np.sin(values)
            shift = self.rng.uniform(0, count)
            found[name] = np.round((values + shift) / count) * count
        found["u"] = np.array(self.run.voltage)[rows]
        for change in self.spoil:
            found = change(found)
        return found


def _read(run: sw.Recording, name: str, moments: Array) -> Array:
    time, values = np.array(run.time), np.array(run.angle if name == "q1" else run.wheel_angle)
    if len(moments) <= len(time) and np.array_equal(moments, time[:: max(1, round(len(time) / len(moments)))]):
        return values[:: max(1, round(len(time) / len(moments)))]
    return spline_at(time, values, spline_slopes(time, values), moments, 0)


@cache
def motion(duration: float = 25.0, rate: float = 1000.0, pushes: tuple[Push, ...] = ()) -> sw.Recording:
    """The twin's motion with perfect sensors, and with half sines of torque from outside."""
    twin, _ = rigs(PERFECT, STRIBECK)
    controller = Compensator.paper(twin, sample_time=1 / rate)
    time = np.arange(round(duration * rate) + 1) / rate
    share = [np.clip((time - at) / length, 0, 1) for at, length, _ in pushes]
    push = sum((peak * np.sin(np.pi * part) for (_, _, peak), part in zip(pushes, share, strict=True)), 0 * time)
    reference = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    return sw.simulate(twin, reference, controller, duration=duration, rate=rate, push=push if pushes else None)


Fault = Callable[[Log, Any], None]


def dropouts(log: Log, share: float) -> None:
    def spoil(table: dict[str, Array]) -> dict[str, Array]:
        kept = log.rng.random(len(table["t"])) >= share
        return {name: column[kept] for name, column in table.items()}

    log.spoil.append(spoil)


def glitches(log: Log, number: int) -> None:
    def spoil(table: dict[str, Array]) -> dict[str, Array]:
        for name in ("q1", "q2"):
            at = log.rng.choice(len(table["t"]), number, replace=False)
            table[name][at] += log.rng.uniform(-np.pi, np.pi, number)
        return table

    log.spoil.append(spoil)


def jitter_of_stamps(log: Log, std: float) -> None:
    def spoil(table: dict[str, Array]) -> dict[str, Array]:
        return table | {"t": np.sort(table["t"] + log.rng.normal(0, std, len(table["t"])))}

    log.spoil.append(spoil)


def jitter_of_rows(log: Log, std: float) -> None:
    log.moments = np.array(log.run.time) + log.rng.normal(0, std, len(log.run))


def latency(log: Log, late: float) -> None:
    log.late = -late


def latency_declared(log: Log, late: float) -> None:
    log.late = -late * log.rng.normal()
    log.rig["sensors.wheel.latency"] = {"value": 0.0, "std": late}


def clock(log: Log, factor: float) -> None:
    log.spoil.append(lambda table: table | {"t": table["t"] * (1 + factor)})


def wandering_clock(log: Log, factor: float) -> None:
    """The rate changes from nominal to `factor` off over the run."""
    log.spoil.append(lambda table: table | {"t": table["t"] * (1 + factor * table["t"] / table["t"][-1] / 2)})


def nonlinearity(log: Log, degrees: float) -> None:
    log.bend = tuple(log.rng.normal(0, np.deg2rad(degrees), 2) for _ in range(2))


def nonlinearity_declared(log: Log, degrees: float) -> None:
    nonlinearity(log, degrees)
    log.rig["sensors.nonlinearity"] = f"{degrees} deg"


def wrap(log: Log, every: int) -> None:
    log.every = every
    log.rig["log.drive_held"] = False
    log.spoil.append(lambda table: table | {n: (table[n] + np.pi) % TURN - np.pi for n in ("q1", "q2")})


def coarse(log: Log, bits: int) -> None:
    log.counts = 2**bits
    log.rig["sensors.counts_per_turn"] = 2**bits


def slow(log: Log, rate: float) -> None:
    log.every = round(1000 / rate)
    log.rig["log.drive_held"] = False  # the voltage in a row was held for 1 ms of it


def no_voltage(log: Log, method: str) -> None:
    log.spoil.append(lambda table: {name: column for name, column in table.items() if name != "u"})
    log.rig["log.voltage"] = None
    log.options["method"] = method


def wheel_speed(log: Log, rate: float) -> None:
    """Steps of 0.1 rad/s with as much noise; the angle in 12 bit."""
    slow(log, rate)
    coarse(log, 12)
    log.rig |= {"log.wheel_angle": None, "log.wheel_speed": "w2"}
    speeds = spline_slopes(np.array(log.run.time), np.array(log.run.wheel_angle))[:: log.every]

    def spoil(table: dict[str, Array]) -> dict[str, Array]:
        noisy = speeds + log.rng.normal(0, 0.1, len(speeds))
        return {"t": table["t"], "q1": table["q1"], "w2": np.round(noisy, 1), "u": table["u"]}

    log.spoil.append(spoil)


def pushed(log: Log, hand: tuple[int, float, float]) -> None:
    """So many pushes of this length (s) and share of the gravity torque, at random moments and of either sign."""
    number, length, share = hand
    moments = log.rng.uniform(1.0, 24.0 - length, number)
    signs = log.rng.choice([-1.0, 1.0], number)
    log.run = motion(
        pushes=tuple((at, length, sign * share * GRAVITY) for at, sign in zip(moments, signs, strict=True))
    )


def nothing(_log: Log, _severity: object) -> None:
    """What is changed is the motion itself."""


FAULTS: dict[str, tuple[Fault, dict[str, object]]] = {
    "rows lost at random": (dropouts, {"1 %": 0.01, "5 %": 0.05, "20 %": 0.2}),
    "glitches of each angle": (glitches, {"2": 2, "20": 20, "200": 200}),
    "jitter of the stamps": (jitter_of_stamps, {"20 µs": 2e-5, "100 µs": 1e-4, "1 ms": 1e-3}),
    "jitter of the rows": (jitter_of_rows, {"20 µs": 2e-5, "100 µs": 1e-4, "1 ms": 1e-3}),
    "wheel late": (latency, {"0.1 ms": 1e-4, "0.5 ms": 5e-4, "5 ms": 5e-3}),
    "wheel late, declared": (latency_declared, {"0 ± 0.1 ms": 1e-4, "0 ± 0.5 ms": 5e-4, "0 ± 5 ms": 5e-3}),
    "clock wrong": (clock, {"0.01 %": 1e-4, "0.1 %": 1e-3, "2 %": 2e-2}),
    "clock drifts": (wandering_clock, {"0.01 %": 1e-4, "0.1 %": 1e-3, "2 %": 2e-2}),
    "encoders nonlinear": (nonlinearity, {"0.02°": 0.02, "0.1°": 0.1, "0.5°": 0.5}),
    "encoders nonlinear, declared": (nonlinearity_declared, {"0.02°": 0.02, "0.1°": 0.1, "0.5°": 0.5}),
    "logged within one turn": (wrap, {"1 kHz": 1, "200 Hz": 5, "50 Hz": 20}),
    "coarse encoders": (coarse, {"12 bit": 12, "10 bit": 10, "8 bit": 8}),
    "slow rows": (slow, {"200 Hz": 200.0, "100 Hz": 100.0, "50 Hz": 50.0}),
    "rate of the loop": (nothing, {"10 kHz": (25.0, 1e4), "2 kHz": (25.0, 2e3), "500 Hz": (25.0, 500.0)}),
    "duration": (nothing, {"600 s": (600.0, 500.0), "10 s": (10.0, 1000.0), "3 s": (3.0, 1000.0)}),
    "pushed by hand": (pushed, {"20 %, 0.2 s": (1, 0.2, 0.2), "100 %, 1 s": (1, 1.0, 1.0), "3 × 500 %": (3, 0.2, 5.0)}),
    "no voltage": (no_voltage, {"momentum": "momentum", "output-error": "output-error", "energy": "energy"}),
    "wheel speed for its angle": (wheel_speed, {"100 Hz": 100.0, "50 Hz": 50.0, "20 Hz": 20.0}),
}
"""By fault: what puts it into a log, and three severities, mild, medium and severe, by their names in the table."""


@dataclass(frozen=True)
class Outcome:
    """One draw: error and standard uncertainty in per cent, whether the interval holds the truth, codes."""

    error: float
    says: float
    covered: bool
    codes: tuple[str, ...]
    warned: bool


def outcome(fault: Fault, severity: object, seed: int) -> Outcome:
    """A log with the fault, read and identified."""
    run = motion(*severity) if fault is nothing else motion()
    log = Log(run, np.random.default_rng([7, seed]))
    fault(log, severity)
    _, given = rigs({"nonlinearity": 0}, STRIBECK)
    rig = given.changed({"log.reference": None, **log.rig})
    try:
        recording = sw.Recording.from_columns(log.columns(), rig)
        result = sw.identify(recording, rig, **log.options)
    except SwingidError as error:
        return Outcome(np.nan, np.nan, False, (f"refused: {error.code}",), True)
    inertia = result.inertia
    low, high = inertia.interval95
    repairs = {f"repaired: {one['repair']}" for one in result.provenance["repairs"]}
    codes = {one.code for one in result.warnings} - {"spikes"}
    covered = bool(low <= TRUTH <= high)
    says = 100 * (inertia.standard_uncertainty or np.nan) / TRUTH
    error = 100 * (inertia.value / TRUTH - 1)
    return Outcome(error, says, covered, (*sorted(codes), *sorted(repairs)), result.status == "warning")


def verdict(found: list[Outcome], grade: str) -> str:
    """Whether a row is as it should be: right, or covered, or doubted, or refused; never wrong and sure of it."""
    wrong = [one for one in found if not one.covered and not abs(one.error) <= WITHIN]
    if not wrong:
        return "right"
    if all(one.warned for one in wrong):
        return "refused" if all(np.isnan(one.error) for one in found) else "warned"
    return f"**wrong {sum(not one.warned for one in wrong)} of {len(found)}**" + ("" if grade == "severe" else " (!)")


def table(names: list[str], draws: int) -> Iterator[str]:
    yield "| fault | severity | largest error, % | says, % | covered | said | verdict |"
    yield "|---|---|---|---|---|---|---|"
    for name in names:
        fault, severities = FAULTS[name]
        for grade, (words, severity) in zip(GRADES, severities.items(), strict=True):
            found = [outcome(fault, severity, seed) for seed in range(draws)]
            errors = np.array([one.error for one in found])
            told = Counter(code for one in found for code in one.codes)
            said = ", ".join(code if n == draws else f"{code} ({n})" for code, n in told.items())
            if np.isnan(errors).all():
                cells = ["–", "–", "–"]
            else:
                largest = errors[np.nanargmax(np.abs(errors))]
                says = np.nanmedian([one.says for one in found])
                covered = f"{sum(one.covered for one in found)} of {np.isfinite(errors).sum()}"
                cells = [f"{largest:+.4f}", f"{says:.4f}", covered]
            yield f"| {name} | {words} | {' | '.join(cells)} | {said} | {verdict(found, grade)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("faults", nargs="*", help="which faults; all without")
    parser.add_argument("--draws", type=int, default=5)
    given = parser.parse_args()
    names = [name for name in FAULTS if not given.faults or any(word in name for word in given.faults)]
    for line in table(names, given.draws):
        print(line, flush=True)


if __name__ == "__main__":
    main()
