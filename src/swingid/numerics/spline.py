"""Cubic splines through samples at any instants, and local polynomial smoothing.

Own code because the common path of a command must not pay for importing ``scipy.interpolate``.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_sums
from swingid.numerics.regression import cholesky


@njit
def rows_before(time: Array, instant: float, included: bool) -> int:
    """Stamps of rising `time` before `instant`, with `included` also one at it: `np.searchsorted`, left or right."""
    count = len(time)
    share = (instant - time[0]) / (time[count - 1] - time[0])
    low = high = int(min(share, 1.0) * (count - 1)) if share > 0.0 else 0
    step = 1
    while low > 0 and not (time[low - 1] < instant or (included and time[low - 1] == instant)):
        low, step = max(low - step, 0), 2 * step
    step = 1
    while high < count and (time[high] < instant or (included and time[high] == instant)):
        high, step = min(high + step, count), 2 * step
    while low < high:
        middle = (low + high) // 2
        if time[middle] < instant or (included and time[middle] == instant):
            low = middle + 1
        else:
            high = middle
    return low


@njit
def spline_slopes(time: Array, values: Array) -> Array:
    """First derivatives at the knots of the natural cubic spline through `values` at strictly rising `time`.

    Thomas algorithm on the continuity of the second derivative, O(n). Needs at least two knots.
    """
    n = len(time)
    slopes = np.empty(n)
    if n == 2:
        slopes[:] = (values[1] - values[0]) / (time[1] - time[0])
        return slopes
    upper = np.empty(n)
    before = time[1] - time[0]
    secant = (values[1] - values[0]) / before
    upper[0] = 0.5
    slopes[0] = 1.5 * secant
    for k in range(1, n - 1):
        after = time[k + 1] - time[k]
        following = (values[k + 1] - values[k]) / after
        left = after / (before + after)
        right = 1.0 - left
        inverse = 1.0 / (2.0 - left * upper[k - 1])
        upper[k] = right * inverse
        slopes[k] = (3.0 * (left * secant + right * following) - left * slopes[k - 1]) * inverse
        before, secant = after, following
    slopes[n - 1] = (3.0 * secant - slopes[n - 2]) / (2.0 - upper[n - 2])
    for k in range(n - 2, -1, -1):
        slopes[k] -= upper[k] * slopes[k + 1]
    return slopes


@njit
def _solve_in_place(gram: Array, right: Array) -> None:
    """Solve a small positive definite system, lower triangle given, by Cholesky; the solution replaces `right`."""
    n = len(right)
    cholesky(gram)
    for a in range(n):
        for j in range(a):
            right[a] -= gram[a, j] * right[j]
        right[a] /= gram[a, a]
    for a in range(n - 1, -1, -1):
        for j in range(a + 1, n):
            right[a] -= gram[j, a] * right[j]
        right[a] /= gram[a, a]


@njit_sums
def _moments(time: Array, values: Array, at: float, half_width: float, powers: Array, products: Array) -> None:
    """Sums of s^0 … s^6 and of s^0 x … s^3 x over samples at s = (t − at)/half_width."""
    s1 = s2 = s3 = s4 = s5 = s6 = x0 = x1 = x2 = x3 = 0.0
    for k in range(len(time)):
        s = (time[k] - at) / half_width
        x = values[k]
        square = s * s
        s1 += s
        s2 += square
        s3 += square * s
        s4 += square * square
        s5 += square * square * s
        s6 += square * square * square
        x0 += x
        x1 += s * x
        x2 += square * x
        x3 += square * s * x
    powers[0] = len(time)
    powers[1], powers[2], powers[3], powers[4], powers[5], powers[6] = s1, s2, s3, s4, s5, s6
    products[0], products[1], products[2], products[3] = x0, x1, x2, x3


@njit
def local_cubic(time: Array, values: Array, at: Array, half_width: float) -> Array:
    """Value and first derivative at each instant of `at`, from a cubic fitted to the samples within `half_width`.

    Returns shape (len(at), 2); NaN where fewer than five samples lie in reach. The samples may be irregular;
    near an end of the log the window is one-sided. (Savitzky and Golay 1964 for regular samples.)
    """
    result = np.full((len(at), 2), np.nan)
    gram = np.empty((4, 4))
    powers = np.empty(7)
    products = np.empty(4)
    for i in range(len(at)):
        first = rows_before(time, at[i] - half_width, False)
        last = rows_before(time, at[i] + half_width, True)
        if last - first < 5:
            continue
        _moments(time[first:last], values[first:last], at[i], half_width, powers, products)
        for a in range(4):
            for c in range(a + 1):
                gram[a, c] = powers[a + c]
        _solve_in_place(gram, products)
        result[i, 0] = products[0]
        result[i, 1] = products[1] / half_width
    return result


@njit
def kinked_slopes(time: Array, values: Array, at: Array, half_width: float) -> Array:
    """Slope at each instant of `at` of a cubic whose curvature may jump there, fitted within `half_width`.

    Returns shape (len(at),); NaN where one side holds fewer than three samples or a quarter of those in reach, for a
    jump shows on both sides only. Four times as noisy as `local_cubic`.
    """
    result = np.full(len(at), np.nan)
    gram, right, terms = np.empty((5, 5)), np.empty(5), np.empty(5)
    for i in range(len(at)):
        first = rows_before(time, at[i] - half_width, False)
        last = rows_before(time, at[i] + half_width, True)
        before = rows_before(time, at[i], False) - first
        if 4 * min(before, last - first - before) < max(12, last - first):
            continue
        gram[:], right[:] = 0.0, 0.0
        middle = values[(first + last) // 2]
        for k in range(first, last):
            s = (time[k] - at[i]) / half_width
            terms[0], terms[1], terms[2], terms[3], terms[4] = 1.0, s, s * s, s * s * s, s * abs(s)
            for a in range(5):
                right[a] += terms[a] * (values[k] - middle)
                for c in range(a + 1):
                    gram[a, c] += terms[a] * terms[c]
        _solve_in_place(gram, right)
        result[i] = right[1] / half_width
    return result


@njit
def spline_at(time: Array, values: Array, slopes: Array, at: Array, derivative: int) -> Array:
    """Cubic Hermite interpolant of `values` and `slopes` (or its first derivative) at rising instants `at`."""
    result = np.empty(len(at))
    k = 0
    for i in range(len(at)):
        while k < len(time) - 2 and at[i] >= time[k + 1]:
            k += 1
        h = time[k + 1] - time[k]
        s = (at[i] - time[k]) / h
        rise = values[k + 1] - values[k]
        c2 = 3 * rise - h * (2 * slopes[k] + slopes[k + 1])
        c3 = h * (slopes[k] + slopes[k + 1]) - 2 * rise
        if derivative == 0:
            result[i] = values[k] + s * (h * slopes[k] + s * (c2 + s * c3))
        else:
            result[i] = slopes[k] + s * (2 * c2 + 3 * s * c3) / h
    return result
