"""Plan files, read and checked, and the plans that come with swingid."""

from __future__ import annotations

import json
import tomllib
from importlib.resources import files
from pathlib import Path

from swingid.errors import InputError, SwingidError, UsageError
from swingid.model.rig import Rig
from swingid.model.rig.toml_file import checked, tables_of, text_of
from swingid.study.campaign.experiment import experiment_of
from swingid.study.campaign.plan import Plan, Point, levels_of
from swingid.study.campaign.tables import MOST_TRIALS, PlanTables

READY = ("coverage", "efficiency", "friction-laws", "imperfections", "gains", "paper-variants", "trust", "clean")
"""Names of the ready plans; the file of each is plans/NAME.toml."""


def ready_text(name: str) -> str:
    """The TOML text of a ready plan."""
    return (files("swingid.study.campaign") / "plans" / f"{name}.toml").read_text(encoding="utf-8")


def described() -> list[tuple[str, str, str]]:
    """(name, what it is about, how long it takes) of every ready plan."""
    tables = [tomllib.loads(ready_text(name)) for name in READY]
    return [(name, str(table["about"]), str(table["takes"])) for name, table in zip(READY, tables, strict=True)]


def load_plan(path_or_name: str | Path) -> Plan:
    """The plan of a file ending in .toml, or a ready one by its name; every level of every factor is tried out.

    Raises UsageError for a name that is neither, InputError for a file that is missing, no TOML or no plan, naming the
    key.
    """
    name = str(path_or_name)
    if name in READY:
        return plan_from_text(ready_text(name), name)
    path = Path(path_or_name)
    if path.suffix.lower() != ".toml":
        raise UsageError(
            f"no plan {name!r}: give a path ending in .toml or one of {', '.join(READY)}", code="unknown-plan"
        )
    missing = "'swingid campaign --list' names the ready plans"
    text = text_of(path, missing=missing, folder="give the file of the plan in it")
    return plan_from_text(text, name, folder=path.parent)


def plan_from_text(text: str, source: str = "plan.toml", *, folder: Path | None = None) -> Plan:
    """The plan of TOML text; rig files are looked for beside it, in `folder`. Errors as `load_plan`."""
    document = tables_of(text, source)
    tables = checked(document, PlanTables, source, "a plan")
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
    rigs = {}
    for name in dict.fromkeys(names):
        beside = folder / name
        path = beside if name.lower().endswith(".toml") and beside.is_file() else name
        try:
            rig = Rig.load(path)
        except SwingidError as error:
            raise InputError(f"{source}: rig: {error.message}", code=error.code) from None
        rigs[name] = (rig.source, rig.text)
    return rigs


def _try_levels(plan: Plan) -> None:
    """Raise InputError where the base, or one level of one factor around it, is no experiment."""
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
