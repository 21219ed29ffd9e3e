"""Encoders bent by 0.1° once per turn, calibrated from the logs that are identified: error of J1 and its interval.

    python benchmarks/encoders.py [--draws 500] [--law viscous|Stribeck] [--undeclared]

Each draw has its own cosine and sine part of both encoders, N(0, 0.1°) each, and its own place of their grids; 14 bit,
1 kHz, 25 s. Each log is written to a file and read back, `calibrate_encoders` sees the files and a rig.toml that
declares 0.1° (--undeclared: nothing), and `identify` the same files and the rig.toml that it writes. Of the first 50
draws also: "as it is", nothing declared and the repair "calibrate" switched off; "by itself", with that repair.
Errors in per cent of the truth; ± of the coverage is binomial.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

import swingid as sw
from accuracy import STRIBECK, TRUTH, Case, logged, over_seeds, rigs
from swingid.calibration.encoders import calibrate_encoders
from swingid.recording.findings import notes_of

BENT = "0.1 deg"
MOTIONS: dict[str, tuple[str, ...]] = {
    "one log, 8.5 rad/s": ("sine 0.8 rad 8.5 rad/s",),
    "two: and 5 rad/s, 1.4 rad": ("sine 0.8 rad 8.5 rad/s", "sine 1.4 rad 5 rad/s"),
    "three: and both at once": (
        "sine 0.8 rad 8.5 rad/s",
        "sine 1.4 rad 5 rad/s",
        "multisine 0.7 rad 5 rad/s + 0.4 rad 8.5 rad/s",
    ),
}
LAWS: dict[str, dict[str, object]] = {"viscous": {}, "Stribeck": STRIBECK}
Row = tuple[float, float, bool]
WAYS = ("as it is", "by itself", "calibrated")
AS_IT_IS = 50
NOTHING: Row = (np.nan, np.nan, False)


def on_one_draw(motions: tuple[str, ...], law: str, declared: bool, seed: int) -> tuple[Row, Row, Row]:
    """Error and standard uncertainty of J1 in per cent, whether there is a warning: of each of `WAYS`."""
    twin, _ = rigs({"nonlinearity": BENT}, LAWS[law])
    _, given = rigs({"nonlinearity": BENT if declared else 0})
    zero = tuple(np.random.default_rng([2, seed]).uniform(0, given.sensors.of("angle").resolution, 2))
    logs = [logged(Case(twin, given, seed=seed, encoder_zero=zero, reference=motion)) for motion in motions]
    found = calibrate_encoders(logs, given)
    if seed >= AS_IT_IS:
        return NOTHING, NOTHING, judged(logs, found.rig)
    untold, off = rigs({"nonlinearity": 0})[1], notes_of(frozenset(["calibrate"]))
    as_read = [replace(log, findings=(*log.findings, *off)) for log in logs]
    return judged(as_read, untold), judged(logs, untold), judged(logs, found.rig)


def judged(logs: list[sw.Recording], rig: sw.Rig) -> Row:
    result = sw.identify(logs if len(logs) > 1 else logs[0], rig)
    inertia = result.inertia
    return (
        100 * (inertia.value / TRUTH - 1),
        100 * (inertia.standard_uncertainty or np.nan) / TRUTH,
        result.status == "warning",
    )


def line(name: str, rows: np.ndarray) -> str:
    """One row of the table: 95th percentile, RMS, coverage with its binomial standard deviation, median of u."""
    errors, says, warned = rows.T
    share = float(np.mean(np.abs(errors) <= 1.959964 * says))
    spread = np.sqrt(share * (1 - share) / len(errors))
    return (
        f"| {name} | {np.percentile(np.abs(errors), 95):.4f} % | {np.sqrt(np.mean(errors**2)):.4f} % "
        f"| {np.median(says):.4f} % | {100 * share:.1f} ± {100 * spread:.1f} % | {100 * np.mean(warned):.0f} % |"
    )


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--law", choices=LAWS, default="viscous")
    parser.add_argument("--undeclared", action="store_true")
    parser.add_argument("--logs", type=int, choices=(1, 2, 3), help="only this row")
    chosen = parser.parse_args(arguments)
    print("| logs | 95th percentile | RMS | median u | 95 % interval covers | warned |\n|---|---|---|---|---|---|")
    for name, motions in MOTIONS.items():
        if chosen.logs is not None and len(motions) != chosen.logs:
            continue
        found = np.array(
            over_seeds(partial(on_one_draw, motions, chosen.law, not chosen.undeclared), chosen.draws), dtype=float
        )
        for k, how in enumerate(WAYS):
            rows = found[:, k]
            print(line(f"{name}, {how}", rows[np.isfinite(rows[:, 0])]), flush=True)


if __name__ == "__main__":
    main()
