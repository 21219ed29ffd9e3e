"""How a generated log of the corpus is made, and writing it by the twin of one tree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from compare_with.rigs import Tree, changed, to_toml

SINE = "sine 0.8 rad 8.5 rad/s"
TWO_TONES = "multisine 0.5 rad 8.5 rad/s + 0.4 rad 5.3 rad/s 1 rad"


@dataclass(frozen=True)
class Recipe:
    """How a log is made: the rig as it is, the rig as identification is told, and the motion.

    reference: motion under the compensator; drive: terms (amplitude, rad/s, phase) of an open loop; neither: a free
    decay. pushes: (instant, length, peak). read_as: changes of the rig that reads it, where that is told wrong things.
    columns: makes the log in the twin's place. warming: rise of the viscous friction (N m s) under a reference. only:
    what of a quick recipe is quick (a method, or "inspect", "read", "simulate"); empty: all but output-error.
    """

    name: str
    twin: Tree
    given: Tree
    reference: str | None = SINE
    drive: tuple[tuple[float, float, float], ...] | None = None
    duration: float = 15.0
    rate: float = 1000.0
    seed: int = 1
    initial_angle: float = 0.0
    pushes: tuple[tuple[float, float, float], ...] = ()
    read_as: dict[str, Any] = field(default_factory=dict)
    controller: str = "compensator"
    quick: bool = False
    only: tuple[str, ...] = ()
    initial_speed: float = 0.0
    warming: float = 0.0
    columns: Callable[[], dict[str, np.ndarray]] | None = None

    @property
    def log(self) -> str:
        """The log's path, the same in both trees."""
        return f"logs/{self.name}.parquet"

    @property
    def rig(self) -> str:
        """The path of the rig file that identification is told."""
        return f"logs/{self.name}.toml"

    def is_quick(self, what: str) -> bool:
        """Whether this of it is for use while refactoring: a method, or "inspect", "read", "simulate"."""
        only = self.only or ((what,) if what != "output-error" or self.name == "law-viscous" else ())
        return self.quick and what in only


def made(sw: Any, recipe: Recipe) -> Any:
    """The recording of a recipe by the twin of the package `sw`."""
    if recipe.columns is not None:
        return sw.Recording.from_columns(recipe.columns(), sw.Rig.from_text(to_toml(recipe.given), "given.toml"))
    rig = sw.Rig.from_text(to_toml(recipe.twin), "twin.toml")
    rows = round(recipe.duration * recipe.rate) + 1
    time = np.arange(rows) / recipe.rate
    options: dict[str, Any] = {}
    if recipe.reference is not None:
        controllers = {"compensator": sw.Compensator, "backstepping": sw.Backstepping}
        options["reference"] = sw.parse_reference(recipe.reference)
        options["controller"] = controllers[recipe.controller].paper(rig, sample_time=1 / recipe.rate)
    if recipe.drive is not None:
        options["drive"] = np.sum([a * np.sin(w * time + p) for a, w, p in recipe.drive], axis=0)
    if recipe.pushes:
        shares = [(peak, (time - at) / length) for at, length, peak in recipe.pushes]
        options["push"] = np.sum([np.where((s > 0) & (s < 1), p * np.sin(np.pi * s), 0.0) for p, s in shares], axis=0)
    if recipe.warming:
        slope = np.gradient(options["reference"](time), time)
        options["push"] = -recipe.warming * time / recipe.duration * slope
    return sw.simulate(
        rig,
        duration=recipe.duration,
        rate=recipe.rate,
        seed=recipe.seed,
        initial_angle=recipe.initial_angle,
        initial_speed=recipe.initial_speed,
        **options,
    )


def write_log(sw: Any, recipe: Recipe, folder: Path) -> None:
    """The log of a recipe and the rig file that reads it, in `folder`/logs."""
    writing = sw.Rig.from_text(to_toml(recipe.given), "given.toml")
    made(sw, recipe).save(folder / recipe.log, writing)
    (folder / recipe.rig).write_text(to_toml(changed(recipe.given, recipe.read_as)) + "\n", encoding="utf-8")
