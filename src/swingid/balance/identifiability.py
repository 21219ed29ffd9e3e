"""Identifiability: rank, condition, and the unknowns with which the wanted one is correlated.

Shared by every method whose estimate is linear in its unknowns: from the regressors of its equations, or from the
information matrix (the inverse of the covariance). Columns are scaled to unit length, so that neither units nor sizes
matter (Belsley, Kuh, Welsch: Regression diagnostics, 1980, ch. 3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from swingid.errors import NotIdentifiableError
from swingid.format import number, percent
from swingid.model.terms import TERMS, words_of
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear

HOPELESS = 0.3
"""Relative standard uncertainty of the inertia above which the estimate is refused."""

SINGULAR = 1e-9
"""Singular value of the scaled columns, in shares of the largest, below which a direction is not identifiable."""

HARDLY = 1.1
"""Inflation of the standard uncertainty below which it is called small, without a number."""

GREATLY = 10.0
"""Inflation from which on pairs of unknowns are searched that only together are correlated with the wanted one."""

BLIND = 1e-3
"""Component of an unidentifiable direction above which an unknown takes part in it."""

TRADES = 0.5
"""Squared correlation above which an unknown is called correlated with the wanted one."""


@dataclass(frozen=True)
class Identifiability:
    """Identifiability of the unknowns, and the correlations of the unknown `wanted`, the first of `names`.

    rank: number of identifiable directions. condition: of the columns scaled to unit length, infinite below full rank.
    covariance (unknowns, unknowns): that of the identifiable directions. blind (unknowns,): component of each unknown
    in the other directions (0 … 1). inflation: standard uncertainty of `wanted` over that with all others known,
    infinite where it is not identifiable.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rank: int
    condition: float
    covariance: Array
    blind: Array
    inflation: float

    @property
    def wanted(self) -> str:
        """The unknown that is examined."""
        return self.names[0]

    @property
    def answerable(self) -> bool:
        """Return whether the wanted unknown is identifiable."""
        return bool(self.blind[0] < BLIND)

    @property
    def together(self) -> tuple[str, ...]:
        """The wanted unknown and those correlated with it, in the order of their correlation."""
        if not self.answerable:
            order = np.argsort(-self.blind[1:], kind="stable") + 1
            return (self.wanted, *(self.names[k] for k in order if self.blind[k] >= BLIND))
        variances = np.maximum(np.diag(self.covariance), 1e-300)
        squared = self.covariance[0] ** 2 / (variances[0] * variances)
        order = np.argsort(-squared[1:], kind="stable") + 1
        names = (self.wanted, *(self.names[k] for k in order if squared[k] > TRADES))
        return names if len(names) > 1 or self.inflation < GREATLY else (self.wanted, *self._pair())

    def _pair(self) -> tuple[str, ...]:
        """The two unknowns that together explain most of the wanted one, where no single one does: two springs."""
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        correlation = self.covariance / np.outer(spread, spread)
        best, pair = TRADES, tuple[str, ...]()
        for i, j in combinations(range(1, len(self.names)), 2):
            correlations = correlation[[i, j]]
            explained = float(correlations[:, 0] @ fit_linear(correlations[:, [i, j]], correlations[:, 0]).values)
            if explained > best:
                best, pair = explained, (self.names[i], self.names[j])
        return pair

    @property
    def price(self) -> str:
        """Inflation of the wanted unknown's uncertainty by the other unknowns, in words."""
        if self.inflation < HARDLY:
            return f"the other unknowns add little to the uncertainty of the {self.wanted}"
        return f"the other unknowns make the uncertainty of the {self.wanted} {self.inflation:.2g} times larger"

    def relative(self, value: float) -> float:
        """Relative standard uncertainty of the wanted unknown at this `value`; infinite if it is not identifiable."""
        return float(np.sqrt(self.covariance[0, 0])) / max(abs(value), 1e-300) if self.answerable else float("inf")

    def scaled_to(self, uncertainty: float) -> Identifiability:
        """The same with the rows' error set so that the wanted unknown has this standard uncertainty."""
        variance = float(self.covariance[0, 0])
        if not (self.answerable and variance > 0 and np.isfinite(uncertainty)):
            return self
        return replace(self, covariance=self.covariance * (uncertainty**2 / variance))

    def combination(self, values: Mapping[str, float]) -> str:
        """Correlations of the wanted unknown, in words: a clause without a full stop. `values` of the unknowns."""
        together = [words_of(name) for name in self.together]
        if len(together) == 1:
            correlated = (
                "is not correlated with the other parameters" if self.answerable else "has no effect on the rows"
            )
            return f"{together[0]} {correlated}"
        text = f"{', '.join(together[:-1])} and {together[-1]} are correlated"
        if not self.answerable:
            return text
        moves = self.covariance[0] / np.sqrt(self.covariance[0, 0])
        sizes = []
        for name in self.together:
            k, value = self.names.index(name), values.get(name, 0.0)
            unit = self.units[k]
            sizes.append(percent(moves[k] / value, sign=True) if value else number(moves[k], unit, 2))
        return f"{text} (by one standard uncertainty, they change together by {' and '.join(sizes)})"


