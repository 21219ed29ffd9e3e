"""Which reading of the wheel angle row (II) speaks for, where noise is all that few windows show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.balance.motor import FEWEST_ROWS, _Reading
from swingid.checks.answer import CLEARLY
from swingid.errors import UnanswerableError
from swingid.identification import identify
from swingid.recording.recording import Recording
from twin_logs import GIVEN, logged, twin

NOISE, EVERY = 0.01, np.ones(FEWEST_ROWS, bool)


def reading(rng: np.random.Generator, missing: float) -> float:
    """What is left of as few windows as are looked at, with noise and a term of the size `missing` left out."""
    free = rng.standard_normal((FEWEST_ROWS, 3))
    driven = free @ [1.0, 0.5, 0.2]
    left_out = missing * rng.standard_normal(FEWEST_ROWS)
    inertial = driven + left_out + NOISE * rng.standard_normal(FEWEST_ROWS)
    return _Reading(inertial, NOISE**2, driven, np.zeros(FEWEST_ROWS), free).refitted(EVERY)


def ratios(missing: float) -> np.ndarray:
    """Of the reading that leaves noise alone to one that misses a term, for 500 draws."""
    rng = np.random.default_rng(5)
    return np.array([reading(rng, 0.0) / reading(rng, missing) for _ in range(500)])


def test_noise_alone_speaks_for_no_reading() -> None:
    # without the least that noise may leave, 7 % of such pairs differ by more than CLEARLY
    assert np.mean(ratios(0.0) < CLEARLY) < 0.01


def test_a_missing_term_beyond_the_noise_speaks_against_a_reading() -> None:
    assert np.mean(ratios(20 * NOISE) < CLEARLY) > 0.99


@pytest.fixture(scope="module")
def sampled(tmp_path_factory):
    """A loop of 1 kHz of which every twentieth row was logged: the voltage does not hold from row to row."""
    log = logged(twin("Stribeck"), tmp_path_factory.mktemp("sampled"), duration=15.0)
    every = slice(None, None, 20)
    rows = log.time[every], log.angle[every], log.wheel_angle[every], log.voltage[every]
    return Recording(**dict(zip(("time", "angle", "wheel_angle", "voltage"), rows, strict=True)))


def codes(messages) -> set[str]:
    return {message.code for message in messages}


def test_a_voltage_that_was_not_held_is_told_from_a_motor_that_does_not_fit(sampled) -> None:
    result = identify(sampled, GIVEN, method="equation-error")
    # the voltage is not used, so it makes no number doubtful
    assert result.status == "ok"
    assert "drive-held" in codes(result.notes)
    assert "drive-held" in codes(identify(sampled, GIVEN, method="backstepping").warnings)
    measured = identify(replace(sampled, drive_held=False), GIVEN, method="backstepping")
    assert "drive-held" not in codes((*measured.warnings, *measured.notes))


def test_a_measured_voltage_is_not_simulated_as_held(sampled) -> None:
    try:  # where the search for a minimum ends is up to the last digit
        said = " ".join(one.message for one in identify(sampled, GIVEN, method="output-error", law="stribeck").warnings)
    except UnanswerableError as refused:
        assert refused.code == "poor-fit"
        said = str(refused)
    assert "drive_held = false" in said
    # half a row is 8 % of the motion; what the voltage did between the logged rows is left
    fit = identify(replace(sampled, drive_held=False), GIVEN, method="output-error", law="stribeck")
    assert fit.details.extra["angle_left"] < 0.05


def test_a_held_voltage_read_as_measured_is_seen(tmp_path) -> None:
    log = logged(twin(), tmp_path, duration=10.0, rate=200.0)
    assert "drive-held" in codes(identify(replace(log, drive_held=False), GIVEN, method="backstepping").warnings)
    assert "drive-held" not in codes(identify(log, GIVEN, method="backstepping").warnings)


def test_a_latency_that_may_be_half_a_row_leaves_open_what_the_voltage_did(tmp_path) -> None:
    rig = twin(latency="0 ± 0.2 ms")
    log = replace(logged(rig, tmp_path, duration=10.0), drive_held=False)
    assert "drive-held" not in codes(
        identify(log, GIVEN.changed({"sensors.latency": "0 ± 0.2 ms"}), method="backstepping").warnings
    )
    assert "drive-held" in codes(identify(log, GIVEN, method="backstepping").warnings)


def test_momentum_notes_a_voltage_that_is_not_held_and_energy_warns(sampled) -> None:
    assert "drive-held" in codes(identify(sampled, GIVEN).notes)
    found = identify(sampled, GIVEN, method="energy")
    assert "drive-held" in codes(found.warnings)
    assert "drive-held" not in codes(found.notes)
