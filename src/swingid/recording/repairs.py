"""The repairs of a log by name: what each does, and which are switched off."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

from swingid.errors import UsageError
from swingid.recording.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

REPAIRS: dict[str, str] = {
    "blanks": "rows without a number, or that do not split into columns, are left out",
    "sort": "rows in the wrong place are sorted by time",
    "repeats": "of rows with one time only the first is kept",
    "clock": "stamps that scatter about a constant rate are replaced by that rate",
    "unwrap": "angles logged within one turn are made continuous",
    "spikes": "single samples that fit neither neighbour are left out",
    "limit": "commanded voltages beyond the rig's voltage_limit are taken as the limit",
    "encoders": "the encoders' nonlinearity that the rig file states is taken off, when a method asks for the angles",
    "calibrate": "bent encoders and late channels that the rig file does not declare are found from the log (momentum)",
    "latency": "the latency that the rig file states is taken off, when a method asks for the angles",
    "push": "rows of a driven log while a torque from outside acts are left out, when a method asks for the angles",
}
"""Every repair that a log may see. Each that was made is named in the result's provenance."""


def switched_off(switches: Mapping[str, bool] | None) -> frozenset[str]:
    """The repairs that `switches` (name to on or off) turns off; UsageError for a name that is none."""
    for name in switches or {}:
        if name not in REPAIRS:
            near = difflib.get_close_matches(name, REPAIRS, n=1)
            hint = f"the nearest is {near[0]}" if near else f"there are {', '.join(REPAIRS)}"
            raise UsageError(f"no repair is called {name!r}; {hint}.", code="unknown-repair")
    return frozenset(name for name, on in (switches or {}).items() if not on)


def notes_of(off: frozenset[str]) -> list[Finding]:
    """A note for each repair that is switched off."""
    return [Finding("repair-off", f"the repair {name!r} was switched off.", "note", name) for name in sorted(off)]
