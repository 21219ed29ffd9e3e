"""What every reference motion offers, and how turning points are found where no formula gives them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from swingid.errors import UsageError
from swingid.numerics.arrays import Array

UNITS = ("rad", "m")


@runtime_checkable
class Reference(Protocol):
    """A motion y_m(t) for the controller to follow, in rad or m. Derivatives are not needed."""

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s), shape of t."""
        ...

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the motion reverses, rising; the middle where it dwells."""
        ...

    def peak_speed(self, duration: float) -> float:
        """Largest |y_m'| (rad/s or m/s) over [0, duration]."""
        ...

    def describe(self) -> str:
        """The motion in the words of `parse_reference`, where these words exist."""
        ...


def refused(motion: str, problem: str) -> UsageError:
    """The error that names a motion and what is wrong with it."""
    return UsageError(f"Reference {motion}: {problem}.", code="bad-reference")


def require_positive(motion: str, unit: str = "rad", **values: float) -> None:
    """Raise UsageError unless every value is positive and finite and `unit` is rad or m; it names motion and value."""
    if unit not in UNITS:
        raise refused(motion, f"the unit must be rad or m, not {unit!r}")
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise refused(motion, f"{name.replace('_', ' ')} must be positive, and is {value}")


def require_axis(motion: object, kind: str) -> None:
    """Raise UsageError where a motion in rad is meant for a "linear" axis, or one in m for a "rotary" one.

    A motion without a unit, such as a plain function, suits both.
    """
    unit = getattr(motion, "unit", None)
    wanted = "m" if kind == "linear" else "rad"
    if unit not in (None, wanted):
        words = motion.describe() if isinstance(motion, Reference) else "motion"
        sentence = f"Reference {words!r} is in {unit}, but the rig's axis is {kind}; give it in {wanted}."
        raise UsageError(sentence, code="bad-reference")


def inside(times: Array, duration: float) -> Array:
    """The times strictly between 0 and `duration`."""
    return times[(times > 0.0) & (times < duration)]


def crossings(
    f: Callable[[Array], Array],
    df: Callable[[Array], Array],
    slope: float,
    bend: float,
    start: float,
    stop: float,
) -> Array:
    """All sign changes of f in (start, stop), rising, none missed.

    `df` is the derivative, `slope` >= max |f'| and `bend` >= max |f''|. Intervals are halved until f keeps
    its sign or is monotone; a root that f only touches is dropped when its interval is too short to matter.
    """
    if not (stop > start and slope > 0.0 and bend > 0.0):
        return np.empty(0)
    count = max(1, math.ceil((stop - start) * bend / slope))
    edges = np.linspace(start, stop, count + 1)
    left, right = edges[:-1], edges[1:]
    shortest, most = 1e-9 * slope / bend, 2**20  # most: sums that nearly cancel everywhere
    instants: list[Array] = []
    while left.size:
        middle, half = 0.5 * (left + right), 0.5 * (right - left)
        f_left, f_right = f(left), f(right)
        changes = (f_left * f_right < 0.0) | (f_right == 0.0)
        clear = np.abs(f(middle)) > slope * half * (1.0 + 1e-9)
        settled = ~clear & ((np.abs(df(middle)) > bend * half) | (half < shortest) | (left.size > most))
        instants.append(_bisect(f, left[settled & changes], right[settled & changes]))
        again = ~clear & ~settled
        left, middle, right = left[again], middle[again], right[again]
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    roots = np.sort(np.concatenate(instants)) if instants else np.empty(0)
    return roots[(roots > start) & (roots < stop)]


def _bisect(f: Callable[[Array], Array], left: Array, right: Array) -> Array:
    """Roots in the brackets (left, right], to rounding."""
    if not left.size:
        return left
    sign = np.sign(f(left))
    for _ in range(60):
        middle = 0.5 * (left + right)
        same = np.sign(f(middle)) == sign
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return 0.5 * (left + right)


def sampled_turning_points(y: Callable[[Array], Array], duration: float, step: float) -> Array:
    """Turning points of a motion known only by its values: swings larger than a thousandth of the range.

    y: position (rad or m) at an array of times (s), for 0 to `duration` (s). `step` (s) must be short against the
    swings. A dwell is reported by its middle, a smooth reversal to about step^2 times the cube of its frequency. Not
    for motions with a formula.
    """
    from swingid.numerics.reversals import reversals

    if not duration > 0.0:
        return np.empty(0)
    times = np.linspace(0.0, duration, max(3, math.ceil(duration / step) + 1))
    values = y(times)
    span = float(np.ptp(values))
    if not span > 0.0:
        return np.empty(0)
    extremes = [_middle_of_extreme(y, times, values, k, 1e-9 * span) for k in reversals(values, 1e-3 * span) if k > 0]
    return inside(np.asarray(extremes, dtype=float), duration)


def _middle_of_extreme(y: Callable[[Array], Array], times: Array, values: Array, k: int, flat: float) -> float:
    """Time of the extreme near sample k: the middle of its plateau, or where the motion is level."""
    first = last = k
    while first > 0 and abs(values[first - 1] - values[k]) <= flat:
        first -= 1
    while last < len(values) - 1 and abs(values[last + 1] - values[k]) <= flat:
        last += 1
    if last - first > 2 or first == 0 or last == len(values) - 1:
        return float(0.5 * (times[first] + times[last]))
    reach = 0.05 * (times[1] - times[0])
    bracket = times[first - 1 : first], times[last + 1 : last + 2]
    return float(_bisect(lambda t: y(t + reach) - y(t - reach), *bracket)[0])
