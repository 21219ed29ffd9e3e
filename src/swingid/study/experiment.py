"""An experiment on the twin: what is run, which rig file the lab has, and the log that is written and read back."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.simulation.twin import Setup, run_of

if TYPE_CHECKING:
    from swingid.control.backstepping import Backstepping
    from swingid.control.compensator import Compensator


@dataclass(frozen=True)
class Experiment:
    """The twin, the rig file of the lab (without inertia and friction), motion, controller, length (s), rate (1/s).

    initial_angle: rad or m. draw: whether the twin's uncertain constants are drawn. methods: name, method, options.
    Everything in it can be sent to another process.
    """

    twin: Rig
    stated: Rig
    reference: Callable[[Array], Array] | None
    controller: Compensator | Backstepping | None
    duration: float
    rate: float
    initial_angle: float
    draw: bool
    methods: tuple[tuple[str, str, Mapping[str, object]], ...]

    def setup(self, seed: int) -> Setup:
        """One run, with everything that is random drawn by `seed`, also the grid phases of the encoders."""
        return Setup(
            self.twin,
            self.reference,
            self.controller,
            duration=self.duration,
            rate=self.rate,
            seed=seed,
            initial_angle=self.initial_angle,
            draw=self.draw,
            encoder_zero=encoder_places(self.twin, seed),
        )

    def log(self, seed: int) -> Recording:
        """The twin's log of the run that `seed` draws."""
        return run_of(self.setup(seed)).recording

    def read(self, log: Recording) -> Recording:
        """What the lab reads from the file that is written of a log."""
        return through_file(log, self.stated)


def without_truth(rig: Rig) -> Rig:
    """The rig as identification gets it: neither inertia nor friction."""
    return rig.changed({"axis.inertia": None, "axis.friction": None})


def encoder_places(rig: Rig, seed: int) -> tuple[float, float]:
    """What the encoders of axis and wheel read at angle 0, within half a step of 0 (rad).

    The grid phase of an encoder is random, and decides what its rounding does to a periodic motion.
    """
    place = np.random.default_rng([seed, 1]).random(2) - 0.5
    steps = (rig.sensors.of("angle").resolution, rig.sensors.of("wheel").resolution)
    return float(place[0] * steps[0]), float(place[1] * steps[1])


def through_file(log: Recording, rig: Rig) -> Recording:
    """What a lab with `rig` reads from the file that is written of a log."""
    with tempfile.TemporaryDirectory() as folder:
        return Recording.load(log.save(Path(folder) / "run.parquet", rig), rig)
