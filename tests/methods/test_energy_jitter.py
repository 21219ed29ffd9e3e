"""Rows read early or late by chance: found in the noise, and what energies make of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.identification import identify
from swingid.methods.energy.jitter import find_jitter
from swingid.preparation.noise import channel_noise
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from twin_logs import INERTIA, PAPER, error, given, logged, twin

TIME = np.arange(0, 20, 1e-3)
SIZE, TURN = 0.8, 12.0
GIVEN = given(PAPER)


def read(instants, *, noise=0.0, step=0.0, seed=0):
    """A log of two sines read at these instants, stamped evenly."""
    rng = np.random.default_rng(seed)
    channels = [size * np.sin(8.5 * instants + 0.3) for size in (SIZE, TURN)]
    channels = [values + noise * rng.standard_normal(len(TIME)) for values in channels]
    channels = [np.round(values / step) * step if step else values for values in channels]
    return Recording(time=TIME, angle=channels[0], wheel_angle=channels[1])


@pytest.mark.parametrize("spread", [1e-5, 1e-4, 3e-4])
def test_jitter_is_told_from_other_noise(spread):
    late = spread * np.random.default_rng(1).standard_normal(len(TIME))
    log = read(TIME + late, noise=2e-4)
    found = find_jitter(log, channel_noise(log, GIVEN))
    assert found.spread == pytest.approx(spread, rel=0.1)
    # mean square of the noise: white, and of the speed times the jitter
    assert found.noise.wheel == pytest.approx(np.hypot(2e-4, spread * TURN * 8.5 / np.sqrt(2)), rel=0.05)


@pytest.mark.parametrize(
    "sensor", [{}, {"noise": 1e-3}, {"step": 2 * np.pi / 16384}, {"step": 2 * np.pi / 256}], ids=str
)
def test_other_noise_is_no_jitter(sensor):
    log = read(TIME, **sensor)
    noise = channel_noise(log, GIVEN)
    found = find_jitter(log, noise)
    assert found.spread == 0.0
    assert found.noise == noise


def test_recorded_stamps_are_no_jitter():
    uneven = TIME + 2e-4 * np.random.default_rng(2).uniform(-1, 1, len(TIME))
    plain = read(uneven, noise=2e-4)
    log = Recording(time=uneven, angle=plain.angle, wheel_angle=plain.wheel_angle)
    assert find_jitter(log, channel_noise(log, GIVEN)).spread == 0.0


def test_a_body_that_rests_at_first_shows_no_jitter():
    """Interpolated readings, as where a latency is left on, ring by next to nothing while the body rests."""
    plain, few = read(TIME, step=2 * np.pi / 16384), slice(0, 4000)
    moves = TIME[few] > 0.51
    angle, wheel = (
        CubicSpline(TIME[few], values[few] * moves)(TIME[few] + 5e-4) for values in (plain.angle, plain.wheel_angle)
    )
    log = Recording(time=TIME[few], angle=angle, wheel_angle=wheel)
    noise = channel_noise(log, GIVEN)
    with np.errstate(all="raise", under="ignore"):
        assert find_jitter(log, noise).noise == noise


@pytest.mark.parametrize("seed", range(3))
def test_energy_bears_a_tenth_of_a_millisecond(seed, tmp_path):
    # the loop acts on the jittered angle: work over the measured turn was 20 % off
    log = logged(twin(jitter=1e-4), tmp_path, seed=seed)
    result = identify(log, GIVEN, "energy")
    assert abs(error(result)) < 5e-3
    low, high = result.inertia.interval95
    assert low < INERTIA < high
    assert "jitter" in {note.code for note in result.notes}


def test_a_loop_that_chatters_on_jitter_is_a_warning():
    rig = twin(jitter=1e-4)
    run = simulate(rig, Sine(0.8, 8.5), Compensator.paper_simulation(rig), duration=20.0, seed=1)
    log = Recording(time=run.time, angle=run.angle, wheel_angle=run.wheel_angle, voltage=run.voltage)
    result = identify(log, GIVEN, "energy")
    assert "jitter-matters" in {warning.code for warning in result.warnings}
    assert abs(error(result)) < 0.03
