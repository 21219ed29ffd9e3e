"""What each run of an ensemble is made with, and which runs the lanes can take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.control.compensator import Compensator
from swingid.errors import UsageError
from swingid.model.parameters import A11, A12, A22, PLACES, SIZE, constants, vector
from swingid.model.terms import TERMS
from swingid.simulation.draws import draw_constants
from swingid.simulation.twin import Controller, Reference, Setup

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

CHANGEABLE = tuple(term.key for term in TERMS.values() if term.key)
"""Keys of a rig file that may differ from run to run without a rig for each."""

SUMS = {
    "axis.inertia": (),
    "axis.friction.viscous": ("axis.friction.viscous_positive", "axis.friction.viscous_negative"),
}
"""Keys that stand in the vector of constants as a summand, and the keys that must not be there for that."""

TERM_OF = {term.key: name for name, term in TERMS.items() if term.key}
"""Name of a term by its key."""


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
        channel = self.rig.drive.channel
        if self.draw:
            return vector(draw_constants(self.own_rig, self.seed), channel)
        return vector(
            {key: quantity.value for key, quantity in constants(self.rig).items()} | dict(self.changes), channel
        )


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
        entries = np.asarray(values[key], dtype=np.float64)
        if not entries.size:
            raise UsageError(f"{key} holds no entries; give one per run", code="bad-lengths")
        for extreme in {float(entries.min()), float(entries.max())}:
            rig.changed({key: extreme})
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
    for row in zip(*(each if len(each) == count else each * count for each in several.values()), strict=True):
        arguments = dict(zip(several, row, strict=True))
        changes = {key: arguments.pop(key) for key in values}
        rig, seed, zero = arguments.pop("rigs"), int(arguments.pop("seeds")), tuple(arguments.pop("encoder_zero"))
        if arguments["controller"] is None and arguments["reference"] is not None and arguments["drive"] is None:
            arguments["controller"] = _standard(rig, changes, standard)
        runs.append(Run(rig, changes=changes, seed=seed, encoder_zero=zero, **arguments, **common))
    return runs


def _standard(rig: Rig, changes: Mapping[str, float], known: dict[int, Compensator]) -> Compensator | None:
    """The compensator of the paper's experiment for a rig with a drive; `known` keeps those of rigs seen before."""
    if rig.drive.channel is None:
        return None
    if any(key.startswith("drive.") for key in changes):
        return Compensator.paper(rig.changed(dict(changes)))
    if id(rig) not in known:
        known[id(rig)] = Compensator.paper(rig)
    return known[id(rig)]


def constants_of(runs: Sequence[Run]) -> Array:
    """The constants (n, SIZE) of all runs, as `Run.constants`; those that differ in a plain sum are computed once."""
    result = np.empty((len(runs), SIZE))
    stated: dict[int, dict[str, float]] = {}
    parts: dict[tuple[object, ...], tuple[list[str], list[str]]] = {}
    known: dict[tuple[object, ...], Array] = {}
    sums: dict[str, list[tuple[int, float]]] = {key: [] for key in SUMS}
    for k, run in enumerate(runs):
        if run.draw:
            result[k] = run.constants()
            continue
        kind = (id(run.rig), *run.changes)
        if kind not in parts:
            values = {key: quantity.value for key, quantity in constants(run.rig).items()}
            stated[id(run.rig)] = values
            plain = [key for key in run.changes if key in SUMS and not any(part in values for part in SUMS[key])]
            parts[kind] = plain, [key for key in run.changes if key not in plain]
        values, (plain, others) = stated[id(run.rig)], parts[kind]
        name = (*kind, *(run.changes[key] for key in others)) if others else kind
        if name not in known:
            known[name] = vector(values | {key: run.changes[key] for key in others}, run.rig.drive.channel)
        result[k] = known[name]
        for key in plain:
            sums[key].append((k, run.changes[key] - values.get(key, 0.0)))
    for key, entries in sums.items():
        for place in PLACES[TERM_OF[key]] if entries else ():
            result[[k for k, _ in entries], place] += [more for _, more in entries]
    impossible = ~((result[:, A11] > 0.0) & (result[:, A11] * result[:, A22] > result[:, A12] ** 2))
    for k in np.flatnonzero(impossible).tolist():
        result[k] = runs[k].constants()
    return result


def _listed(value: object) -> list[Any]:
    """A sequence as a list; anything else as a list of one."""
    return list(value) if isinstance(value, (list, tuple)) else [value]
