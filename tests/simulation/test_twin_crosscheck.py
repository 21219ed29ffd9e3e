"""The twin against scipy's solve_ivp with events, an independent code, under the voltages that the twin logged."""

from __future__ import annotations

import numpy as np
import pytest

from long_cases import quick_if
from motion_by_events import motion
from swingid.simulation import simulate_run
from twin_cases import body_of, direct_rig, paper_rig, sine, warm_compensator

RATE = 100.0


def crosscheck(rig, run, initial=(0.0, 0.0, 0.0, 0.0), method="DOP853", rtol=1e-10):
    """Largest differences in angles (rad) and speeds (rad/s), and shares of time that axis and wheel rest."""
    truth = run.truth
    states = motion(body_of(rig), truth.command[:-1], 1.0 / RATE, initial, method, rtol)
    angles = max(abs(truth.angle - states[:, 0]).max(), abs(truth.wheel_angle - states[:, 2]).max())
    speeds = max(abs(truth.speed - states[:, 1]).max(), abs(truth.wheel_speed - states[:, 3]).max())
    assert truth.guarded_steps == 0
    # They also agree, at every instant, about what rests.
    assert np.array_equal(truth.speed == 0.0, states[:, 1] == 0.0)
    assert np.array_equal(truth.wheel_speed == 0.0, states[:, 3] == 0.0)
    return angles, speeds, np.mean(truth.speed == 0.0), np.mean(truth.wheel_speed == 0.0)


@pytest.mark.parametrize(
    "law",
    quick_if(
        lambda law: law in ("viscous", "stribeck", "lugre"),
        ["viscous", "coulomb", "stribeck", "quadratic", "cubic", "lugre"],
    ),
)
def test_closed_loop_follows_the_independent_motion(law):
    rig = paper_rig(law)
    run = simulate_run(rig, sine(0.8, 8.5), warm_compensator(rig), duration=2.5, rate=RATE)
    angles, speeds, _, _ = crosscheck(rig, run)
    assert run.truth.mode_changes > 10
    assert angles < 1e-7
    assert speeds < 1e-6


def test_an_axis_that_sticks_at_turning_points():
    rig = paper_rig("sticking")
    run = simulate_run(rig, sine(0.8, 3.0), warm_compensator(rig), duration=2.5, rate=RATE)
    angles, speeds, axis_rests, _ = crosscheck(rig, run)
    assert axis_rests > 0.03
    assert angles < 1e-7
    assert speeds < 1e-6


def test_a_wheel_that_sticks_and_an_axis_that_sticks():
    rig = paper_rig("sticking", **{"drive.motor.coulomb": 4e-3})
    slow = 3.0 * np.sin(1.3 * np.arange(301) / RATE) * np.sin(9.0 * np.arange(301) / RATE)
    run = simulate_run(rig, duration=3.0, rate=RATE, drive=slow, initial_angle=1.0)
    angles, speeds, axis_rests, wheel_rests = crosscheck(rig, run, (1.0, 0.0, 0.0, 0.0))
    both = np.mean((run.truth.speed == 0.0) & (run.truth.wheel_speed == 0.0))
    assert 0.1 < wheel_rests < 0.95
    assert 0.1 < axis_rests < 0.95
    assert 0.0 < both < min(axis_rests, wheel_rests)
    assert angles < 1e-7
    assert speeds < 1e-6


def test_a_wheel_that_sticks_near_resonance():
    rig = paper_rig("viscous")
    run = simulate_run(rig, sine(0.8, 4.5), warm_compensator(rig, coulomb_voltage=0.0), duration=2.5, rate=RATE)
    angles, speeds, _, wheel_rests = crosscheck(rig, run)
    assert wheel_rests > 0.05
    assert angles < 1e-7
    assert speeds < 1e-6


@pytest.mark.parametrize("law", ["sticking", "lugre"])
def test_direct_drive(law):
    rig = direct_rig(law)
    torque = 0.06 * np.sin(3.0 * np.arange(251) / RATE)
    run = simulate_run(rig, duration=2.5, rate=RATE, drive=torque)
    angles, speeds, axis_rests, _ = crosscheck(rig, run)
    assert (law == "lugre") or axis_rests > 0.05
    assert angles < 1e-7
    assert speeds < 1e-6


def test_stiff_bristles():
    bristles = {"bristle_stiffness": 30.0, "bristle_damping": 0.01}
    rig = paper_rig("lugre", **{"axis.friction.lugre": bristles})
    run = simulate_run(rig, sine(0.8, 8.5), warm_compensator(rig), duration=2.5, rate=RATE)
    angles, speeds, _, _ = crosscheck(rig, run, method="LSODA", rtol=1e-11)
    assert angles < 1e-6
    assert speeds < 1e-5
