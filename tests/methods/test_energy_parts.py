"""What the energy method is made of: running integrals, mirrored nodes, noise of slopes, voltage between rows."""

from __future__ import annotations

import numpy as np
import pytest

from closed_form_logs import ONE_TONE, TWO_TONES
from swingid.balance.energies import of_energy
from swingid.balance.motor import motor_drag, motor_torque
from swingid.methods.energy.balance import MOTOR, Course, PassRows
from swingid.methods.energy.chain import between_rows
from swingid.methods.energy.fit import slope_overlap
from swingid.methods.energy.passes import mirrored_passes
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.quadrature import GaussNodes, running_hats, running_integrals
from swingid.numerics.regression import block_covariance
from swingid.numerics.spline import local_cubic
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import Noise, uneven_noise
from swingid.recording.recording import Recording

IRREGULAR = np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 60)) * 0.02


@pytest.mark.parametrize(("points", "power"), [(2, 0), (2, 1), (3, 2)])
def test_running_integrals_of_polynomials_are_exact_at_any_instant(points, power):
    nodes = GaussNodes(IRREGULAR, points)
    at = np.sort(np.random.default_rng(2).uniform(IRREGULAR[0], IRREGULAR[-1], 40))
    (found,) = running_integrals(nodes, nodes.instants[None] ** power, at)
    expected = (at ** (power + 1) - IRREGULAR[0] ** (power + 1)) / (power + 1)
    assert found == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("points", [2, 3])
def test_at_the_samples_they_have_the_degree_of_gauss_rules(points):
    nodes, power = GaussNodes(IRREGULAR, points), 2 * points - 1
    (found,) = running_integrals(nodes, nodes.instants[None] ** power, IRREGULAR)
    expected = (IRREGULAR ** (power + 1) - IRREGULAR[0] ** (power + 1)) / (power + 1)
    assert found == pytest.approx(expected, abs=1e-14)


def test_a_held_signal_costs_no_accuracy_between_samples():
    time, levels = np.array([0.0, 1.0, 1.5, 4.0]), np.array([2.0, -1.0, 3.0, 0.0])
    nodes = GaussNodes(time)
    signals = np.stack([nodes.hold(levels), nodes.hold(levels) * nodes.instants])
    found, ramp = running_integrals(nodes, signals, np.array([1.2, 2.0]))
    assert found == pytest.approx([2 - 0.2, 2 - 0.5 + 3 * 0.5])
    assert ramp == pytest.approx([1 - (1.2**2 - 1) / 2, 1 - (1.5**2 - 1) / 2 + 3 * (4 - 1.5**2) / 2])


@pytest.mark.parametrize("points", [2, 3])
def test_running_hats_are_the_running_integrals_of_the_hats(points):
    nodes, knots = GaussNodes(IRREGULAR, points), np.array([0.3, 0.5, 1.1, 2.0])
    values, powers = 1.2 + np.sin(5 * nodes.instants), np.cos(nodes.instants)
    at = np.sort(np.random.default_rng(4).uniform(IRREGULAR[0], IRREGULAR[-1], 40))
    hats = np.stack([np.interp(values, knots, row) * powers for row in np.eye(4)])
    found = running_hats(nodes, values, powers, knots, at)
    assert found == pytest.approx(running_integrals(nodes, hats, at), abs=1e-14)


@pytest.mark.parametrize("motion", [ONE_TONE, TWO_TONES])
def test_nodes_are_at_equal_angles_before_and_after_each_turning_point(motion):
    time = np.arange(10_001) / 1000
    found = find_motion(time, motion(time), 0.0)
    depths = np.array([0.1, 0.3, 0.5])
    passes = mirrored_passes(found, depths, time, 0.1)
    assert len(passes.turning) == len(found.turning_times) - 2
    angles = motion(passes.instants)
    sizes = np.minimum(found.swing_sizes[:-1], found.swing_sizes[1:])[:, None]
    top = motion(motion.reversals(0, 10))[1:-1, None]
    expected = top - passes.sides[:, None] * sizes * depths
    assert np.abs(angles[:, [4, 5, 6]] - expected).max() < 1e-4
    assert np.abs(angles[:, [2, 1, 0]] - expected).max() < 1e-4


def test_nodes_of_a_sine_are_mirrored_in_time_too():
    time = np.arange(10_001) / 1000
    passes = mirrored_passes(find_motion(time, ONE_TONE(time), 0.0), np.array([0.05, 0.5]), time, 0.1)
    before, after = (
        passes.turning[:, None] - passes.instants[:, [1, 0]],
        passes.instants[:, 3:] - passes.turning[:, None],
    )
    assert np.abs(before - after).max() < 1e-4
    assert after[:, 1] == pytest.approx(np.pi / 2 / 8.5, abs=1e-4)


