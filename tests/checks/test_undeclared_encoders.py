"""Encoder errors that nobody declared are found in the same log and taken off, and nothing else is taken for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from test_repairs import LOG, RIG

from closed_form_logs import TWO_TONES, direct_log, direct_rig, exact_rig, wheel_log
from swingid.control.references import Multisine, Sine
from swingid.identification import identify
from swingid.recording.recording import Recording
from twin_logs import INERTIA, error, given, logged, twin, without

CODE = "calibrated-by-itself"
UNTOLD = {"sensors.nonlinearity": 0}
TIME = np.arange(12_001) / 1000


def codes(result) -> set[str]:
    return {warning.code for warning in result.warnings}


def friction(v):
    return 5e-4 * v + 3e-3 * np.sign(v)


@pytest.mark.parametrize(("size", "law", "seed"), [("0.1 deg", "viscous", 1), ("0.5 deg", "Stribeck", 1)])
def test_bent_encoders_are_found_in_the_log_itself(tmp_path, size, law, seed):
    rig = twin(law, nonlinearity=size)
    log, told = logged(rig, tmp_path, seed=seed), given(rig).changed(UNTOLD)
    left, result = identify(without(log, "calibrate"), told), identify(log, told)
    u = result.inertia.standard_uncertainty / INERTIA
    assert abs(error(left)) > 1e-3
    assert abs(error(result)) < 4 * u < 1e-3
    assert codes(result) == {CODE}
    assert {made["repair"] for made in result.provenance["repairs"] if made["done"]} >= {"calibrate", "encoders"}
    assert result.provenance["rig_sha256"] == left.provenance["rig_sha256"]
    assert [one["repair"] for one in left.provenance["repairs"] if not one["done"]] == ["calibrate"]


def test_a_large_nonlinearity_that_is_only_declared_is_found_to_all_orders(tmp_path):
    rig = twin("viscous", nonlinearity="0.5 deg")
    log, told = logged(rig, tmp_path, seed=1), given(rig).changed({"sensors.nonlinearity": "0.5 deg"})
    left, result = identify(without(log, "calibrate"), told), identify(log, told)
    assert codes(left) == {"large-nonlinearity"}
    assert codes(result) == {CODE}
    # its second order resembles a torque that depends on the angle, which the interval has to allow for
    assert abs(error(result)) < 4 * result.inertia.standard_uncertainty / INERTIA < 4e-3


def test_several_logs_tell_the_encoders_together(tmp_path):
    rig = twin("viscous", nonlinearity="0.1 deg")
    motions = Sine(0.8, 8.5), Sine(1.4, 5.0), Multisine((Sine(0.7, 5.0), Sine(0.4, 8.5)))
    logs = []
    for k, motion in enumerate(motions):
        (tmp_path / str(k)).mkdir()
        logs.append(logged(rig, tmp_path / str(k), motion, seed=3))
    result = identify(logs, given(rig).changed(UNTOLD))
    assert CODE in codes(result)
    assert abs(error(result)) < 3e-5


def test_a_late_wheel_is_moved():
    log, inner = wheel_log(exact_rig(), TWO_TONES, friction, TIME), slice(20, -20)
    wheel = CubicSpline(log.time, log.wheel_angle)(log.time + 5e-3)
    result = identify(Recording(time=log.time[inner], angle=log.angle[inner], wheel_angle=wheel[inner]), exact_rig())
    assert codes(result) == {CODE}
    assert abs(error(result)) < 1e-4


def test_a_wheel_that_obeys_no_balance_is_not_taken_for_bent_encoders():
    # of this log nearly nothing is physical; a nonlinearity of 1.6° would make its balance close, and hide that
    result = identify(LOG, RIG)
    assert "motor-balance" in codes(result)
    assert CODE not in codes(result)


def test_a_nonlinearity_declared_on_a_direct_drive():
    log = direct_log(TWO_TONES, friction, TIME)
    result = identify(log, direct_rig(**{"sensors.nonlinearity": "0.1 deg"}))
    assert abs(error(result)) < 3 * result.inertia.standard_uncertainty / INERTIA
