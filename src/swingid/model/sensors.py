"""Encoders and their imperfections, each optional and off by default.

A reading is q + alpha cos q + beta sin q (integral nonlinearity, once per turn), plus the offset of the
encoder's zero, plus white noise, rounded to the nearest step of the resolution. Rounding rather than
flooring: the difference is half a step of offset, which a real log carries in its zero. When a reading
happens (latency, jitter) is no property of its value: who reads evaluates the motion at the true instant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined

# Places in an encoder's array.
RESOLUTION, ALPHA, BETA, ZERO = 0, 1, 2, 3


@njit_inlined
def encoder_reading(q: float, encoder: Array, noise: float) -> float:
    """Reading (rad or m) of the true angle q with one draw of noise; `encoder` from `Encoder.array`."""
    reading = q + encoder[ZERO] + noise
    if encoder[ALPHA] != 0.0 or encoder[BETA] != 0.0:
        reading += encoder[ALPHA] * math.cos(q) + encoder[BETA] * math.sin(q)
    if encoder[RESOLUTION] > 0.0:
        reading = encoder[RESOLUTION] * np.rint(reading / encoder[RESOLUTION])
    return float(reading)


@dataclass(frozen=True, slots=True)
class Encoder:
    """One encoder with everything that is wrong with it; the default is perfect.

    resolution: rad (m) per count, 0 continuous. alpha, beta: rad (m), cosine and sine part of the integral
    nonlinearity. zero: rad (m), what it reads at q = 0.
    """

    resolution: float = 0.0
    alpha: float = 0.0
    beta: float = 0.0
    zero: float = 0.0

    def array(self) -> Array:
        """The array (4,) that `encoder_reading` takes."""
        return np.array([self.resolution, self.alpha, self.beta, self.zero])

    def read(self, angles: Array, noise: Array | None = None) -> Array:
        """Readings (rad or m) of true angles (n,), with noise (n,) added before the counts are taken."""
        draws = np.zeros(len(angles)) if noise is None else noise
        array = self.array()
        return np.array([encoder_reading(q, array, draw) for q, draw in zip(angles, draws, strict=True)])
