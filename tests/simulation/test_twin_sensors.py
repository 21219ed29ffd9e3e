"""Encoders: what the log holds against the true motion, and which random draw does what."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swingid.model.sensors import Encoder
from swingid.simulation import simulate, simulate_run
from swingid.simulation.draws import draw_constants
from twin_cases import first_call_compiles, free_rig, paper_rig, sine, warm_compensator

STEP = 2 * math.pi / 16384
DURATION = 1.0


def closed_loop(rig, seed=1, duration=DURATION, **options):
    return simulate_run(rig, sine(0.8, 8.5), warm_compensator(rig), duration=duration, seed=seed, **options)


@first_call_compiles
@given(st.floats(-100.0, 100.0), st.floats(-0.01, 0.01), st.floats(-0.01, 0.01), st.floats(-1.0, 1.0))
def test_an_encoder_reads_what_its_imperfections_say(q, alpha, beta, zero):
    true = np.array([q])
    assert Encoder().read(true)[0] == q
    curved = Encoder(alpha=alpha, beta=beta, zero=zero).read(true)[0]
    assert curved == pytest.approx(q + zero + alpha * math.cos(q) + beta * math.sin(q), abs=1e-12)
    coarse = Encoder(resolution=STEP, alpha=alpha, beta=beta, zero=zero).read(true)[0]
    assert abs(coarse - curved) <= 0.5 * STEP * (1 + 1e-9)
    assert coarse / STEP == pytest.approx(round(coarse / STEP), abs=1e-6)
    noisy = Encoder(resolution=STEP).read(true, np.array([0.3]))[0]
    assert abs(noisy - (q + 0.3)) <= 0.5 * STEP * (1 + 1e-9)


def test_perfect_sensors_log_the_true_angles():
    run = closed_loop(paper_rig())
    assert np.array_equal(run.recording.angle, run.truth.angle)
    assert np.array_equal(run.recording.wheel_angle, run.truth.wheel_angle)


def test_counts_of_the_log():
    run = closed_loop(paper_rig(**{"sensors.counts_per_turn": 16384}))
    for logged, true in ((run.recording.angle, run.truth.angle), (run.recording.wheel_angle, run.truth.wheel_angle)):
        assert np.abs(logged - true).max() <= 0.5 * STEP * (1 + 1e-9)
        assert logged / STEP == pytest.approx(np.rint(logged / STEP), abs=1e-8)


def test_nonlinearity_is_once_per_turn_of_each_encoder():
    run = closed_loop(paper_rig(**{"sensors.nonlinearity": "0.5 deg"}))
    logs, truths = (run.recording.angle, run.recording.wheel_angle), (run.truth.angle, run.truth.wheel_angle)
    for i in range(2):
        encoder, q = run.truth.draws.encoders[i], truths[i]
        assert logs[i] - q == pytest.approx(encoder.alpha * np.cos(q) + encoder.beta * np.sin(q), abs=1e-12)
    drawn = [
        [encoder.alpha, encoder.beta]
        for seed in range(300)
        for encoder in simulate_run(
            free_rig(**{"sensors.nonlinearity": 0.01}), duration=0.01, rate=100.0, seed=seed
        ).truth.draws.encoders
    ]
    assert np.std(drawn, axis=0) == pytest.approx([0.01, 0.01], rel=0.1)
    assert np.abs(np.corrcoef(np.reshape(drawn, (300, 4)).T) - np.eye(4)).max() < 0.2


def held(commands, times):
    """The same held commands at ten times the rate."""
    return np.repeat(commands, times)[: times * (len(commands) - 1) + 1]


@pytest.mark.parametrize("latency", [0.3e-3, -0.4e-3, 2.7e-3])
def test_latency_reads_the_motion_at_the_true_instant(latency):
    # The instants t_k + latency are samples of a second run of ten times the rate, where nothing is interpolated.
    volts = 5.0 * np.sin(np.arange(301) * 0.03)
    late = simulate(paper_rig("stribeck", **{"sensors.latency": latency}), duration=0.3, drive=volts, initial_angle=0.4)
    fine = simulate(
        paper_rig("stribeck"),
        duration=0.303,
        rate=10_000.0,
        drive=held(np.append(volts, [volts[-1]] * 3), 10),
        initial_angle=0.4,
    )
    shift = round(latency * 10_000)
    rows = np.arange(1, 301)
    assert late.angle[rows] == pytest.approx(fine.angle[10 * rows + shift], abs=1e-9)
    assert late.wheel_angle[rows] == pytest.approx(fine.wheel_angle[10 * rows + shift], abs=1e-9)
    assert np.array_equal(late.time, np.arange(301) / 1000.0)


def test_a_late_log_leaves_the_controller_alone_and_an_early_one_delays_it():
    true, late, early = (closed_loop(paper_rig(**{"sensors.latency": latency})) for latency in (0.0, 0.5e-3, -0.5e-3))
    assert np.array_equal(late.recording.voltage, true.recording.voltage)
    assert np.array_equal(late.truth.angle, true.truth.angle)
    assert not np.array_equal(late.recording.angle, true.recording.angle)
    assert not np.array_equal(early.recording.voltage, true.recording.voltage)


def test_an_encoder_that_is_off_its_zero_misleads_log_and_controller():
    run = closed_loop(paper_rig(), encoder_zero=(0.02, 1.0))
    assert run.recording.angle == pytest.approx(run.truth.angle + 0.02, abs=1e-15)
    assert run.recording.wheel_angle == pytest.approx(run.truth.wheel_angle + 1.0, abs=1e-12)
    assert not np.array_equal(run.recording.voltage, closed_loop(paper_rig()).recording.voltage)


def test_only_the_wheels_channel_is_late():
    run = closed_loop(paper_rig(**{"sensors.wheel": {"latency": "1 ms"}}))
    assert np.array_equal(run.recording.angle, run.truth.angle)
    assert run.recording.wheel_angle[:-1] == pytest.approx(run.truth.wheel_angle[1:], abs=1e-9)


def test_latency_is_drawn_with_its_uncertainty():
    rig = free_rig(**{"sensors.latency": "0.2 ± 0.3 ms"})
    drawn = np.array([simulate_run(rig, duration=0.01, rate=100.0, seed=s).truth.draws.latencies for s in range(400)])
    assert drawn.mean(axis=0) == pytest.approx([2e-4, 2e-4], abs=5e-5)
    assert drawn.std(axis=0) == pytest.approx([3e-4, 3e-4], rel=0.1)
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 0.15


def test_before_the_start_the_motion_is_uniform():
    run = simulate_run(free_rig(**{"sensors.latency": -0.02}), duration=0.1, rate=100.0, initial_speed=2.0)
    assert run.recording.angle[:2] == pytest.approx([-0.04, -0.02], abs=1e-15)
    assert run.recording.angle[2] == 0.0


def test_jitter_reads_at_other_instants_than_it_stamps():
    rig = free_rig(**{"sensors.jitter": "100 us"})
    run = simulate_run(rig, duration=5.0, initial_angle=1.0)
    assert np.array_equal(run.recording.time, np.arange(5001) / 1000.0)
    moving = np.abs(run.truth.speed) > 1.0
    apart = (run.recording.angle - run.truth.angle)[moving] / run.truth.speed[moving]
    assert apart.std() == pytest.approx(1e-4, rel=0.05)
    assert abs(apart.mean()) < 1e-5
    assert apart == pytest.approx(run.truth.draws.delays[0][moving], abs=1e-6)


def test_both_channels_of_a_row_share_its_jitter():
    run = closed_loop(paper_rig(**{"sensors.jitter": "100 us"}))
    assert np.array_equal(run.truth.draws.delays[0], run.truth.draws.delays[1])
    assert run.truth.draws.delays[0].std() == pytest.approx(1e-4, rel=0.1)


def test_dropouts_take_rows_and_nothing_else():
    whole, holed = closed_loop(paper_rig()), closed_loop(paper_rig(**{"sensors.dropouts": 0.05}))
    kept = holed.truth.draws.kept
    assert 0.02 < 1.0 - kept.mean() < 0.08
    assert np.array_equal(holed.recording.time, whole.recording.time[kept])
    assert np.array_equal(holed.recording.angle, whole.recording.angle[kept])
    assert np.array_equal(holed.recording.voltage, whole.recording.voltage[kept])


def test_noise_is_white_and_of_its_size():
    run = simulate_run(free_rig(**{"sensors.noise": 1e-3}), duration=5.0, initial_angle=0.5)
    noise = run.recording.angle - run.truth.angle
    assert noise.std() == pytest.approx(1e-3, rel=0.05)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.05


def test_one_imperfection_leaves_the_draws_of_the_others():
    plain = closed_loop(paper_rig(**{"sensors.nonlinearity": 0.01}), seed=5).truth.draws
    more = closed_loop(
        paper_rig(**{"sensors.nonlinearity": 0.01, "sensors.noise": 1e-3, "sensors.jitter": 1e-4}), seed=5
    ).truth.draws
    assert plain.encoders == more.encoders
    assert plain.latencies == more.latencies


def test_constants_are_drawn_from_what_the_rig_states():
    rig = paper_rig(
        **{
            "axis.gravity_torque": "78 ± 0.39 mN*m",
            "drive.wheel.inertia": "1134 ± 5 g*cm^2",
            "axis.friction.coulomb": "0.1 ± 1 mN*m",
        }
    )
    drawn = [draw_constants(rig, seed) for seed in range(400)]
    b = np.array([values["axis.gravity_torque"] for values in drawn])
    j2 = np.array([values["drive.wheel.inertia"] for values in drawn])
    assert (b.mean(), b.std()) == (pytest.approx(78e-3, abs=1e-4), pytest.approx(0.39e-3, rel=0.1))
    assert (j2.mean(), j2.std()) == (pytest.approx(11.34e-5, abs=2e-7), pytest.approx(5e-7, rel=0.1))
    assert abs(np.corrcoef(b, j2)[0, 1]) < 0.15
    assert min(values["axis.friction.coulomb"] for values in drawn) >= 0.0
    assert {values["axis.inertia"] for values in drawn} == {302.2e-5}
