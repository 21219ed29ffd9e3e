"""Do several logs agree? Each is compared with the others, with the covariance of the difference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from swingid.pooling.pooling import pool
from swingid.pooling.shares import Estimate, sum_of
from swingid.uncertainty.significance import family_level


@dataclass(frozen=True)
class Deviation:
    """Log number `log` less the pooled value of the others, its standard uncertainty; `beyond`: it is significant."""

    log: int
    value: float
    u: float
    beyond: bool

    @property
    def normalised(self) -> float:
        """E_n of ISO 13528 (9.7) and ISO/IEC 17043: the deviation over its expanded uncertainty, k = 2."""
        return self.value / (2 * self.u) if self.u > 0 else math.copysign(math.inf, self.value)


def deviations(estimates: Sequence[Estimate]) -> list[Deviation]:
    """Each log against the pooled value of the others (leave one out), common sources cancelled.

    The scatter between logs is left out of the uncertainties: it is what is tested here.
    """
    if len(estimates) < 2:
        return []
    limit = family_level(len(estimates))
    found = []
    for k, estimate in enumerate(estimates):
        others = [other for j, other in enumerate(estimates) if j != k]
        rest = sum_of(others, pool(others).weights)
        gap = sum_of([estimate, rest], [1.0, -1.0])
        floor = 1e-9 * abs(estimate.value)
        u = math.hypot(gap.u, floor)
        found.append(Deviation(k, gap.value, u, abs(gap.value) > limit * u))
    return found


def outliers(estimates: Sequence[Estimate]) -> list[Deviation]:
    """The logs that disagree with the rest, the worst first: it is taken out and the others are tested again.

    Of two logs that disagree both are returned, for nothing shows which is right. So are all where no majority agrees.
    """
    left = list(range(len(estimates)))
    named: list[Deviation] = []
    while len(left) > 1:
        tested = deviations([estimates[k] for k in left])
        worst = max(tested, key=lambda d: abs(d.normalised))
        if not worst.beyond:
            break
        if len(left) == 2 or len(named) + 1 >= math.ceil(len(estimates) / 2):
            return deviations(estimates)
        named.append(Deviation(left[worst.log], worst.value, worst.u, True))
        left.remove(left[worst.log])
    return named
