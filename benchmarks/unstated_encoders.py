"""Encoders of which the rig file states nothing: errors of the inertia on logs of a simulator that is not the twin.

    python benchmarks/unstated_encoders.py [--draws 200] [--methods momentum,equation-error] [--stated NUMBER]

A body on a horizontal axis with a reaction wheel, by the absolute angular momenta p1 (both) and p2 (wheel) of
Hamilton's equations, p1' = −b sin q1 − F, p2' = τ (Runge-Kutta of fourth order, all logs at once; nothing of the
package is used). The motor's torque follows from a held voltage. A reading is q + α cos q + β sin q + γ cos 2q +
δ sin 2q of the true angle: 0.1° for each of α and β, 0.03° for each of γ and δ, independent in both encoders, in
16384 steps per turn; the wheel is read 0.3 ms after the angle; stamps jitter by 20 µs. One frequency, with an amplitude
and a place of its own in each log; viscous and Coulomb friction. The rig file states the steps, exact constants, clock
and tilts, and of the encoders nothing else, or with --stated that nonlinearity.

A row: answers without a warning ("green"), those of them that are more than 1.5 half-widths of their 95 % interval
off, the coverage of all, the median of error and half-width (%), and the warnings by their number.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path

import numpy as np

import swingid as sw
from swingid.errors import SwingidError

INERTIA, WHEEL, GRAVITY = 302.2e-5, 11.34e-5, 78e-3
VISCOUS, COULOMB, SMOOTH = 3e-4, 4e-4, 2e-3
GAIN, BACK_EMF, LOSS, HELD_BACK = 20e-3, 3e-5, 2e-5, 4e-4
"""Motor on the wheel, without gear: N m/V, N m s, N m s, N m."""
STEP, SUBSTEPS, ROWS = 1e-3, 4, 15_000
COUNTS, BEND, SECOND, LATE, JITTER = 16384, np.radians(0.1), np.radians(0.03), 0.3e-3, 20e-6

RIG = f"""
name = "bench"
[axis]
gravity_torque = {GRAVITY}
tilt = 0
[drive]
kind = "reaction-wheel"
[drive.wheel]
inertia = {WHEEL}
tilt = 0
[drive.motor]
rotor_inertia = 0
torque_per_volt = {GAIN}
back_emf = {BACK_EMF}
viscous = {LOSS}
coulomb = {HELD_BACK}
[sensors]
counts_per_turn = {COUNTS}
[log]
clock = 0
"""


def dry(speed: np.ndarray) -> np.ndarray:
    """sgn of a speed (rad/s), smooth within `SMOOTH`."""
    return np.tanh(speed / SMOOTH)


def slopes(state: np.ndarray, volts: np.ndarray) -> np.ndarray:
    """Time derivatives of the state (4, logs): angles of body and wheel, absolute momenta of both and of the wheel."""
    q1, _, p1, p2 = state
    body = (p1 - p2) / INERTIA
    wheel = p2 / WHEEL - body
    torque = GAIN * volts - (BACK_EMF + LOSS) * wheel - HELD_BACK * np.tanh(wheel / 0.1)
    return np.array([body, wheel, -GRAVITY * np.sin(q1) - VISCOUS * body - COULOMB * dry(body), torque])


def motions(draws: int, rows: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True states (rows, 4, logs) and their slopes, and the volts (rows, logs): a sine that a controller follows."""
    rng = np.random.default_rng(seed)
    amplitude, speed = rng.uniform(0.6, 1.2, draws), rng.uniform(7.0, 10.0, draws)
    state, place = np.zeros((4, draws)), rng.uniform(0, 2 * np.pi, draws)
    state[0] = amplitude
    states, rates, volts = np.empty((rows, 4, draws)), np.empty((rows, 4, draws)), np.empty((rows, draws))
    short = STEP / SUBSTEPS
    for k in range(rows):
        phase = speed * k * STEP
        wanted, rate = amplitude * np.cos(phase), -amplitude * speed * np.sin(phase)
        body = (state[2] - state[3]) / INERTIA
        need = -INERTIA * (-wanted * speed**2 - 60 * (body - rate) - 900 * (state[0] - wanted))
        need += -GRAVITY * np.sin(state[0]) - VISCOUS * body - COULOMB * dry(body)
        wheel = state[3] / WHEEL - body
        volts[k] = (need + (BACK_EMF + LOSS) * wheel + HELD_BACK * np.tanh(wheel / 0.1)) / GAIN
        states[k], rates[k] = state, slopes(state, volts[k])
        for _ in range(SUBSTEPS):
            one = slopes(state, volts[k])
            two = slopes(state + short / 2 * one, volts[k])
            three = slopes(state + short / 2 * two, volts[k])
            state = state + short / 6 * (one + 2 * two + 2 * three + slopes(state + short * three, volts[k]))
    states[:, 1] += place
    return states, rates, volts


