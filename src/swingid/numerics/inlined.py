"""`njit_inlined`: `njit` for the small functions of a hot loop, which cost more to call than to run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numba

from swingid.numerics import compiled

njit_inlined: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", forceinline=True, _nrt=False
)
"""For functions that neither make nor return an array, nor call one that does.

Without numba's runtime (_nrt) an array that is passed on is not counted as one more reference. The compiler cannot take
these counts out where a function branches, and in a hot loop they cost more than the rest of the function.
"""

njit_inlined_with_arrays: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", forceinline=True
)
"""For the others."""
