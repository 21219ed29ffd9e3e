"""The tables of a plan file, checked: what is varied, how, and around which experiment."""

from __future__ import annotations

import re
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from swingid.errors import UsageError
from swingid.methods.output_error.unknowns import friction_unknowns
from swingid.methods.table import METHODS
from swingid.model.rig.fields import Column, Table, refuse
from swingid.model.terms import TERMS
from swingid.study.faults import every_fault

Design = Literal["grid", "one-at-a-time", "random", "latin-hypercube", "sobol"]

SAMPLED = ("random", "latin-hypercube", "sobol")
"""Designs that draw `points` points; the others take what the factors list."""

PREFIXES = ("both", "twin", "stated", "faults", "controller", "methods", "reference")
PLAIN_KEYS = ("rig", "uncertainty", "reference", "duration", "rate", "initial_angle")

KEYS_IN_WORDS = f"give {', '.join(PLAIN_KEYS)}, or a key that begins with {', '.join(f'{p}.' for p in PREFIXES)}"

BATCHED = ("momentum-batch", "energy-batch")
"""Methods that read all runs of a point together, `swingid.batch`."""

CLEAN = 8
"""Where a plan takes every fault, one run of so many and one has none, to see the warnings of clean logs."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
MOST_TRIALS = 10_000_000


class Factor(Table):
    """One thing that is varied: a key with values or a range, or levels that set several keys at once."""

    key: str | None = None
    values: list[bool | int | float | str] | None = None
    range: tuple[float, float] | None = None
    scale: Literal["linear", "log"] = "linear"
    steps: int | None = Field(None, gt=1)
    relative: bool = False
    levels: dict[str, dict[str, Any]] | None = None

    @model_validator(mode="before")
    @classmethod
    def _all_faults(cls, raw: Any) -> Any:
        if isinstance(raw, dict) and str(raw.get("key")).startswith("faults.") and len(raw) == 1:
            return {**raw, "values": [*["none"] * (len(every_fault()) // CLEAN), *every_fault()]}
        return raw

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = [name for name in ("values", "range", "levels") if getattr(self, name) is not None]
        if len(given) != 1:
            refuse("bad-factor", f"needs one of values, range and levels, and has {' and '.join(given) or 'none'}")
        if self.levels is not None:
            for name in ("key", "steps"):
                if getattr(self, name) is not None:
                    refuse("bad-factor", "has no use beside levels, which name their keys", name)
            if self.relative:
                refuse("bad-factor", "has no use beside levels; write the values", "relative")
            if not self.levels:
                refuse("bad-factor", "is empty; give at least one level", "levels")
        elif self.key is None:
            refuse("missing-key", 'is missing; name what is varied, such as "twin.sensors.noise"', "key")
        elif not is_key(self.key):
            refuse("unknown-key", f"is {self.key!r}; {KEYS_IN_WORDS}", "key")
        self._check_numbers()
        return self

    def _check_numbers(self) -> None:
        if self.values is not None and not self.values:
            refuse("bad-factor", "is empty; give at least one value", "values")
        if self.relative and any(isinstance(value, str) for value in self.values or ()):
            refuse("bad-factor", "holds text, which cannot be a multiple of the base's value", "values")
        if self.relative and (self.key or "").partition(".")[0] not in ("both", "twin", "stated"):
            refuse("bad-factor", "is for keys of the rig: both., twin. or stated.", "relative")
        if self.range is not None:
            low, high = self.range
            if not low < high:
                refuse("bad-factor", f"must rise, and is [{low:g}, {high:g}]", "range")
            if self.scale == "log" and low <= 0:
                refuse("bad-factor", f"must begin above 0 on a log scale, and begins at {low:g}", "range")

    @property
    def listed(self) -> bool:
        """Return whether it has a few values rather than a range."""
        return self.range is None or self.steps is not None


class Base(Table):
    """The experiment around which the factors vary it."""

    rig: Column = "paper"
    reference: str | None = None
    duration: float = Field(gt=0)
    rate: float = Field(1000.0, gt=0)
    initial_angle: float | str = 0.0
    draw: bool = True
    methods: list[str] = Field(default_factory=lambda: ["momentum"])
    controller: dict[str, Any] = Field(default_factory=dict)
    both: dict[str, Any] = Field(default_factory=dict)
    twin: dict[str, Any] = Field(default_factory=dict)
    stated: dict[str, Any] = Field(default_factory=dict)
    faults: dict[str, str] = Field(default_factory=dict)
    uncertainty: float = Field(0.0, ge=0)


class Bound(Table):
    """The friction law and free constants for which the Cramer–Rao bound is computed."""

    law: Column = "viscous"
    free: list[str] = Field(default_factory=list)

    @field_validator("law")
    @classmethod
    def _known_law(cls, law: str) -> str:
        try:
            friction_unknowns(law)
        except UsageError as error:
            refuse(error.code, f"is {law!r}: {error.message}")
        return law


class Report(Table):
    """What the report draws beside the standard pictures: maps over pairs of factors."""

    maps: list[tuple[str, str]] = Field(default_factory=list)


class PlanTables(Table):
    """A whole plan file."""

    name: Column
    about: str = ""
    takes: str = ""
    seed: int = Field(0, ge=0)
    repeats: int = Field(1, gt=0)
    design: Design = "grid"
    points: int | None = Field(None, gt=0)
    seeds: Literal["independent", "common"] = "independent"
    quantities: list[str] = Field(default_factory=lambda: ["inertia"], min_length=1)
    block: int = Field(8, gt=0)
    base: Base
    methods: dict[str, dict[str, Any]] = Field(default_factory=dict)
    factors: dict[str, Factor] = Field(default_factory=dict)
    bound: Bound | None = None
    report: Report = Report()

    @field_validator("name")
    @classmethod
    def _plain_name(cls, name: str) -> str:
        if not re.fullmatch(r"[\w.-]+", name):
            refuse("wrong-value", f"must be one word that can name a folder, not {name!r}")
        return name

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for name, factor in self.factors.items():
            if not NAME.fullmatch(name):
                refuse("wrong-value", "must be letters, digits and _", f"factors.{name}")
            if name in RESERVED:
                refuse("wrong-value", "is a column of the results already; choose another name", f"factors.{name}")
            if self.design not in SAMPLED and not factor.listed:
                refuse("missing-key", f"is missing, which the design {self.design!r} needs", f"factors.{name}.steps")
        if self.design in SAMPLED and self.points is None:
            refuse("missing-key", f"is missing, which the design {self.design!r} needs", "points")
        known = [name for name, term in TERMS.items() if term.key.startswith("axis.") and ".lugre." not in term.key]
        for name in self.quantities:
            over, slash, under = name.partition("/")
            if over not in known or (slash and under not in known):
                refuse("wrong-value", f"names {name!r}; choose of {', '.join(known)}", "quantities")
        if self.design not in SAMPLED and self.points is not None:
            refuse("contradiction", f"belongs to the designs {', '.join(SAMPLED)}", "points")
        if self.design in SAMPLED and not self.factors:
            refuse("missing-key", f"is missing, and the design {self.design!r} has nothing to draw", "factors")
        for pair in self.report.maps:
            for name in pair:
                if name not in self.factors:
                    refuse("wrong-value", f"names {name!r}, which is no factor", "report.maps")
        self._check_methods()
        return self

    def _check_methods(self) -> None:
        for name, table in self.methods.items():
            if table.get("method") not in tuple(METHODS):
                has = "is missing" if "method" not in table else f"is {table['method']!r}"
                refuse("unknown-method", f"{has}; choose one of {', '.join(METHODS)}", f"methods.{name}.method")
        for name in self.base.methods:
            if name not in (*METHODS, *BATCHED, *self.methods):
                known = ", ".join((*METHODS, *BATCHED, *self.methods))
                refuse(
                    "unknown-method", f"names {name!r}; choose of {known}, or define [methods.{name}]", "base.methods"
                )
        if len(set(self.base.methods)) < len(self.base.methods):
            refuse("wrong-value", "names a method twice; define another name for it under [methods]", "base.methods")
        batched = [name for name in self.base.methods if name in BATCHED]
        if batched and len(batched) < len(self.base.methods):
            refuse(
                "contradiction",
                f"names {batched[0]!r} beside others; give only {' and '.join(BATCHED)}",
                "base.methods",
            )
        if batched and self.quantities != ["inertia"]:
            refuse("contradiction", f'must be ["inertia"], all that {batched[0]} answers', "quantities")


RESERVED = (
    "trial", "point", "repeat", "seed", "method", "quantity", "status", "code", "message", "warnings", "truth", "value",
    "u", "low", "high", "error", "bound", "wanted", "tracking", "k_tilde", "settling", "chatter", "saturated",
)  # fmt: skip
"""Columns of the results that are no factors."""


def is_key(key: str) -> bool:
    """Return whether a dotted key is one that can be set or varied."""
    prefix, dot, rest = key.partition(".")
    return key in PLAIN_KEYS or (prefix in PREFIXES and bool(dot) and bool(rest))
