"""Results in the types of uncertainties and pandas: the same numbers, and the correlation of the fit."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import factories
from swingid.errors import UnanswerableError

uncertainties = pytest.importorskip("uncertainties", reason="needs pip install 'swingid[exchange]'")
pytest.importorskip("pandas", reason="needs pip install 'swingid[exchange]'")


def test_a_ufloat_has_value_and_standard_uncertainty() -> None:
    result = factories.clean_result()
    found = result["inertia"].ufloat()
    assert found.nominal_value == 3.0228e-3
    assert found.std_dev == pytest.approx(math.sqrt(41e-12))
    with pytest.raises(UnanswerableError, match="unknown"):
        result["stribeck_speed"].ufloat()
    with pytest.raises(KeyError, match="it has inertia, viscous"):
        result["mass"]


def test_correlated_parameters_stay_so() -> None:
    """u(x - y)² = u² + w² - 2 r u w."""
    result = factories.clean_result()
    correlation = {"inertia": {"inertia": 1.0, "viscous": 0.5}, "viscous": {"inertia": 0.5, "viscous": 1.0}}
    found = replace(result, correlation=correlation).ufloats()
    u, w = math.sqrt(41e-12), 3e-5
    assert (found["inertia"] - found["viscous"]).std_dev == pytest.approx(math.sqrt(u**2 + w**2 - u * w))
    assert set(found) == {"inertia", "viscous"}
    apart = result.ufloats()
    assert (apart["inertia"] - apart["viscous"]).std_dev == pytest.approx(math.hypot(u, w))


def test_data_frames_have_the_numbers_of_the_json() -> None:
    result = factories.clean_result()
    frame = result.to_dataframe()
    assert list(frame.index) == list(result.parameters)
    assert frame.loc["inertia", "value"] == result["inertia"].value
    assert (frame.loc["inertia", "low"], frame.loc["inertia", "high"]) == result["inertia"].interval95
    assert frame.loc["viscous", "unit"] == "N m s"
    assert math.isnan(frame.loc["stribeck_speed", "standard_uncertainty"])
    budget = result.to_dataframe(budget=True)
    assert list(budget["source"]) == [one.source for one in result.budget]
    assert budget["sensitivity"].iloc[0] == 20.0
