from __future__ import annotations

import math
import re
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swingid.errors import InputError
from swingid.units import Quantity, parse_quantity

finite = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e200, max_value=1e200)


@pytest.mark.parametrize(
    ("raw", "unit", "value", "std"),
    [
        (5e-3, "N*m", 5e-3, None),
        (10, "V", 10.0, None),
        ("5e-3", "N*m", 5e-3, None),
        ("-.5", "rad", -0.5, None),
        ("−2 m", "m", -2.0, None),
        ("1134 ± 5 g*cm^2", "kg*m^2", 1134e-7, 5e-7),
        ("1134+/-5 g cm²", "kg*m^2", 1134e-7, 5e-7),
        ("1134 +- 5 g·cm**2", "kg*m^2", 1134e-7, 5e-7),
        ("(1134 ± 5) g*cm^2", "kg*m^2", 1134e-7, 5e-7),
        ({"value": 1134, "std": 5, "unit": "g*cm^2"}, "kg*m^2", 1134e-7, 5e-7),
        ("1134 g*cm^2 ± 5 g*cm^2", "kg*m^2", 1134e-7, 5e-7),
        ("78e-3 N m ± 0.5 %", "N*m", 0.078, 0.00039),
        ("302.2e-5 ± 5e-5", "kg*m^2", 302.2e-5, 5e-5),
        ("302.2e-5 ± 5e-5 g*cm^2", "kg*m^2", 302.2e-12, 5e-12),
        ("90° +/- 1 °", "rad", math.pi / 2, math.pi / 180),
        ({"value": 4.4}, "", 4.4, None),
        (Quantity(3.0, 0.1), "s", 3.0, 0.1),
        ("0.1 deg", "rad", math.radians(0.1), None),
        ("90°", "rad", math.pi / 2, None),
        ("2 turns", "rad", 4 * math.pi, None),
        ("60 rpm", "rad/s", 2 * math.pi, None),
        ("0 ± 0.3 ms", "s", 0.0, 3e-4),
        ("20 us", "s", 2e-5, None),
        ("20 µs", "s", 2e-5, None),
        ("78e-3 ± 0.5 % N m", "N*m", 0.078, 0.00039),
        ("-4 ± 25 % N", "N", -4.0, 1.0),
        ("90 %", "", 0.9, None),
        ("78 ± 1 mNm", "N*m", 0.078, 0.001),
        ("1 mN*m/(deg/s)", "N*m*s", 0.18 / math.pi, None),
        ("2 kHz", "Hz", 2000.0, None),
        ("2 N m s^(3/2)", "N m s^1.5", 2.0, None),
        ("2 N m s^(-1/2)", "N m s^-0.5", 2.0, None),
        ("3 J", "N*m", 3.0, None),
        ("2 lb in^2", "kg*m^2", 2 * 0.45359237 * 0.0254**2, None),
    ],
)
def test_reads_what_people_write(raw: object, unit: str, value: float, std: float | None) -> None:
    found = parse_quantity(raw, unit, "key")
    assert found.value == pytest.approx(value, rel=1e-14)
    assert found.std == (None if std is None else pytest.approx(std, rel=1e-14))


