"""What many runs say of a method: bias, RMSE, coverage, widths, efficiency, each with its own standard error."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.study.rehearse.rehearsal import Expectation


@dataclass(frozen=True)
class Answers:
    """What one method said of one quantity in n runs: arrays (n,), NaN where it did not.

    point: of the plan. truth, value: SI. half_width: of the 95 % interval (SI). bound: least standard deviation (SI).
    codes: of refusals and failures, "" else; warnings: codes with blanks between.
    """

    point: Ints
    truth: Array
    value: Array
    half_width: Array
    bound: Array
    codes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def errors(self) -> Array:
        """Relative errors, NaN where the truth is 0."""
        return self.relative(self.value) - 1

    def relative(self, values: Array) -> Array:
        """Values in units of the truth, NaN where that is 0."""
        size = np.where(self.truth == 0.0, np.nan, self.truth)
        result: Array = values / size
        return result


@dataclass(frozen=True)
class Statistics:
    """Figures of one method. Errors and widths are relative to the truth; each with its standard error, NaN if unknown.

    coverage: share of the 95 % intervals that hold the truth, with its binomial error (Agresti and Coull). width:
    median half-width over RMSE, 1.96 where intervals are right and errors normal. efficiency: Cramér and Rao's
    variance over the mean squared error, 1 at best. Over several points, each error counts in its own point's median
    half-width and its own run's bound.
    """

    runs: int
    answered: int
    bias: tuple[float, float]
    rmse: tuple[float, float]
    p95: float
    coverage: tuple[float, float]
    half_width: float
    width: float
    efficiency: tuple[float, float]
    refusals: dict[str, int] = field(default_factory=dict)
    warnings: dict[str, int] = field(default_factory=dict)


def statistics_of(answers: Answers, method: str = "") -> Statistics:
    """The figures of some answers."""
    errors = answers.errors
    refusals = dict(Counter(code for code in answers.codes if code))
    warnings = dict(Counter(code for text in answers.warnings for code in text.split()))
    seen = Expectation(method, errors, np.abs(answers.relative(answers.half_width)), refusals, warnings)
    known = errors[np.isfinite(errors)]
    squares = known**2
    count = len(known)
    rmse, spread = seen.rmse, _error_of_mean(squares)
    return Statistics(
        runs=len(errors),
        answered=seen.answered,
        bias=(seen.bias, _error_of_mean(known)),
        rmse=(rmse, spread / (2 * rmse) if count > 1 and rmse > 0 else float("nan")),
        p95=seen.p95,
        coverage=seen.coverage,
        half_width=seen.half_width,
        width=_width(answers),
        efficiency=_efficiency(answers),
        refusals=refusals,
        warnings=warnings,
    )


def _error_of_mean(values: Array) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


def _width(answers: Answers) -> float:
    """Median half-width over the root mean square of the errors."""
    widths = np.full(len(answers.value), np.nan)
    for point in np.unique(answers.point):
        own = (answers.point == point) & np.isfinite(answers.half_width)
        if own.any():
            widths[own] = np.median(answers.half_width[own])
    shares = ((answers.value - answers.truth) / widths)[widths > 0]
    size = float(np.mean(shares**2)) if len(shares) else 0.0
    return size**-0.5 if size > 0 else float("nan")


def _efficiency(answers: Answers) -> tuple[float, float]:
    """Least mean squared error over that of the errors, and its standard error."""
    squares = ((answers.value - answers.truth) / answers.bound)[np.isfinite(answers.value)] ** 2
    if not len(squares) or not np.isfinite(squares).all() or not np.mean(squares) > 0:
        return float("nan"), float("nan")
    mean = float(np.mean(squares))
    return 1 / mean, _error_of_mean(squares) / mean**2
