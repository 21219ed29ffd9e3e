"""A result for other packages: values of `uncertainties` that know their correlation, and data frames of pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from swingid.errors import missing_package

if TYPE_CHECKING:
    import pandas

    from swingid.result.data import ResultData

EXTRA = "exchange"


def as_ufloats(result: ResultData) -> dict[str, Any]:
    """All parameters whose uncertainty is known, as ufloats with the correlation of the result.

    Raises InputError without the extra `exchange`.
    """
    known = {
        name: parameter for name, parameter in result.parameters.items() if parameter.standard_uncertainty is not None
    }
    single = {name: parameter.ufloat() for name, parameter in known.items()}
    together = [name for name in known if name in result.correlation]
    if len(together) < 2:
        return single
    from uncertainties import correlated_values_norm

    matrix = [[result.correlation[first][second] for second in together] for first in together]
    pairs = [(known[name].value, known[name].standard_uncertainty) for name in together]
    return single | dict(zip(together, correlated_values_norm(pairs, matrix), strict=True))


def as_frame(result: ResultData, *, budget: bool) -> pandas.DataFrame:
    """One row per parameter by its name, or with `budget` one per entry of the budget; unknown numbers are NaN.

    Raises InputError without the extra `exchange`.
    """
    try:
        import pandas
    except ImportError:
        raise missing_package("a data frame", "pandas", EXTRA) from None
    if budget:
        return pandas.DataFrame([entry.to_dict() for entry in result.budget])
    rows: dict[str, dict[str, object]] = {}
    for name, parameter in result.parameters.items():
        low, high = parameter.interval95 or (None, None)
        rows[name] = parameter.to_dict() | {"low": low, "high": high}
        del rows[name]["interval95"]
    frame = pandas.DataFrame.from_dict(rows, orient="index")
    frame.index.name = "parameter"
    numbers = [name for name in frame.columns if name != "unit"]
    return frame.astype(dict.fromkeys(numbers, float))
