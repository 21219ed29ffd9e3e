"""An encoder nonlinearity that nobody declared: a warning with the inertia that it would make, and none without one."""

from __future__ import annotations

import re

import pytest

from swingid.identification import identify
from twin_logs import INERTIA, given, logged, result_of, twin, without

UNTOLD = {"sensors.nonlinearity": 0}


def warning(result) -> str | None:
    found = [one.message for one in result.warnings if one.code == "encoder-nonlinearity"]
    return found[0] if found else None


@pytest.mark.parametrize("seed", [1, 2])
def test_half_a_degree_is_told_with_the_inertia_it_would_make(tmp_path, seed):
    rig = twin("Stribeck", nonlinearity="0.5 deg")
    log = logged(rig, tmp_path, seed=seed)
    text = warning(identify(without(log, "calibrate"), given(rig).changed(UNTOLD)))
    assert text is not None
    value, spread, power = re.search(r"inertia \(([\d.]+) ± ([\d.]+)\)e(-\d+)", text).groups()
    value, spread = float(value) * 10 ** int(power), float(spread) * 10 ** int(power)
    assert abs(value - INERTIA) < 4 * spread
    assert spread < 0.003 * INERTIA
    assert warning(identify(log, given(rig))) is None  # declared, so calibrated


@pytest.mark.parametrize("law", ["viscous", "LuGre", "sticking", "direction-dependent"])
def test_friction_alone_is_not_taken_for_it(tmp_path, law):
    rig = twin(law, nonlinearity=0)
    assert warning(identify(logged(rig, tmp_path, duration=15.0), given(rig))) is None


def test_noise_is_not_taken_for_it(tmp_path):
    rig = twin("viscous", nonlinearity=0, counts_per_turn=None, noise=3e-3)
    for seed in range(3):
        assert warning(identify(logged(rig, tmp_path, duration=15.0, seed=seed), given(rig))) is None


def test_a_declared_nonlinearity_is_not_taken_for_a_wrong_zero(tmp_path):
    # seed 1 bends both encoders so that cos q1 looked off by 13 mrad beside a fit without the nonlinearity
    rig = twin("viscous", nonlinearity="0.1 deg")
    assert result_of(rig, tmp_path, seed=1).status == "ok"
