"""A voltage that stands at its limits part of the time: it is known there, so those rows are as good as others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.identification import identify
from swingid.recording.recording import Recording
from twin_logs import INERTIA, error, given, logged, twin


def limited(volts: float):
    return twin("Stribeck", counts_per_turn=16384).changed({"drive.motor.voltage_limit": volts})


@pytest.mark.parametrize(("volts", "share"), [(8.0, 0.48), (6.0, 0.76)])
def test_momentum_does_not_mind(tmp_path, volts, share):
    rig = limited(volts)
    log = logged(rig, tmp_path)
    assert np.mean(np.abs(log.voltage) >= volts - 1e-9) == pytest.approx(share, abs=0.05)
    result = identify(log, given(rig))
    assert abs(error(result)) < 1e-4
    assert result.status == "ok"


def test_energy_uses_rows_at_the_limit(tmp_path):
    result = identify(logged(limited(8.0), tmp_path), given(limited(8.0)), "energy")
    low, high = result.inertia.interval95
    assert abs(error(result)) < 5e-4
    assert low < INERTIA < high
    assert result.status == "ok"


def test_energy_warns_of_a_voltage_that_jumps_from_limit_to_limit(tmp_path):
    result = identify(logged(limited(6.0), tmp_path), given(limited(6.0)), "energy")
    assert "voltage-saturated" in [warning.code for warning in result.warnings]
    assert abs(error(result)) < 3e-3


def test_commands_logged_before_the_limiter_are_taken_at_the_limit(tmp_path):
    """The same log with three times the voltage where the limiter cut it off."""
    rig = limited(8.0)
    log = logged(rig, tmp_path)
    beyond = np.where(np.abs(log.voltage) >= 8.0 - 1e-9, 3 * log.voltage, log.voltage)
    replace(log, voltage=beyond, findings=()).save(tmp_path / "beyond.parquet", given(rig))
    read = Recording.load(tmp_path / "beyond.parquet", given(rig))
    assert [one.repair for one in read.findings if one.repair] == ["limit"]
    results = [identify(one, given(rig), "energy").inertia.value for one in (log, read)]
    assert results[1] == pytest.approx(results[0], rel=1e-9)
