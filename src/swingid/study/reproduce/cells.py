"""Numbers as cells of a table."""

from __future__ import annotations

import math

NOTHING = "–"


def number(value: float | None, digits: int = 3, most: int = 7) -> str:
    """A number to so many significant digits and at most so many places, without an exponent; a dash for None."""
    if value is None:
        return NOTHING
    rounded = float(f"{value:.{digits - 1}e}")
    if rounded == 0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{min(places, most)}f}".replace("-", "−")


def signed(value: float | None, digits: int = 2) -> str:
    """Per cent with their sign, to a thousandth at most; below half of that they are not worth one."""
    if value is None:
        return NOTHING
    if abs(value) < 5e-4:
        return "< 0.0005"
    text = number(value, digits, most=3)
    return text if text.startswith("−") else f"+{text}"


def inertia(value: float | None, places: int = 2) -> str:
    """An inertia in 10⁻⁵ kg m²."""
    return NOTHING if value is None else f"{1e5 * value:.{places}f}".replace("-", "−")