def readings(angle: np.ndarray, rate: np.ndarray, late: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What an encoder of its own reads (rows,) at `late` (rows,) s after the stamps."""
    q = angle + rate * late
    parts = rng.standard_normal(4) * [BEND, BEND, SECOND, SECOND]
    bent = q + parts @ [np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)]
    count = 2 * np.pi / COUNTS
    return count * np.rint(bent / count)


def logs(draws: int, rows: int = ROWS) -> list[sw.Recording]:
    """The logs, each with its own encoders."""
    states, rates, volts = motions(draws, rows)
    found, time = [], STEP * np.arange(rows)
    for n in range(draws):
        rng = np.random.default_rng([2, n])
        jitter = JITTER * rng.standard_normal(rows)
        angle = readings(states[:, 0, n], rates[:, 0, n], jitter, rng)
        wheel = readings(states[:, 1, n], rates[:, 1, n], jitter + LATE, rng)
        found.append(sw.Recording(time=time, angle=angle, wheel_angle=wheel, voltage=volts[:, n]))
    return found


def judged(log: sw.Recording, rig: sw.Rig, method: str) -> dict[str, object]:
    """Error and half-width in per cent of the truth, and what the result warns of."""
    try:
        result = sw.identify(log, rig, method)
    except SwingidError as error:
        return {"method": method, "codes": [error.code], "refused": True}
    low, high = result.inertia.interval95
    return {
        "method": method,
        "error": 100 * (result.inertia.value / INERTIA - 1),
        "half": 50 * (high - low) / INERTIA,
        "codes": sorted({warning.code for warning in result.warnings}),
    }


def row(method: str, all_rows: list[dict[str, object]]) -> str:
    """The line of the table of one method."""
    rows = [one for one in all_rows if one["method"] == method]
    given = [one for one in rows if "error" in one]
    error, half = (np.array([one[key] for one in given], float) for key in ("error", "half"))
    green = np.array([not one["codes"] for one in given], bool)
    off = int(np.sum(green & (np.abs(error) > 1.5 * half)))
    codes = Counter(code for one in rows for code in one["codes"])
    return (
        f"| {method} | {len(rows)} | {green.sum()} | {off} | {100 * np.mean(np.abs(error) < half):.0f} % | "
        f"{np.median(np.abs(error)):.4f} | {np.median(half):.4f} | {dict(codes)} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--methods", default="momentum,equation-error")
    parser.add_argument("--stated", help='sensors.nonlinearity, such as "0.1 deg"')
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rig = sw.Rig.from_text(RIG)
    rig = rig.changed({"sensors.nonlinearity": options.stated}) if options.stated else rig
    methods = options.methods.split(",")
    rows = [judged(log, rig, method) for log in logs(options.draws) for method in methods]
    print("| method | logs | green | beyond 1.5 half-widths | covers | error % | half-width % | warnings |")
    for method in methods:
        print(row(method, rows))
    if options.json is not None:
        options.json.write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
