"""Motions worth a look: sines and pairs of sines within the limits, away from resonance."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from swingid.control.references import Multisine, Sine
from swingid.model.rig import Rig
from swingid.study.design.course import course_of

Build = Callable[[float], Sine | Multisine]
"""A motion from its amplitude."""

FREQUENCIES = (1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.5, 10.0, 12.0, 15.0, 20.0, 25.0)
"""rad/s; what a person might ask of a rig with a motor."""

SPARE = 0.8
"""Share of the voltage limit that a motion may need: the controller wants the rest."""

SHARES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.08)
"""Amplitudes tried, in shares of the largest allowed."""

SPLIT = (0.6, 0.4)
"""Amplitudes of the slower and the faster of two sines."""

APART = (1.5, 3.5)
"""Least and largest ratio of two frequencies."""

RESONANCE = (0.6, 1.35)
"""A sine between these shares of the frequency of the free swing is near resonance: the wheel hardly works."""

ROUGH = 200.0
"""Rows per second at which limits are checked."""


@dataclass(frozen=True)
class Limits:
    """Largest angle (rad, m), wheel speed or, without a wheel, speed of the axis (rad/s, m/s; None: any), voltage."""

    angle: float
    speed: float | None
    voltage: float | None

    def kept(self, peaks: dict[str, float]) -> bool:
        """Whether a motion with these peaks stays inside, with what the controller wants to spare."""
        speed = peaks.get("wheel_speed", peaks["speed"])
        if self.speed is not None and speed > self.speed:
            return False
        return self.voltage is None or peaks.get("voltage", 0.0) <= SPARE * self.voltage


def candidates(rig: Rig, limits: Limits, natural: float, slowest: float) -> list[Sine | Multisine]:
    """Sines and pairs of sines at the largest amplitude that the limits allow.

    natural: frequency of the free swing (rad/s); slowest: the slowest allowed by the length of the run.
    """
    unit = "rad" if rig.axis.kind == "rotary" else "m"
    found: list[Sine | Multisine] = []
    for build in (*_sines(natural, slowest, unit), *_pairs(natural, slowest, unit)):
        for share in SHARES:
            motion = build(share * limits.angle)
            if limits.kept(course_of(rig, motion, 8.0, ROUGH).peaks):
                found.append(motion)
                break
    return found


def _sines(natural: float, slowest: float, unit: str) -> Iterator[Build]:
    low, high = RESONANCE[0] * natural, RESONANCE[1] * natural
    for frequency in FREQUENCIES:
        if frequency >= slowest and not low < frequency < high:
            yield partial(_sine, frequency, unit)


def _pairs(natural: float, slowest: float, unit: str) -> Iterator[Build]:
    for slow, fast in combinations(FREQUENCIES, 2):
        apart = APART[0] <= fast / slow <= APART[1]
        if slow >= slowest and apart and fast > RESONANCE[1] * natural:
            yield partial(_pair, (slow, fast), unit)


def _sine(frequency: float, unit: str, amplitude: float) -> Sine:
    return Sine(_neat(amplitude), frequency, 0.0, unit)


def _pair(frequencies: tuple[float, float], unit: str, amplitude: float) -> Multisine:
    parts = zip(SPLIT, frequencies, strict=True)
    return Multisine(tuple(_sine(frequency, unit, share * amplitude) for share, frequency in parts))


def _neat(amplitude: float) -> float:
    """Two digits, rounded down."""
    digits = 10.0 ** (np.floor(np.log10(amplitude)) - 1)
    return float(f"{np.floor(amplitude / digits + 1e-9) * digits:.6g}")
