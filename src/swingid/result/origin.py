"""What is read of the provenance of a result, which may come from a file: logs and their hashes, constants, options."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from swingid.units import Quantity


@dataclass(frozen=True)
class Origin:
    """Logs by name and hash, in their order; what else code asks of where a result comes from, empty where not given.

    several: whether of several logs. constants: of the rig file, by key; made_of: their contributions, by key and key;
    found: constants that the fit moved. noise: of angle and wheel. result: name of a result that was subtracted from
    another; runs: those by "tare" and "loaded".
    """

    logs: tuple[str | None, ...]
    digests: tuple[str, ...]
    several: bool
    constants: Mapping[str, Quantity]
    made_of: Mapping[str, Mapping[str, float]]
    found: Mapping[str, float]
    options: Mapping[str, object]
    noise: Mapping[str, float | None]
    result: str
    runs: Mapping[str, Origin]

    @classmethod
    def of(cls, provenance: Mapping[str, object]) -> Origin:
        """Read what is there, and pass over what a file has otherwise."""
        several = isinstance(provenance.get("logs"), list)
        logs, digests = (_each(provenance, name) for name in ("log", "log_sha256"))
        stated = {key: _table(value) for key, value in _table(provenance.get("constants")).items()}
        return cls(
            logs=tuple(None if log is None else str(log) for log in logs),
            digests=tuple(dict.fromkeys(digest for digest in digests if isinstance(digest, str) and digest)),
            several=several,
            constants={key: _quantity(value) for key, value in stated.items() if _is_number(value.get("value"))},
            made_of={key: _table(parts) for key, parts in _table(provenance.get("made_of")).items()},
            found={key: value for key, value in _table(provenance.get("constants_found")).items() if _is_number(value)},
            options=_table(provenance.get("options")),
            noise=_table(_table(provenance.get("preparation")).get("noise")),
            result=str(provenance.get("result") or ""),
            runs={name: cls.of(run) for name in ("tare", "loaded") if (run := _table(provenance.get(name)))},
        )


def _each(provenance: Mapping[str, object], name: str) -> list[object]:
    """The entry of each log, of one or several."""
    several = provenance.get(name.replace("log", "logs"))
    return several if isinstance(several, list) else [provenance.get(name)]


def _table(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _is_number(value: object) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number of more than 308 digits
        return False


def _quantity(entry: Mapping[str, Any]) -> Quantity:
    """A constant with its standard uncertainty; exact where none is given."""
    return Quantity(float(entry["value"]), float(entry["std"]) if _is_number(entry.get("std")) else None)
