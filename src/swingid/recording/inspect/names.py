"""What the names of columns say, in the spellings that logs have: roles and units."""

from __future__ import annotations

import re

from swingid.recording.unit_names import UNITS, canonical

WORDS: dict[str, tuple[str, ...]] = {
    "time": (
        "t",
        "time",
        "tout",
        "times",
        "timestamp",
        "stamp",
        "zeit",
        "clock",
        "elapsed",
        "sec",
        "secs",
        "seconds",
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
    "voltage": ("u", "u0", "v", "volt", "volts", "voltage", "vin", "vm", "spannung", "ua", "input", "uc"),
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
    "time": frozenset({"s", "ms", "us", "ns"}),
    "angle": frozenset({"rad", "deg", "turns", "counts", "m", "mm"}),
    "wheel": frozenset({"rad", "deg", "turns", "counts"}),
    "voltage": frozenset({"V", "mV"}),
    "torque": frozenset({"N m", "mN m", "N"}),
    "current": frozenset({"A", "mA"}),
}
SPEED_UNITS = frozenset({"rad/s", "deg/s", "rpm", "turns/s", "counts/s", "m/s"})
CONTAINERS = re.compile(r"\b(joint_?states?|field|header|msg|topic)\b(?=[/._])", re.IGNORECASE)
"""Parts of a name that say where a message came from, such as /joint_states/pendulum/position."""

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
