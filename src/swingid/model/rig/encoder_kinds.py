"""Kinds of sensors of an angle, and how far their readings may be off where the rig file does not state it.

An error that repeats with every turn is α cos q + β sin q + γ cos 2q + δ sin 2q. Data sheets give its largest size M
over a turn, as mounted. Each of α and β is taken as normal with M/2.45, so that hypot(α, β) exceeds M in 5 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

EXCEEDED = float(np.sqrt(-2 * np.log(0.05)))
"""Standard deviations of one part that the amplitude of two exceeds in 5 %: 2.45."""


@dataclass(frozen=True)
class Kind:
    """A kind of sensor: its name in a rig file, what it is, and where the two numbers are from.

    once, twice: standard deviation (deg) of each of cosine and sine part, once and twice per turn. counts: per turn
    (None where they vary, or where there are none).
    """

    name: str
    words: str
    once: float
    twice: float
    source: str
    counts: int | None = None


def _by_maximum(name: str, words: str, most: float, source: str, counts: int | None, share: float) -> Kind:
    """A kind by the largest error (deg) of its data sheet; share: of twice per turn in once per turn."""
    once = float(f"{most / EXCEEDED:.2g}")
    return Kind(name, words, once, float(f"{share * once:.2g}"), source, counts)


MAGNET, DISC = 0.5, 0.2
"""Twice per turn against once per turn. A magnet off its chip makes both: offsets of the Hall signals act once, unequal
gains, and the square of the displacement, twice. A disc off its hub acts once per turn, an elliptic one twice."""

UNKNOWN = Kind(
    "unknown",
    "not known",
    0.15,
    0.05,
    "between the kinds below: a hub 50 um off under one read head at 11 mm is 0.26 deg, data sheets say 0.25 to 1 deg",
)

KINDS = (
    UNKNOWN,
    _by_maximum("AS5048A", "magnet, 14 bit", 0.8, "data sheet: INL 0.8 deg at most, magnet centred", 16384, MAGNET),
    _by_maximum("AS5047P", "magnet, 14 bit", 0.8, "data sheet: INL 0.8 deg at most, magnet centred", 16384, MAGNET),
    _by_maximum("AS5600", "magnet, 12 bit", 1.0, "data sheet: INL 1 deg at most", 4096, MAGNET),
    _by_maximum("MT6701", "magnet, 14 bit", 1.0, "data sheet: INL 1 deg", 16384, MAGNET),
    _by_maximum("AMT10x", "capacitive, AMT102 and AMT103", 0.25, "data sheet: accuracy 0.25 deg", None, DISC),
    _by_maximum(
        "optical",
        "disc with lines, 4 counts per line",
        0.26,
        "a hub 50 um off under one read head at 11 mm",
        None,
        DISC,
    ),
    _by_maximum("potentiometer", "voltage of a slider", 1.7, "independent linearity 0.5 % of 340 deg", None, MAGNET),
    _by_maximum(
        "camera",
        "marks in a video",
        0.57,
        "a pivot marked 1 % of the lever off; its plane seen from 7 deg aside acts twice per turn",
        None,
        MAGNET,
    ),
    Kind("gyroscope", "rate, as of a phone", 0.0, 0.0, "a rate has no place on a turn; its scale is angle_speed_scale"),
    Kind("ideal", "of a simulation", 0.0, 0.0, "by definition"),
)
"""All of them; what is not known first."""

NAMES = tuple(kind.name for kind in KINDS)

DELAY = 1 / np.sqrt(12)
"""Standard deviation of the delay between two channels in samples: a reading falls anywhere within its row."""


def kind_of(name: str | None) -> Kind:
    """The kind of this name in any case of letters; the unknown one for None. KeyError for others."""
    if name is None:
        return UNKNOWN
    return {kind.name.lower(): kind for kind in KINDS}[name.lower()]


def table() -> list[str]:
    """Lines of a table of all kinds, for people who choose one."""
    rows = [("sensor", "what it is", "once, twice per turn", "source of the numbers")]
    rows += [(kind.name, kind.words, f"{kind.once:g}, {kind.twice:g} deg", kind.source) for kind in KINDS]
    widths = [max(len(row[k]) for row in rows) for k in range(3)]
    return ["  ".join([*(row[k].ljust(widths[k]) for k in range(3)), row[3]]) for row in rows]
