"""Which consistency checks an identification carried out: each has a record here, and marks itself when it runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """A consistency check in words, and the codes of the messages by which it reports a finding."""

    words: str
    codes: tuple[str, ...]


CHECKS = {
    "signs": Check("signs of the channels: inertia and gravity torque are positive", ()),
    "identifiability": Check(
        "identifiability: the motion determines the parameters", ("gravity-and-inertia", "near-resonance")
    ),
    "motor": Check(
        "equation (II): wheel angle, sign of the voltage and motor constants",
        ("voltage-sign", "wheel-angle-reading", "motor-balance", "drive-held"),
    ),
    "angle-zero": Check("zero of the angle", ("zero-off",)),
    "angle-scale": Check("scale of the angle", ("angle-scale",)),
    "gravity-torque": Check("gravity torque as stated against the log", ("gravity-torque-disagrees",)),
    "encoders": Check("encoder nonlinearity as stated against the log", ("encoder-nonlinearity",)),
    "place": Check("torques that depend on the angle and are not stated", ("place-torque",)),
    "closure": Check("the balance closes: its residuals are small", ("balance-open",)),
    "latency": Check("timing of the channels against each other", ("late-channel",)),
    "parts": Check("parts of the log agree with one another", ("parts-disagree",)),
    "stability": Check(
        "friction and zero of the angle do not change within the log",
        ("friction-changes", "zero-drifts", "second-half-not-predicted", "mirrored-parts-differ"),
    ),
    "momentum": Check("agreement with the momentum balance of the same swings", ("disagrees-with-momentum",)),
    "saturation": Check("saturation of the voltage", ("voltage-saturated",)),
}
"""The checks by name, in the order of a report."""

_ran: ContextVar[set[str] | None] = ContextVar("checks that ran", default=None)


def ran(name: str) -> None:
    """Record that the check `name` is carried out; called where it has what it needs."""
    assert name in CHECKS
    names = _ran.get()
    if names is not None:
        names.add(name)


@contextmanager
def recorded() -> Iterator[set[str]]:
    """The names of the checks that ran inside the block, once it has ended."""
    names: set[str] = set()
    token = _ran.set(names)
    try:
        yield names
    finally:
        _ran.reset(token)


def in_order(names: set[str]) -> tuple[str, ...]:
    """Names of checks in the order of `CHECKS`."""
    return tuple(name for name in CHECKS if name in names)
