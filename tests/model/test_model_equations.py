"""The equations of motion: rows (I), (II), power balance, printed form (10)-(11), polynomials of (13)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swingid.errors import UnanswerableError
from swingid.model.dynamics import accelerations, holding_torques
from swingid.model.energy import drive_power, kinetic_energy, motor_friction_power, potential_energy
from swingid.model.friction import sliding_friction
from swingid.model.motor import motor_branch
from swingid.model.parameters import VISCOUS_N, rig_vector
from swingid.model.printed import alphas, polynomials, state_space
from twin_cases import LAWS, body_of, direct_rig, first_call_compiles, paper_rig

ANGLES, SPEEDS, VOLTS = st.floats(-7.0, 7.0), st.floats(-20.0, 20.0), st.floats(-10.0, 10.0)
SIDES = st.sampled_from([-1, 1])
RIGS = {law: paper_rig(law) for law in LAWS}
DIRECT = {law: direct_rig(law) for law in LAWS}


@first_call_compiles
@given(st.sampled_from(sorted(LAWS)), st.booleans(), ANGLES, SPEEDS, SPEEDS, SIDES, SIDES, VOLTS)
def test_power_balance_closes_to_rounding(law, direct, q1, v1, v2, s1, s2, u):
    # d/dt (T + Pi) = power of the drive - power lost, with energies and accelerations from the same vector.
    p = rig_vector((DIRECT if direct else RIGS)[law])
    v2, s2 = (0.0, 0) if direct else (v2, s2)
    z = 1e-4 * v1
    a1, a2 = accelerations(q1, v1, v2, z, s1, s2, motor_branch(u, v2, p), u, p)
    # T is quadratic, so its central difference along the acceleration is its derivative.
    rate = 0.5 * (kinetic_energy(v1 + a1, v2 + a2, p) - kinetic_energy(v1 - a1, v2 - a2, p))
    rate += 78e-3 * math.sin(q1) * v1
    lost = sliding_friction(v1, s1, z, p) * v1 + motor_friction_power(v2, s2, p)
    given_power = drive_power(u, v1, v2, p)
    scale = abs(given_power) + abs(lost) + kinetic_energy(a1, a2, p) + kinetic_energy(v1, v2, p) + 1.0
    assert rate == pytest.approx(given_power - lost, abs=1e-13 * scale)


@first_call_compiles
@given(ANGLES, st.floats(1e-6, 1e-3))
def test_potential_energy_is_the_integral_of_gravity(q1, step):
    p = rig_vector(RIGS["viscous"])
    slope = (potential_energy(q1 + step, p) - potential_energy(q1 - step, p)) / (2 * step)
    assert slope == pytest.approx(78e-3 * math.sin(q1), abs=78e-3 * step**2 + 1e-16 / step)


@first_call_compiles
@given(st.sampled_from(["viscous", "coulomb", "quadratic"]), ANGLES, SPEEDS, SPEEDS, VOLTS)
def test_accelerations_solve_both_rows(law, q1, v1, v2, u):
    p, body = rig_vector(RIGS[law]), body_of(RIGS[law])
    s1, s2 = (1 if v1 > 0 else -1), (1 if v2 > 0 else -1)
    a1, a2 = accelerations(q1, v1, v2, 0.0, s1, s2, motor_branch(u, v2, p), u, p)
    row1, row2 = body.loads([q1, v1, 0.0, v2, 0.0], u, s1, s2)
    assert body.a11 * a1 + body.a12 * a2 == pytest.approx(row1, rel=1e-10, abs=1e-14)
    assert body.a12 * a1 + body.a22 * a2 == pytest.approx(row2, rel=1e-10, abs=1e-14)


@first_call_compiles
@given(ANGLES, SPEEDS, SPEEDS, VOLTS, st.sampled_from([(1, 0), (-1, 0), (0, 1), (0, -1), (0, 0)]))
def test_what_rests_is_held_by_the_torque_of_its_row(q1, v1, v2, u, sides):
    p, body = rig_vector(RIGS["coulomb"]), body_of(RIGS["coulomb"])
    s1, s2 = sides
    v1, v2 = v1 * (s1 != 0), v2 * (s2 != 0)
    branch = motor_branch(u, v2, p)
    a1, a2 = accelerations(q1, v1, v2, 0.0, s1, s2, branch, u, p)
    hold1, hold2 = holding_torques(q1, v2, a1, a2, s2, branch, u, p)
    wanted, forces = body.accelerations([q1, v1, 0.0, v2, 0.0], u, s1, s2, (s1 == 0, s2 == 0))
    assert [a1, a2] == pytest.approx(wanted, rel=1e-10, abs=1e-12)
    if s1 == 0:
        assert a1 == 0.0
        assert hold1 == pytest.approx(forces[0], rel=1e-10, abs=1e-14)
    if s2 == 0:
        assert a2 == 0.0
        assert hold2 == pytest.approx(forces[1], rel=1e-10, abs=1e-14)


def compensated():
    """The paper's rig as (10) sees it: Coulomb friction and dead zone of the motor compensated away."""
    return paper_rig("viscous", **{"drive.motor.coulomb": 0.0, "drive.motor.dead_zone": [0.0, 0.0]})


