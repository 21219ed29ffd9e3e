"""Many logs, each by itself, by one or more methods, as one table of results: a row per log, method and parameter."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from swingid.errors import SwingidError, UsageError
from swingid.format import plus_minus
from swingid.identification import identify_beside
from swingid.methods.table import Answers
from swingid.model.rig import Rig
from swingid.progress import tracked
from swingid.recording.large import LargeLog
from swingid.recording.recording import Recording
from swingid.result.result import Result, refusal
from swingid.table import Table, plain

COLUMNS = (
    *("log", "method", "status", "parameter", "value", "standard_uncertainty", "low95", "high95", "unit"),
    *("codes", "message"),
)
"""Names of the columns of the table; low95, high95: ends of the 95 % interval; codes: of the warnings."""


@dataclass(frozen=True)
class ResultsTable:
    """Results by log and method, in their order."""

    results: Mapping[tuple[str, str], Result]

    @property
    def answered(self) -> bool:
        """Return whether any log has a number."""
        return any(result.status != "refused" for result in self.results.values())

    def rows(self) -> Iterator[tuple[object, ...]]:
        """The cells of `COLUMNS`, one row per parameter; of a refused log one row with its code and its reason."""
        for (log, method), result in self.results.items():
            codes = " ".join(dict.fromkeys(warning.code for warning in result.warnings))
            if result.error is not None:
                yield log, method, result.status, *[""] * 6, result.error.code, result.error.message
            for name, parameter in result.parameters.items():
                ends = parameter.interval95 or ("", "")
                u = "" if parameter.standard_uncertainty is None else parameter.standard_uncertainty
                yield log, method, result.status, name, parameter.value, u, *ends, parameter.unit, codes, ""

    def to_csv(self) -> str:
        """The table as text with commas; numbers with all their digits."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(self.rows())
        return text.getvalue()

    def summary(self) -> str:
        """A line per log and method with its leading parameter, for a terminal."""
        rows = []
        for (log, method), result in self.results.items():
            shown = "" if result.error is None else result.error.code
            if not shown:
                main = result.main
                shown = f"{result.leading} {plus_minus(main.value, main.standard_uncertainty, main.unit)}"
            rows.append((log, method, result.status, shown))
        table = Table(plain("log", "method", "status", "result"), tuple(rows))
        return "\n".join(line.rstrip() for line in table.lines())


Load = Callable[[str], Recording | LargeLog]


def results_table(
    logs: Sequence[str], load: Load, rig: Rig, methods: Sequence[str], *, part: object = None
) -> ResultsTable:
    """Every log by itself by every method; one that cannot be read, or a method that refuses, is a row with its reason.

    load: reads a log. part: of each log, as of `identify`. Raises UsageError for an unknown method.
    """
    results: dict[tuple[str, str], Result] = {}
    for path in tracked(logs):
        try:
            log: Recording | LargeLog | SwingidError = load(path)
        except SwingidError as error:
            log = error
        momentum = Answers()
        for method in methods:
            results[path, method] = _one(log, rig, method, part, momentum)
    return ResultsTable(results)


def _one(log: Recording | LargeLog | SwingidError, rig: Rig, method: str, part: object, momentum: Answers) -> Result:
    """The result of a log, or its refusal."""
    if isinstance(log, SwingidError):
        return refusal(method, log)
    try:
        return identify_beside(momentum, log, rig, method, part=part)
    except SwingidError as error:
        if isinstance(error, UsageError) and not isinstance(log, LargeLog):
            raise
        return refusal(method, error)
