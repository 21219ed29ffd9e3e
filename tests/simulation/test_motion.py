"""Turning points, speed, rests and the usable part of motions that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swingid.errors import UnanswerableError
from swingid.numerics.test_functions import project_steps
from swingid.preparation.motion import find_motion, grid_step, sample_noise
from swingid.preparation.segment import usable_part
from swingid.preparation.speed import smooth_speed

OMEGA, AMPLITUDE = 8.5, 0.8
TIME = np.arange(20_001) / 1000
ENCODER = 2 * np.pi / 16384


def sine(time):
    return AMPLITUDE * np.sin(OMEGA * time)


def turns_of_sine(time):
    turns = (np.arange(1000) + 0.5) * np.pi / OMEGA
    return turns[(turns > time[0]) & (turns < time[-1])]


def noisy(values, noise, seed=0):
    return values + noise * np.random.default_rng(seed).standard_normal(len(values))


def stroke(s):
    """Rest-to-rest step from 0 to 1 on [0, 1] with three vanishing derivatives at both ends."""
    s = np.clip(s, 0.0, 1.0)
    return s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)


def strokes(time, size=1.0, move=0.8, dwell=0.5):
    """To and fro between 0 and `size`, with a rest after each stroke."""
    position = np.zeros_like(time)
    for k in range(int(time[-1] / (move + dwell)) + 1):
        sign = 1.0 if k % 2 == 0 else -1.0
        position += sign * size * stroke((time - k * (move + dwell)) / move)
    return position


# turning points


def test_turning_points_of_a_sine():
    motion = find_motion(TIME, sine(TIME), 0.0)
    expected = turns_of_sine(TIME)
    assert motion.turning_times == pytest.approx(expected, abs=1e-6)
    assert motion.turning_angles == pytest.approx(np.sign(np.sin(OMEGA * expected)) * AMPLITUDE, abs=1e-6)
    assert np.array_equal(motion.sides, np.sign(motion.turning_angles))
    assert motion.half_period == pytest.approx(np.pi / OMEGA, abs=1e-6)
    assert motion.swing_sizes == pytest.approx(np.full(len(expected) - 1, 2 * AMPLITUDE), abs=1e-6)
    assert len(motion.rests) == 0


def test_turning_points_at_irregular_stamps_with_gaps():
    rng = np.random.default_rng(3)
    time = np.sort(TIME + rng.uniform(-4e-4, 4e-4, len(TIME)))[rng.random(len(TIME)) > 0.05]
    assert find_motion(time, sine(time), 0.0).turning_times == pytest.approx(turns_of_sine(time), abs=1e-6)


@pytest.mark.parametrize("noise", [1e-5, 1e-4, 1e-3, 1e-2, 3e-2])
def test_speed_and_turning_points_err_by_the_stated_noise(noise):
    motion = find_motion(TIME, noisy(sine(TIME), noise), noise)
    truth = AMPLITUDE * OMEGA * np.cos(OMEGA * motion.speed.grid)
    error = (motion.speed.speed - truth)[3:-3]
    assert 0.5 * motion.speed.noise < error.std() < 2 * motion.speed.noise
    # Turning points are read off a third of the width, where a slope has 3^1.5 times the noise.
    expected = turns_of_sine(TIME)
    assert len(motion.turning_times) == len(expected)
    late = motion.turning_times - expected
    stated = motion.speed.noise * 3**1.5 / (AMPLITUDE * OMEGA**2)
    assert late.std() < 1.3 * stated
    assert abs(late.mean()) < 4 * stated / np.sqrt(len(late))


@pytest.mark.parametrize("bits", [8, 10, 12, 14])
def test_turning_points_of_coarse_encoders(bits):
    step = 2 * np.pi / 2**bits
    motion = find_motion(TIME, step * np.rint(sine(TIME) / step), step / np.sqrt(12))
    assert motion.turning_times == pytest.approx(turns_of_sine(TIME), abs=1.5e-3)
    assert np.array_equal(motion.sides, -np.sign(np.cos(OMEGA * (motion.turning_times + 0.1))))


def test_speed_of_a_wide_smooth_motion_uses_wide_windows():
    # Lepski: the width grows with the noise, as far as the motion is locally cubic.
    widths = [smooth_speed(TIME, noisy(sine(TIME), n), n).half_width for n in (1e-6, 1e-4, 1e-2)]
    assert widths[0] < widths[1] < widths[2] < np.pi / OMEGA


def test_a_noisy_axis_at_rest_has_no_motion():
    with pytest.raises(UnanswerableError) as caught:
        find_motion(TIME, noisy(np.full(len(TIME), 0.3), 1e-3), 1e-3)
    assert caught.value.code == "no-motion"


def test_a_noisy_rest_after_a_motion_has_no_turning_points():
    moving = TIME < 10.0
    end = np.pi * np.floor(10.0 * OMEGA / np.pi) / OMEGA  # stops at a zero of the sine
    angle = np.where(end > TIME, sine(TIME) * stroke((end - TIME) / 3.0), 0.0)
    motion = find_motion(TIME, noisy(angle, 1e-3), 1e-3)
    assert motion.turning_times.max() < end
    assert (np.diff(motion.turning_times) > 0.2).all()
    assert np.abs(motion.turning_angles).min() > 0.005
    assert moving[np.searchsorted(TIME, motion.turning_times)].all()
    covered = np.clip(motion.rests[:, 1], end, None) - np.clip(motion.rests[:, 0], end, None)
    assert covered.sum() > 0.8 * (TIME[-1] - end)


def test_ripple_below_the_smallest_swing_makes_no_turning_points():
    slow = np.sin(TIME)
    calm = find_motion(TIME, slow + 0.004 * np.sin(60 * TIME), 0.0)
    assert len(calm.turning_times) == 6
    assert calm.turning_times == pytest.approx((np.arange(6) + 0.5) * np.pi, abs=0.06)
    assert (np.diff(calm.sides) != 0).all()
    rough = find_motion(TIME, slow + 0.05 * np.sin(60 * TIME), 0.0)
    assert len(rough.turning_times) > 100
    assert (np.diff(rough.sides) != 0).all()
    assert (np.sign(np.diff(rough.turning_angles)) == rough.sides[1:]).all()


# rests and directions


def test_dwells_are_found_as_rests():
    angle = strokes(TIME)
    motion = find_motion(TIME, ENCODER * np.rint(angle / ENCODER), ENCODER / np.sqrt(12))
    begins = 0.8 + 1.3 * np.arange(15)
    assert len(motion.rests) == len(begins)
    for (begin, end), expected in zip(motion.rests, begins, strict=True):
        assert expected - 0.15 < begin < expected + 0.05
        assert min(expected + 0.45, TIME[-1] - 0.05) < end < min(expected + 0.65, TIME[-1] + 1e-9)
    inside = np.array([any(begin < t < end for begin, end in motion.rests) for t in motion.turning_times])
    assert inside.all()


def test_directions_are_the_sign_of_the_speed():
    motion = find_motion(TIME, sine(TIME), 0.0)
    edges, signs = motion.directions(TIME[0], TIME[-1])
    assert len(edges) == len(signs) + 1
    assert (np.diff(edges) > 0).all()
    middles = (edges[1:] + edges[:-1]) / 2
    assert np.array_equal(signs, np.sign(np.cos(OMEGA * middles)))
    centres, half = np.linspace(1.0, 19.0, 200), np.full(200, 0.31)
    s = np.linspace(-1, 1, 20_001)
    expected = [
        half[0] * np.trapezoid((1 - s * s) ** 3 * np.sign(np.cos(OMEGA * (c + half[0] * s))), s) for c in centres
    ]
    assert project_steps(edges, signs, centres, half) == pytest.approx(expected, abs=1e-4)


def test_directions_carry_zero_in_rests():
    angle = strokes(TIME)
    motion = find_motion(TIME, angle, 0.0)
    edges, signs = motion.directions(TIME[0], TIME[-1])
    assert len(edges) == len(signs) + 1
    assert (np.diff(edges) >= 0).all()
    speed = np.gradient(angle, TIME)
    at = np.clip(np.searchsorted(edges, TIME, side="right") - 1, 0, len(signs) - 1)
    fast = np.abs(speed) > 0.02 * np.abs(speed).max()
    assert np.array_equal(signs[at][fast], np.sign(speed)[fast])
    still = (TIME % 1.3 > 0.85) & (TIME % 1.3 < 1.25)
    assert (signs[at][still] == 0).all()


def test_one_direction_only():
    time = np.arange(2001) / 1000
    motion = find_motion(time, 0.5 * time**2 + time, 0.0)
    edges, signs = motion.directions(0.0, 2.0)
    assert edges.tolist() == [0.0, 2.0]
    assert signs.tolist() == [1.0]


def test_a_part_of_a_motion():
    motion = find_motion(TIME, strokes(TIME), 0.0)
    part = motion.within(2.35, 7.1)
    inside = (motion.turning_times > 2.35) & (motion.turning_times < 7.1)
    assert np.array_equal(part.turning_times, motion.turning_times[inside])
    assert np.array_equal(part.turning_angles, motion.turning_angles[inside])
    assert np.array_equal(part.sides, motion.sides[inside])
    assert part.rests.min() == 2.35  # a rest that the cut divides counts as far as it reaches
    assert part.rests.max() < 7.1
    assert len(part.rests) == 4
    edges, signs = part.directions(2.35, 7.1)
    assert (edges[0], edges[-1]) == (2.35, 7.1)
    assert signs[np.searchsorted(edges, 2.4) - 1] == 0.0
    assert len(edges) == len(signs) + 1


# noise and grid


@given(st.floats(1e-8, 1e-1), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_the_grid_of_an_encoder_is_found(step, seed):
    rng = np.random.default_rng(seed)
    values = step * (np.rint(rng.uniform(-1000, 1000)) + np.rint(np.cumsum(rng.standard_normal(2000) * 2)))
    assert grid_step(values) == pytest.approx(step, rel=1e-6)


def test_continuous_values_have_no_grid():
    assert grid_step(sine(TIME)) == 0.0
    assert grid_step(noisy(sine(TIME), 1e-3)) == 0.0
    assert grid_step(np.full(500, 0.3)) == 0.0


def test_noise_is_read_off_the_samples():
    assert sample_noise(noisy(sine(TIME), 2e-3)) == pytest.approx(2e-3, rel=0.05)
    assert sample_noise(sine(TIME)) < 1e-12
    assert sample_noise(sine(TIME[:15])) == 0.0


# the usable part


def test_a_steady_motion_is_used_whole():
    motion = find_motion(TIME, sine(TIME), 0.0)
    start, stop, note = usable_part(motion, "wheel_angle", 0.0, 20.0)
    assert (start, stop) == (0.0, 20.0)
    assert note.code == "segment"
    assert note.message == "used the part from 0 to 20 s of a log from 0 to 20 s."


def test_the_transient_of_an_adapting_controller_is_dropped():
    growing = np.clip(0.1 + 0.9 * TIME / 7.0, 0.0, 1.0) * sine(TIME)
    motion = find_motion(TIME, growing, 0.0)
    start, stop, note = usable_part(motion, "torque", 0.0, 20.0)
    # From where swings are within 5 % of the steady ones: at 95 % of the amplitude, that is 6.6 s, or one swing later.
    assert 6.4 < start < 6.6 + 2 * np.pi / OMEGA
    assert start in motion.turning_times
    assert stop == 20.0
    assert note.message.endswith("after the transient.")


def test_a_motion_of_several_frequencies_is_not_taken_for_a_transient():
    angle = 0.5 * np.sin(5 * TIME) + 0.4 * np.sin(8.1 * TIME + 1)
    assert usable_part(find_motion(TIME, angle, 0.0), "torque", 0.0, 20.0)[:2] == (0.0, 20.0)


def decay_between_hand_and_rest(time, noise, release=4.85, start=3.9):
    """At rest, lifted by hand to 2.6, let go at `release`, and at rest again in the end (Coulomb-like decay)."""
    left = np.clip(1 - (time - release) / 60.0, 0.0, None)
    free = 2.6 * left * np.cos(6.5 * (time - release))
    lifted = 2.6 * stroke((time - start) / (release - start))
    return noisy(np.where(time < release, lifted, free), noise)


def test_the_free_decay_between_hand_and_rest_is_found():
    time = np.arange(80_000) / 1000
    motion = find_motion(time, decay_between_hand_and_rest(time, 1e-4), 1e-4)
    start, stop, note = usable_part(motion, None, 0.0, 80.0)
    assert 4.85 <= start < 4.85 + 2 * np.pi / 6.5
    assert 60.0 < stop < 65.1
    assert note.message.endswith("the free decay.")


def test_a_push_ends_the_free_decay():
    time = np.arange(40_000) / 1000
    decaying = np.where(time < 25.0, np.exp(-time / 20), np.exp(-25 / 20) * np.exp((time - 25.0) / 20))
    motion = find_motion(time, decaying * np.cos(6.5 * time), 0.0)
    start, stop, _ = usable_part(motion, None, 0.0, 40.0)
    assert start < 1.5
    assert 24.0 < stop < 26.0


@pytest.mark.parametrize("channel", ["wheel_angle", "torque", None])
def test_few_turning_points_are_no_answer(channel):
    time = np.arange(1000) / 1000
    motion = find_motion(time, np.sin(6 * time), 0.0)
    with pytest.raises(UnanswerableError) as caught:
        usable_part(motion, channel, 0.0, 1.0)
    assert caught.value.code == "no-turning-points"


def test_swings_that_only_grow_are_no_free_decay():
    motion = find_motion(TIME, np.exp(TIME / 10) * sine(TIME), 0.0)
    with pytest.raises(UnanswerableError) as caught:
        usable_part(motion, None, 0.0, 20.0)
    assert caught.value.code == "no-free-decay"


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("swings", [1.0, 4.0, 12.0])
def test_a_body_that_a_hand_drives_is_no_free_decay(seed, swings):
    rng = np.random.default_rng(seed)
    time = np.arange(30_000) / 500
    places = np.arange(0.0, 62.0, np.pi / 6.5 * swings)
    amplitude = np.interp(time, places, np.exp(0.3 * rng.normal(size=len(places))))
    motion = find_motion(time, amplitude * np.cos(6.5 * time), 0.0)
    with pytest.raises(UnanswerableError) as caught:
        usable_part(motion, None, 0.0, 60.0)
    assert caught.value.code == "driven-by-hand"


def test_the_decay_after_a_hand_has_driven_the_body_is_taken():
    time = np.arange(60_000) / 500
    amplitude = np.where(time < 40, 1 + 0.4 * np.sin(time), np.exp(-(time - 40) / 15) * (1 + 0.4 * np.sin(40)))
    motion = find_motion(time, amplitude * np.cos(6.5 * time), 0.0)
    start, stop, _ = usable_part(motion, None, 0.0, 120.0)
    assert 38.0 < start < 42.0
    assert stop > 90.0


@pytest.mark.parametrize("seed", range(8))
def test_jitter_of_the_angle_is_no_hand(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(60_000) / 500
    jitter = np.interp(time, np.arange(0.0, 122.0, np.pi / 6.5), rng.normal(0, 0.01, 253))
    motion = find_motion(time, np.exp(-time / 12) * (1 + jitter) * np.cos(6.5 * time), 0.0)
    start, stop, _ = usable_part(motion, None, 0.0, 120.0)
    assert stop - start > 5.0
