"""Numbers as people write them: value ± standard uncertainty, two digits of it, one common exponent.

    plus_minus(0.00302214, 4.2e-7, "kg*m^2")              '(3.02214 ± 0.00042)e-3 kg m²'
    plus_minus(0.00302214, 4.2e-7, "kg*m^2", fine=True)   '(3.02214 ± 0.00042) × 10⁻³ kg m²'

`fine` is for pages and figures (true minus, raised exponent, no break inside a number or unit), the plain form for
terminals.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal
from functools import cache

EXACT = Context(prec=400, rounding=ROUND_HALF_EVEN)
TWO_DIGITS = Context(prec=2, rounding=ROUND_HALF_EVEN)
RAISED = str.maketrans("0123456789-+", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺")
ROUNDING = 1e-9
"""Share of a signal's range below which its noise is rounding of the logged numbers: finer than a 30 bit encoder."""

FINEST = 15
"""Digits of a double; an uncertainty below them is written on its own."""


@dataclass(frozen=True)
class Rounded:
    """Digits of a value and its uncertainty (None: unknown), both times ten to `exponent`, a multiple of three."""

    value: str
    uncertainty: str | None
    exponent: int

    def text(self, unit: str = "", *, fine: bool = False) -> str:
        """Write as one string with the unit."""
        digits = self.value if self.uncertainty is None else f"{self.value} ± {self.uncertainty}"
        return _assemble(digits, self.exponent, unit, fine, bracket=self.uncertainty is not None)


def rounded(value: float, uncertainty: float | None) -> Rounded:
    """Round the uncertainty to two significant digits and the value to the same place.

    Without an uncertainty (None, not finite, or zero) the value keeps six significant digits.
    """
    if not math.isfinite(value):
        return Rounded("unknown", None, 0)
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty == 0.0:
        exact = Decimal(f"{value:.6g}")
        exponent = common_exponent([value])
        return Rounded(_strip(f"{_shift(exact, -exponent):f}"), None, exponent)
    uncertainty = abs(uncertainty)
    if uncertainty < abs(value) * 10.0 ** (1 - FINEST):
        whole = rounded(value, None)
        return Rounded(whole.value, f"{uncertainty / 10.0**whole.exponent:.1e}", whole.exponent)
    place = last_place(uncertainty)
    exponent = common_exponent([value, uncertainty])
    while place > exponent:
        exponent += 3
    return Rounded(_digits(value, place, exponent), _digits(uncertainty, place, exponent), exponent)


def plus_minus(value: float, uncertainty: float | None, unit: str = "", *, fine: bool = False) -> str:
    """'(3.02214 ± 0.00042)e-3 kg m²'; the value alone when there is no uncertainty."""
    return rounded(value, uncertainty).text(unit, fine=fine)


def interval(bounds: tuple[float, float], unit: str = "", *, middle: float | None = None, fine: bool = False) -> str:
    """'[3.02132, 3.02296]e-3 kg m²', to about a hundredth of its width; with the power of ten of `middle` if given."""
    low, high = bounds
    width = high - low
    if not (math.isfinite(width) and width > max(abs(low), abs(high)) * 10.0 ** (1 - FINEST)):
        return _assemble(f"[{low:.12g}, {high:.12g}]", 0, unit, fine, bracket=False)
    place = last_place(width / 4)
    exponent = common_exponent([low, high]) if middle is None else rounded(middle, width / 4).exponent
    while place > exponent:
        exponent += 3
    digits = f"[{_digits(low, place, exponent)}, {_digits(high, place, exponent)}]"
    return _assemble(digits, exponent, unit, fine, bracket=False)


def span(low: float, high: float, unit: str = "", digits: int = 4, *, fine: bool = False) -> str:
    """'(−299.6 … 548.5) × 10⁻⁶ N m': two limits without uncertainty."""
    exponent = common_exponent([low, high])
    edges = [_strip(f"{_shift(Decimal(f'{edge:.{digits}g}'), -exponent):f}") for edge in (low, high)]
    return _assemble(" … ".join(edges), exponent, unit, fine, bracket=True)


