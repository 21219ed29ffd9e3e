"""A wheel that slips on the shaft of its encoder as it turns one way is found as it slips, and nothing else is one."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from closed_form_logs import INERTIA, ONE_TONE, TIME, TWO_TONES, Sines, encoded, exact_rig, wheel_log
from swingid.checks.table import CHECKS
from swingid.checks.wheel import SLIP
from swingid.identification import identify
from swingid.recording.recording import Recording


def log_of(motion, way: int = 1, share: float = 0.0) -> Recording:
    rig = exact_rig()
    log = wheel_log(rig, motion, lambda v: 1.1e-3 * v, TIME)
    turned = np.diff(log.wheel_angle, prepend=log.wheel_angle[0])
    slipped = share * np.cumsum(np.where(way * turned > 0, turned, 0.0))
    return encoded(replace(log, wheel_angle=log.wheel_angle + slipped))


@pytest.mark.parametrize(
    ("motion", "way"), [(ONE_TONE, 1), (ONE_TONE, -1), (TWO_TONES, 1)], ids=["one tone", "one tone, back", "two tones"]
)
def test_a_wheel_that_slips_is_named_and_the_interval_holds(motion, way):
    found = identify(log_of(motion, way, 0.005), exact_rig())
    message = next(one.message for one in found.warnings if one.code == "wheel-slips")
    assert ("forward" if way > 0 else "back") in message
    share, spread = (float(one) for one in re.search(r"slip by \(([\d.]+) ± ([\d.]+)\) %", message).groups())
    assert abs(share - 0.5) < 4 * spread < 0.1
    low, high = found.inertia.interval95
    assert low < INERTIA < high
    assert any(one.source == SLIP for one in found.budget)


@pytest.mark.parametrize("motion", [ONE_TONE, TWO_TONES], ids=["one tone", "two tones"])
@pytest.mark.parametrize("stated", [{}, {"axis.gravity_torque": 79e-3}], ids=["right", "gravity wrong"])
def test_a_wheel_that_does_not_slip_is_not(motion, stated):
    found = identify(log_of(motion), exact_rig(**stated))
    assert "wheel-slips" not in {one.code for one in (*found.warnings, *found.notes)}
    assert "wheel" in CHECKS


@pytest.mark.parametrize("omega", [3.0, 4.99])
def test_rows_in_which_a_slip_hardly_is_do_not_show_one(omega):
    # slow swings of the wheel: a slip of 150 % to 190 % would take the last 1e-5 of the torque
    found = identify(encoded(wheel_log(exact_rig(), Sines((0.8, omega, 0.0)), lambda v: 1.1e-3 * v, TIME)), exact_rig())
    assert "wheel-slips" not in {one.code for one in (*found.warnings, *found.notes)}
    assert SLIP not in {one.source for one in found.budget}