def examine(names: Sequence[str], units: Sequence[str], columns: Array, noise: float = 1.0) -> Identifiability:
    """Identifiability by linear equations: columns (rows, unknowns), and the standard deviation of one row's error.

    The first unknown is the wanted one. The errors of rows are independent: give rows divided by their errors where
    these differ, and the information matrix to `examine_information` where they are correlated.
    """
    sizes = np.linalg.norm(columns, axis=0)
    scale = np.where(sizes > 0, sizes, 1.0)
    missing = max(len(scale) - len(columns), 0)  # rows of zeros: every direction then has a singular value
    _, s, vt = np.linalg.svd(np.vstack([columns / scale, np.zeros((missing, len(scale)))]), full_matrices=False)
    seen = s > SINGULAR * max(float(s[0]), 1e-300)
    half = vt[seen] / s[seen, None]
    covariance = (half.T @ half) * noise**2 / np.outer(scale, scale)
    blind = np.sqrt((vt[~seen] ** 2).sum(axis=0))
    return Identifiability(
        names=tuple(names),
        units=tuple(units),
        rank=int(seen.sum()),
        condition=float(s[0] / s[-1]) if seen[-1] else float("inf"),
        covariance=covariance,
        blind=blind,
        inflation=float(np.linalg.norm(half[:, 0])) if blind[0] < BLIND else float("inf"),
    )


def examine_information(names: Sequence[str], units: Sequence[str], information: Array) -> Identifiability:
    """Identifiability by an information matrix (unknowns, unknowns): the inverse of the covariance of the unknowns.

    It contains squares of the columns, so directions below 1e-8 of the largest are rounding and not identifiable.
    """
    diagonal = np.sqrt(np.maximum(np.diag(information), 0.0))
    scale = np.where(diagonal > 0, diagonal, 1.0)
    powers, directions = np.linalg.eigh(information / np.outer(scale, scale))
    roots = np.sqrt(np.where(powers > 1e-16 * max(float(powers[-1]), 1e-300), powers, 0.0))
    # of an unknown without information nothing is seen, not even what rounding leaves
    return examine(names, units, (directions * roots).T * np.where(diagonal > 0, scale, 0.0))


def second_frequency(frequency: float, natural: float) -> float:
    """A frequency (rad/s) to add to a motion of `frequency`: well away from it and from the free swing's, `natural`."""
    lower = frequency / 1.7
    chosen = lower if lower > 1.4 * natural else max(frequency * 1.7, 1.4 * natural)
    return float(f"{chosen:.2g}")


def advice(seen: Identifiability, frequency: float | None = None, natural: float = 0.0, *, key: str = "") -> str:
    """How to make the wanted unknown identifiable; frequency: the motion's (rad/s), natural: the free swing's.

    key: of a constant that to state helps, in place of those of the torques that are correlated with the inertia.
    """
    others = [name for name in seen.together if name in TERMS and TERMS[name].is_conservative]
    if others and "inertia" in seen.together:
        return advice_on_gravity(frequency, natural, [key] if key else [TERMS[name].key or name for name in others])
    return "record larger or faster swings, or more of them"


def advice_on_gravity(
    frequency: float | None = None,
    natural: float = 0.0,
    keys: Sequence[str] = ("axis.gravity_torque",),
    *,
    driven: bool = True,
) -> str:
    """How to distinguish the inertia from torques of the angle, stated under `keys`: gravity, springs, cogging.

    driven: whether a drive moves the body; one that swings freely has its own frequency only.
    """
    if not driven:
        return f"give {' or '.join(keys)} (a gravity torque is 0 on a wire and on a vertical axis)"
    such = "" if frequency is None else f", such as {second_frequency(frequency, natural):g} rad/s"
    more = " and a second amplitude" if len(keys) > 1 else ""
    return f"add a second frequency{such}{more}, or give {' or '.join(keys)}"


def require_seen(seen: Identifiability, frequency: float | None = None, natural: float = 0.0, *, key: str = "") -> None:
    """Raise NotIdentifiableError, with `advice`, where the wanted unknown is not identifiable."""
    if seen.answerable:
        return
    raise NotIdentifiableError(
        f"{words_of(seen.wanted)} is not identifiable: in this motion {seen.combination({})}; "
        f"{advice(seen, frequency, natural, key=key)}."
    )
