"""The text of a quantity in one spelling: decimal points, the unit once and at its end; and what is wrong with it."""

from __future__ import annotations

import re
from datetime import date, time

NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_UNIT_FIRST = re.compile(  # numbers are atomic: "e-5" is no unit
    rf"\s*(?P<value>(?>{NUMBER}))\s*(?P<unit>[^\s\d±()+%.-][^±()]*?)\s*(?:±|\+/-|\+-)\s*"
    rf"(?P<std>(?>{NUMBER}))\s*(?P<again>\S.*?)\s*"
)
LONGEST = 200
"""Characters beyond which no text is a quantity."""


class UnusableError(Exception):
    """What is wrong with a quantity, as a predicate without its subject."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


_COMMA = re.compile(r"(?<![0-9.,])([0-9]+),([0-9]+)(?![0-9.,])")
_THOUSANDS = re.compile(r"[1-9][0-9]{0,2},[0-9]{3}")


def with_points(text: str) -> str:
    """The text with decimal points for decimal commas.

    Raises UnusableError where each comma could part thousands, or where commas stand beside decimal points.
    """
    numbers = [match[0] for match in _COMMA.finditer(text)] if len(text) <= LONGEST else []
    if not numbers:
        return text
    if all(_THOUSANDS.fullmatch(number) for number in numbers):
        point, none = numbers[0].replace(",", "."), numbers[0].replace(",", "")
        raise UnusableError(
            "not-a-quantity", f"is {shown(text)}, where the comma may part thousands; write {point} or {none}"
        )
    if "." in text:
        raise UnusableError("not-a-quantity", f"is {shown(text)}, with points and commas; write decimal points")
    return _COMMA.sub(r"\1.\2", text)


def with_unit_last(text: str) -> str:
    """The text "147.6 g ± 0.2 g" or "147.6 g ± 0.1 %" with the unit once, at its end."""
    match = _UNIT_FIRST.fullmatch(text) if len(text) <= LONGEST else None
    if match is None or match["again"] not in (match["unit"], "%"):
        return text
    return f"{match['value']} ± {match['std']} {'% ' if match['again'] == '%' else ''}{match['unit']}"


def shown(raw: object) -> str:
    """A value of a TOML file as a message shows it, cut short."""
    if isinstance(raw, bool):
        return str(raw).lower()
    if isinstance(raw, int):
        return "a large whole number" if abs(raw) >= 10**20 else str(raw)
    text = raw.isoformat() if isinstance(raw, date | time) else repr(raw)
    return text if len(text) <= 50 else f"{text[:47]}..."
