"""`reproduce`: section 5 of the paper on the twin, as plain data and as what its figures show."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from swingid.errors import UsageError
from swingid.result.data import plain
from swingid.study.reproduce import published
from swingid.study.reproduce.claims import TESTS, claim_rows
from swingid.study.reproduce.experiment import (
    FRICTIONS,
    SIMULATION_STEPS,
    Experiment,
    Simulation,
    experiment,
    simulation,
)
from swingid.study.reproduce.imperfections import imperfection_rows, imperfections
from swingid.study.reproduce.runs import WAYS

SCHEMA = "swingid.reproduce/1"

PUBLISHED = ("J1", "A11_BODY", "J_E_PRINTED", "J_E", "J_E_ERROR", "F1", "SIMULATION_ERROR", "TIMES", "BACKSTEPPING")

DIGITS = 6
"""Significant digits of the numbers in `results`, so that they do not depend on the last bits."""


@dataclass(frozen=True)
class Reproduction:
    """results: all numbers as plain data, schema "swingid.reproduce/1". experiment, simulation: what the figures show.

    Two reproductions with the same seed have the same results.
    """

    results: dict[str, object]
    experiment: Experiment = field(repr=False)
    simulation: Simulation = field(repr=False)

    def to_json(self) -> str:
        """`results` as JSON text."""
        return json.dumps(self.results, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def reproduce(*, seed: int = 0, quick: bool = False, progress: Callable[[str], None] | None = None) -> Reproduction:
    """Run section 5 of the paper on the twin; one to two minutes.

    seed: of the encoders' grids and draws. quick: without the table of imperfections and the claims. progress: takes
    what comes next, in words. Raises UsageError for a seed below zero.
    """
    if seed < 0:
        raise UsageError(f"the seed must be zero or positive, and is {seed}.", code="bad-seed")
    report = progress or (lambda _: None)
    runs = {friction: experiment(friction, seed, report) for friction in FRICTIONS}
    ideal = simulation(report)
    results: dict[str, object] = {
        "schema": SCHEMA,
        "seed": seed,
        "paper": {name.lower(): getattr(published, name) for name in PUBLISHED},
        "experiment": [run.answers for run in runs.values()],
        "simulation": ideal.answers,
    }
    if not quick:
        results["imperfections"] = imperfection_rows(seed, report)
        results["claims"] = claim_rows(seed, report)
    return Reproduction(plain_data(results), runs["viscous"], ideal)


def steps(*, quick: bool = False) -> int:
    """How often `reproduce` calls `progress`."""
    always = len(FRICTIONS) * len(WAYS) + SIMULATION_STEPS
    return always + (0 if quick else len(imperfections()) + len(TESTS))


def plain_data(value: Any) -> Any:
    """What JSON knows (`result.data.plain`), numbers to `DIGITS` digits."""
    value = plain(value)
    if isinstance(value, dict):
        return {key: plain_data(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain_data(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
