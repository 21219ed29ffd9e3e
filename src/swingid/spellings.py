"""The units of columns as people spell them, in the header of a log and in a rig file."""

from __future__ import annotations

SPELLINGS: dict[str, tuple[str, ...]] = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millis", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanoseconds"),
    "rad": ("rad", "radian", "radians"),
    "deg": ("deg", "degree", "degrees", "°", "º", "grad"),
    "turns": ("turn", "turns", "rev", "revs", "revolution", "revolutions", "umdr"),
    "counts": ("count", "counts", "ticks", "cnt", "cnts", "inc"),
    "m": ("m",),
    "mm": ("mm",),
    "px": ("px", "pixel", "pixels"),
    "V": ("v", "volt", "volts"),
    "mV": ("mv",),
    "N m": ("nm", "n m", "n*m", "n·m"),
    "mN m": ("mnm", "mn m", "mn*m", "mn·m"),
    "N": ("n",),
    "rad/s": ("rad/s", "radians/s", "rads"),
    "deg/s": ("deg/s", "degrees/s", "°/s"),
    "rpm": ("rpm", "1/min", "u/min", "r/min", "rev/min"),
    "turns/s": ("turns/s", "rev/s"),
    "counts/s": ("counts/s",),
    "m/s": ("m/s",),
    "A": ("a",),
    "mA": ("ma",),
    "Hz": ("hz",),
}
UNITS = {spelling: unit for unit, spellings in SPELLINGS.items() for spelling in spellings}
"""The unit of a spelling in lower case."""


def canonical(unit: str) -> str:
    """A unit as rig.toml spells it; one that is not known as it stands."""
    return UNITS.get(unit.strip().lower(), unit)
