"""A wheel polled by a clock of its own, in beat with the rows: found by its repeated and doubled rows, and moved."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from long_cases import quick_first
from swingid.numerics.arrays import Array
from swingid.preparation.beat import ages, on_rows

RATE, ROWS = 1000.0, 8000
COUNT = 2 * np.pi / 16384
TIME = np.arange(ROWS) / RATE


def turned(time: Array) -> Array:
    """A wheel's angle, rad."""
    return 8.0 * np.sin(8.5 * time) + 3.0 * time


def polls(period: float, start: float = 1e-4) -> Array:
    """Instants (rows,) of the last poll at each row."""
    return np.floor((TIME + start) / period) * period - start


@pytest.mark.parametrize("beat", [2.7, -2.7, 1.3, -4.1, 11.0])
def test_the_age_of_each_row_is_found(beat: float) -> None:
    read = polls(1 / (RATE - beat))
    angle = COUNT * np.rint(turned(read) / COUNT)
    found = ages(angle, COUNT)
    assert found is not None
    true = RATE * (TIME - read)
    true -= true.mean()
    assert np.std(found - true) < 0.3 * np.std(true)  # a start may be a row off
    before, after = (
        angle - turned(TIME - np.mean(TIME - read)),
        on_rows(angle, found) - turned(TIME - np.mean(TIME - read)),
    )
    assert np.std(after) < 0.3 * np.std(before)


def test_what_is_no_beat_is_left() -> None:
    rng = np.random.default_rng(1)
    late = {
        "on time": TIME,
        "jitter": TIME + 5e-5 * rng.standard_normal(ROWS),
        "every second row": TIME - np.arange(ROWS) % 2 / RATE,
        "every fifth row": TIME - np.arange(ROWS) % 5 / RATE,
        "a value twice at random": TIME - (rng.random(ROWS) < 0.02) / RATE,
    }
    for name, read in late.items():
        assert ages(COUNT * np.rint(turned(read) / COUNT), COUNT) is None, name
    assert ages(turned(TIME), 0.0) is None


@pytest.mark.parametrize("sign", quick_first(1, [1, -1]))
def test_a_beat_at_twice_the_frequency_no_longer_looks_like_inertia(sign: int) -> None:
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    import unstated_encoders as bench

    states, _, volts = bench.motions(1, ROWS)
    rng = np.random.default_rng(1)
    speed = (rng.uniform(0.6, 1.2, 1), rng.uniform(7.0, 10.0, 1))[1][0]
    read = polls(1 / (RATE - sign * speed / np.pi))
    wheel = COUNT * np.rint(np.interp(read, TIME, states[:, 1, 0]) / COUNT)
    axis = COUNT * np.rint(states[:, 0, 0] / COUNT)
    log = sw.Recording(time=TIME, angle=axis, wheel_angle=wheel, voltage=volts[:, 0])
    rig = sw.Rig.from_text(bench.RIG).changed({"sensors.nonlinearity": 0})
    found, kept = (sw.identify(one, rig) for one in (log, replace(log, repairs_off=frozenset(["encoders"]))))
    assert "wheel-polled" in [note.code for note in found.notes]
    low, high = found.inertia.interval95
    assert low < bench.INERTIA < high
    assert high - low < 1e-3 * bench.INERTIA
    assert abs(kept.inertia.value / bench.INERTIA - 1) > 2e-3
