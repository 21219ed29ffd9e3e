"""Constants that are stated with an uncertainty: unknowns under that prior, between "known" and "unknown"."""

from __future__ import annotations

import numpy as np
import pytest

import swingid as sw
from swingid.identification import identify

PAPER = sw.Rig.load("paper")
GRAVITY = 0.078  # N m
INERTIA = 302.2e-5  # kg m²
TWO_TONES = "multisine 0.7 rad 5 rad/s + 0.4 rad 8.5 rad/s"


@pytest.fixture(scope="module", params=[TWO_TONES, "sine 0.8 rad 8.5 rad/s"], ids=["two tones", "one tone"])
def log(request):
    return sw.simulate(PAPER, sw.parse_reference(request.param), duration=20.0, seed=1)


def answer(log, gravity):
    """Inertia and its standard uncertainty, as shares of the true one."""
    found = identify(log, PAPER.changed({"axis.gravity_torque": gravity})).inertia
    return found.value / INERTIA, found.standard_uncertainty / INERTIA


def stated(share, off=0.0):
    return {"value": GRAVITY * (1 + off), "std": GRAVITY * share}


def test_a_prior_lies_between_a_known_constant_and_an_unknown_one(log):
    known, unknown = answer(log, GRAVITY), answer(log, "unknown")
    propagated = [answer(log, GRAVITY * (1 + off))[0] for off in (1e-4, -1e-4)]
    per_share = (propagated[0] - propagated[1]) / 2e-4
    for share in (1e-7, 1e-4, 1e-3, 1e-2, 0.1, 10.0):
        # by a third, for the weight of a prior follows from the residuals, which are correlated
        assert answer(log, stated(share))[1] < 1.33 * min(unknown[1], np.hypot(known[1], per_share * share))
    np.testing.assert_allclose(answer(log, stated(1e-9)), known, rtol=0.01, atol=1e-7)
    np.testing.assert_allclose(answer(log, stated(10.0)), unknown, rtol=0.02, atol=1e-7)


def test_a_constant_that_is_off_within_its_prior_costs_nothing(log):
    value, u = answer(log, "unknown")
    for off in (-0.1, 0.1):
        found = identify(log, PAPER.changed({"axis.gravity_torque": stated(0.1, off)}))
        assert found.status == "ok"
        assert abs(found.inertia.value / INERTIA - value) < 0.5 * u
        assert found.parameters["viscous"].value == pytest.approx(1.144e-3, rel=1e-3)
        assert np.mean(found.details.swings.values) == pytest.approx(found.inertia.value, rel=5e-4)


def test_intervals_of_drawn_constants_cover(log):
    random, inside = np.random.default_rng(5), 0
    for _ in range(12):
        gravity, wheel = 1 + 0.02 * random.standard_normal(), 1 + 0.002 * random.standard_normal()
        rig = PAPER.changed(
            {
                "axis.gravity_torque": stated(0.02, gravity - 1),
                "drive.wheel.inertia": {"value": 11.34e-5 * wheel, "std": 11.34e-5 * 0.002},
            }
        )
        low, high = identify(log, rig).inertia.interval95
        inside += low <= INERTIA <= high
        assert high - low < 4 * 0.0025 * INERTIA  # what the wheel alone makes
    assert inside >= 10  # of 12 at 95 %: fewer in 2 % of draws


def test_a_drive_without_a_second_scale_is_known_no_better_than_stated(log):
    doubtful = {"drive.wheel.inertia": {"value": 11.34e-5, "std": 11.34e-5 * 0.05}, "axis.gravity_torque": "unknown"}
    found = identify(log, PAPER.changed(doubtful)).inertia
    assert found.value == pytest.approx(INERTIA, rel=1e-3)
    assert found.standard_uncertainty == pytest.approx(0.05 * 0.96 * INERTIA, rel=0.06)
