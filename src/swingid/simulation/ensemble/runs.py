"""What each run of an ensemble is made with, and which runs the lanes can take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.control.compensator import Compensator
from swingid.errors import UsageError
from swingid.model.parameters import constants, vector
from swingid.model.terms import TERMS
from swingid.simulation.draws import CHANNELS, draw_constants, draw_nonlinearity, stream
from swingid.simulation.ensemble.lanes import CHAIN_MOST, OTHERS
from swingid.simulation.twin import Controller, Reference, Setup

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

CHANGEABLE = tuple(term.key for term in TERMS.values() if term.key)
"""Keys of a rig file that may differ from run to run without a rig for each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Run(Setup):
    """One run; its rig differs from `rig` in `changes`: values (SI) of keys in `CHANGEABLE`.

    controller None: the loop is open, with `drive` (rows,) as commands or none.
    """

    changes: Mapping[str, float] = field(default_factory=dict)

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
        """Whether the lanes know all terms of its motion (of the constants p) and its controller."""
        if np.any(p[OTHERS]):
            return False
        return not isinstance(self.controller, Compensator) or len(self.controller.k) <= CHAIN_MOST

    @cached_property
    def is_late(self) -> bool:
        """Whether some encoder is not read at the instants of the rows."""
        sensors = [self.rig.sensors.of(name) for name in CHANNELS]
        return any(s.jitter or s.latency.value or s.latency.std for s in sensors)

    def delays(self, rows: int) -> Array:
        """How much after its row each encoder is read (2, rows) (s), as drawn."""
        sensors = [self.rig.sensors.of(name) for name in CHANNELS]
        latency = stream(self.seed, "latency").standard_normal(2)
        jitter = stream(self.seed, "jitter").standard_normal(rows)
        own = [s.latency.value + (s.latency.std or 0.0) * one for s, one in zip(sensors, latency, strict=True)]
        return np.array([one + s.jitter * jitter for s, one in zip(sensors, own, strict=True)])

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
    reference: Reference | Sequence[Reference] | None = None,
    controller: Controller | Sequence[Controller] | None = None,
    *,
    seeds: int | Sequence[int] = 0,
    values: Mapping[str, ArrayLike] | None = None,
    initial_angle: ArrayLike = 0.0,
    initial_speed: ArrayLike = 0.0,
    drive: ArrayLike | None = None,
    encoder_zero: ArrayLike = (0.0, 0.0),
    **common: Any,
) -> list[Run]:
    """The runs that the arguments of `simulate_ensemble` describe: what is given once, as all of `common`, is of all.

    Raises UsageError where lengths differ or a key cannot differ from run to run, InputError for impossible values.
    """
    rig = rigs if not isinstance(rigs, Sequence) else rigs[0]
    values = values or {}
    for key in values:
        if key not in CHANGEABLE:
            text = f"{key} cannot differ from run to run by `values`; give one rig per run instead"
            raise UsageError(text, code="unknown-key")
        rig.changed({key: float(np.min(values[key]))})
    commands = None if drive is None else np.asarray(drive, dtype=np.float64)
    numbers = {"initial_angle": initial_angle, "initial_speed": initial_speed, **values}
    several: dict[str, list[Any]] = {
        "rigs": _listed(rigs),
        "reference": _listed(reference),
        "controller": _listed(controller),
        "drive": list(commands) if commands is not None and commands.ndim == 2 else [commands],
        "seeds": _listed(seeds if isinstance(seeds, int) else list(seeds)),
        "encoder_zero": np.atleast_2d(np.asarray(encoder_zero, dtype=np.float64)).tolist(),
    } | {name: np.atleast_1d(np.asarray(each, dtype=np.float64)).tolist() for name, each in numbers.items()}
    count = max(len(each) for each in several.values())
    for name, each in several.items():
        if len(each) not in (1, count):
            text = f"{name} holds {len(each)} entries for {count} runs; give one or {count}"
            raise UsageError(text, code="bad-lengths")
    runs: list[Run] = []
    standard: dict[int, Compensator] = {}
    for k in range(count):
        own = {name: each[k if len(each) == count else 0] for name, each in several.items()}
        changes = {key: own.pop(key) for key in values}
        rig, seed, zero = own.pop("rigs"), int(own.pop("seeds")), tuple(own.pop("encoder_zero"))
        run = Run(rig, changes=changes, seed=seed, encoder_zero=zero, **own, **common)
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


def _listed(value: object) -> list[Any]:
    """A sequence as a list; anything else as a list of one."""
    return list(value) if isinstance(value, (list, tuple)) else [value]
