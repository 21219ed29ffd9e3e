"""The result of an identification: its data, its text, its picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from swingid.errors import SwingidError
from swingid.result.data import SCHEMA, Convergence, Details, FrictionCurve, Message, ResultData, SwingSeries
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined
from swingid.uncertainty.freedom import COVERAGE_FACTOR

if TYPE_CHECKING:
    import pandas
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

    def __getitem__(self, name: str) -> Parameter:
        """An identified parameter by its name; KeyError that names those there are for any other."""
        try:
            return self.parameters[name]
        except KeyError:
            raise KeyError(f"{name!r} is not in this result; it has {', '.join(self.parameters) or 'none'}") from None

    def ufloats(self) -> dict[str, Any]:
        """The parameters as ufloats of `uncertainties`, correlated as the result states; see `result.frames`."""
        from swingid.result.frames import as_ufloats

        return as_ufloats(self)

    def to_dataframe(self, *, budget: bool = False) -> pandas.DataFrame:
        """The parameters, or with `budget` the entries of the budget, as a data frame of pandas."""
        from swingid.result.frames import as_frame

        return as_frame(self, budget=budget)

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
