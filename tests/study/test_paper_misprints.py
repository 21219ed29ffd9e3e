"""The misprints and gaps of the paper that docs/paper.md lists, those that no other test meets: what is printed fails,
what stands in its place holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from closed_form_logs import LAWS, ONE_TONE, SMOOTH_MOTOR, TIME, exact_rig, motor_log
from swingid.control.compensator import Compensator
from swingid.errors import InputError
from swingid.identification import identify
from swingid.model.dynamics import accelerations
from swingid.model.motor import ideal_torque, motor_torque
from swingid.model.parameters import A11, A12, A22, C1, C2, D1, D2, ETA, F2, F3, GEAR, VISCOUS_P, B, rig_vector
from swingid.model.printed import alphas, state_space
from swingid.simulation import simulate_run
from swingid.study.reproduce import published
from twin_logs import INERTIA, PAPER

P = rig_vector(PAPER)
SMOOTH = rig_vector(PAPER.changed(SMOOTH_MOTOR))
BODY_MASS, L2 = 68.0e-3, 117.0e-3


def test_6_counts_m2_l2_squared_twice():
    """Without the last term (6) finds J1 of a closed-form motion, so any m2 > 0 makes it too small."""
    rig = exact_rig(**SMOOTH_MOTOR)
    found = identify(motor_log(rig, ONE_TONE, LAWS["viscous"], TIME), rig, "energy", variant="printed")
    assert found.inertia.value == pytest.approx(INERTIA, rel=1e-5)
    # a disc with the wheel's J2 that is no wider than the rod is long has at least m2 = 2 J2 / l2^2
    least = 2 * 11.34e-5
    assert (found.inertia.value - least) / INERTIA - 1 < -0.07


def test_8_jumps_in_its_third_branch_as_printed():
    below = (P[D2] - 1e-9) / (P[ETA] * P[C1])
    assert motor_torque(below, 0.0, P) == pytest.approx(-1e-9, rel=1e-6)
    as_printed = ideal_torque(below, 0.0, P) + P[D2]
    assert as_printed == pytest.approx(2 * P[D2], rel=1e-4)


def test_9_has_the_sign_of_friction_wrong_in_its_first_row_only():
    q1, v1, v2, u = 0.3, 2.0, -20.0, 1.5
    a1, a2 = accelerations(q1, v1, v2, 0.0, 1, 1, 1, u, SMOOTH)
    a11, a12, a22, n = (SMOOTH[place] for place in (A11, A12, A22, GEAR))
    friction = SMOOTH[VISCOUS_P] * v1
    gravity = SMOOTH[B] * np.sin(q1)
    motor = n * (SMOOTH[ETA] * (SMOOTH[C1] * u - SMOOTH[C2] * v2) - SMOOTH[F2] * n * v2)
    determinant = a11 * a22 - a12**2
    assert a1 == pytest.approx((-a22 * (gravity + friction) - a12 * motor) / determinant, rel=1e-12)
    as_printed = (-a22 * (gravity - friction) - a12 * motor) / determinant
    assert as_printed - a1 == pytest.approx(2 * a22 * friction / determinant, rel=1e-9)
    assert a2 == pytest.approx((a11 * motor + a12 * (gravity + friction)) / determinant, rel=1e-12)


def test_u1_acts_on_the_motor_and_not_on_the_bearing():
    """With the wheel turning, u1 takes f3 out of row (II); of the bearing's friction it takes nothing."""
    controller = Compensator.paper(PAPER)
    assert P[ETA] * P[C1] * controller.coulomb_voltage == pytest.approx(P[F3], rel=1e-12)
    q1, v1, v2, u2 = 0.3, 2.0, 20.0, 1.5
    u1, u3 = controller.coulomb_voltage, controller.dead_zone_voltage[1]
    assert P[ETA] * P[C1] * u3 == pytest.approx(P[D1], rel=1e-12)
    compensated = accelerations(q1, v1, v2, 0.0, 1, 1, 1, u2 + u1 + u3, P)
    frictionless_motor = accelerations(q1, v1, v2, 0.0, 1, 1, 1, u2, SMOOTH)
    assert compensated == pytest.approx(frictionless_motor, rel=1e-12)


def test_a_constant_load_spins_the_wheel_up_until_the_voltage_is_at_its_limit():
    """r(p) has the root 0: the control of q1 does not hold the speed of the wheel, and then lets go of q1 too."""
    rig = PAPER.changed({"sensors.counts_per_turn": None})
    controller = replace(Compensator.paper_simulation(rig), k_tilde0=700.0, lambda0=0.0)
    run = simulate_run(rig, lambda t: 0.03 * (1 - np.exp(-t)), controller, duration=24.0, rate=1e4)
    truth = run.truth
    held = (truth.time > 6.0) & (truth.time < 14.0)
    assert truth.angle[held].min() > 0.02
    load = P[B] * np.mean(np.sin(truth.angle[held]))
    assert np.ptp(truth.wheel_speed[held]) / 8.0 == pytest.approx(load / P[A12], rel=0.01)
    assert truth.command[-1] == -10.0
    assert abs(truth.angle[-1]) < 0.005


