"""A plan and its points: grids, one factor at a time, random points, Latin hypercubes, Sobol sequences."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from swingid.errors import UsageError
from swingid.numerics.arrays import Array
from swingid.study.campaign.tables import BATCHED, SAMPLED, Factor, PlanTables
from swingid.study.changes import Times

BASE = "base"
"""Label of a factor that is as the base has it, where one factor at a time is varied."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan with the rig files that it names; equal to another where what decides the results is.

    tables: the checked file; document: the same as plain data; rigs: (source, text) by the name in the plan; source:
    the file, for messages; runs: at most so many trials, None for all.
    """

    tables: PlanTables
    document: Mapping[str, Any]
    rigs: Mapping[str, tuple[str, str]]
    source: str
    runs: int | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Plan) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @cached_property
    def _key(self) -> tuple[str, str]:
        return self.source, repr(self.identity())

    @cached_property
    def points(self) -> list[Point]:
        """The points, drawn by the seed where the design draws them."""
        return points_of(self.tables)

    @property
    def name(self) -> str:
        """The plan's name."""
        return self.tables.name

    @property
    def whole(self) -> int:
        """Number of trials of the whole plan."""
        return len(self.points) * self.tables.repeats

    @property
    def trials(self) -> int:
        """Number of trials that are run."""
        return self.whole if self.runs is None else min(self.runs, self.whole)

    @property
    def blocks(self) -> int:
        """Number of blocks of trials, each of which is done as a whole."""
        return -(-self.trials // self.tables.block)

    @property
    def batched(self) -> bool:
        """Return whether the runs of a point are simulated and identified together."""
        return bool(self.tables.base.methods) and self.tables.base.methods[0] in BATCHED

    def block(self, number: int) -> range:
        """The trials of a block."""
        size = self.tables.block
        return range(number * size, min((number + 1) * size, self.trials))

    def place(self, trial: int) -> tuple[int, int]:
        """(point, repeat) of a trial: all repeats of a point, then the next; of fewer runs an even choice."""
        return divmod(trial * self.whole // self.trials, self.tables.repeats)

    def seed(self, point: int, repeat: int) -> int:
        """The seed of a trial: the second child of the plan's seed, its child by repeat, and by point.

        With seeds = "common" a repeat draws the same at every point.
        """
        child = (1, repeat) if self.tables.seeds == "common" else (1, repeat, point)
        sequence = np.random.SeedSequence(self.tables.seed, spawn_key=child)
        return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))

    def identity(self) -> dict[str, Any]:
        """What decides the results beside the code: the plan but for its words, the rigs, the number of runs."""
        decisive = {k: v for k, v in self.document.items() if k not in ("about", "takes", "report")}
        rigs = {name: hashlib.sha256(text.encode()).hexdigest() for name, (_, text) in self.rigs.items()}
        return {"plan": decisive, "rigs": rigs, "runs": self.trials}

    def with_runs(self, runs: int | None) -> Plan:
        """The plan with at most so many trials. Raises UsageError unless it is positive."""
        if runs is not None and runs < 1:
            raise UsageError(f"--runs is {runs}; give a positive number of runs", code="few-runs")
        return replace(self, runs=runs)


def differing_key(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """The first dotted key at which two plain documents differ."""
    a, b = flattened(first), flattened(second)
    return next((key for key in sorted(a.keys() | b.keys()) if a.get(key) != b.get(key)), "")


@dataclass(frozen=True)
class Point:
    """One point: `labels`, the entry of each factor's column, and `settings`, what is set at which dotted key."""

    labels: dict[str, float | str] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)


def points_of(plan: PlanTables) -> list[Point]:
    """All points of a plan in order. In a grid the last factor varies fastest; one at a time begins with the base.

    A sampled design is drawn by the plan's seed (`design_seed`).
    """
    factors = plan.factors
    if plan.design in SAMPLED:
        return _sampled(plan)
    listed = {name: levels_of(name, factor) for name, factor in factors.items()}
    if plan.design == "grid":
        return [_joined(levels) for levels in product(*listed.values())]
    base: dict[str, float | str] = dict.fromkeys(factors, BASE)
    points = [Point(dict(base), {})]
    for name, levels in listed.items():
        for level in levels:
            label = level.labels[name]
            points.append(Point(base | {name: label if isinstance(label, str) else f"{label:g}"}, level.settings))
    return points


def levels_of(name: str, factor: Factor) -> list[Point]:
    """The levels of a factor that has a few; each sets what it sets and nothing else."""
    if factor.levels is not None:
        return [Point({name: label}, flattened(table)) for label, table in factor.levels.items()]
    assert factor.key is not None
    if factor.values is not None:
        values: list[bool | int | float | str] = factor.values
    else:
        assert factor.range is not None
        shares = np.linspace(0.0, 1.0, factor.steps or 2)
        values = [_within(factor, float(share)) for share in shares]  # their ends are the range's
    return [_one(name, factor, value) for value in values]


def flattened(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as values at dotted keys."""
    flat: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, Mapping):
            flat |= flattened(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def design_seed(seed: int) -> np.random.SeedSequence:
    """What the points of a sampled design are drawn by: the first child of the plan's seed."""
    return np.random.SeedSequence(seed).spawn(2)[0]


def _sampled(plan: PlanTables) -> list[Point]:
    assert plan.points is not None
    shares = unit_points(plan.design, plan.points, len(plan.factors), design_seed(plan.seed))
    points = []
    for row in shares:
        columns = []
        for share, (name, factor) in zip(row, plan.factors.items(), strict=True):
            if factor.listed:
                levels = levels_of(name, factor)
                columns.append(levels[min(int(share * len(levels)), len(levels) - 1)])
            else:
                columns.append(_one(name, factor, _within(factor, float(share))))
        points.append(_joined(columns))
    return points


def unit_points(design: str, count: int, dimensions: int, seed: np.random.SeedSequence) -> Array:
    """Points (count, dimensions) of a design in the unit cube."""
    generator = np.random.default_rng(seed)
    if design == "random":
        return generator.random((count, dimensions))
    from scipy.stats import qmc

    if design == "latin-hypercube":
        points: Array = qmc.LatinHypercube(dimensions, rng=generator).random(count)
        return points
    # Sobol's points are balanced in powers of two; the first `count` of the next power
    sobol = qmc.Sobol(dimensions, scramble=True, rng=generator)
    drawn: Array = sobol.random_base2(max(0, math.ceil(math.log2(count))))
    return drawn[:count]


def _within(factor: Factor, share: float) -> float:
    """The value at a share of a factor's range, even in the logarithm on a log scale."""
    assert factor.range is not None
    low, high = factor.range
    if factor.scale == "log":
        return float(f"{low * (high / low) ** share:.12g}")
    return float(f"{low + (high - low) * share:.12g}")


def _one(name: str, factor: Factor, value: bool | float | str) -> Point:
    assert factor.key is not None
    setting = Times(float(value)) if factor.relative else value
    label = str(value).lower() if isinstance(value, bool) else value
    return Point({name: label if isinstance(label, str) else float(label)}, {factor.key: setting})


def _joined(levels: tuple[Point, ...] | list[Point]) -> Point:
    labels: dict[str, float | str] = {}
    settings: dict[str, Any] = {}
    for level in levels:
        labels |= level.labels
        settings |= level.settings
    return Point(labels, settings)