@pytest.mark.parametrize(
    ("raw", "unit", "words"),
    [
        (True, "s", "true"),
        (None, "s", "number"),
        ([1, 2], "s", "number"),
        (math.nan, "s", "finite"),
        (-math.inf, "s", "finite"),
        (10**400, "s", "too large"),
        ("nan", "s", "no quantity"),
        ("1e999 s", "s", "finite"),
        ("1e305 km", "mm", "finite"),
        ("", "s", "no quantity"),
        ("fast", "s", "no quantity"),
        ("1,134 s", "s", "write 1.134 or 1134"),
        ("1,134 ± 0.5 s", "s", "write 1.134 or 1134"),
        ("1,5 ± 0.1 s", "s", "write decimal points"),
        ("1.134,5 s", "s", "unit"),
        ("1,134,567 s", "s", "unit"),
        ("1 ± 2 ± 3 s", "s", "unit"),
        ("(1 ± 2 s", "s", "no quantity"),
        ("1 ± -2 s", "s", "-2"),
        ({"value": 1, "std": -1}, "s", "-1"),
        ({"value": "1 s"}, "s", "number"),
        ({"std": 1}, "s", "value"),
        ({"value": 1, "unit": 3}, "s", "unit"),
        ({"value": 1, "error": 3}, "s", "error"),
        ("4 g ± 5 mg", "kg", "unit"),
        ("4 gr", "kg", "gram"),
        ("4 kg", "kg*m^2", "'kg', but is expected in kg*m^2"),
        ("4 rad", "", "'rad'"),
        ("5 ± 1 %", "", "%"),
        ("4 %", "rad", "%"),
        ("4 foo", "s", "'foo'"),
        ("4 degC", "s", "'degC'"),
        ("4 dB", "rad", "'dB'"),
        ("2 Hz", "rad/s", "rad/s"),
        ("4 9^9^9^9 s", "s", "unit"),
        ("4 s^s", "s", "unit"),
        ("4 " + "s  " * 80 + "!", "s", "no quantity"),
    ],
)
def test_refuses_what_has_no_meaning(raw: object, unit: str, words: str) -> None:
    with pytest.raises(InputError, match=r"^drive\.wheel\.inertia ") as refused:
        parse_quantity(raw, unit, "drive.wheel.inertia")
    assert words in refused.value.message
    assert len(refused.value.message) < 250
    assert "\n" not in refused.value.message


@given(
    whole=st.integers(0, 10**6),
    digits=st.text("0123456789", min_size=1, max_size=6).filter(lambda text: len(text) != 3),
    std=st.integers(0, 99),
    unit=st.sampled_from(["", " g", " mN*m", " kg * 9,81 m/s^2"]),
)
def test_reads_decimal_commas_as_points(whole: int, digits: str, std: int, unit: str) -> None:
    text = f"{whole},{digits} ± 0,{std:02d}{unit}"
    expected = {"": "kg", " g": "kg", " mN*m": "N*m"}.get(unit, "N")
    assert parse_quantity(text, expected, "k") == parse_quantity(text.replace(",", "."), expected, "k")


@given(value=finite, std=st.none() | finite.map(abs), sign=st.sampled_from(["±", "+/-", " +- "]))
def test_round_trip_in_si(value: float, std: float | None, sign: str) -> None:
    text = f"{value!r}" + ("" if std is None else f"{sign}{std!r}")
    assert parse_quantity(f"{text} kg*m^2", "kg*m^2", "k") == Quantity(value, std)
    assert parse_quantity(str(Quantity(value, std)), "kg*m^2", "k") == Quantity(value, std)


@given(
    value=st.floats(1e-9, 1e9),
    std=st.floats(0, 1e9),
    unit=st.sampled_from([("g*cm^2", 1e-7), ("kg mm^2", 1e-6), ("kg/m^-2", 1.0), ("t*m**2", 1e3), ("N*m*s^2", 1.0)]),
)
def test_round_trip_through_units(value: float, std: float, unit: tuple[str, float]) -> None:
    found = parse_quantity(f"{value!r} ± {std!r} {unit[0]}", "kg*m^2", "k")
    assert found.value == pytest.approx(value * unit[1], rel=1e-12)
    assert found.std == pytest.approx(std * unit[1], rel=1e-12)


tokens = st.sampled_from(
    [
        "1",
        "2.5",
        "e9",
        "±",
        "+/-",
        "%",
        " ",
        "  ",
        "^",
        "**",
        "*",
        "/",
        "(",
        ")",
        "-",
        "m",
        "kg",
        "if",
        "lambda",
        "s",
        "°",
        "µ",
        "9",
    ]
)


