"""What each run of an ensemble is made with, and which runs the lanes can take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.control.compensator import Compensator
from swingid.errors import UsageError
from swingid.model.parameters import constants, vector
from swingid.model.terms import TERMS
from swingid.simulation.draws import CHANNELS, draw_constants, draw_nonlinearity, stream
from swingid.simulation.ensemble.lanes import OTHERS
from swingid.simulation.twin import Controller, Reference

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

CHANGEABLE = tuple(term.key for term in TERMS.values() if term.key)
"""Keys of a rig file that may differ from run to run without a rig for each."""


@dataclass(frozen=True)
class Run:
    """One run: the arguments of `simulate` that make it.

    changes: values (SI) of keys in `CHANGEABLE` by which its rig differs from `rig`. controller None: the loop is open,
    with `drive` (rows,) as commands or none.
    """

    rig: Rig
    changes: Mapping[str, float]
    reference: Reference | None
    controller: Controller | None
    drive: Array | None
    seed: int
    initial_angle: float
    initial_speed: float
    draw: bool
    encoder_zero: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def own_rig(self) -> Rig:
        """The rig with its changes."""
        return self.rig.changed(dict(self.changes)) if self.changes else self.rig

    def constants(self) -> Array:
        """Vector (SIZE,) of `model.parameters`, drawn where the run is to be. Errors as `vector`."""
        kind = self.rig.drive.kind
        if self.draw:
            return vector(draw_constants(self.own_rig, self.seed), kind)
        return vector({key: quantity.value for key, quantity in constants(self.rig).items()} | dict(self.changes), kind)

    def fits_lanes(self, p: Array) -> bool:
        """Whether the lanes know all terms of its motion (of the constants p), its controller and sensors."""
        if np.any(p[OTHERS]):
            return False
        if self.controller is not None and (
            not isinstance(self.controller, Compensator) or len(self.controller.k) != 1
        ):
            return False
        sensors = [self.rig.sensors.of(name) for name in CHANNELS]
        return not any(s.jitter or s.latency.value or s.latency.std for s in sensors)

    def encoders(self) -> Array:
        """Arrays (2, 4) of `model.sensors` for axis and wheel."""
        steps = [self.rig.sensors.of(name).resolution for name in CHANNELS]
        bent = draw_nonlinearity(self.rig, self.seed)
        rows = zip(steps, bent, self.encoder_zero, strict=True)
        return np.array([[step, alpha, beta, zero] for step, (alpha, beta), zero in rows])

    def noise(self, rows: int) -> Array | None:
        """Noise (2, rows) (rad) of the two encoders, None where there is none."""
        levels = [self.rig.sensors.of(name).noise for name in CHANNELS]
        if not any(levels):
            return None
        draws = stream(self.seed, "noise").standard_normal((2, rows))
        draws *= np.array(levels)[:, None]
        return draws


def runs_of(
    rigs: Rig | Sequence[Rig],
    reference: Reference | Sequence[Reference] | None,
    controller: Controller | Sequence[Controller] | None,
    values: Mapping[str, ArrayLike],
    drive: ArrayLike | None,
    seeds: int | Sequence[int],
    initial_angle: ArrayLike,
    initial_speed: ArrayLike,
    draw: bool,
    encoder_zero: ArrayLike = (0.0, 0.0),
) -> list[Run]:
    """The runs that the arguments of `simulate_ensemble` describe: what is given once holds for all of them.

    Raises UsageError where lengths differ or a key cannot differ from run to run, InputError for impossible values.
    """
    rig = rigs if not isinstance(rigs, Sequence) else rigs[0]
    for key in values:
        if key not in CHANGEABLE:
            raise UsageError(
                f"{key} cannot differ from run to run by `values`; give one rig per run instead", code="unknown-key"
            )
        rig.changed({key: float(np.min(values[key]))})
    commands = None if drive is None else np.asarray(drive, dtype=np.float64)
    several: dict[str, list[object]] = {
        "rigs": _listed(rigs),
        "reference": _listed(reference),
        "controller": _listed(controller),
        "drive": list(commands) if commands is not None and commands.ndim == 2 else [commands],
        "seeds": _listed(seeds if isinstance(seeds, int) else list(seeds)),
        "initial_angle": np.atleast_1d(np.asarray(initial_angle, dtype=np.float64)).tolist(),
        "initial_speed": np.atleast_1d(np.asarray(initial_speed, dtype=np.float64)).tolist(),
        "encoder_zero": np.atleast_2d(np.asarray(encoder_zero, dtype=np.float64)).tolist(),
    } | {key: np.atleast_1d(np.asarray(value, dtype=np.float64)).tolist() for key, value in values.items()}
    count = max(len(each) for each in several.values())
    for name, each in several.items():
        if len(each) not in (1, count):
            raise UsageError(
                f"{name} holds {len(each)} entries for {count} runs; give one or {count}", code="bad-lengths"
            )
    runs: list[Run] = []
    standard: dict[int, Compensator] = {}
    for k in range(count):
        one: dict[str, Any] = {name: each[k if len(each) == count else 0] for name, each in several.items()}
        changes = {key: one[key] for key in values}
        run = Run(
            one["rigs"], changes, one["reference"], one["controller"], one["drive"], int(one["seeds"]),
            one["initial_angle"], one["initial_speed"], draw, tuple(one["encoder_zero"]),
        )  # fmt: skip
        runs.append(_with_controller(run, standard))
    return runs


def _with_controller(run: Run, standard: dict[int, Compensator]) -> Run:
    """The run with the compensator of the paper's experiment where it has a reference and no controller.

    `standard` keeps those of rigs seen before, by identity.
    """
    if run.reference is None or run.controller is not None or run.drive is not None or run.rig.drive.kind == "none":
        return run
    if any(key.startswith("drive.") for key in run.changes):
        return replace(run, controller=Compensator.paper(run.own_rig))
    if id(run.rig) not in standard:
        standard[id(run.rig)] = Compensator.paper(run.rig)
    return replace(run, controller=standard[id(run.rig)])


def _listed(value: object) -> list[object]:
    """A sequence as a list; anything else as a list of one."""
    return list(value) if isinstance(value, (list, tuple)) else [value]
