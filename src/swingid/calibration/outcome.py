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
from swingid.result.sources import values_of
from swingid.uncertainty.budget import Evaluated, Parameter, correlation_of
from swingid.uncertainty.uncertain import Uncertain, covariance
from swingid.units import Quantity


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
        table = {
            first: {name: row[name] for name in names} for first, row in whole.correlation.items() if first in names
        }
        parameters = {name: whole.parameters[name] for name in names}
        budget = [entry for entry in whole.budget if entry.parameter in names]
        return replace(self, evaluated=Evaluated(parameters, budget, table if len(names) > 1 else {}))

    def joined(self, other: Found) -> Found:
        """Both groups: correlated by the stated constants that they share; the scatter is each group's own."""
        mine, theirs = self.evaluated, other.evaluated
        known = _values(mine, self.name) | _values(theirs, other.name)
        table = correlation_of(list(known), covariance(list(known.values())))
        evaluated = Evaluated(mine.parameters | theirs.parameters, [*mine.budget, *theirs.budget], table)
        warnings, notes = (*self.warnings, *other.warnings), (*self.notes, *other.notes)
        return Found(self.name, evaluated, warnings, notes)


def _values(evaluated: Evaluated, group: str) -> dict[str, Uncertain]:
    """The parameters whose uncertainty is known, with their sources; what is not stated is of this group alone."""
    known = [name for name, p in evaluated.parameters.items() if p.standard_uncertainty is not None]
    return values_of(evaluated, known, lambda entry: entry.shared_id or f"{group}: {entry.source}")


def result_of(
    method: str,
    logs: Sequence[Recording],
    rig: Rig,
    evaluated: Evaluated,
    warnings: Sequence[Message],
    notes: Sequence[Message],
) -> Result:
    """The result of a calibration by these logs, each message once."""
    origin = provenance(logs[0], rig)
    if len(logs) > 1:
        sources = [log.source for log in logs]
        origin |= {"logs": [source.path for source in sources], "logs_sha256": [source.sha256 for source in sources]}
    return Result(
        method=method,
        status="warning" if warnings else "ok",
        parameters=evaluated.parameters,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(dict.fromkeys(notes)),
        budget=tuple(evaluated.budget),
        provenance=origin,
        correlation=evaluated.correlation,
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