def test_blocks_across_a_gap_are_left_out():
    time = np.arange(10_001) / 1000
    motion = find_motion(time, ONE_TONE(time), 0.0)
    whole = mirrored_passes(motion, np.array([0.1, 0.5]), time, 0.1)
    hole = whole.turning[5] + np.array([0.02, 0.16])
    kept = time[(time < hole[0]) | (time > hole[1])]
    passes = mirrored_passes(motion, np.array([0.1, 0.5]), kept, 0.1)
    assert np.setdiff1d(whole.turning, passes.turning) == pytest.approx([whole.turning[5]])


@pytest.mark.parametrize("distance", [0.0, 0.3, 0.9, 1.6, 2.5])
def test_slopes_of_near_local_cubics_are_correlated_as_told(distance):
    time, width = np.arange(-2000, 6001) * 1e-3, 1.0005
    weights = [_slope_weights(time, at, width) for at in (0.0, distance * width)]
    correlation = weights[0] @ weights[1] / (weights[0] @ weights[0])
    assert slope_overlap(distance) == pytest.approx(correlation, abs=3e-3)


def _slope_weights(time, at, width):
    """Weights of the samples in the slope of a local cubic."""
    weights = np.zeros(len(time))
    near = np.nonzero(np.abs(time - at) <= width)[0]
    powers = ((time[near] - at) / width)[:, None] ** np.arange(4)
    weights[near] = np.linalg.pinv(powers)[1] / width
    values = np.sin(time)
    assert weights @ values == pytest.approx(local_cubic(time, values, np.array([at]), width)[0, 1])
    return weights


def test_covariance_of_blocks_counts_neighbours_and_is_the_mean_s_for_independent_ones():
    scores = np.random.default_rng(4).standard_normal((1, 20_000)) / 20_000
    assert block_covariance(scores, 1)[0, 0] == pytest.approx(1 / 20_000, rel=0.05)
    twice = np.repeat(scores[:, ::2], 2, axis=1)
    assert block_covariance(twice, 1)[0, 0] == pytest.approx(1.5 / 20_000, rel=0.05)


def test_a_held_voltage_is_its_row_s_and_where_rows_are_lost_lies_on_their_line():
    time = np.array([0.0, 1.0, 2.0, 3.0, 6.0, 7.0])
    values = np.array([5.0, 4.0, 7.0, 1.0, 4.0, 0.0])
    held = between_rows(GaussNodes(time), values, held=True)
    # lost rows at 4 and 5 would have held 2 and 3, after the 1 of the row at 3
    assert held[:, 0] == pytest.approx([5.0, 4.0, 7.0, (1 + 2 + 3) / 3, 4.0])
    assert held[:, 1] == pytest.approx(held[:, 0])


def test_the_terms_of_the_motor_sum_up_to_its_work():
    """N (M − f2 N q2' − f3 sgn q2') q2' of (8), with a dead zone, whose constants have a term each."""
    rig = Rig.builtin("paper").changed({"drive.motor.dead_zone": [-3e-4, 5e-4]})
    motor, equation, t = rig.drive.motor, of_energy(rig, Equation.of(rig)), np.arange(4000) * 1e-3
    log = Recording(t, angle=0.8 * np.sin(8.5 * t), wheel_angle=9 * np.sin(5 * t), voltage=0.4 * np.sin(7 * t))
    encoders, noise = Encoders.of(rig), Noise(1e-9, 1e-9, 1e-3)
    course = Course.of(log, rig, find_motion(t, log.angle, 0.0), noise, encoders)
    rows = PassRows.of(course, np.linspace(0.1, 3.9, 40).reshape(2, 20), equation)
    torque = motor_torque(motor, course.drive, course.wheel_speed) - motor_drag(motor, course.wheel_speed)
    power = motor.gear_ratio.value * torque * course.turn
    (work,) = running_integrals(course.nodes, [power], rows.windows.centres)
    assert 0.01 < np.mean(course.active) < 0.99
    assert -rows.sum_of({name: equation.value(name) for name in MOTOR}) == pytest.approx(work, rel=1e-10, abs=1e-12)


def test_a_measured_torque_is_interpolated():
    time = np.linspace(0, 1, 200)
    nodes = GaussNodes(time)
    found = between_rows(nodes, np.cos(3 * time), held=False)
    assert np.abs(found - np.cos(3 * nodes.instants))[20:-20].max() < 1e-8


def test_noise_is_told_from_uneven_stamps():
    rng = np.random.default_rng(7)
    time = np.arange(5000) * 1e-3 + rng.uniform(-2e-4, 2e-4, 5000)
    time = time[rng.random(5000) > 0.05]
    assert uneven_noise(time, ONE_TONE(time)) < 1e-9
    assert uneven_noise(time, ONE_TONE(time) + rng.normal(0, 1e-3, len(time))) == pytest.approx(1e-3, rel=0.05)
    assert uneven_noise(time[:15], ONE_TONE(time[:15])) == 0.0
