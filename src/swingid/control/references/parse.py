"""Reference motions from text, as in ``--reference "sine 0.8 rad 8.5 rad/s"``.

Grammar: a kind, then numbers each followed by a unit (none = SI). Frequencies in rad/s, Hz, or any unit of
angle per time; angles in rad, deg, ..., or lengths for a linear axis (whether they suit a rig: `require_axis`).

    sine       AMPLITUDE FREQUENCY [PHASE]
    multisine  AMPLITUDE FREQUENCY [PHASE] + AMPLITUDE FREQUENCY [PHASE] + ...
    strokes    AMPLITUDE STROKE-TIME [DWELL]
    triangle   AMPLITUDE FREQUENCY [CORNER-TIME]
    chirp      AMPLITUDE FROM-FREQUENCY TO-FREQUENCY SWEEP-TIME
    file       PATH.csv

The file has time (s) and position (rad or m) in its first two columns.
"""

from __future__ import annotations

import math
import re
from typing import Any

from swingid.control.references.base import Reference, refused, require_axis
from swingid.control.references.motions import Chirp, Multisine, Sine, Strokes, Triangle
from swingid.control.references.sampled import Sampled
from swingid.errors import InputError, UsageError
from swingid.model.rig import Rig

EXAMPLES = {
    "sine": "sine 0.8 rad 8.5 rad/s",
    "multisine": "multisine 0.5 rad 5 rad/s + 0.3 rad 8.5 rad/s",
    "strokes": "strokes 0.8 rad 0.5 s 0.2 s",
    "triangle": "triangle 45 deg 1 Hz 0.1 s",
    "chirp": "chirp 0.5 rad 0.5 Hz 2 Hz 20 s",
    "file": "file motion.csv",
}
TERM = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d+.-][^\s+]*)?(?=\s|$)")

Term = tuple[str, str]


def parse_reference(text: str, unit: str = "rad") -> Reference:
    """Return the reference motion that a text names.

    Parameters
    ----------
    text
        After the grammar of this module.
    unit
        Of a bare amplitude.

    Raises
    ------
    UsageError
        Text outside the grammar, with an example.
    InputError
        An unusable file.

    Examples
    --------
    >>> import swingid as sw
    >>> motion = sw.parse_reference("sine 45 deg 1 Hz")
    >>> float(motion(0.25).round(3))  # rad
    0.785
    """
    if not isinstance(text, str):
        raise UsageError(f'{text!r} is no text of a motion, such as "sine 0.8 rad 8.5 rad/s".', code="bad-reference")
    kind, _, rest = text.strip().partition(" ")
    if kind == "file":
        if not rest.strip():
            raise _bad(text, kind, "the path is missing")
        return Sampled.load(rest.strip())
    if kind not in EXAMPLES:
        raise _bad(text, "sine", f"it must begin with one of {', '.join(EXAMPLES)}")
    if kind == "multisine":
        return Multisine(tuple(_motion(text, kind, part, unit) for part in re.split(r"\s\+\s", rest)))
    motion: Reference = _motion(text, kind, rest, unit)
    return motion


def reference_for(text: str, rig: Rig) -> Reference:
    """Parse as `parse_reference`, a bare amplitude in the unit of the rig's axis; UsageError for a motion of
    another.
    """
    motion = parse_reference(text, "m" if rig.axis.kind == "linear" else "rad")
    require_axis(motion, rig.axis.kind)
    return motion


_MOTIONS: dict[str, tuple[type[Any], dict[str, str]]] = {
    "sine": (Sine, {"frequency": "rad/s", "phase": "rad"}),
    "multisine": (Sine, {"frequency": "rad/s", "phase": "rad"}),
    "strokes": (Strokes, {"stroke_time": "s", "dwell": "s"}),
    "triangle": (Triangle, {"frequency": "rad/s", "corner": "s"}),
    "chirp": (Chirp, {"low": "rad/s", "high": "rad/s", "sweep": "s"}),
}
"""Motions, of a multisine its parts, with the SI units of what follows the amplitude; of two the last may be left out.
"""


def _motion(text: str, kind: str, rest: str, plain: str) -> Any:
    """A motion from the quantities in `rest`; plain: unit of an amplitude that states none."""
    motion, fields = _MOTIONS[kind]
    fewest = 1 if len(fields) == 2 else len(fields)
    amplitude, unit, terms = _terms(text, kind, rest, (fewest, len(fields)), plain)
    values = {name: _value(text, kind, term, si) for (name, si), term in zip(fields.items(), terms, strict=False)}
    return motion(amplitude, unit=unit, **values)


def _terms(text: str, kind: str, rest: str, wanted: tuple[int, int], plain: str) -> tuple[float, str, list[Term]]:
    """Amplitude with its unit (`plain` where none is given), and as many further terms (number, unit) as wanted."""
    (fewest, most), terms, place = wanted, [], 0
    while place < len(rest.rstrip()):
        match = TERM.match(rest, place)
        if match is None:
            raise _bad(text, kind, f"{rest[place:].strip()!r} is not a number with a unit")
        terms.append((match[1], match[2] or ""))
        place = match.end()
    if not fewest <= len(terms) - 1 <= most:
        count = f"{fewest + 1}" if fewest == most else f"{fewest + 1} to {most + 1}"
        raise _bad(text, kind, f"{kind} takes {count} quantities, not {len(terms)}")
    if (terms[0][1] or plain) != "m":
        try:
            return _value(text, kind, terms[0], "rad"), "rad", terms[1:]
        except UsageError:
            pass  # not an angle: a length, or the error of the next line
    return _value(text, kind, terms[0], "m"), "m", terms[1:]


def _value(text: str, kind: str, term: Term, unit: str) -> float:
    """The number of a term in `unit`; cycles per second count 2π rad, which a unit system takes for 1/s."""
    number, given = term
    if unit == "rad/s" and given.endswith("Hz"):
        return 2.0 * math.pi * _value(text, kind, term, "Hz")
    if not math.isfinite(float(number)):
        raise _bad(text, kind, f"{number} is too large")
    if given in ("", unit):
        return float(number)
    from swingid.units import parse_quantity

    try:
        return float(parse_quantity(f"{number} {given}", unit, kind).value)
    except InputError as error:
        raise _bad(text, kind, f"{number} {given} cannot be read in {unit}") from error


def _bad(text: str, kind: str, reason: str) -> UsageError:
    return refused(repr(text.strip()), f"{reason}; write for example {EXAMPLES[kind]!r}")
