"""Columns as candidates for channels: their names, their units, and how they move with each other."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.header import ANGLES, FACTORS, SPEEDS, TIMES
from swingid.spellings import UNITS, canonical

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.inspect.columns import Column


WORDS: dict[str, tuple[str, ...]] = {
    "time": (
        *("t", "time", "tout", "times", "timestamp", "stamp", "zeit", "clock", "elapsed", "sec", "secs", "seconds"),
        "tid",
    ),
    "angle": (
        *("q", "q1", "theta", "theta1", "th", "th1", "angle", "angle1", "pos", "position", "phi", "phi1", "pendulum"),
        *("pend", "rod", "arm", "link", "joint", "axis", "alpha", "alpha1", "winkel", "qm", "x", "x1", "y"),
        *("encoder", "encoder1", "enc", "enc1", "displacement"),
    ),
    "wheel": (
        *("q2", "wheel", "flywheel", "rw", "rotor", "disk", "disc", "theta2", "th2", "phi2", "alpha2", "rad"),
        *("schwungrad", "rueckrad", "x2", "encoder2", "enc2", "angle2", "reaction", "motor", "x3"),
    ),
    "voltage": (
        *("u", "u0", "v", "volt", "volts", "voltage", "vin", "vm", "spannung", "ua", "input", "uc", "pwm", "duty"),
    ),
    "torque": ("tau", "torque", "moment", "force", "effort", "drehmoment", "kraft", "vir", "trq", "mot"),
    "current": ("i", "current", "amps", "ampere", "strom", "im", "ia"),
}

REFERENCE = {
    *("ref", "reference", "des", "desired", "goal", "target", "set", "setpoint", "sp", "cmd", "command", "commanded"),
    *("soll", "ym", "qg", "r", "qd", "qref", "qdes", "traj", "trajectory", "planned"),
}
SPEED = {
    *("vel", "velocity", "speed", "omega", "rate", "rpm", "w", "w1", "w2", "dot", "dq", "dq1", "dq2", "dtheta", "dth"),
    *("qdot", "thetadot", "gyro", "geschwindigkeit", "dphi", "dalpha", "omega1", "omega2", "d", "dx", "qp", "thd"),
}
OTHER = {
    *("acc", "acceleration", "ddq", "error", "err", "temp", "temperature", "kp", "kd", "enable", "enabled", "id"),
    *("seq", "nsec", "nsecs", "frame", "index", "row", "sample"),
}

ROLE_UNITS: dict[str, frozenset[str]] = {
    "time": TIMES,
    "angle": ANGLES,
    "wheel": ANGLES - {"m", "mm"},
    "voltage": frozenset(FACTORS["voltage"]),
    "torque": frozenset(FACTORS["torque"]),
    "current": frozenset({"A", "mA"}),
}
SPEED_UNITS = SPEEDS | {"m/s"}
RATE_UNITS = SPEEDS - {"m/s", "mm/s"}
CONTAINERS = re.compile(r"\b(joint_?states?|field|header|msg|topic)\b(?=[/._])", re.IGNORECASE)
"""Parts of a name that state where a message came from, such as /joint_states/pendulum/position."""

GYROSCOPE = re.compile(
    r"gyr|angular[ _.]*(velocity|rate|speed)|rotation[ _.]*rate|^rotation [xyz]$|(^|[ _./])(omega|[gw])[ _.]?[xyz]$",
    re.IGNORECASE,
)

NO_MOTION = re.compile(
    r"acc(el|x|y|z|_|\b)|(^|[xyz])acc$|magnet|gravity|beschleun|aceler|(^|[ _./])[am][ _.]?[xyz]$", re.IGNORECASE
)
"""Names of accelerometers, and of what phones compute of them: no angle and no rate follows from one column."""


def is_gyroscope(name: str) -> bool:
    """Return whether a column is called as gyroscopes are: phyphox, IMUs, `sensor_msgs/Imu`."""
    return GYROSCOPE.search(re.sub(r"[\[(].*?[\])]", "", name).strip()) is not None


TICKS = frozenset(("tick", "ticks", "cycle", "cycles", "cnt", "count", "counts"))


def counts_ticks(name: str) -> bool:
    """Return whether a column of the time is called ticks or cycles of a timer, which may have any length, without a
    unit.
    """
    return unit_of(name, "") not in TIMES and not TICKS.isdisjoint(words_of(name))


def is_no_motion(candidate: Candidate) -> bool:
    """Return whether a column is of an accelerometer or a magnetometer, by its name or unit."""
    unit = candidate.unit.replace("²", "^2").replace("µ", "u").lower()
    bare = re.sub(r"[\[(].*?[\])]", "", candidate.name).strip()
    return unit in ("m/s^2", "m/s2", "g", "ut") or (NO_MOTION.search(bare) is not None and not is_gyroscope(bare))


GREEK = {"θ": "theta", "φ": "phi", "α": "alpha", "ω": "omega", "τ": "tau"}


def words_of(name: str) -> list[str]:
    """The words of a column's name in lower case: "pendAngle_rad [deg]" gives pend, angle, rad."""
    bare = CONTAINERS.sub(" ", re.sub(r"[\[(].*?[\])]", " ", name))
    for letter, word in GREEK.items():
        bare = bare.replace(letter, word)
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare)
    return re.findall(r"[a-zà-ÿµ°]+\d*|\d+", split.lower())


