"""Trials of an experiment on the twin: a run, its log, the rows that all methods answer; and figures of many rows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swingid.errors import SwingidError
from swingid.identification import identify_beside
from swingid.methods.table import Answers
from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.result.result import Parameter

if TYPE_CHECKING:
    from swingid.result.result import Result
    from swingid.study.experiment import Experiment

STILL = 0.01
"""Share of its final value within which the gain k tilde counts as settled."""

AT_LIMIT = 0.999
"""Share of the voltage limit from which on a command counts as saturated."""

Row = dict[str, Any]

Columns = Mapping[str, NDArray[Any]]
"""Rows by column."""

FAILED, REFUSED = "failed", "refused"
"""Status of a row where there was no log, and where the method has no number; others are those of a result."""


@dataclass(frozen=True)
class Loop:
    """Measures of one run; NaN where there is no loop.

    wanted, tracking: RMS of y_m less its mean, and of y_m - q1, over the second half (rad). k_tilde: the gain at the
    end. settling (s): since when k tilde is within 1 % of it. chatter: RMS of the voltage's change from sample to
    sample over the second half (V; direct drive N m). saturated: share of the second half at the voltage's limit.
    """

    wanted: float = np.nan
    tracking: float = np.nan
    k_tilde: float = np.nan
    settling: float = np.nan
    chatter: float = np.nan
    saturated: float = np.nan


def loop_of(log: Recording, limit: float | None) -> Loop:
    """The measures of a log that holds its reference and its gain. limit: of the voltage, None for none."""
    if log.reference is None or log.adaptive_gain is None:
        return Loop()
    half = slice(len(log) // 2, None)
    gain = log.adaptive_gain
    far = np.flatnonzero(np.abs(gain - gain[-1]) > STILL * abs(gain[-1]))
    settled = log.time[far[-1] + 1] - log.time[0] if len(far) else 0.0
    commands = log.voltage if log.voltage is not None else log.torque
    chatter = saturated = np.nan
    if commands is not None:
        chatter = float(np.sqrt(np.mean(np.diff(commands[half]) ** 2)))
        saturated = 0.0 if limit is None else float(np.mean(np.abs(commands[half]) >= AT_LIMIT * limit))
    tracking = float(np.sqrt(np.mean((log.reference - log.angle)[half] ** 2)))
    return Loop(float(np.std(log.reference[half])), tracking, float(gain[-1]), float(settled), chatter, saturated)


@dataclass(frozen=True)
class Head:
    """What all rows of a trial have in common: its place, the twin's true values, measures of the loop, bounds."""

    place: Row = field(default_factory=dict)
    truth: Row = field(default_factory=dict)
    loop: Loop = field(default_factory=Loop)
    bounds: dict[str, float] = field(default_factory=dict)

    def row(
        self,
        method: str,
        quantity: str,
        estimate: Parameter | Exception | None,
        status: str = "ok",
        warnings: Iterable[str] = (),
    ) -> Row:
        """A row with a number, with the reason why there is none, or with neither."""
        nothing = dict.fromkeys(("value", "u", "low", "high", "error"), math.nan)
        code, message = "", ""
        if isinstance(estimate, SwingidError):
            code, message = estimate.code, estimate.message
        elif isinstance(estimate, Exception):
            code, message = f"bug-{type(estimate).__name__}", " ".join(str(estimate).split())[:200]
        over, _, under = quantity.partition("/")  # a parameter, or a ratio such as "gravity_torque/inertia"
        truth = _number(self.truth.get(over)) / (_number(self.truth.get(under)) if under else 1.0)
        row = {
            **self.place,
            "method": method,
            "quantity": quantity,
            "status": status,
            "code": code,
            "message": message,
            "warnings": " ".join(sorted(set(warnings))),
            "truth": truth,
            **nothing,
            "bound": self.bounds.get(quantity, math.nan),
            **asdict(self.loop),
        }
        if estimate is None or isinstance(estimate, Exception):
            return row
        low, high = estimate.interval95 or (math.nan, math.nan)
        u = math.nan if estimate.standard_uncertainty is None else estimate.standard_uncertainty
        error = estimate.value / truth - 1 if truth else math.nan
        return row | {"value": estimate.value, "u": u, "low": low, "high": high, "error": error}