def percent(fraction: float, *, sign: bool = False, fine: bool = False) -> str:
    """'0.014 %': two significant digits of a share; with `sign` for deviations."""
    if not math.isfinite(fraction):
        return "unknown"
    share = 100 * fraction
    if share == 0.0 or abs(share) >= 9.95:
        digits = f"{share:.0f}"
    elif abs(share) < 1e-5:
        digits = f"{share:.1e}"
    else:
        digits = _digits(share, last_place(share), 0)
    if sign and share > 0:
        digits = f"+{digits}"
    if not fine:
        return f"{digits} %"
    plain, _, power = digits.partition("e")
    digits = f"{plain}\u00a0×\u00a010{str(int(power)).translate(RAISED)}" if power else plain
    return f"{digits.replace('-', '−')}\u00a0%"


def number(value: float, unit: str = "", digits: int = 4, *, fine: bool = False) -> str:
    """A number that has no uncertainty of its own, to so many significant digits."""
    if not math.isfinite(value):
        return "unknown"
    exponent = common_exponent([value])
    shown = _strip(f"{_shift(Decimal(f'{value:.{digits}g}'), -exponent):f}")
    return _assemble(shown, exponent, unit, fine, bracket=False)


def noise_of(noise: float, span: float, unit: str, digits: int = 3, *, fine: bool = False) -> str:
    """Standard deviation of the noise of a signal whose range is `span`; '0 rad' where it is rounding."""
    return number(noise if noise > ROUNDING * span else 0.0, unit, digits, fine=fine)


def pretty_unit(unit: str) -> str:
    """'kg*m^2' → 'kg m²'; what is pretty already stays."""
    text = unit.replace("**", "^").replace("*", " ").replace("·", " ")
    text = re.sub(r"\^\(?([-+]?\d+)\)?(?![.\d])", lambda match: match[1].translate(RAISED), text)
    return re.sub(r"\s+", " ", text).strip()


@cache
def time_power(unit: str) -> float:
    """Power of the time in an SI unit as parameters have it: −2 of "N m", −1 of "N m s", 0 of "kg m^2"."""
    over, _, under = unit.partition("/")
    powers = [0.0]
    for side, sign in ((over, 1), (under, -1)):
        for name, _, power in (factor.partition("^") for factor in side.split()):
            powers.append(sign * {"N": -2, "s": 1}.get(name, 0) * float(power or 1))
    return sum(powers)


def common_exponent(values: Sequence[float]) -> int:
    """0 for magnitudes from 0.01 to 9999, else the multiple of three that leaves one to three digits."""
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if largest == 0.0:
        return 0
    magnitude = Decimal(f"{largest:.5e}").adjusted()
    return 0 if -2 <= magnitude < 4 else 3 * (magnitude // 3)


def power_of_ten(exponent: int) -> str:
    """'10⁻³'."""
    return "10" + str(exponent).translate(RAISED)


def last_place(uncertainty: float) -> int:
    """Power of ten of the second significant digit of a positive uncertainty, after rounding to two digits."""
    return TWO_DIGITS.plus(Decimal(repr(abs(float(uncertainty))))).adjusted() - 1


def _digits(value: float, place: int, exponent: int) -> str:
    """`value` rounded to ten to `place`, written times ten to `exponent` (place ≤ exponent)."""
    rounded_value = Decimal(repr(float(value))).quantize(Decimal(1).scaleb(place), context=EXACT)
    if rounded_value == 0:
        rounded_value = abs(rounded_value)
    return f"{_shift(rounded_value, -exponent):f}"


def _shift(value: Decimal, exponent: int) -> Decimal:
    return value.scaleb(exponent, context=EXACT)


def _strip(digits: str) -> str:
    return digits.rstrip("0").rstrip(".") if "." in digits else digits


def _assemble(digits: str, exponent: int, unit: str, fine: bool, *, bracket: bool) -> str:
    if fine:
        digits = digits.replace("-", "−")
    if exponent and bracket:
        digits = f"({digits})"
    if exponent:
        digits += f" × {power_of_ten(exponent)}" if fine else f"e{exponent:+d}".replace("+", "")
    elif bracket and unit:
        digits = f"({digits})"
    text = f"{digits} {pretty_unit(unit)}".strip()
    # a line may break before the power of ten only
    return text.replace(" ", "\u00a0").replace("\u00a0×", " ×") if fine else text


def left(share: float) -> str:
    """What a balance leaves, as a share of what it balances, in words fit for a sentence."""
    if share > 10:
        return "many times itself"
    return "less than 0.001 %" if share < 1e-5 else percent(share)
