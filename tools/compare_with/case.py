"""One case of the corpus: a name, and what is run in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compare_with.outcomes import of_command
from compare_with.rigs import Tree, to_toml

METHODS = ("momentum", "energy", "equation-error", "output-error", "backstepping")


@dataclass(frozen=True)
class Case:
    """A name, what is run (given the case's own folder; returns plain data), its level, and whether it needs logs."""

    name: str
    run: Callable[[Path], Any]
    quick: bool = False
    needs_logs: bool = True


def command(
    name: str, *steps: list[str], quick: bool = False, needs_logs: bool = True, rig: Tree | None = None
) -> Case:
    """A case of commands, run one after the other; `{here}` in an argument is the case's folder.

    rig: is written as `{here}/rig.toml` before.
    """

    def run(folder: Path) -> Any:
        if rig is not None:
            (folder / "rig.toml").write_text(to_toml(rig) + "\n", encoding="utf-8")
        return [
            of_command([one.replace("{here}", str(folder)) for one in step], folder, f"out{k}")
            for k, step in enumerate(steps)
        ]

    return Case(name, run, quick, needs_logs)