def rows_of(
    head: Head,
    experiment: Experiment,
    log: Recording,
    quantities: Sequence[str] = ("inertia",),
    caught: tuple[type[Exception], ...] = (Exception,),
) -> list[Row]:
    """The rows of one log of the twin, one per method and quantity; `caught`: errors that become rows."""
    motor, truth = experiment.twin.drive.motor, log.metadata["truth"]
    assert isinstance(truth, dict)
    loop = loop_of(log, None if motor is None else motor.voltage_limit)
    head = replace(head, truth=truth, loop=loop)
    if not experiment.methods:
        return [head.row("", q, None) for q in quantities]
    rows = []
    try:
        known = experiment.read(log)
    except caught as error:
        return [head.row(name, q, error, FAILED) for name, _, _ in experiment.methods for q in quantities]
    momentum = Answers()
    for name, method, options in experiment.methods:
        try:
            result: Result | Exception = identify_beside(momentum, known, experiment.stated, method, **options)
        except caught as error:
            result = error
        rows += [_answer(head, name, q, result) for q in quantities]
    return rows


def _answer(head: Head, name: str, quantity: str, result: Result | Exception) -> Row:
    if isinstance(result, Exception):
        return head.row(name, quantity, result, REFUSED)
    if quantity not in result.parameters:
        missing = SwingidError(f"{name} does not identify {quantity}", code="not-identified")
        return head.row(name, quantity, missing, REFUSED)
    warnings = (warning.code for warning in result.warnings)
    return head.row(name, quantity, result.parameters[quantity], result.status, warnings)


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def columns_of(rows: Sequence[Row]) -> Columns:
    """The columns of rows that have the same keys."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


@dataclass(frozen=True)
class Expectation:
    """What to expect of one method: relative errors of the inertia, and half-widths of its 95 % intervals, per run.

    refusals, warnings: how many runs had which code.
    """

    method: str
    errors: Array
    half_widths: Array
    refusals: dict[str, int]
    warnings: dict[str, int]

    @classmethod
    def of(cls, method: str, columns: Columns) -> Expectation:
        """Summarise rows of one method and quantity; where the truth is 0 there is no relative error."""
        truth = np.where(columns["truth"] == 0.0, np.nan, columns["truth"])
        return cls(
            method,
            columns["value"] / truth - 1,
            np.abs((columns["high"] - columns["low"]) / 2 / truth),
            dict(Counter(code for code in columns["code"].tolist() if code)),
            dict(Counter(code for text in columns["warnings"].tolist() for code in text.split())),
        )

    @property
    def answered(self) -> int:
        """Number of runs with a number."""
        return int(np.isfinite(self.errors).sum())

    @property
    def bias(self) -> float:
        """Mean relative error."""
        return float(np.nanmean(self.errors)) if self.answered else float("nan")

    @property
    def rmse(self) -> float:
        """Root of the mean square of the relative error."""
        return float(np.sqrt(np.nanmean(self.errors**2))) if self.answered else float("nan")

    @property
    def p95(self) -> float:
        """95th percentile of the absolute relative error."""
        return float(np.nanquantile(np.abs(self.errors), 0.95)) if self.answered else float("nan")

    @property
    def half_width(self) -> float:
        """Median relative half-width of the 95 % interval; NaN where no run has one."""
        known = self.half_widths[np.isfinite(self.half_widths)]
        return float(np.median(known)) if len(known) else float("nan")

    @property
    def coverage(self) -> tuple[float, float]:
        """Share of the intervals that contain the true value, and its binomial standard error (Agresti and Coull)."""
        known = np.isfinite(self.half_widths)
        count = int(known.sum())
        if not count:
            return float("nan"), float("nan")
        hits = int((np.abs(self.errors[known]) <= self.half_widths[known]).sum())
        # two more of each keep the error from vanishing at 100 %
        share = (hits + 2) / (count + 4)
        return hits / count, float(np.sqrt(share * (1 - share) / (count + 4)))
