"""The result of an identification: its data, its text, its picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import SwingidError, UnanswerableError
from swingid.result.data import SCHEMA, Convergence, Details, FrictionCurve, Message, ResultData, SwingSeries
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined
from swingid.uncertainty.freedom import COVERAGE_FACTOR

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas
    from matplotlib.axes import Axes

    from swingid.numerics.arrays import Array

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
    """The result of one method from one log, see `ResultData`; per_log holds those of several logs.

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper")
    >>> log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25, seed=1)
    >>> result = sw.identify(log, rig)
    >>> low, high = result["inertia"].interval95
    >>> low < log.truth["inertia"] < high
    True
    >>> [entry.type for entry in result.budget if entry.parameter == "inertia"][:1]
    ['A']
    """

    per_log: tuple[Result, ...] = ()

    def __getitem__(self, name: str) -> Parameter:
        """An identified parameter by its name; KeyError that names those there are for any other."""
        try:
            return self.parameters[name]
        except KeyError:
            raise KeyError(f"{name!r} is not in this result; it has {', '.join(self.parameters) or 'none'}") from None

    @property
    def residuals(self) -> Array:
        """Residuals of the fit (n,), read-only: N m (N) of each window, or as `details.residual_unit` says.

        Their times (s) are `details.residual_times`. It is empty where the method or the result has none.
        """
        return np.empty(0) if self.details is None else self.details.residuals

    def covariance(self, names: Sequence[str] | None = None) -> Array:
        """Covariance (k, k) of the named parameters, of type A and B together, in products of their units.

        By default of all parameters whose uncertainty is known, in the order of `parameters`. Raises KeyError for a
        name that is not there, UnanswerableError for a parameter of unknown uncertainty. `covariance_of_fit` is
        that of type A alone.

        Examples
        --------
        >>> import swingid as sw
        >>> rig = sw.Rig.load("paper").changed({"axis.gravity_torque": "unknown"})
        >>> two = sw.parse_reference("multisine 0.5 rad 5 rad/s + 0.3 rad 8.5 rad/s")
        >>> result = sw.identify(sw.simulate(sw.Rig.load("paper"), two, duration=25, seed=1), rig)
        >>> matrix = result.covariance(["inertia", "gravity_torque"])
        >>> matrix.shape, bool(matrix[0, 0] ** 0.5 == result.inertia.u)
        ((2, 2), True)
        """
        if names is None:
            names = [name for name, parameter in self.parameters.items() if parameter.standard_uncertainty is not None]
        spread = [self[name].standard_uncertainty for name in names]
        if None in spread:
            unknown = names[spread.index(None)]
            raise UnanswerableError(f"the uncertainty of {unknown} is unknown; leave it out.", code="no-covariance")
        r = [[1.0 if a == b else self.correlation.get(a, {}).get(b, 0.0) for b in names] for a in names]
        u = np.array(spread, dtype=np.float64)
        return np.array(r).reshape(len(u), len(u)) * np.outer(u, u)

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
