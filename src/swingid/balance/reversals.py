"""The impulse at each reversal, by dynamic friction or a late turning point: when it is an unknown, and what is left.

LuGre's bristles, backlash and short sticking let the old direction act a moment longer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from swingid.balance.delays import Torque, dry_friction
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.uncertainty.significance import DETECTED

REVERSAL = 0.1
"""Longest time, in swings, over which dry friction of a free decay may still have its old direction.

Nothing but friction acts at its reversals, where a drive has backlash and latencies, too. What acts longer is no
impulse at the reversal. The impulses that LuGre's bristles and Stribeck's peak make in simulated logs are 0.001 to 0.07
of the dry friction times a swing; those that correlated errors of a camera or a rate gyro make in logs without dry
friction are 0.12 and more (logs of benchmarks/strangers.py), and bias the inertia by 1 to 8 %.
"""

USUAL = 0.01
"""Usual impulse of dynamic friction, as a share of dry friction times a swing: the geometric mean of 0.001 and 0.1,
between which those of simulated logs and `REVERSAL` are."""

LIKELIER = 0.5
"""Probability of such an impulse from which on it is more likely than none."""

IMPULSES = ("memory", "memory_equal")
"""Impulses at the reversals: by a way over which friction keeps its direction, and what is the same at each of them
beyond that (bristles' damping, a late turning point)."""

TIMING = "timing of the turning points"
"""Source of uncertainty by an impulse that is no unknown."""

VARIED = 0.1
"""Standard deviation of the weights of the reversals from which on the two can be distinguished."""


class Impulse(NamedTuple):
    """Its terms that are unknowns, none where it is left out, and its standard uncertainty (N m s or N s) then."""

    terms: tuple[str, ...]
    left: float


def impulse_found(
    equation: Equation, motion: Motion, fitted: tuple[float, float], expected: tuple[float, float], dry: float
) -> Impulse:
    """Return whether the impulse that the rows show is an unknown.

    It is where it is significant, and in a driven motion where it is likelier than not and to leave it out leaves more
    uncertain than its estimate is; in a free decay a weak one is more often a correlated error of the angle, and left
    out it is in the interval. fitted: the impulse with its standard uncertainty by a fit of "memory" alone. expected:
    see `impulses_expected`. dry: dry friction (N m or N) in the same log.
    """
    size, spread = abs(fitted[0]), fitted[1]
    remaining, probability = impulse_left(expected[0], size, spread, expected[1])
    likely = equation.driven and probability > LIKELIER and remaining > spread
    seen = (size > DETECTED * spread or likely) and impulse_possible(equation, motion, size, dry)
    return Impulse(impulses_of(motion) if seen else (), remaining)


def impulses_of(motion: Motion) -> tuple[str, ...]:
    """The terms of an impulse that is an unknown: both parts of IMPULSES where the reversals differ."""
    return IMPULSES if float(np.std(motion.reversals[2])) > VARIED else IMPULSES[:1]


def impulses_expected(motion: Motion, late: Array, torque: Torque, levels: Array) -> tuple[float, float]:
    """The impulse by turning points that are late by `late` s, and the usual one of such friction (N m s or N s)."""
    dry = dry_friction(torque, levels)
    return float(np.sqrt(np.mean(late**2))) * 2 * dry, USUAL * motion.half_period * dry


def impulse_possible(equation: Equation, motion: Motion, impulse: float, dry: float) -> bool:
    """Return whether dry friction (N m or N) can have made an impulse of this size at each reversal, see `REVERSAL`.

    What is fitted in place of dry friction may be negative in a free decay: it drives the motion, and has no memory.
    """
    return equation.driven or impulse < REVERSAL * motion.half_period * dry


def impulse_left(prior: float, fitted: float, spread: float, usual: float = 0.0) -> tuple[float, float]:
    """Standard uncertainty of the impulse at each reversal (N m s or N s) where the rows give `fitted` ± `spread`.

    The correction of the turning points has a standard uncertainty equal to its magnitude (`prior`), for friction at
    rest is extrapolated from faster motion, where a short peak does not show. Dry friction has a memory of its own, an
    impulse of the size `usual`, or has none: as likely a priori, weighted by the likelihood of `fitted` (Bayesian model
    averaging). The rows reduce each to its posterior. Returned: the root of its mean square, the probability of memory.
    """
    priors = np.array([prior**2, prior**2 + usual**2])
    variances = np.maximum(priors + spread**2, 1e-300)
    likelihood = np.exp(-0.5 * fitted**2 * (1.0 / variances - 1.0 / variances[1])) / np.sqrt(variances)
    weight, probability = priors / variances, likelihood / likelihood.sum()
    squares = (weight * fitted) ** 2 + weight * spread**2
    return float(np.sqrt(probability @ squares)), float(probability[1])
