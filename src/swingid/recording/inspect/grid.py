"""The grid on which a column's values lie: steps of an encoder or a converter, or digits that were written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array


FEWEST = 10
MOST = 20_000
OFF = 0.02
"""Distance from a multiple of the step, in steps, within which a change is one."""

SURE = 0.99
"""Share of the changes that have to be multiples of the step."""


def grid_of(values: Array) -> float:
    """The step of which all changes between rows are multiples, 0 where there is none; values (n,) finite.

    Found from the changes between rows, the small ones first: the step is refined on ever larger changes, so that it is
    known to a fraction of a step over the whole range.
    """
    stride = max(1, len(values) // MOST)
    changes = np.abs(np.diff(values)) if stride == 1 else np.abs(values[1::stride] - values[:-1:stride])
    largest = float(np.abs(values).max(initial=0.0))
    rounding = 4e-16 * largest
    changes = np.sort(changes[changes > 8 * rounding])
    if len(changes) < FEWEST:
        return 0.0
    for start in (changes[0], changes[len(changes) // 200], changes[len(changes) // 20]):
        step = _refined(changes, float(start))
        off = np.abs(changes / step - np.round(changes / step))
        if np.mean(off < OFF + 2 * rounding / step) > SURE and changes[-1] > 1.5 * step:
            return step
    return 0.0


def _refined(changes: Array, step: float) -> float:
    """Least-squares step on the changes up to 3, 30, 300 … steps; changes sorted."""
    reach = 3.0
    for _ in range(8):
        near = changes[: np.searchsorted(changes, reach * step)]
        counts = np.round(near / step)
        good = np.abs(near / step - counts) < 0.2
        counts, near = counts[good & (counts > 0)], near[good & (counts > 0)]
        if not len(near):
            break
        step = float((near * counts).sum() / (counts**2).sum())
        if near[-1] == changes[-1]:
            break
        reach *= 10
    return step


def is_decimal(step: float) -> bool:
    """Whether a step is 1, 2 or 5 times a power of ten, as of written digits rather than of an encoder."""
    if step <= 0:
        return False
    mantissa = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
    return bool(min(abs(mantissa - m) for m in (1.0, 2.0, 5.0, 10.0)) < 1e-6 * mantissa)
