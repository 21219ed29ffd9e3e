"""A plan, read and checked: what a campaign does, and everything its trials need, ready to be sent to any process."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from swingid.errors import InputError, SwingidError, UsageError
from swingid.model.rig import Rig
from swingid.model.rig.errors import describe
from swingid.study.campaign.factors import Point, flattened, levels_of, points_of
from swingid.study.campaign.tables import BATCHED, MOST_TRIALS, PlanTables


@dataclass(frozen=True)
class Plan:
    """A plan with the rig files that it names.

    tables: the checked file; document: the same as plain data; rigs: (source, text) by the name in the plan; source:
    the file, for messages; runs: at most so many trials, None for all.
    """

    tables: PlanTables
    document: Mapping[str, Any]
    rigs: Mapping[str, tuple[str, str]]
    source: str
    runs: int | None = None

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
        """Whether the runs of a point are simulated and identified together."""
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


def load_plan(path_or_name: str | Path) -> Plan:
    """The plan of a file ending in .toml, or a ready one by its name; every level of every factor is tried out.

    Raises UsageError for a name that is neither, InputError for a file that is missing, no TOML or no plan, naming the
    key.
    """
    from swingid.study.campaign.ready import READY, ready_text

    name = str(path_or_name)
    if name in READY:
        return plan_from_text(ready_text(name), name)
    path = Path(path_or_name)
    if path.suffix.lower() != ".toml":
        raise UsageError(
            f"no plan {name!r}: give a path ending in .toml or one of {', '.join(READY)}", code="unknown-plan"
        )
    try:
        text = path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise InputError(
            f"{path} does not exist; 'swingid campaign --list' names the ready plans", code="missing-file"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8", code="not-utf8") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{str(path)!r} cannot be read: {reason}", code="unreadable-file") from None
    return plan_from_text(text, name, folder=path.parent)


def plan_from_text(text: str, source: str = "plan.toml", *, folder: Path | None = None) -> Plan:
    """The plan of TOML text; rig files are looked for beside it, in `folder`. Errors as `load_plan`."""
    try:
        document = tomllib.loads(text.removeprefix("\ufeff"))
    except (ValueError, RecursionError) as error:
        problem = "nested too deeply" if isinstance(error, RecursionError) else " ".join(str(error).split())
        raise InputError(f"{source} is not TOML: {problem[:200]}", code="not-toml") from None
    try:
        tables = PlanTables.model_validate(document)
    except ValidationError as error:
        code, problem = describe(error, PlanTables, what="a plan")
        raise InputError(f"{source}: {problem}", code=code) from None
    plain = json.loads(json.dumps(document, default=str))
    plan = Plan(tables, plain, _rigs(tables, source, folder or Path()), source)
    if plan.whole > MOST_TRIALS:
        raise InputError(f"{source}: {plan.whole} trials are more than {MOST_TRIALS}; plan fewer", code="too-many")
    _try_levels(plan)
    return plan


def _rigs(tables: PlanTables, source: str, folder: Path) -> dict[str, tuple[str, str]]:
    """(source, text) of every rig that the plan names."""
    names = [tables.base.rig]
    for factor in tables.factors.values():
        if factor.key == "rig":
            names += [str(value) for value in factor.values or ()]
        names += [str(level["rig"]) for level in (factor.levels or {}).values() if "rig" in level]
    found = {}
    for name in dict.fromkeys(names):
        beside = folder / name
        path = beside if name.lower().endswith(".toml") and beside.is_file() else name
        try:
            rig = Rig.load(path)
        except SwingidError as error:
            raise InputError(f"{source}: rig: {error.message}", code=error.code) from None
        found[name] = (rig.source, rig.text)
    return found


def _try_levels(plan: Plan) -> None:
    """Raise InputError where the base, or one level of one factor around it, is no experiment."""
    from swingid.study.campaign.experiment import experiment_of

    tried: list[tuple[str, Point]] = [("base", Point())]
    for name, factor in plan.tables.factors.items():
        if factor.listed:
            levels = levels_of(name, factor)
        else:
            ends = factor.model_copy(update={"steps": 2})
            levels = levels_of(name, ends)
        tried += [(f"factors.{name} at {level.labels[name]!r}", level) for level in levels]
    # what only a factor gives must be there when another one is tried
    first = tried[0][1].settings | {k: v for _, level in reversed(tried[1:]) for k, v in level.settings.items()}
    needed = {k: v for k, v in first.items() if k.partition(".")[0] == "reference"}
    for place, point in tried:
        try:
            experiment_of(plan, Point(point.labels, needed | point.settings))
        except SwingidError as error:
            raise InputError(f"{plan.source}: {place}: {error.message}", code=error.code) from None


def differing_key(one: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """The first dotted key at which two plain documents differ."""
    a, b = flattened(one), flattened(other)
    return next((key for key in sorted(a.keys() | b.keys()) if a.get(key) != b.get(key)), "")