def test_v2_falls_with_the_consistent_law_and_may_rise_with_the_printed_one():
    """V2' in 4.2 leaves out the errors of alpha_4 and alpha_7, which are c4 and c7 times that of alpha_2."""
    alpha = alphas(SMOOTH)
    c4, c7 = alpha[4] / alpha[2], alpha[7] / alpha[2]
    n1, n2, gamma1, gamma2 = 10.0, 10.0, 10.0, 100.0
    rises = 0
    for e1, e2, x1, x2, x4, share in np.random.default_rng(0).uniform(-1, 1, (200, 6)) * [0.1, 1, 0.8, 6, 120, 0.8]:
        a2, a3 = (1 + share) * alpha[2], 0.5 * alpha[3]
        e1_rate = e2 - n1 * e1
        # (21) without y_m'', which cancels out of e2'
        u2 = (e1 - a3 * x2 - a2 * np.sin(x1) + c7 * a2 * x4 + n1 * e1_rate + n2 * e2) / (c4 * a2)
        e2_rate = -alpha[3] * x2 - alpha[2] * np.sin(x1) + alpha[7] * x4 - alpha[4] * u2 + n1 * e1_rate
        wanted = -n1 * e1**2 - n2 * e2**2
        common = e1 * e1_rate + e2 * e2_rate - (alpha[3] - a3) / gamma1 * (-gamma1 * e2 * x2)
        error = alpha[2] - a2
        consistent = common - error / gamma2 * gamma2 * e2 * (-np.sin(x1) + c7 * x4 - c4 * u2)
        printed = common - error / gamma2 * -gamma2 * e2 * np.sin(x1)
        assert consistent == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        rises += printed > 0
    assert rises > 20


def test_section_5_contradicts_itself_in_j_e():
    j1, a11, known = published.J1, published.A11_BODY, published.J_E
    nls, proposed = (a11[way] - j1[way] for way in ("nls", "proposed"))
    assert nls == pytest.approx(108.4e-5)
    assert published.J_E_PRINTED["nls"] == pytest.approx(nls + 10e-5)
    assert int(100 * (nls / known - 1)) == published.J_E_ERROR["nls"]
    assert proposed == pytest.approx(published.J_E_PRINTED["proposed"])
    assert int(100 * (proposed / known - 1)) == published.J_E_ERROR["proposed"]


def test_the_ranking_of_section_5_rests_on_what_a11_prime_means():
    """With − J2 − Jr, as its formula says, NLS would be the better one."""
    carried = 11.34e-5 + 0.21e-5
    errors = {way: published.A11_BODY[way] - published.J1[way] - carried - published.J_E for way in published.J1}
    assert errors["nls"] / published.J_E == pytest.approx(0.008, abs=5e-4)
    assert errors["proposed"] / published.J_E == pytest.approx(-0.049, abs=5e-4)


def test_b_of_section_5_is_a_torque():
    assert pytest.approx(PAPER.axis.gravity_torque.value, rel=2e-3) == BODY_MASS * 9.81 * L2


def test_the_times_of_fig_7_miss_the_turning_point_and_reach_beyond_the_one_before():
    t10, t11, t20, t21 = published.TIMES
    middle = (t11 + t20) / 2
    assert (t10 + t21) / 2 == pytest.approx(middle)
    turning = 25.5 * np.pi / 8.5
    assert turning - middle == pytest.approx(1.8e-3, abs=5e-5)
    half_period = np.pi / 8.5
    assert t11 - t10 > half_period
    assert t10 < turning - half_period < t11
    # (6) divides by q12'^2 + q13'^2 − q11'^2 − q14'^2, at most 2 times the square of the peak speed
    speeds = np.cos(8.5 * np.array(published.TIMES)) ** 2
    assert abs(speeds @ [-1, 1, 1, -1]) / 2 < 0.06


def test_sigma_is_below_k_tilde_while_k_tilde_is_below_1_over_sigma0():
    """(16) asks for sigma > nu + kappa = k tilde; with (19) that begins at k tilde = 1/sigma0, 10 in the experiment."""
    sigma0 = Compensator.paper(PAPER).sigma0
    run = simulate_run(PAPER, lambda t: 0.8 * np.sin(8.5 * t), Compensator.paper(PAPER), duration=12.0)
    gain = run.recording.adaptive_gain
    below = sigma0 * gain**2 < gain
    np.testing.assert_array_equal(below[gain > 0], gain[gain > 0] < 1 / sigma0)
    assert below[1000:5000].all()
    assert not below[-1]


@pytest.mark.parametrize(("sign", "bound"), [(1.0, (0.0, 1e-3)), (-1.0, (0.2, np.inf))])
def test_e1_of_4_2_with_the_sign_of_14_would_drive_the_pendulum_away(sign: float, bound: tuple[float, float]):
    """(10) under (21) with the true constants, from an error of 20 mrad: e1 = x1 − y_m, and y_m − x1 as (14) has it."""
    alpha = alphas(SMOOTH)
    n1, n2, h = 10.0, 10.0, 1e-3

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        reference, rate, bend = (0.8 * 8.5**k * np.sin(8.5 * t + k * np.pi / 2) for k in range(3))
        e1 = sign * (x[0] - reference)
        e1_rate = x[1] - rate
        e2 = e1_rate + n1 * e1
        wanted = e1 - alpha[3] * x[1] - alpha[2] * np.sin(x[0]) + alpha[7] * x[3] + n1 * e1_rate - bend + n2 * e2
        return state_space(x, wanted / alpha[4], alpha)

    x = np.array([0.02, 0.8 * 8.5, 0.0, 0.0])
    for step in range(1000):
        t = step * h
        k1 = slope(t, x)
        k2 = slope(t + h / 2, x + h / 2 * k1)
        k3 = slope(t + h / 2, x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(t + h, x + h * k3))
    assert bound[0] <= abs(x[0] - 0.8 * np.sin(8.5)) <= bound[1]


def test_c2_is_a_torque_per_speed():
    """c2 q2' of (8) is a torque; N m rad/s V^-2, as printed, would make it none."""
    assert PAPER.changed({"drive.motor.back_emf": "3.697e-6 N m s/rad"}).drive.motor.back_emf.value == 3.697e-6
    with pytest.raises(InputError, match="back_emf"):
        PAPER.changed({"drive.motor.back_emf": "3.697e-6 N m rad/s/V**2"})
