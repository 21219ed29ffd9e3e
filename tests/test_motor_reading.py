"""Which reading of the wheel angle row (II) speaks for, where noise is all that few windows show."""

from __future__ import annotations

import numpy as np

from swingid.identify.momentum.checks import CLEARLY
from swingid.identify.motor_balance import FEWEST_ROWS, _Reading

NOISE, EVERY = 0.01, np.ones(FEWEST_ROWS, bool)


def reading(rng: np.random.Generator, missing: float) -> float:
    """What is left of as few windows as are looked at, with noise and a term of the size `missing` left out."""
    free = rng.standard_normal((FEWEST_ROWS, 3))
    driven = free @ [1.0, 0.5, 0.2]
    left_out = missing * rng.standard_normal(FEWEST_ROWS)
    inertial = driven + left_out + NOISE * rng.standard_normal(FEWEST_ROWS)
    return _Reading(inertial, driven, np.zeros(FEWEST_ROWS), free).refitted(EVERY, NOISE**2)


def ratios(missing: float) -> np.ndarray:
    """Of the reading that leaves noise alone to one that misses a term, for 500 draws."""
    rng = np.random.default_rng(5)
    return np.array([reading(rng, 0.0) / reading(rng, missing) for _ in range(500)])


def test_noise_alone_speaks_for_no_reading() -> None:
    # without the least that noise may leave, 7 % of such pairs differ by more than CLEARLY
    assert np.mean(ratios(0.0) < CLEARLY) < 0.01


def test_a_missing_term_beyond_the_noise_speaks_against_a_reading() -> None:
    assert np.mean(ratios(20 * NOISE) < CLEARLY) > 0.99