def unit_of(name: str, stated: str) -> str:
    """The unit that a column states, in the header or as a word at the end of its name; "" where there is none."""
    if stated:
        return canonical(stated)
    compact = re.sub(r"[\[(].*?[\])]", "", name.lower())
    if re.search(r"((rad|deg)[_/ ]?(p|per)?[_/ ]?s|m[_/ ](per[_ ])?s|mps)(_|$)", compact):
        return next(u for u in ("rad/s", "deg/s", "m/s") if u.split("/")[0] in compact)
    words = words_of(name)
    if len(words) > 1:
        return UNITS.get(words[-1], "")
    return "rpm" if words == ["rpm"] else ""


def name_scores(name: str) -> dict[str, float]:
    """How well a name fits each role (0 … 3), also "speed", "reference" and "other"."""
    words = words_of(name)
    joined = "".join(words)
    scores = {role: _score(words, joined, known) for role, known in WORDS.items()}
    scores["speed"] = _score(words, joined, tuple(SPEED))
    scores["reference"] = _score(words, joined, tuple(REFERENCE))
    scores["other"] = _score(words, joined, tuple(OTHER))
    if scores["reference"] >= 2 and len(words) > 1:
        scores["angle"] = min(scores["angle"], 1.0)
    if scores["wheel"] >= 2 and max(scores[role] for role in ("voltage", "torque", "current")) >= 2:
        scores["wheel"] = 1.0  # motor_voltage is no wheel
    if scores["wheel"] >= 2 and len(words) > 1:
        scores["angle"] = min(scores["angle"], 1.0)
    return scores


def _score(words: list[str], joined: str, known: tuple[str, ...]) -> float:
    """3: the name is one of `known`; 2: one of its words is; 1: it begins with one of three letters or more."""
    if joined in known:
        return 3.0
    if any(word in known for word in words):
        return 2.0
    return 1.0 if any(word.startswith(k) for word in words for k in known if len(k) > 2) else 0.0


MOST = 20_000
"""Rows that the comparison of columns looks at."""

GAINS = (1.0, 180 / np.pi, np.pi / 180, 30 / np.pi, 2 * np.pi, 0.5 / np.pi)
"""Speed per slope of its angle: equal units, degrees and radians, revolutions per minute, turns."""


def thin(values: Array) -> Array:
    """A stretch from the middle of the log, NaN filled, for comparisons."""
    if len(values) > MOST:
        begin = (len(values) - MOST) // 2
        values = values[begin : begin + MOST]
    bad = ~np.isfinite(values)
    if bad.any() and not bad.all():
        values = values.copy()
        values[bad] = np.interp(np.flatnonzero(bad), np.flatnonzero(~bad), values[~bad])
    return values


