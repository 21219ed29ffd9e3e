"""Two results of one rig, without and with a body: whether they can be subtracted, and what they share."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from swingid.errors import InputError
from swingid.result.data import require_inertia
from swingid.result.file import load_result
from swingid.result.result import Message, Result
from swingid.result.sources import values_of
from swingid.uncertainty.budget import BudgetEntry
from swingid.uncertainty.uncertain import Uncertain

GRAVITY = "axis.gravity_torque"

ENCODERS = "sensors."


@dataclass(frozen=True)
class Runs:
    """The results without (tare) and with (loaded) the body, how they are called, and notes on what they share."""

    tare: Result
    loaded: Result
    names: tuple[str, str]
    apart: frozenset[str] = frozenset()
    notes: tuple[Message, ...] = ()

    @classmethod
    def of(cls, tare: Result | str | Path, loaded: Result | str | Path, *, ratios: bool = False) -> Runs:
        """Read and check both; ratios: whether both may be ones of ratios. Raises InputError for other pairs."""
        words = {"the tare result": tare, "the loaded result": loaded}
        of_tare, of_loaded = (name if isinstance(given, Result) else str(given) for name, given in words.items())
        names = of_tare, of_loaded
        first, second = (r if isinstance(r, Result) else load_result(r) for r in (tare, loaded))
        _require_same(first, second, names, ratios=ratios and first.ratios and second.ratios)
        apart, notes = _constants_apart(first, second, names)
        return cls(first, second, names, frozenset(apart), tuple(notes))

    def values(self, *names: str) -> tuple[dict[str, Uncertain], dict[str, Uncertain]]:
        """Parameters of both runs; shared constants have one identity, everything else two."""
        tare, loaded = (
            replace(result, budget=tuple(self._labelled(entry, run) for entry in result.budget))
            for result, run in zip(self.each, ("tare", "loaded"), strict=True)
        )
        return values_of(tare, names), values_of(loaded, names)

    def _labelled(self, entry: BudgetEntry, run: str) -> BudgetEntry:
        """Put the run into the name of a source that is its own; without the sign of its effect a shared one is,
        too.
        """
        shared = entry.shared_id
        if shared is not None and shared not in self.apart and entry.sensitivity is not None:
            return entry
        return replace(entry, origin=replace(entry.origin, name=f"{entry.source} ({run})", shared_id=None))

    @property
    def each(self) -> tuple[Result, Result]:
        """Both results, that without the body first."""
        return self.tare, self.loaded

    @property
    def unit(self) -> str:
        """The unit of the inertia."""
        return self.tare.inertia.unit


def _require_same(tare: Result, loaded: Result, names: tuple[str, str], *, ratios: bool) -> None:
    """Raise InputError where one has no inertia, or the two are not of one kind."""
    for result, name in zip((tare, loaded), names, strict=True):
        require_inertia(result, name, ratios=ratios)
    if tare.method != loaded.method:
        raise InputError(
            f"{names[0]} is by {tare.method} and {names[1]} by {loaded.method}, whose errors do not cancel; "
            "identify both logs by one method.",
            code="different-methods",
        )
    units = tare.main.unit, loaded.main.unit
    if units[0] != units[1]:
        raise InputError(
            f"{names[0]} gives {units[0]} and {names[1]} gives {units[1]}; both must be of one kind of axis.",
            code="different-units",
        )
    if names[0] == names[1] or set(tare.origin.digests) & set(loaded.origin.digests):
        raise InputError(
            f"{names[0]} and {names[1]} are of the same log; the body was in one of the runs only.", code="same-log"
        )


def _constants_apart(tare: Result, loaded: Result, names: tuple[str, str]) -> tuple[set[str], list[Message]]:
    """Shared ids that stand for different quantities in the two runs, with notes.

    Raises InputError where a constant that matters differs: a difference of rigs would be taken for a body.
    """
    keys = dict.fromkeys([*_deviations(tare), *_deviations(loaded), *tare.sensitivities, *loaded.sensitivities])
    apart: set[str] = set()
    notes: list[Message] = []
    for key in keys:
        first, second = (result.origin.constants.get(key) for result in (tare, loaded))
        if first is not None and second is not None and key != GRAVITY and not _alike(first.value, second.value):
            raise InputError(
                f"{names[0]} and {names[1]} were identified with different rigs: {key} is {first.value:.6g} and "
                f"{second.value:.6g}; identify both with the same constants.",
                code="different-rigs",
            )
        spreads = [_deviations(result).get(key) for result in (tare, loaded)]
        same_value = first is None or second is None or _alike(first.value, second.value)
        if None not in spreads and not (same_value and _alike(*spreads)):  # type: ignore[arg-type]
            apart.add(key)
    if GRAVITY in apart:
        text = f"{GRAVITY} is another one with the body, and its two uncertainties count as independent."
        notes.append(Message("gravity-of-each-run", text))
    elif (b := tare.origin.constants.get(GRAVITY)) and b == loaded.origin.constants.get(GRAVITY) and b.value != 0:
        text = f"both runs have the same {GRAVITY}, as if the body's centre were on the axis; if not, correct the rig."
        notes.append(Message("gravity-unchanged", text))
    others = sorted(apart - {GRAVITY})
    if others:
        text = f"stated with another uncertainty in the two runs, and counted as independent: {', '.join(others)}."
        notes.append(Message("independent-constants", text))
    encoders = [key for key in _deviations(tare) if key.startswith(ENCODERS) and key not in apart]
    if encoders:
        notes.append(
            Message("encoders-unchanged", "the encoders count as untouched between the runs: their errors cancel.")
        )
    return apart, notes


def _deviations(result: Result) -> dict[str, float]:
    """Standard deviation of each shared source in its own unit, from the budget of the inertia."""
    return {
        entry.shared_id: entry.standard_uncertainty / abs(entry.sensitivity)
        for entry in result.budget
        if entry.parameter == result.leading and entry.shared_id is not None and entry.sensitivity
    }


def _alike(first: float, second: float) -> bool:
    return math.isclose(first, second, rel_tol=1e-6)