@first_call_compiles
@given(ANGLES, SPEEDS, st.floats(-300.0, 300.0), VOLTS)
def test_printed_state_space_is_the_mass_matrix_form(q1, v1, v2, u2):
    p = rig_vector(compensated())
    a1, a2 = accelerations(q1, v1, v2, 0.0, 1, 1, 1, u2, p)
    printed = state_space(np.array([q1, v1, 0.3, v2]), u2, alphas(p))
    scale = 1e-12 * (1.0 + abs(a1) + abs(a2))
    assert printed == pytest.approx([v1, a1, v2, a2], rel=1e-11, abs=scale)


def jacobian(p):
    """Numerical Jacobian (4, 4) of (q1, q1', q2, q2') and input columns (4, 2) for u2 and phi = sin y, at rest."""

    def slope(x, u):
        a1, a2 = accelerations(x[0], x[1], x[3], 0.0, 1, 1, 1, u, p)
        return np.array([x[1], a1, x[3], a2])

    rest, step = np.zeros(4), 1e-4
    a = np.column_stack([(slope(step * e, 0.0) - slope(-step * e, 0.0)) / (2 * step) for e in np.eye(4)])
    by_u = (slope(rest, step) - slope(rest, -step)) / (2 * step)
    # y enters only by sin y: the column of q1 is the input column of phi, and phi is then no feedback.
    by_phi, a[:, 0] = a[:, 0].copy(), 0.0
    return a, np.column_stack([by_u, by_phi])


def test_polynomials_of_13_are_the_linearisation():
    p = rig_vector(compensated())
    r, a, h = polynomials(alphas(p))
    system, inputs = jacobian(p)
    for s in (1.0 + 2.0j, -3.0 + 0.5j, 20.0j):
        response = np.linalg.solve(s * np.eye(4) - system, inputs)[0]
        assert np.polyval(r, s) / np.polyval(a, s) == pytest.approx(response[0], rel=1e-6)
        assert np.polyval(h, s) / np.polyval(a, s) == pytest.approx(response[1], rel=1e-6)


def test_the_wheels_speed_is_not_held():
    # alpha4 alpha9 = alpha5 alpha7: r(p) = -alpha4 p shares the root 0 with a(p), and r_m < 0.
    alpha = alphas(rig_vector(compensated()))
    r, a, h = polynomials(alpha)
    assert r[0] == -alpha[4] < 0.0
    assert abs(r[1]) < 1e-15 * alpha[4] * alpha[9]
    assert a[-1] == 0.0
    assert (len(a), a[0], h[0]) == (4, 1.0, -alpha[2])
    assert (alpha[1:] > 0.0).all()


def test_no_printed_form_without_a_wheel():
    with pytest.raises(UnanswerableError, match="wheel"):
        alphas(rig_vector(DIRECT["viscous"]))
    p = rig_vector(compensated())
    p[VISCOUS_N] *= 2
    with pytest.raises(UnanswerableError, match="viscous"):
        alphas(p)
