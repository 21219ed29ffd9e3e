"""Kernels for the processor's vector units: their `njit`, and 512-bit vectors where the processor has them.

LLVM uses half of a 512-bit register on many processors (Intel from Skylake on), because code that seldom requires all
of it loses more by the lower clock than it gains. It decides so per function, by the attribute
"prefer-vector-width"; the functions here are long loops of arithmetic, and set it for themselves alone. A processor
without such registers ignores it, and kernels elsewhere, those of other packages too, are compiled as before.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numba
from numba.core import types
from numba.extending import intrinsic

from swingid.numerics import compiled

WIDTH = '"prefer-vector-width"="512"'


@intrinsic  # type: ignore[untyped-decorator]
def widest(typing: object) -> tuple[Any, Any]:
    """Let the loops of the function that calls this use the widest vectors there are; nothing is done at run time."""
    del typing

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature, arguments
        set.add(builder.function.attributes, WIDTH)  # llvmlite's own `add` knows no attribute with a value
        return context.get_dummy_value()

    return types.void(), codegen


njit_lane: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", forceinline=True, fastmath={"contract", "nsz"}
)
"""For the arithmetic of one run inside a loop over runs: inlined, products and sums fused."""

njit_threads: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", nogil=True, fastmath={"contract", "nsz"}
)
"""For what runs beside other threads."""
