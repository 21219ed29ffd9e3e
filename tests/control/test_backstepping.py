"""The backstepping controller (21): its law by hand, its closed loop, and the paper's simulation of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.control import backstepping
from swingid.control.backstepping import Backstepping, reference_rates
from swingid.control.observer import VelocityObserver
from swingid.control.references import Sine
from swingid.errors import UsageError
from swingid.model.parameters import rig_vector
from swingid.model.printed import alphas
from swingid.model.rig import Rig
from swingid.simulation import simulate_run

PAPER = Rig.builtin("paper")
IDEAL = PAPER.changed({"sensors.counts_per_turn": None})
TRUTH = alphas(rig_vector(PAPER))
INERTIA = PAPER.axis.inertia.value


def run(rig: Rig, motion: Sine, controller: Backstepping, duration: float, rate: float, **options: float):
    return simulate_run(rig, motion, controller, duration=duration, rate=rate, **options).recording


def off(controller: Backstepping, alpha2: np.ndarray) -> np.ndarray:
    """Error of J1^ in per cent."""
    return 100 * (controller.inertia(alpha2) / INERTIA - 1)


def test_the_constants_are_those_of_equation_11() -> None:
    controller = Backstepping.paper(PAPER)
    assert controller.c4 == pytest.approx(TRUTH[4] / TRUTH[2], rel=1e-14)
    assert controller.c7 == pytest.approx(TRUTH[7] / TRUTH[2], rel=1e-14)
    assert float(controller.inertia(TRUTH[2])) == pytest.approx(INERTIA, rel=1e-12)
    assert float(controller.viscous(TRUTH[2], TRUTH[3])) == pytest.approx(1.144e-3, rel=1e-12)


def test_rates_of_the_reference_are_of_second_order() -> None:
    errors = []
    for h in (4e-3, 2e-3, 1e-3):
        memory = np.zeros(backstepping.STATES)
        times = h * np.arange(round(1.0 / h) + 1)
        rates = np.array([reference_rates(np.sin(8.5 * t), memory, h) for t in times])[4:]
        exact = np.column_stack([8.5 * np.cos(8.5 * times), -72.25 * np.sin(8.5 * times)])[4:]
        errors.append(np.abs(rates - exact).max(axis=0))
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


def test_rates_of_a_parabola_are_exact_from_the_third_sample_on() -> None:
    memory, h = np.zeros(backstepping.STATES), 0.1
    rates = [reference_rates(1 + 2 * t + 3 * t * t, memory, h) for t in h * np.arange(8)]
    assert rates[0] == (0.0, 0.0)
    np.testing.assert_allclose(rates[2:], [(2 + 6 * t, 6.0) for t in h * np.arange(2, 8)], rtol=1e-10)


@pytest.mark.parametrize("law", ["printed", "consistent"])
@pytest.mark.parametrize("limit", [None, 0.5])
def test_one_sample_is_the_law_on_paper(law: str, limit: float | None) -> None:
    """(21) and its adaptation, with the voltage that was applied where the limit cuts it off."""
    controller = replace(Backstepping.paper(PAPER), law=law, alpha2=20.0, alpha3=0.5, voltage_limit=limit)
    h, motion = 1e-3, 0.1 * np.arange(5) ** 2 * 1e-4
    angles, wheel = motion + 0.002 + 1e-3 * np.arange(5), -0.02 * np.arange(5)
    state = controller.initial_state()
    for k in range(5):
        before = state
        voltage, state = controller.step(k * h, (motion[k], angles[k], wheel[k]), state)
    observer = VelocityObserver()
    x1, x2, x4 = angles[-1], *(observer.run(h * np.arange(5), channel)[-1] for channel in (angles, wheel))
    rate, bend = 2e-5 * 4 / h, 2e-5 / h**2
    a2, a3 = before[:2]
    a4, a7 = controller.c4 * a2, controller.c7 * a2
    e1 = x1 - motion[-1]
    e2 = x2 + 10 * e1 - rate
    u2 = (e1 - a3 * x2 - a2 * np.sin(x1) + a7 * x4 + 10 * (x2 - rate) - bend + 10 * e2) / a4
    u1 = controller.coulomb_voltage * np.sign(x4)
    u3 = controller.dead_zone_voltage[int(u1 + u2 > controller.back_emf_ratio * x4)]
    u0 = u1 + u2 + u3
    if limit is not None:
        assert abs(u0) > limit
        u0 = np.clip(u0, -limit, limit)
    assert voltage == pytest.approx(u0, rel=1e-9)
    drive = -np.sin(x1)
    if law == "consistent":
        drive += controller.c7 * x4 - controller.c4 * (u0 - u1 - u3)
    assert state[0] == pytest.approx(a2 + h * 100 * e2 * drive, rel=1e-12)
    assert state[1] == pytest.approx(a3 - h * 10 * e2 * x2, rel=1e-12)


def test_estimates_stay_positive() -> None:
    controller = replace(Backstepping.paper(PAPER), gamma1=1e6, gamma2=1e6)
    state = controller.initial_state()
    for k in range(200):
        _, state = controller.step(k * 1e-3, (0.0, 0.3 + 1e-3 * k, 0.0), state)
        assert state[0] >= 1e-6
        assert state[1] >= 1e-6


def test_with_the_true_constants_the_errors_obey_the_linear_system_of_the_proof() -> None:
    """e1' = e2 - n1 e1, e2' = -e1 - n2 e2, as the rate grows; no adaptation, no motor that sticks at reversals."""
    rig = IDEAL.changed({"drive.motor.coulomb": 0.0, "drive.motor.dead_zone": [0.0, 0.0]})
    motion, start = Sine(0.3, 4.0), 0.01
    errors = []
    for rate in (2e3, 4e3, 8e3):
        known = {"gamma1": 0.0, "gamma2": 0.0, "alpha2": TRUTH[2], "alpha3": TRUTH[3]}
        controller = replace(Backstepping.paper(rig), observers=(VelocityObserver(1e6),) * 2, **known)
        log = run(rig, motion, controller, 1.0, rate, initial_angle=start, initial_speed=1.2)
        t = log.time
        exact = start * np.exp(-10 * t) * (np.cos(t) + 10 * np.sin(t))  # e1(0) = 0.01, e2(0) = 10 e1(0)
        errors.append(np.abs(log.angle - log.reference - exact).max())
    assert errors[-1] < 0.02 * start
    assert errors[0] > 1.8 * errors[1] > 1.8**2 * errors[2]


@pytest.mark.parametrize("law", ["printed", "consistent"])
def test_python_step_is_the_compiled_loop(law: str) -> None:
    """`Backstepping.step` on the logged angles gives the logged voltages and estimates back, to the last bit."""
    controller = Backstepping.paper(PAPER, law=law)
    log = run(PAPER, Sine(0.8, 8.5), controller, 2.0, 1000.0)
    state = controller.initial_state()
    for k in range(len(log)):
        voltage, state = controller.step(log.time[k], (log.reference[k], log.angle[k], log.wheel_angle[k]), state)
        assert voltage == log.voltage[k]
        assert state[0] == log.adaptive_gain[k]


def test_the_paper_s_simulation_converges_to_5_per_cent_in_8_s_by_the_printed_law() -> None:
    """Section 5: 5 % after 8 s; here 6.6 % at 2 rad/s, +-10 V, ideal angles at 10 kHz. The frequency is not printed."""
    printed = Backstepping.paper(IDEAL)
    alpha2 = run(IDEAL, Sine(0.8, 2.0), printed, 12.0, 1e4).adaptive_gain
    assert off(printed, alpha2[80_000]) == pytest.approx(7.0, abs=1.0)
    assert abs(off(printed, alpha2[-1])) < 1.0


def test_at_2_rad_per_s_the_consistent_law_is_far_slower() -> None:
    consistent = Backstepping.paper(IDEAL, law="consistent")
    alpha2 = run(IDEAL, Sine(0.8, 2.0), consistent, 12.0, 1e4).adaptive_gain
    assert 40 < off(consistent, alpha2[80_000]) < 74
    assert 25 < off(consistent, alpha2[-1]) < 50


@pytest.mark.parametrize("law", ["printed", "consistent"])
def test_at_8_5_rad_per_s_both_laws_are_done_in_5_s(law: str) -> None:
    controller = Backstepping.paper(IDEAL, law=law)
    log = run(IDEAL, Sine(0.8, 8.5), controller, 8.0, 1e4)
    assert np.abs(off(controller, log.adaptive_gain[50_000:])).max() < 0.3
    assert np.abs(log.angle - log.reference)[50_000:].max() < 1e-3


def test_the_paper_s_encoders_at_1_khz_leave_it_within_1_per_cent_at_8_5_rad_per_s() -> None:
    controller = Backstepping.paper(PAPER)
    log = run(PAPER, Sine(0.8, 8.5), controller, 12.0, 1e3)
    assert np.abs(off(controller, log.adaptive_gain[5000:])).max() < 1.0


def test_the_paper_s_gains_are_too_high_for_the_paper_s_encoders_at_10_khz() -> None:
    """The paper warns that noise may lead the parameters astray: differences of 14-bit angles over 0.1 ms do."""
    controller = Backstepping.paper(PAPER)
    log = run(PAPER, Sine(0.8, 2.0), controller, 12.0, 1e4)
    assert np.abs(off(controller, log.adaptive_gain[80_000:])).min() > 10.0


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"n1": 0.0}, "n1"),
        ({"gamma2": -1.0}, "gamma2"),
        ({"alpha2": float("inf")}, "alpha2"),
        ({"voltage_limit": 0.0}, "voltage_limit"),
        ({"law": "other"}, "law"),
    ],
)
def test_gains_out_of_range_are_named(changes: dict[str, object], word: str) -> None:
    with pytest.raises(UsageError, match=word):
        replace(Backstepping.paper(PAPER), **changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"drive": {"kind": "direct"}, "log": {"torque": "tau"}},
        {"axis.gravity_torque": "unknown"},
        {"axis.gravity_torque": 0.0},
    ],
)
def test_rigs_it_is_not_made_for_are_named(changes: dict[str, object]) -> None:
    with pytest.raises(UsageError, match="paper-2020"):
        Backstepping.paper(PAPER.changed(changes))
