"""What a calibration returns: the result of its logs, and the rig file with the constants that were found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from swingid.model.rig import Rig
from swingid.model.rig.edit import edited
from swingid.recording.recording import Recording
from swingid.result.provenance import provenance
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter
from swingid.units import Quantity

Table = dict[str, dict[str, float]]
"""Correlation coefficients by the names of both parameters."""


@dataclass(frozen=True)
class Found:
    """What a group of logs determines, with warnings and notes; name: of the logs."""

    name: str
    evaluated: Evaluated
    warnings: tuple[Message, ...] = ()
    notes: tuple[Message, ...] = ()

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The parameters by name."""
        return self.evaluated.parameters

    def only(self, names: Sequence[str]) -> Found:
        """The same with these parameters alone."""
        whole = self.evaluated
        table = {one: {name: row[name] for name in names} for one, row in whole.correlation.items() if one in names}
        parameters = {name: whole.parameters[name] for name in names}
        budget = [entry for entry in whole.budget if entry.parameter in names]
        return replace(self, evaluated=Evaluated(parameters, budget, table if len(names) > 1 else {}))

    def joined(self, other: Found) -> Found:
        """Both groups: correlated by the stated constants that they share; the scatter is each group's own."""
        mine, theirs = self.evaluated, other.evaluated
        parameters, budget = mine.parameters | theirs.parameters, [*mine.budget, *theirs.budget]
        known = {name: u for name, p in parameters.items() if (u := p.standard_uncertainty) is not None}
        table: Table = {name: {name: 1.0} for name in known}
        for name, row in (*mine.correlation.items(), *theirs.correlation.items()):
            table[name] |= row
        shifts = {name: shifts_of(budget, name) for name in known}
        for one in known.keys() & mine.parameters.keys():
            for two in known.keys() & theirs.parameters.keys():
                shared = sum(u * shifts[two].get(key, 0.0) for key, u in shifts[one].items())
                whole = known[one] * known[two]
                table[one][two] = table[two][one] = shared / whole if whole else 0.0
        warnings, notes = (*self.warnings, *other.warnings), (*self.notes, *other.notes)
        return Found(self.name, Evaluated(parameters, budget, table), warnings, notes)


def shifts_of(budget: Sequence[BudgetEntry], parameter: str) -> dict[str, float]:
    """Change of a parameter for one standard uncertainty of each stated quantity (JCGM 100 5.2)."""
    return {
        e.shared_id: math.copysign(e.standard_uncertainty, e.sensitivity)
        for e in budget
        if e.parameter == parameter and e.shared_id is not None and e.sensitivity is not None
    }


def result_of(
    method: str,
    logs: Sequence[Recording],
    rig: Rig,
    found: Evaluated,
    warnings: Sequence[Message],
    notes: Sequence[Message],
) -> Result:
    """The result of a calibration by these logs, each message once."""
    origin = provenance(logs[0], rig)
    if len(logs) > 1:
        sources = [log.source for log in logs]
        origin |= {"logs": [one.path for one in sources], "logs_sha256": [one.sha256 for one in sources]}
    return Result(
        method=method,
        status="warning" if warnings else "ok",
        parameters=found.parameters,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(dict.fromkeys(notes)),
        budget=tuple(found.budget),
        provenance=origin,
        correlation=found.correlation,
    )


def rewritten(rig: Rig, values: Mapping[str, object]) -> tuple[Rig, list[Message]]:
    """The rig with `values` at dotted keys of its file (None: no such key), and a note where its comments were lost."""
    text, kept = edited(rig.text, values)
    lost = "the comments of the rig file could not be kept because of its layout; its tables were written anew."
    return Rig.from_text(text, rig.source, default_name=rig.name), [] if kept else [Message("comments-lost", lost)]


def quantity(parameter: Parameter, *, least: float = -math.inf) -> Quantity:
    """Value, not below `least`, and standard uncertainty as the rig file states them."""
    u = parameter.standard_uncertainty
    return Quantity(max(rounded(parameter), least), None if u is None else float(f"{u:.3g}"))


def rounded(parameter: Parameter) -> float:
    """The value to two digits more than the first of its uncertainty, at most to fifteen."""
    u = parameter.standard_uncertainty
    if not u or not parameter.value:
        return float(f"{parameter.value:.10g}")
    digits = math.floor(math.log10(abs(parameter.value))) - math.floor(math.log10(u)) + 4
    return float(f"{parameter.value:.{min(max(digits, 3), 15)}g}")
