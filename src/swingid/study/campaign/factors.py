"""From factors to the points of a campaign: grids, one factor at a time, random points, Latin hypercubes, Sobol."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from swingid.numerics.arrays import Array
from swingid.study.campaign.tables import SAMPLED, Factor, PlanTables

BASE = "base"
"""Label of a factor that is as the base has it, where one factor at a time is varied."""


@dataclass(frozen=True)
class Times:
    """A multiple of what the base states at a key."""

    factor: float


@dataclass(frozen=True)
class Point:
    """One point: `labels`, what each factor's column says, and `settings`, what is set at which dotted key."""

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
        points += [Point(base | {name: _text(level.labels[name])}, level.settings) for level in levels]
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
        own = []
        for share, (name, factor) in zip(row, plan.factors.items(), strict=True):
            if factor.listed:
                levels = levels_of(name, factor)
                own.append(levels[min(int(share * len(levels)), len(levels) - 1)])
            else:
                own.append(_one(name, factor, _within(factor, float(share))))
        points.append(_joined(own))
    return points


def unit_points(design: str, count: int, dimensions: int, seed: np.random.SeedSequence) -> Array:
    """Points (count, dimensions) of a design in the unit cube."""
    generator = np.random.default_rng(seed)
    if design == "random":
        return generator.random((count, dimensions))
    from scipy.stats import qmc

    if design == "latin-hypercube":
        found: Array = qmc.LatinHypercube(dimensions, rng=generator).random(count)
        return found
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


def _text(label: float | str) -> str:
    return label if isinstance(label, str) else f"{label:g}"
