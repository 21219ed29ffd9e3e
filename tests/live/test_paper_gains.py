"""The adaptive gain on the paper's rig: where it settles with the gains of the experiment and of Fig. 7."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.model.rig import Rig
from swingid.simulation.twin import simulate

RIG = Rig.builtin("paper")
SINE = parse_reference("sine 0.8 rad 8.5 rad/s")


def ideal_angles() -> Rig:
    """The paper's rig with encoders of no step, as in a simulation of its equations."""
    text = RIG.text.replace("counts_per_turn = 16384", "")
    assert text != RIG.text
    return Rig.from_text(text, "ideal angles")


@pytest.mark.parametrize(
    "change", [{}, {"dead_zone_switch": "printed"}, {"differentiate_gain": False}, {"filter_time": 0.0}]
)
def test_experiment_gains_settle_at_13(change: dict) -> None:
    """13.3 ± 0.3 at 1 kHz with 14-bit angles, u1 and u3 on, in every reading of the paper."""
    controller = replace(Compensator.paper(RIG), **change)
    assert controller.coulomb_voltage > 0.0
    assert controller.dead_zone_voltage[0] < 0.0 < controller.dead_zone_voltage[1]
    log = simulate(RIG, SINE, controller, duration=25.0, rate=1000.0)
    k_tilde = log.adaptive_gain
    assert k_tilde is not None
    assert k_tilde[-1] == pytest.approx(13.3, abs=0.3)
    assert np.all(k_tilde[log.time > 15.0] == k_tilde[-1])
    late = log.time > 15.0
    # The band of (18) is kept, and the voltage stays within its limits without touching them.
    assert np.max(np.abs(log.reference[late] - log.angle[late])) < 0.082
    assert np.max(np.abs(log.voltage[late])) < 10.0


def test_test_body_near_resonance_asks_for_less_than_half_the_gain() -> None:
    """With the body, at 6 rad/s against a resonance of 6.2 rad/s, gravity does most of the work."""
    rig = Rig.builtin("paper-body")
    log = simulate(rig, parse_reference("sine 0.8 rad 6 rad/s"), duration=25.0)
    assert log.adaptive_gain[-1] < 0.5 * 13.3
    assert np.all(log.adaptive_gain[log.time > 15.0] == log.adaptive_gain[-1])


def test_simulation_gains_settle_near_730_at_10_khz() -> None:
    rig = ideal_angles()
    log = simulate(rig, SINE, Compensator.paper_simulation(rig), duration=9.0, rate=10_000.0)
    k_tilde = log.adaptive_gain
    assert k_tilde[-1] == pytest.approx(730.0, abs=20.0)
    late = log.time > 6.0
    assert np.all(k_tilde[late] == k_tilde[-1])
    assert np.max(np.abs(log.voltage[late])) < 10.0
    assert np.max(np.abs(log.reference[late] - log.angle[late])) < 0.005


def test_simulation_gains_never_settle_at_1_khz() -> None:
    rig = ideal_angles()
    log = simulate(rig, SINE, Compensator.paper_simulation(rig, sample_time=1e-3), duration=9.0, rate=1000.0)
    late = log.time > 6.0
    assert log.adaptive_gain[-1] > log.adaptive_gain[late][0] + 50.0
    assert np.mean(np.abs(log.voltage[late]) == 10.0) > 0.9


def test_python_step_is_the_compiled_loop() -> None:
    """`Compensator.step` on the logged angles gives the logged voltages and gains back, to the last bit."""
    log = simulate(RIG, SINE, duration=3.0)
    controller = Compensator.paper(RIG)
    state = controller.initial_state(log.angle[0], log.wheel_angle[0])
    for k in range(len(log.time)):
        angles = (log.reference[k], log.angle[k], log.wheel_angle[k])
        voltage, state = controller.step(log.time[k], angles, state)
        assert voltage == log.voltage[k]
        assert state[0] == log.adaptive_gain[k]