def smooth(values: Array) -> Array:
    """Moving average over five rows."""
    return np.convolve(values, np.full(5, 0.2), "same")


def slope(values: Array, stamps: Array) -> Array:
    """Speed of a column over some rows on each side, without the jumps of a wrapped angle."""
    reach = 3
    slope = np.zeros(len(values))
    steps = stamps[2 * reach :] - stamps[: -2 * reach]
    rise = values[2 * reach :] - values[: -2 * reach]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope[reach:-reach] = np.where(steps > 0, rise / steps, 0.0)
    limit = 6 * np.quantile(np.abs(slope), 0.9)
    return np.where(np.abs(slope) <= limit, slope, 0.0)


def correlation(first: Array, second: Array) -> float:
    """Pearson's correlation, 0 where one of the two does not vary."""
    first, second = first - first.mean(), second - second.mean()
    size = float(np.sqrt((first @ first) * (second @ second)))
    return float(first @ second) / size if size > 0 and np.isfinite(size) else 0.0


def roughness(values: Array) -> float:
    """How much a column moves from row to row against its range: small for a position, large for a command."""
    part = thin(values)
    span = float(np.ptp(part))
    return float(np.sqrt(np.mean(np.diff(part, 2) ** 2))) / span if span > 0 and len(part) > 2 else np.inf


def has_size(speed: Array, slope: Array) -> bool:
    """Return whether a speed is its angle's slope in one of the usual units."""
    gain = float(np.sqrt((speed @ speed) / max(float(slope @ slope), 1e-300)))
    return min(abs(gain / usual - 1) for usual in GAINS) < 0.05


def changes_sign(values: Array) -> bool:
    """Return whether there are values on both sides of zero."""
    return bool(np.nanmin(values) < 0 < np.nanmax(values)) if np.isfinite(values).any() else False


def passes(values: Array, low: float, high: float) -> int:
    """How often the values go from below `low` to above `high` or back; 0 where the two are close (less than 4)."""
    side = np.where(values >= high, 1, np.where(values <= low, -1, 0))
    return int(np.count_nonzero(np.diff(side[side != 0]))) if high - low > 4 else 0


ALIKE = 0.98
"""Correlation of two positions from which on they are one motion: a measured one and its reference."""


@dataclass(frozen=True)
class Role:
    """A column in a role: "time", "angle", "wheel_angle", "wheel_speed", "voltage", "torque" or "reference"; of a mark
    in a video "point_x", "point_y", of one on the pivot "pivot_x", "pivot_y".

    unit: stated or guessed, "" where unknown; why: the reason of the guess; sure: whether the name supports it.
    """

    role: str
    column: str
    unit: str
    why: str
    sure: bool


@dataclass(frozen=True, eq=False)
class Candidate:
    """A column with its scores by role and the unit that is stated, "" for none."""

    column: Column
    scores: dict[str, float]
    unit: str

    @property
    def name(self) -> str:
        """The column's name."""
        return self.column.name

    @property
    def values(self) -> Array:
        """The column's numbers."""
        return self.column.values

    def unit_in(self, role: str) -> str:
        """The stated unit where it is one of this role, else ""."""
        return self.unit if self.unit in ROLE_UNITS[role] else ""


def fits(candidate: Candidate, role: str) -> float:
    """Score of a role by name and unit; negative where the unit is another quantity's."""
    score = candidate.scores[role]
    if candidate.unit and any(candidate.unit in units for units in ROLE_UNITS.values()):
        score += 2.0 if candidate.unit in ROLE_UNITS[role] else -4.0
    elif candidate.unit in SPEED_UNITS or candidate.unit == "px":
        score -= 4.0
    return score - candidate.scores["other"]


def alike(first: Candidate, second: Candidate) -> bool:
    """Return whether two columns are one motion, measured or reference: correlated and of similar range."""
    ratio = first.column.span / max(second.column.span, 1e-300)
    return 0.3 < ratio < 3.0 and correlation(thin(first.values), thin(second.values)) > ALIKE
