"""Kernels for the processor's vector units: their `njit`, 512-bit vectors where there are any, elementary functions.

LLVM uses half of a 512-bit register on many processors (Intel from Skylake on), because code that seldom requires all
of it loses more by the lower clock than it gains. It decides so per function, by the attribute
"prefer-vector-width"; the functions here are long loops of arithmetic, and set it for themselves alone. A processor
without such registers ignores it, and kernels elsewhere, those of other packages too, are compiled as before.

Elementary functions are straight-line arithmetic, so that the compiler computes them for many runs at once: a call of
the library's sin or exp keeps a loop scalar. Reduction by Cody and Waite, polynomials written so that few of their
products wait for others.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic

from swingid.numerics.compiled import helpers, kernels

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


njit_lane = helpers(forceinline=True, fastmath={"contract", "nsz"}, _nrt=False)
"""For the arithmetic of one run inside a loop over runs: inlined, products and sums fused; makes no array, as
`compiled.njit_inlined`."""

njit_part = helpers(fastmath={"contract", "nsz"}, _nrt=False)
"""The same for what is not inlined, as a hot loop seldom calls it."""

njit_threads = kernels(nogil=True, fastmath={"contract", "nsz"}, _nrt=False)
"""For what Python calls beside other threads; makes no array."""

njit_sums = helpers(fastmath={"reassoc", "contract", "nsz"})
"""For functions of kernels whose sums may be reordered."""

njit_sums_threads = kernels(nogil=True, fastmath={"reassoc", "contract", "nsz"})
"""For such kernels, which Python calls beside other threads."""

LARGEST_ANGLE = 1e5
"""rad: up to here `sine_cosine` is exact to 1e-15; a rig that turns further is not for many runs at once."""

TWO_OVER_PI = 2.0 / np.pi
# pi/2 in two parts; n times the first is exact for |n| < 2^20 (fdlibm, e_rem_pio2.c).
HALF_PI_1, HALF_PI_2 = 1.57079632673412561417e00, 6.07710050650619224932e-11
# Minimax polynomials on |r| <= pi/4 (fdlibm, k_sin.c, k_cos.c).
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11

LOG2E, LN2_HIGH, LN2_LOW = 1.4426950408889634074, 6.93147180369123816490e-01, 1.90821492927058770002e-10
DEEPEST = 700.0


@njit_lane
def sine_cosine(x: float) -> tuple[float, float]:
    """Sine and cosine of x (rad), |x| < LARGEST_ANGLE, each to 1e-15."""
    n = np.rint(x * TWO_OVER_PI)
    r = (x - n * HALF_PI_1) - n * HALF_PI_2
    z = r * r
    zz = z * z
    s = r + r * z * ((S1 + z * S2) + zz * ((S3 + z * S4) + zz * (S5 + z * S6)))
    c = (1.0 - 0.5 * z) + zz * ((C1 + z * C2) + zz * ((C3 + z * C4) + zz * (C5 + z * C6)))
    quarter = n - 4.0 * np.floor(0.25 * n)
    swapped = (quarter == 1.0) | (quarter == 3.0)
    sine, cosine = (c, s) if swapped else (s, c)
    return (-sine if quarter >= 2.0 else sine), (-cosine if (quarter == 1.0) | (quarter == 2.0) else cosine)


@njit_lane
def decay(x: float) -> float:
    """exp(-x) for x >= 0 to 1e-15 of its value; beyond 700 it stays at exp(-700)."""
    x = x if x < DEEPEST else DEEPEST
    n = np.rint(x * LOG2E)
    r = (n * LN2_HIGH - x) + n * LN2_LOW
    rr = r * r
    low = (1 / 2 + r * (1 / 6)) + rr * ((1 / 24 + r * (1 / 120)) + rr * (1 / 720 + r * (1 / 5040)))
    high = (1 / 40320 + r * (1 / 362880)) + rr * (1 / 3628800 + r * (1 / 39916800))
    high += (rr * rr) * (1 / 479001600 + r * (1 / 6227020800))
    p = 1.0 + (r + rr * (low + (rr * rr) * (rr * high)))
    return float(p * np.int64((1023 - np.int64(n)) << 52).view(np.float64))
