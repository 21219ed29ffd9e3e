"""`njit_inlined`: `njit` for the small functions of a hot loop, which cost more to call than to run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numba

from swingid.numerics import compiled

njit_inlined: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", forceinline=True
)
