"""The plans that come with swingid, by name."""

from __future__ import annotations

import tomllib
from importlib.resources import files

READY = ("coverage", "efficiency", "friction-laws", "imperfections", "gains", "paper-variants")
"""Names of the ready plans; the file of each is plans/NAME.toml."""


def ready_text(name: str) -> str:
    """The TOML text of a ready plan."""
    return (files("swingid.study.campaign") / "plans" / f"{name}.toml").read_text(encoding="utf-8")


def described() -> list[tuple[str, str, str]]:
    """(name, what it is about, how long it takes) of every ready plan."""
    tables = [tomllib.loads(ready_text(name)) for name in READY]
    return [(name, str(table["about"]), str(table["takes"])) for name, table in zip(READY, tables, strict=True)]
