"""Integration between and through events: orders of convergence, rest, release, closed forms of free motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swingid.model.dynamics import accelerations, holding_torques
from swingid.model.energy import drive_power, kinetic_energy, motor_friction_power, potential_energy
from swingid.model.friction import release_margin, sliding_friction
from swingid.model.integrator import FIRST, NEW, NOW, Q1, ROWS, STATES, STEP_KERNEL, V1, V2, derivative, quintic, step
from swingid.model.motion import COUNTS, EVENTS, FIELDS, GUARDED, MANY_EVENTS, advance
from swingid.model.parameters import STATIC_N, STATIC_P, WHEEL_STATIC, rig_vector
from swingid.model.sticking import BEGIN_KERNEL, choose_mode, dip, wheel_margin
from swingid.simulation import simulate_run
from twin_cases import body_of, direct_rig, first_call_compiles, free_rig, paper_rig

FRICTIONLESS = {
    "drive.motor.viscous": 0.0,
    "drive.motor.coulomb": 0.0,
    "drive.motor.back_emf": 0.0,
    "drive.motor.dead_zone": [0.0, 0.0],
    "axis.friction.viscous": None,
}


def fixed_steps(p, y, h, steps, u=0.0, mode=(1, 1, 1)):
    """State after steps of one length within one mode, however long they are."""
    work = np.zeros((ROWS, STATES))
    work[NOW] = y
    for _ in range(steps):
        derivative(work, NOW, FIRST, mode, u, p)
        step(work, h, mode, u, p)
        work[NOW] = work[NEW]
    return work[NOW]


def slope_of(errors, ratio=2.0):
    return np.log(np.abs(errors[:-1]) / np.abs(errors[1:])) / math.log(ratio)


def test_frictionless_energy_drift_falls_with_the_integrators_order():
    p = rig_vector(paper_rig(**FRICTIONLESS))

    def energy(y):
        return kinetic_energy(y[V1], y[V2], p) + potential_energy(y[Q1], p)

    start = np.array([2.0, 0.0, 0.0, 30.0, 0.0])
    drifts = [energy(fixed_steps(p, start, 1.6 / n, n)) - energy(start) for n in (20, 40, 80, 160)]
    assert slope_of(np.array(drifts)) == pytest.approx(5.5, abs=0.7)
    assert abs(drifts[-1]) < 1e-9 * energy(start)


def test_states_converge_with_order_five():
    p = rig_vector(paper_rig("quadratic"))
    start = np.array([0.5, 3.0, 0.0, 60.0, 0.0])
    best = fixed_steps(p, start, 0.4 / 640, 640, u=2.0)
    errors = [np.abs(fixed_steps(p, start, 0.4 / n, n, u=2.0) - best).max() for n in (5, 10, 20)]
    assert slope_of(np.array(errors)) == pytest.approx(5.0, abs=0.5)


def test_dense_output_is_of_order_six_in_the_angle():
    def error(h):
        ends = [(math.sin(t), math.cos(t), -math.sin(t)) for t in (0.7, 0.7 + h)]
        angle, speed = quintic(0.37, h, *ends)
        return angle - math.sin(0.7 + 0.37 * h), speed - math.cos(0.7 + 0.37 * h)

    errors = np.array([error(h) for h in (0.4, 0.2, 0.1)])
    assert slope_of(errors[:, 0]) == pytest.approx(6.0, abs=0.2)
    assert slope_of(errors[:, 1]) == pytest.approx(5.0, abs=0.3)
    assert quintic(0.0, 0.1, (0.3, 1.0, 2.0), (0.41, 1.2, 2.0)) == (0.3, 1.0)


def test_work_along_a_trajectory_is_the_change_of_energy():
    # Simpson's rule on powers along the true motion: what is left falls with its order, to nothing.
    rig = paper_rig("quadratic")
    p, left = rig_vector(rig), []
    for rows in (81, 161, 321):
        times = np.linspace(0.0, 0.2, rows)
        run = simulate_run(rig, duration=0.25, rate=4.0, drive=[6.0, 6.0], initial_angle=0.3, truth_times=times)
        t = run.truth
        assert (t.speed[1:] < 0.0).all()
        assert (t.wheel_speed[1:] > 0.0).all()
        power = [
            drive_power(6.0, v1, v2, p) - sliding_friction(v1, -1, 0.0, p) * v1 - motor_friction_power(v2, 1, p)
            for v1, v2 in zip(t.speed, t.wheel_speed, strict=True)
        ]
        weights = np.full(rows, 2.0)
        weights[1::2], weights[[0, -1]] = 4.0, 1.0
        energies = [kinetic_energy(t.speed[i], t.wheel_speed[i], p) + potential_energy(t.angle[i], p) for i in (0, -1)]
        left.append(weights @ power * (0.2 / (rows - 1)) / 3.0 - (energies[1] - energies[0]))
    assert abs(left[-1]) < 2e-11
    assert slope_of(np.array(left)) == pytest.approx(4.0, abs=0.2)


def test_constant_friction_on_a_balanced_axis_stops_where_it_must():
    # b = 0: deceleration Fc/J, stop after v0 J/Fc at v0^2 J/(2 Fc), and rest for good.
    rig = free_rig("coulomb", **{"axis.gravity_torque": 0.0, "axis.friction.viscous": None})
    j, fc, v0 = 302.2e-5, 3e-3, 2.0
    run = simulate_run(rig, duration=3.0, rate=100.0, initial_speed=v0)
    stop = v0 * j / fc
    moving = run.truth.time < stop
    t = run.truth.time[moving]
    assert run.truth.angle[moving] == pytest.approx(v0 * t - 0.5 * fc / j * t**2, abs=1e-12)
    assert run.truth.angle[~moving] == pytest.approx(v0**2 * j / (2 * fc), abs=1e-12)
    assert (run.truth.speed[~moving] == 0.0).all()
    assert run.truth.mode_changes == 1


def test_each_swing_of_a_pendulum_with_coulomb_friction_loses_its_work():
    # b (cos next - cos last) = Fc (last + next) from turning point to turning point, exactly, until b sin q < Fc.
    rig = free_rig("coulomb", **{"axis.friction.viscous": None})
    b, fc, last = 78e-3, 3e-3, 1.0
    turns = [last]
    while b * math.sin(last) > fc:
        low, high = 0.0, last
        for _ in range(60):
            middle = 0.5 * (low + high)
            gained = b * (math.cos(middle) - math.cos(last)) > fc * (last + middle)
            low, high = (middle, high) if gained else (low, middle)
        last = low
        turns.append(last)
    run = simulate_run(rig, duration=8.0, rate=100.0, initial_angle=1.0, truth_times=np.arange(0.0, 8.0, 1e-4))
    speed, angle = run.truth.speed, run.truth.angle
    rest = np.flatnonzero(speed == 0.0)
    first = rest[rest > 10][0]
    # The last sample before each turning point, and on at the deceleration that it had: v^2 / (2 a).
    i = np.flatnonzero(speed[1:first] * speed[2 : first + 1] < 0.0) + 1
    seen = np.abs(angle[i] + 0.5 * speed[i] ** 2 / ((speed[i - 1] - speed[i]) / 1e-4))
    assert np.append(seen, abs(angle[first])) == pytest.approx(turns[1:], abs=1e-9)
    assert (speed[first:] == 0.0).all()
    assert (angle[first:] == angle[first]).all()


@first_call_compiles
@given(st.floats(-1.5, 1.5), st.floats(-10.0, 10.0), st.booleans(), st.floats(-30.0, 30.0))
def test_rest_is_decided_as_gausss_principle_says(q1, u, wheel_rests, v2):
    rig = paper_rig("coulomb", **{"axis.friction.coulomb": 0.02})
    p, body = rig_vector(rig), body_of(rig)
    work = np.zeros((ROWS, STATES))
    work[NOW] = [q1, 0.0, 0.0, 0.0 if wheel_rests else v2, 0.0]
    s1, s2, branch = choose_mode(work, u, p)
    y = work[NOW]
    a1, a2 = accelerations(q1, 0.0, y[V2], 0.0, s1, s2, branch, u, p)
    hold1, hold2 = holding_torques(q1, y[V2], a1, a2, s2, branch, u, p)
    slacks = [release_margin(hold1, 0.0, p) / p[STATIC_P], wheel_margin(hold2, p) / p[WHEEL_STATIC]]
    on_the_brink = (s1 == 0 and slacks[0] < 1e-9) or (y[V2] == 0 and s2 == 0 and slacks[1] < 1e-9)
    on_the_brink = on_the_brink or (s1 != 0 and abs(a1) < 1e-6) or (y[V2] == 0 and s2 != 0 and abs(a2) < 1e-6)
    assert on_the_brink or (s1, s2) == body.decide(y, u)


def test_a_reversal_and_back_within_one_step_is_seen():
    # v(t) = 1e-3 - 4 t + 3800 t^2 is negative in the middle of 1 ms and positive at both ends.
    v, a, c = 1e-3, -4.0, 3800.0
    h = 1e-3
    low = dip(v, a, v + a * h + c * h * h, a + 2 * c * h, h)
    assert low == pytest.approx(4.0 / 7600.0, rel=1e-6)
    assert dip(2e-3, a, 2e-3 + a * h + c * h * h, a + 2 * c * h, h) == h


def test_stick_and_release_happen_at_the_known_instants():
    # A resting axis under a slow torque ramp of held steps is released by the first that passes the static level.
    rig = direct_rig("sticking", **{"axis.gravity_torque": 0.0})
    torque = np.arange(101) * 5e-4
    run = simulate_run(rig, duration=1.0, rate=100.0, drive=torque)
    released = np.flatnonzero(run.truth.speed != 0.0)[0]
    assert torque[released - 2] <= 30e-3 < torque[released - 1]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_random_motions_need_no_guard(seed):
    rig = paper_rig("sticking")
    volts = np.random.default_rng(seed).uniform(-10.0, 10.0, 60)
    run = simulate_run(rig, duration=0.59, rate=100.0, drive=volts, initial_angle=0.5)
    assert run.truth.guarded_steps == 0
    assert run.truth.mode_changes < 4 * len(volts)


def test_a_decay_that_has_nearly_ended_takes_the_side_of_its_acceleration():
    # below some 1e-9 rad/s² the wrong side passed for the right one, and ended at once, over and over
    run = simulate_run(paper_rig("viscous"), duration=132.5, rate=10.0, initial_angle=1.0)
    assert 0.0 < np.abs(run.truth.angle[-20:]).max() < 1e-10
    assert run.truth.guarded_steps == 0
    assert run.truth.mode_changes < 132.5 * 5.1 / np.pi + 20


def test_the_guard_lets_a_chattering_motion_go_on():
    # A made-up vector whose release level is below its sliding level: neither rest nor motion agrees with itself.
    p = rig_vector(free_rig("coulomb"))
    p[STATIC_P] = p[STATIC_N] = 0.0
    work, counts = np.zeros((ROWS, STATES)), np.zeros(COUNTS, np.int64)
    work[NOW, Q1] = -0.02
    noted = np.empty(0), np.empty((0, STATES)), np.empty((0, FIELDS)), counts
    advance(STEP_KERNEL, BEGIN_KERNEL, 0.0, 1e-3, 0.0, work, 1e-3, p, *noted)
    assert 0 < counts[GUARDED] <= 1000
    assert counts[EVENTS] > MANY_EVENTS
    assert abs(work[NOW, V1]) < 1e-6 * 3.2e-3 / 302.2e-5
    assert work[NOW, Q1] == pytest.approx(-0.02, abs=1e-6)
