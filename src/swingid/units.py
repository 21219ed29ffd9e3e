"""Numbers as people write them, "1134 ± 5 g*cm^2", into SI values with a standard uncertainty.

Value, ± and unit are split here; pint sees the unit alone (it reads "1134 ± 5" as a product), and is imported
only when there is a unit that differs from the expected one. Only at the door: inside, everything is SI.

Products, quotients, powers and sums of such numbers are read as well: "0.107 ± 0.001 kg * 9.81 m/s^2 * 0.23 m".
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from tokenize import TokenError
from typing import Any

from swingid.errors import InputError
from swingid.quantity_text import LONGEST, NUMBER, UnusableError, shown, with_points, with_unit_last
from swingid.uncertainty.budget import stated
from swingid.uncertainty.uncertain import Uncertain

_QUANTITY = re.compile(
    rf"(?P<open>\()?\s*(?P<value>{NUMBER})\s*"
    rf"(?:(?:±|\+/-|\+-)\s*(?P<std>{NUMBER})\s*(?P<percent>%)?\s*)?"
    r"(?(open)\))\s*(?P<unit>.*)",
    re.DOTALL,
)
_TERM = re.compile(rf"\s*(?P<value>{NUMBER})\s*(?:(?:±|\+/-|\+-)\s*(?P<std>{NUMBER})\s*(?P<percent>%)?)?\s*")
_OPERATOR = re.compile(r"[*/]\s*\(?\s*\.?[0-9]|\s[+-]\s|\)\s*[*/^]")
# Names, whole and half powers, products and quotients: pint would also evaluate 9^9^9^9, so it never sees other text.
_NAME = r"(?:[A-Za-zµμΩ]+(?: ?(?:\^|\*\*) ?(?:\(?[+-]?(?:[1-9](?:\.5)?|0\.5)\)?|\([+-]?[1-9] ?/ ?2\)))?)"
_UNIT = re.compile(rf"(?:1 ?/ ?)?\(?{_NAME}(?:(?: ?[*/] ?| )\(?{_NAME}\)?)*\)?")
_HERTZ = re.compile(r"Hz|hertz")
_GRAIN = re.compile(r"\bgr\b")  # 65 mg; people write it for the gram
_NO_FREQUENCY = "is given in {}, but is an angular speed; write rad/s, deg/s or turns/s"

SHARES = {"%": 0.01, "ppm": 1e-6}
"""Units of pure numbers."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """An SI value with its standard uncertainty `std`; None: none was stated, the value counts as exact.

    parts: of what was computed from several stated numbers, how much each contributes to `std`, by its key.
    """

    value: float
    std: float | None = None
    parts: tuple[tuple[str, float], ...] = field(default=(), compare=False, repr=False)

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        return repr(self.value) if self.std is None else f"{self.value!r} ± {self.std!r}"

    @classmethod
    def of(cls, uncertain: Uncertain) -> Quantity:
        """What was computed from stated numbers; exact where none of them had an uncertainty."""
        parts = tuple((key, abs(shift)) for key, shift in uncertain.shifts.items())
        return cls(uncertain.value, uncertain.u if uncertain.shifts else None, parts if len(parts) > 1 else ())

    def uncertain(self, key: str) -> Uncertain:
        """The value with its source, whose name and identity is the key, where an uncertainty was stated."""
        if self.std is None:
            return Uncertain(self.value)
        return Uncertain.of(self.value, self.std, stated(key, key, self.std or None))


class UnknownScale(Quantity):
    """A constant that would set the scale and is "unknown": 1 in units of itself, so that what follows are ratios."""


def parse_quantity(raw: object, unit: str, key: str) -> Quantity:
    """The SI Quantity that `raw` states, where `unit` is the SI unit expected ("" for a pure number).

    `raw` is a number (SI already), text such as "1134 ± 5 g*cm^2" (also "+/-" and "+-", "(1134 ± 5) g*cm^2",
    "1134 g*cm^2 ± 5 g*cm^2", and "78e-3 ± 0.5 % N*m" or "78e-3 N*m ± 0.5 %", where the uncertainty is relative to the
    value), a calculation with such numbers, all independent, as "0.107 ± 0.001 kg * 9.81 m/s^2 * 0.23 m" (sums with
    blanks around + and -), a table {value=, std=, unit=} (std in the same unit), or a Quantity. What follows ± is one
    standard uncertainty. Pure numbers take "%" as a unit, angles rad, deg (°) and turns. A decimal comma is read
    ("1,5 g") unless it could part thousands ("1,134 g"), which is refused.

    Raises InputError that names `key`, for text that is no quantity, for values that are not finite, negative
    uncertainties, and units that are unknown or of another dimension. With key "" its message is the predicate
    of a sentence, for callers that know better how to name the place.
    """
    try:
        return _read(raw, unit)
    except UnusableError as problem:
        raise InputError(f"{key} {problem.message}".strip(), code=problem.code) from None


def _read(raw: object, unit: str) -> Quantity:
    raw = with_unit_last(with_points(raw)) if isinstance(raw, str) else raw
    if isinstance(raw, str) and _is_calculation(raw):
        return _Calculation(raw).result(unit)
    if isinstance(raw, Quantity):
        value, std, given = raw.value, raw.std, ""
    elif isinstance(raw, str):
        value, std, given = _split(raw, unit)
    elif isinstance(raw, Mapping):
        value, std, given = _from_table(raw, unit)
    else:
        value, std, given = _number(raw, unit), None, ""
    if not math.isfinite(value) or (std is not None and not math.isfinite(std)):
        raise UnusableError("not-finite", f"must be finite, not {shown(raw)}")
    if std is not None and std < 0:
        raise UnusableError(
            "negative-uncertainty", f"has the uncertainty {std:g}; give one standard uncertainty, which is not negative"
        )
    factor = _factor(given, unit)
    value, std = value * factor, None if std is None else std * factor
    if not math.isfinite(value) or (std is not None and not math.isfinite(std)):
        raise UnusableError("not-finite", f"must be finite in {unit or 'its unit'}, not {shown(raw)}")
    return Quantity(value, std, raw.parts if isinstance(raw, Quantity) else ())


def _is_calculation(text: str) -> bool:
    """Return whether a text is more than one number with its uncertainty and unit."""
    text = _plain(text) if len(text) <= LONGEST else ""
    match = _QUANTITY.fullmatch(text)
    simple = match is not None and (match["unit"].strip() == "" or _UNIT.fullmatch(match["unit"].strip()) is not None)
    return not simple and _OPERATOR.search(text) is not None


_SI_NAMES = "write units as kg, g, m, mm, s, N, N*m, rad, deg"
_ADVICE_OF_CALCULATION = (
    'write decimal points, * / ^ between the factors and blanks around + and -, as in "9.81 m/s^2 * (0.1 ± 0.001 kg * '
    '0.2 m + 0.03 kg * 17 cm)"'
)


class _Calculation:
    """A sum of products of quantities, read by recursive descent; all numbers in it are independent (GUM 5.1.2).

    Its parts are quantities of pint in base units, with a source for each standard uncertainty that was stated.
    """

    def __init__(self, text: str) -> None:
        self.shown, self.text, self.at = shown(text), _plain(text), 0

    def result(self, expected: str) -> Quantity:
        """The Quantity in the expected SI unit. Raises UnusableError."""
        registry = _registry()
        try:
            total = self._sum()
        except OverflowError:
            raise UnusableError("not-finite", f"must be finite, not {self.shown}") from None
        except ZeroDivisionError:
            raise UnusableError("not-finite", "divides by zero") from None
        if self.at < len(self.text):
            raise self._unreadable()
        target = registry.parse_units(expected or "dimensionless")
        if "rad" in expected and _HERTZ.search(self.text):
            raise UnusableError("wrong-unit", _NO_FREQUENCY.format(self.shown))
        if total.dimensionality != target.dimensionality:
            given = f"in {text}" if (text := f"{total.units:~P}") else "a pure number"
            raise UnusableError(
                "wrong-unit", f"is {self.shown}, which is {given}, but is expected in {expected or 'no unit'}"
            )
        whole = Quantity.of(total.magnitude * float(registry.convert(1.0, total.units, target)))
        if not (math.isfinite(whole.value) and math.isfinite(whole.std or 0.0)):
            raise UnusableError("not-finite", f"must be finite, not {self.shown}")
        return whole

    def _unreadable(self) -> UnusableError:
        rest = self.text[self.at :][:30]
        where = f"at {rest!r}" if rest else "at its end"
        return UnusableError(
            "not-a-quantity", f"is {self.shown}, which cannot be read {where}; {_ADVICE_OF_CALCULATION}"
        )

    def _took(self, pattern: str) -> str | None:
        """The text that matches here, which is passed, without blanks around it."""
        match = re.compile(pattern).match(self.text, self.at)
        if match is None:
            return None
        self.at = match.end()
        return match[0].strip()

    def _sum(self) -> Any:
        total = self._product()
        while sign := self._took(r" [+-] "):
            more = self._product()
            if total.dimensionality != more.dimensionality:
                added = f"adds {total.units:~P} and {more.units:~P}".replace("  ", " pure numbers ")
                raise UnusableError("wrong-unit", added)
            total = total + more if sign == "+" else total - more
        return total

    def _product(self) -> Any:
        product = self._power()
        while operator := self._took(r" ?[*/] ?"):
            factor = self._power()
            product = product * factor if operator == "*" else product / factor
        return product

    def _power(self) -> Any:
        factor = self._atom()
        exponent = self._took(r" ?(?:\^|\*\*) ?-?[1-9]")
        return factor if exponent is None else factor ** int(exponent.lstrip("^* "))

    def _atom(self) -> Any:
        if self._took(r" ?\( ?") is not None:
            total = self._sum()
            if self._took(r" ?\)") is None:
                raise self._unreadable()
            return total * self._with_unit(1.0, None)
        match = _TERM.match(self.text, self.at)
        if match is None:
            raise self._unreadable()
        self.at = len(self.text[: match.end()].rstrip())
        value, std = float(match["value"]), None if match["std"] is None else float(match["std"])
        if match["percent"] and std is not None:
            std *= abs(value) / 100
        return self._with_unit(value, std)

    def _with_unit(self, value: float, std: float | None) -> Any:
        """A number with the unit that follows here, if any, in base units."""
        import pint

        if std is not None and std < 0:
            raise UnusableError("negative-uncertainty", f"has the uncertainty {std:g}; give one that is not negative")
        if self._took(r" ?%") is not None:
            value, std = value / 100, None if std is None else std / 100
        text = self._took(rf" ?{_NAME}(?:(?: ?[*/] ?| ){_NAME})*") or "dimensionless"
        registry = _registry()
        try:
            unit = registry.parse_units(text)
            zero, scaled = (registry.Quantity(x, unit).to_base_units() for x in (0.0, 1.0))
        except (pint.errors.PintError, TokenError, AttributeError, ValueError, TypeError):
            raise UnusableError(
                "wrong-unit", f"is {self.shown}, which has the unknown unit {text!r}; {_SI_NAMES}"
            ) from None
        if float(zero.magnitude) != 0.0:
            raise UnusableError("wrong-unit", f"is {self.shown}, where {text} has another zero than its base unit")
        return registry.Quantity(
            Quantity(value, std).uncertain(f"number {self.at}") * float(scaled.magnitude), scaled.units
        )


def _plain(text: str) -> str:
    """A text with the signs and powers of units as pint reads them, and single blanks."""
    text = re.sub(r"°(?![CF])", "deg", text.replace("·", "*").replace("⋅", "*").replace("−", "-").replace("×", "*"))
    return " ".join(text.replace("²", "^2").replace("³", "^3").split())


def _split(text: str, unit: str) -> tuple[float, float | None, str]:
    """Value, uncertainty and unit as text."""
    match = _QUANTITY.fullmatch(text.strip().replace("−", "-")) if len(text) <= LONGEST else None
    if match is None:
        raise UnusableError("not-a-quantity", f"is {shown(text)}, which is no quantity; {_advice(unit)}")
    value = float(match["value"])
    std = None if match["std"] is None else float(match["std"])
    if match["percent"]:
        assert std is not None
        # "5 ± 1 %" of a pure number could mean 5 % ± 1 %: ask rather than guess.
        if unit == "":
            raise UnusableError(
                "not-a-quantity", f"is {shown(text)}, where % may belong to both numbers; write both without %"
            )
        std *= abs(value) / 100
    return value, std, match["unit"].strip()


def _from_table(raw: Mapping[Any, object], unit: str) -> tuple[float, float | None, str]:
    strange = [str(key) for key in raw if key not in ("value", "std", "unit")]
    if strange or "value" not in raw:
        problem = f"has the unknown key {strange[0][:40]!r}" if strange else "lacks value"
        raise UnusableError("not-a-quantity", f"{problem}; a quantity's table is {{value=…, std=…, unit=…}}")
    given = raw.get("unit", "")
    if not isinstance(given, str):
        raise UnusableError("not-a-quantity", f"has the unit {shown(given)}, which is not text; {_advice(unit)}")
    std = None if raw.get("std") is None else _number(raw["std"], unit)
    return _number(raw["value"], unit), std, given.strip()


def _number(raw: object, unit: str) -> float:
    if isinstance(raw, bool) or not isinstance(raw, int | float):
        raise UnusableError("not-a-quantity", f"is {shown(raw)}, which is no number; {_advice(unit)}")
    try:
        return float(raw)
    except OverflowError:
        raise UnusableError("not-finite", "is too large a number") from None


@lru_cache(maxsize=512)
def _factor(given: str, expected: str) -> float:
    """How many `expected` one `given` is; 1 where no unit is given, without pint where both read the same."""
    if given in ("", expected):
        return 1.0
    if expected == "":
        if given in SHARES:
            return SHARES[given]
        raise UnusableError("wrong-unit", f"is given in {given[:40]!r}, but is a pure number without a unit")
    text = _plain(given)
    if _UNIT.fullmatch(text) is None or text.count("(") != text.count(")"):
        calculated = re.search(r"(^|[ +])\d", text) is not None
        more = f"; in a calculation {_ADVICE_OF_CALCULATION}" if calculated else ""
        raise UnusableError("wrong-unit", f"has the unreadable unit {given[:40]!r}; expected is {expected}{more}")
    if _GRAIN.search(text):
        raise UnusableError("wrong-unit", f"is given in {given[:40]!r}; gr is the grain, so write g for the gram")
    if "rad" in expected and _HERTZ.search(text):
        raise UnusableError("wrong-unit", _NO_FREQUENCY.format(repr(given)))
    return _ask_pint(text, given, expected)


def _ask_pint(text: str, given: str, expected: str) -> float:
    import pint

    registry = _registry()
    try:
        unit = registry.parse_units(text)
        alike = unit.dimensionality == registry.parse_units(expected).dimensionality
        # Logarithmic units and offset temperatures are no factors: their zero is not zero.
        alike = alike and float(registry.convert(0.0, unit, expected)) == 0.0
        factor = float(registry.convert(1.0, unit, expected)) if alike else math.nan
    except (pint.errors.PintError, TokenError, AttributeError, ValueError, TypeError):
        # pint's ways of saying that a name is no unit
        message = f"has the unknown unit {given[:40]!r}; expected is {expected}"
        raise UnusableError("wrong-unit", message) from None
    if not math.isfinite(factor) or factor == 0.0:
        raise UnusableError("wrong-unit", f"is given in {given[:40]!r}, but is expected in {expected}")
    return factor


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry()
    # How motors' data sheets write it; pint knows only the product.
    registry.define("newton_metre = newton * meter = Nm")
    return registry


def _advice(unit: str) -> str:
    return f'write a number, or text like "1.2 ± 0.1{" " + unit if unit else ""}"'
