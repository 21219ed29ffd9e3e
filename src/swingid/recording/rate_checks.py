"""What is wrong with a logged rate: a sensor at its limit, and one that is not the rate of the angle beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.recording.findings import Kind
from swingid.recording.rates import integral, without_line

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Ints
    from swingid.recording.conventions import Channels, Reading

APART = 0.1
"""Difference of the scales of an angle and of its rate beside it that no calibration explains: another unit or axis."""


def check_beside(channels: Channels, reading: Reading) -> None:
    """Note how well a rate and the angle beside it (model units) agree; InputError where they are no such pair."""
    if reading.conventions.axis != ("angle", "angle_speed") or len(channels["time"]) < FEWEST_ROWS:
        return
    time, angle = channels["time"], channels["angle"]
    if not (np.diff(time) > 0).all():
        return
    turned = integral(time, channels["angle_speed"], reading.conventions.axis_rate_is)
    turned = angle + without_line(time, turned - angle)
    centred = angle - angle.mean()
    ratio = float(centred @ turned) / max(float(centred @ centred), 1e-300)
    share = float(np.std(turned - ratio * centred) / max(float(np.std(turned)), 1e-300))
    columns = reading.conventions.columns
    pair = f"column {columns['angle_speed']!r} and column {columns['angle']!r}"
    if abs(ratio - 1) > APART or share > APART:
        text = f"{reading.name}: {pair} are no rate and its angle: the integral of the one is {ratio:.3g} times the "
        text += f"other, and {share:.0%} of it is something else; check [log] angle_speed_unit, angle_speed and their"
        raise InputError(f"{text} signs, or leave one of the two out.", code="rate-conflict")
    text = f"the integral of {pair.replace(' and', ' is')}, times {ratio:.4f}, within {share:.2%}."
    reading.found("rate-beside-angle", text, "note", kind=Kind.ANGLE_BESIDE)


FLAT, KINK, PEAKS = 3, 3.0, 2
"""A sensor at its limit: so many equal rows at the extreme of the log, at so many places, with a kink of so many steps
of its grid before and after; the top of a coarse but smooth rate is left by single steps."""

FEWEST_LEFT = 0.1
"""Share of the rows between two saturated places that is still a log."""


def saturated(rate: Array) -> Ints:
    """Rows (k, 2), first and last, of the runs in which a rate is at the limit of its sensor."""
    runs = [run for limit in (rate.max(), rate.min()) for run in _at_limit(rate, float(limit))]
    return np.array(sorted(runs), dtype=np.int64).reshape(-1, 2)


def _at_limit(rate: Array, limit: float) -> list[tuple[int, int]]:
    changes = np.abs(np.diff(rate))
    step = float(changes[changes > 0].min(initial=np.inf))
    at = np.concatenate(([False], rate == limit, [False]))
    begins, ends = np.flatnonzero(~at[:-1] & at[1:]), np.flatnonzero(at[:-1] & ~at[1:]) - 1
    long = ends - begins + 1 >= FLAT
    runs = list(zip(begins[long].tolist(), ends[long].tolist(), strict=True))
    inner = [(a, b) for a, b in runs if a > 0 and b < len(rate) - 1]
    kinks = [max(changes[a - 1], changes[b]) for a, b in inner]
    if len(inner) < PEAKS or float(np.median(kinks)) < KINK * step:
        return []
    return runs


FEWEST_ROWS = 10
"""Rows of which a rate and an angle can be compared."""


def unsaturated(logged: Channels, reading: Reading) -> Channels:
    """The longest run of rows in which the rate is not at its sensor's limit, with a finding; its integral is known.

    Raises InputError where hardly anything is left.
    """
    rate = logged.get("angle_speed")
    runs = saturated(rate) if rate is not None and len(rate) > FEWEST_ROWS else np.empty((0, 2), dtype=np.int64)
    if rate is None or not len(runs):
        return logged
    edges = np.concatenate([[-1], runs.ravel(), [len(rate)]]).reshape(-1, 2)
    first, last = max(edges.tolist(), key=lambda gap: gap[1] - gap[0])
    text = f"{reading.column('angle_speed')} is at the limit of its sensor, {np.abs(rate[runs[0, 0]]):.4g}, at "
    text += f"{len(runs)} places"
    if last - first - 1 < FEWEST_LEFT * len(rate):
        advice = "and what lies between is too short; set a wider range of the sensor, or swing less"
        raise InputError(f"{reading.name}: {text}, {advice}.", code="saturated-rate")
    time = logged["time"]
    used = slice(first + 1, last)
    text += f"; its integral is unknown there, and only the rows from {time[first + 1]:.4g} to {time[last - 1]:.4g} s"
    reading.found("saturated-rate", f"{text} were used.", "warning")
    return {name: values[used] for name, values in logged.items()}
