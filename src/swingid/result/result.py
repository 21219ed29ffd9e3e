"""The result of an identification: its data, its text, its picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from swingid.errors import SwingidError
from swingid.result.data import SCHEMA, Convergence, Details, FrictionCurve, Message, ResultData, SwingSeries
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined
from swingid.uncertainty.freedom import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "COVERAGE_FACTOR",
    "SCHEMA",
    "BudgetEntry",
    "Convergence",
    "Details",
    "FrictionCurve",
    "Message",
    "Parameter",
    "Result",
    "SwingSeries",
    "combined",
    "refusal",
]


@dataclass(frozen=True)
class Result(ResultData):
    """The result of one method from one log, see `ResultData`; per_log holds those of several logs."""

    per_log: tuple[Result, ...] = ()

    def summary(self) -> str:
        """A report to read, in the manner of lmfit's ``fit_report``."""
        from swingid.result.summary import summarise

        return summarise(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the inertia of every swing with the estimate and its interval; returns the axes."""
        from swingid.result.plot import plot_result

        return plot_result(self, ax)


def refusal(method: str, error: SwingidError, provenance: dict[str, object] | None = None) -> Result:
    """The result without a number, with the reason."""
    return Result(
        method=method,
        status="refused",
        error=Message(error.code, error.message),
        provenance=provenance or {},
    )
