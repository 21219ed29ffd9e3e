"""Numbers as people read them: nothing lost, nothing invented."""

from __future__ import annotations

import math
import re
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swingid.format import interval, noise_of, number, percent, plus_minus, pretty_unit, rounded, span

values = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e30, max_value=1e30)
spreads = st.floats(min_value=1e-30, max_value=1e30)


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (0.00302214, 4.2e-7, "(3.02214 ± 0.00042)e-3 kg m²"),
        (95.1, 0.234, "(95.10 ± 0.23) kg m²"),
        (1234.5, 123.0, "(1.23 ± 0.12)e3 kg m²"),
        (11.34e-5, 5.2e-7, "(113.40 ± 0.52)e-6 kg m²"),
        (0.1, 0.0996, "(0.10 ± 0.10) kg m²"),
        (0.0, 1e-3, "(0.0 ± 1.0)e-3 kg m²"),
        (-3.4e-5, 2e-3, "(0.0 ± 2.0)e-3 kg m²"),
        (9999.7, 0.96, "(9999.70 ± 0.96) kg m²"),
        (0.078, None, "0.078 kg m²"),
        (11.34e-5, None, "113.4e-6 kg m²"),
        (0.00302214, math.nan, "3.02214e-3 kg m²"),
        (math.nan, 1.0, "unknown kg m²"),
    ],
)
def test_value_and_uncertainty_share_place_and_exponent(value: float, uncertainty: float | None, text: str) -> None:
    assert plus_minus(value, uncertainty, "kg*m^2") == text


def test_fine_form_has_true_minus_raised_exponent_and_breaks_only_before_the_power() -> None:
    text = plus_minus(-0.00302214, 4.2e-7, "kg*m^2", fine=True)
    assert text.replace("\u00a0", " ") == "(−3.02214 ± 0.00042) × 10⁻³ kg m²"
    assert text.split(" ") == ["(−3.02214\u00a0±\u00a00.00042)", "×\u00a010⁻³\u00a0kg\u00a0m²"]


@given(values, spreads)
def test_what_is_written_is_the_value_to_half_a_last_place(value: float, uncertainty: float) -> None:
    shown = rounded(value, uncertainty)
    assert shown.uncertainty is not None
    assert shown.exponent % 3 == 0
    power = Decimal(10) ** shown.exponent
    if "e" in shown.uncertainty:  # too small against the value to share its place
        assert uncertainty < 1e-13 * abs(value)
        assert float(Decimal(shown.value) * power) == pytest.approx(value, rel=1e-5)
        return
    place = Decimal(1).scaleb(Decimal(shown.uncertainty).as_tuple().exponent) * power
    assert Decimal(shown.value).as_tuple().exponent == Decimal(shown.uncertainty).as_tuple().exponent
    assert abs(Decimal(shown.value) * power - Decimal(repr(value))) <= place * Decimal("0.5000001")
    assert abs(Decimal(shown.uncertainty) * power - Decimal(repr(uncertainty))) <= place * Decimal("0.5000001")
    digits = shown.uncertainty.replace(".", "").lstrip("0")
    assert len(digits) == 2


@given(values, spreads)
def test_an_interval_contains_its_middle_and_is_ordered(value: float, uncertainty: float) -> None:
    low, high = value - 1.96 * uncertainty, value + 1.96 * uncertainty
    match = re.fullmatch(r"\[(.+), (.+)\](?:e(-?\d+))?", interval((low, high)))
    assert match is not None
    power = Decimal(10) ** int(match[3] or 0)
    shown_low, shown_high = Decimal(match[1]) * power, Decimal(match[2]) * power
    assert shown_low <= shown_high
    if high - low > 1e-10 * max(abs(low), abs(high)):
        tolerance = Decimal(high - low) / 20
        assert abs(shown_low - Decimal(low)) <= tolerance
        assert abs(shown_high - Decimal(high)) <= tolerance


@given(st.floats(min_value=-10, max_value=10))
def test_percent_keeps_two_digits(fraction: float) -> None:
    text = percent(fraction)
    shown = float(text.removesuffix(" %"))
    assert shown == pytest.approx(100 * fraction, rel=0.051, abs=1e-300)


@pytest.mark.parametrize(
    ("fraction", "text"),
    [(0.00014, "+0.014 %"), (-0.0012345, "-0.12 %"), (0.1278, "+13 %"), (0.0, "0 %"), (math.inf, "unknown")],
)
def test_percent_with_sign(fraction: float, text: str) -> None:
    assert percent(fraction, sign=True) == text


def test_an_interval_has_the_power_of_ten_of_its_value() -> None:
    assert plus_minus(903e-6, 55e-6) == "(903 ± 55)e-6"
    assert interval((0.7952e-3, 1.0108e-3)) == "[0.795, 1.011]e-3"
    assert interval((0.7952e-3, 1.0108e-3), middle=903e-6) == "[795, 1011]e-6"


def test_numbers_and_spans_without_uncertainty() -> None:
    assert number(8.5, "rad/s") == "8.5 rad/s"
    assert number(0.000383495, "rad", 3) == "383e-6 rad"
    assert span(-2.996e-4, 5.485e-4, "N m") == "(-299.6 … 548.5)e-6 N m"


@pytest.mark.parametrize(
    ("unit", "pretty"),
    [("kg*m^2", "kg m²"), ("kg m²", "kg m²"), ("N*s**2/m^2", "N s²/m²"), ("s^-1", "s⁻¹"), ("", "")],
)
def test_units_read_as_print(unit: str, pretty: str) -> None:
    assert pretty_unit(unit) == pretty
    assert pretty_unit(pretty) == pretty


def test_noise_that_is_rounding_reads_as_none() -> None:
    assert noise_of(42.3e-21, 1.6, "rad") == "0 rad"
    assert noise_of(0.0, 0.0, "rad") == "0 rad"
    assert noise_of(1.1068e-4, 1.6, "rad") == "111e-6 rad"
