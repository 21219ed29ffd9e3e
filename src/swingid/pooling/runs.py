"""Two results of one rig, without and with a body: whether they can be subtracted, and what they have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from swingid.errors import InputError
from swingid.pooling.shares import Estimate, Identity, estimate_of
from swingid.result.file import load_result
from swingid.result.result import BudgetEntry, Message, Result

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
    def of(cls, tare: Result | str | Path, loaded: Result | str | Path) -> Runs:
        """Read and check both. Raises InputError where they cannot be subtracted."""
        names = (_name(tare, "the tare result"), _name(loaded, "the loaded result"))
        first, second = (r if isinstance(r, Result) else load_result(r) for r in (tare, loaded))
        for result, name in ((first, names[0]), (second, names[1])):
            _require_answer(result, name)
        _require_same(first, second, names)
        apart, notes = _constants_apart(first, second, names)
        return cls(first, second, names, frozenset(apart), tuple(notes))

    def estimates(self, parameter: str) -> tuple[Estimate, Estimate]:
        """Of a parameter of both runs; shared constants have one identity, everything else two."""
        tare = estimate_of(self.tare, parameter, self._identity("tare"))
        loaded = estimate_of(self.loaded, parameter, self._identity("loaded"))
        return _labelled(tare, "tare"), _labelled(loaded, "loaded")

    def _identity(self, run: str) -> Identity:
        def key(entry: BudgetEntry) -> str:
            shared = entry.shared_id
            # without the sign of its effect a shared source cannot cancel
            if shared is None or shared in self.apart or entry.sensitivity is None:
                return f"{entry.source} ({run})"
            return shared

        return key

    @property
    def unit(self) -> str:
        """Of the inertia."""
        return self.tare.inertia.unit

    def constant(self, key: str) -> tuple[float, float] | None:
        """Value and standard uncertainty (0: exact) of a constant of the rig, None where the results do not say."""
        return _constant(self.tare, key)


def _labelled(estimate: Estimate, run: str) -> Estimate:
    """With the run named in the sources that are its own."""
    return Estimate(
        estimate.value,
        {
            key: replace(share, source=key.partition(" #")[0], shared_id=None) if key.endswith(f"({run})") else share
            for key, share in estimate.shares.items()
        },
    )


def _name(given: Result | str | Path, otherwise: str) -> str:
    return otherwise if isinstance(given, Result) else str(given)


def _require_answer(result: Result, name: str) -> None:
    if result.status == "refused" or "inertia" not in result.parameters:
        reason = f": {result.error.message.rstrip('.')}" if result.error else ""
        raise InputError(f"{name} holds no inertia{reason}; identify a log that gives one.", code="refused-result")


def _require_same(tare: Result, loaded: Result, names: tuple[str, str]) -> None:
    """Raise InputError where the two results are not of one kind."""
    if tare.method != loaded.method:
        raise InputError(
            f"{names[0]} is by {tare.method} and {names[1]} by {loaded.method}, whose errors do not cancel; "
            "identify both logs by one method.",
            code="different-methods",
        )
    units = tare.inertia.unit, loaded.inertia.unit
    if units[0] != units[1]:
        raise InputError(
            f"{names[0]} gives {units[0]} and {names[1]} gives {units[1]}; both must be of one kind of axis.",
            code="different-units",
        )
    if names[0] == names[1] or _logs(tare) & _logs(loaded):
        raise InputError(
            f"{names[0]} and {names[1]} are of the same log; the body was in one of the runs only.", code="same-log"
        )


def _logs(result: Result) -> set[str]:
    """Hashes of the logs of a result, of one or several."""
    several = result.provenance.get("logs_sha256")
    hashes = several if isinstance(several, list) else [result.provenance.get("log_sha256")]
    return {text for text in hashes if isinstance(text, str)}


def _constant(result: Result, key: str) -> tuple[float, float] | None:
    constants = result.provenance.get("constants")
    entry = constants.get(key) if isinstance(constants, dict) else None
    if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
        return None
    std = entry.get("std")
    return float(entry["value"]), float(std) if isinstance(std, int | float) else 0.0


def _constants_apart(tare: Result, loaded: Result, names: tuple[str, str]) -> tuple[set[str], list[Message]]:
    """Shared ids that stand for different quantities in the two runs, with notes.

    Raises InputError where a constant that matters differs: a difference of rigs would be taken for a body.
    """
    keys = dict.fromkeys([*_deviations(tare), *_deviations(loaded), *tare.sensitivities, *loaded.sensitivities])
    apart: set[str] = set()
    notes: list[Message] = []
    for key in keys:
        one, other = _constant(tare, key), _constant(loaded, key)
        if one is not None and other is not None and key != GRAVITY and not _alike(one[0], other[0]):
            raise InputError(
                f"{names[0]} and {names[1]} were identified with different rigs: {key} is {one[0]:.6g} and "
                f"{other[0]:.6g}; identify both with the same constants.",
                code="different-rigs",
            )
        spreads = [_deviations(result).get(key) for result in (tare, loaded)]
        same_value = one is None or other is None or _alike(one[0], other[0])
        if None not in spreads and not (same_value and _alike(*spreads)):  # type: ignore[arg-type]
            apart.add(key)
    if GRAVITY in apart:
        text = f"{GRAVITY} is another one with the body, and its two uncertainties count as independent."
        notes.append(Message("gravity-of-each-run", text))
    elif (b := _constant(tare, GRAVITY)) is not None and b == _constant(loaded, GRAVITY) and b[0] != 0:
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
        if entry.parameter == "inertia" and entry.shared_id is not None and entry.sensitivity
    }


def _alike(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-6)