@settings(max_examples=300, deadline=None)
@given(
    raw=st.text(max_size=40)
    | st.lists(tokens, max_size=12).map("".join)
    | st.floats()
    | st.dictionaries(st.text(max_size=5), st.text(max_size=5))
)
def test_garbage_is_a_quantity_or_an_input_error(raw: object) -> None:
    try:
        found = parse_quantity(raw, "N*m", "key")
    except InputError as error:
        message = error.message
    else:
        message = "key is fine"
        assert math.isfinite(found.value)
    assert message.startswith("key ")


def test_pint_waits_for_a_foreign_unit() -> None:
    script = (
        "import sys; from swingid.units import parse_quantity as p\n"
        "p(1.5, 's', 'k'); p('1 ± 2', 's', 'k'); p('3 rad/s', 'rad/s', 'k'); assert 'pint' not in sys.modules\n"
        "p('3 ms', 's', 'k'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize(
    ("text", "unit", "value", "std"),
    [
        ("0.107 kg * 9.81 m/s^2 * 0.23 m", "N*m", 0.107 * 9.81 * 0.23, None),
        ("0.1 ± 0.001 kg * 10 m/s² * 0.2 ± 0.001 m", "N*m", 0.2, math.hypot(0.01, 0.005) * 0.2),
        ("(0.5 ± 0.01) kg * (10 cm)^2 / 12", "kg*m^2", 0.005 / 12, 1e-4 / 12),
        ("1/2 * 0.3 kg * (5 ± 0.1 % cm)^2", "kg*m^2", 3.75e-4, 7.5e-7),
        ("0.98 ± 0.03 m - 50 ± 4 cm", "m", 0.48, 0.05),
        ("2 * 30 deg", "rad", math.pi / 3, None),
        ("1 / 0.2 s", "rad/s", 5.0, None),
        ("3 * 5 %", "", 0.15, None),
        ("2·3 × 4", "", 24.0, None),
    ],
)
def test_a_calculation_with_quantities(text, unit, value, std):
    found = parse_quantity(text, unit, "key")
    assert found.value == pytest.approx(value, rel=1e-12)
    assert found.std == (None if std is None else pytest.approx(std, rel=1e-9))


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        ("1 kg * 2", "kg*m^2", "in kg, but is expected in kg*m^2"),
        ("3 kg + 2 m", "kg", "adds kg and m"),
        ("0.98 - 0.5 m", "m", "adds pure numbers and m"),
        ("1/0", "", "divides by zero"),
        ("(2 * 3", "", "cannot be read at its end"),
        ("2 * 3 )", "", "cannot be read at"),
        ("1e200 * 1e200 kg", "kg", "finite"),
        ("2 * 20 degC", "kg", "another zero"),
        ("2 * 3 parsnips", "kg", "unknown unit 'parsnips'"),
        ("3 * 5 Hz", "rad/s", "angular speed"),
        ("0.5 ± -1 kg * 2", "kg", "not negative"),
        ("2026-11-22", "", "pure number"),
        ("0.1 kg x 2", "kg", "write decimal points, * / ^ between the factors"),
        ("2 kg+1 kg", "kg", "blanks around + and -"),
        ("12/255", "V", "which is a pure number, but is expected in V"),
        ("2 kg * 9.81 m/s^2) * (3 m", "N*m", "unknown unit 'm/s^2)'"),
    ],
)
def test_what_is_no_calculation_is_one_sentence(text, unit, said):
    with pytest.raises(InputError, match=re.escape(said)) as raised:
        parse_quantity(text, unit, "axis.gravity_torque")
    assert str(raised.value).startswith("axis.gravity_torque ")


@given(st.text(alphabet="0123456789.eE+-*/^()± kgms", max_size=40))
def test_any_text_is_a_quantity_or_an_error_of_input(text):
    try:
        found = parse_quantity(text, "kg", "k")
    except InputError:
        return
    assert math.isfinite(found.value)
