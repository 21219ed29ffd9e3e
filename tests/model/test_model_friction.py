"""Friction laws, motor and parameter vector against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swingid.errors import InputError
from swingid.model import parameters as places
from swingid.model.friction import bristle_rate, dry_level, release_margin, sliding_friction, static_curve
from swingid.model.motor import branch_margin, branch_torque, motor_branch, motor_friction, motor_torque
from swingid.model.parameters import constants, rig_vector, vector
from twin_cases import first_call_compiles, free_rig, paper_rig

SPEEDS = st.floats(-50.0, 50.0).filter(lambda v: abs(v) > 1e-6)


def axis(**friction):
    return vector({"axis.inertia": 3e-3, **{f"axis.friction.{k}": v for k, v in friction.items()}}, "none")


@first_call_compiles
@given(SPEEDS)
def test_each_term_of_the_static_curve(v):
    s = math.copysign(1.0, v)
    assert static_curve(v, axis(viscous=2e-3)) == pytest.approx(2e-3 * v)
    assert static_curve(v, axis(coulomb=3e-3)) == s * 3e-3
    assert static_curve(v, axis(quadratic=4e-4)) == pytest.approx(4e-4 * v * abs(v))
    assert static_curve(v, axis(cubic=5e-5)) == pytest.approx(5e-5 * v**3)
    assert static_curve(v, axis(offset=1e-3)) == 1e-3
    stribeck = 3e-3 + 2e-3 * math.exp(-((v / 0.5) ** 2))
    assert static_curve(v, axis(coulomb=3e-3, static=5e-3, stribeck_speed=0.5)) == pytest.approx(s * stribeck)
    two_sided = axis(viscous=1e-3, viscous_positive=2e-3, coulomb=1e-3, coulomb_negative=4e-3)
    assert static_curve(v, two_sided) == pytest.approx(2e-3 * v + 1e-3 if v > 0 else 1e-3 * v - 4e-3)


@first_call_compiles
@given(SPEEDS)
def test_friction_without_direction_is_odd(v):
    p = axis(viscous=1e-3, coulomb=2e-3, static=3e-3, stribeck_speed=0.1, quadratic=1e-4, cubic=1e-5)
    assert static_curve(-v, p) == pytest.approx(-static_curve(v, p), rel=1e-15)


def test_static_friction_without_a_stribeck_speed_falls_at_once():
    p = axis(coulomb=2e-3, static=3e-3)
    assert dry_level(0.0, 1, p) == 2e-3
    assert release_margin(2.5e-3, 0.0, p) > 0.0
    assert release_margin(3.1e-3, 0.0, p) < 0.0


def test_release_knows_directions_and_offset():
    p = axis(coulomb_positive=2e-3, coulomb_negative=5e-3, offset=1e-3)
    assert release_margin(3e-3, 0.0, p) == pytest.approx(0.0, abs=1e-18)
    assert release_margin(-4e-3, 0.0, p) == pytest.approx(0.0, abs=1e-18)
    assert release_margin(0.0, 0.0, p) > 0.0


@first_call_compiles
@given(SPEEDS)
def test_settled_bristles_give_the_static_curve(v):
    laws = {"coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.5, "viscous": 1e-3}
    p = axis(**laws, **{"lugre.bristle_stiffness": 30.0, "lugre.bristle_damping": 0.01})
    s = 1 if v > 0 else -1
    settled = s * dry_level(v, s, p) / 30.0
    assert bristle_rate(v, s, settled, p) == pytest.approx(0.0, abs=1e-12 * abs(v))
    assert sliding_friction(v, s, settled, p) == pytest.approx(static_curve(v, axis(**laws)), rel=1e-9)


def test_lugre_without_a_level_is_refused():
    with pytest.raises(InputError, match=r"axis\.friction\.coulomb") as caught:
        axis(**{"lugre.bristle_stiffness": 30.0})
    assert caught.value.code == "lugre-without-coulomb"


@first_call_compiles
@given(st.floats(-12.0, 12.0), st.floats(-400.0, 400.0))
def test_dead_zone_is_that_of_8_with_its_third_branch_corrected(u, v2):
    p = rig_vector(paper_rig())
    ideal = 0.9 * (52.04e-4 * u - 3.697e-6 * v2)
    expected = max(ideal - 5.485e-4, 0.0) + min(ideal + 2.996e-4, 0.0)
    assert motor_torque(u, v2, p) == pytest.approx(expected, rel=1e-12, abs=1e-18)


@first_call_compiles
@given(st.floats(-1.0, 1.0), st.floats(-400.0, 400.0))
def test_a_branch_holds_where_its_margin_is_not_negative(u, v2):
    p = rig_vector(paper_rig())
    branch = motor_branch(u, v2, p)
    assert branch_margin(u, v2, branch, p) >= 0.0
    for other in {-1, 0, 1} - {branch}:
        assert branch_margin(u, v2, other, p) <= 0.0


def test_torque_does_not_jump_at_the_edges_of_the_dead_zone():
    p = rig_vector(paper_rig())
    for edge, branch in ((5.485e-4, 1), (-2.996e-4, -1)):
        u = edge / (0.9 * 52.04e-4)
        assert branch_torque(u, 0.0, branch, p) == pytest.approx(0.0, abs=1e-18)


def test_motor_friction_is_on_the_rotor():
    p = rig_vector(paper_rig())
    assert motor_friction(10.0, 1, p) == pytest.approx(3.687e-5 * 4.4 * 10.0 + 302.02e-5)


def test_every_place_of_the_vector_is_named_once():
    names = {name: value for name, value in vars(places).items() if name.isupper() and type(value) is int}
    inside = [names.pop(name) for name in ("COEFFICIENT", "SHIFT", "ORDER", "KIND", "POWER", "ODD")]
    slot, most, first, size = (names.pop(name) for name in ("SLOT", "MOST_FURTHER", "FIRST_SLOT", "SIZE"))
    assert sorted(names.values()) == list(range(first))
    assert sorted(inside) == list(range(slot))
    assert size == first + slot * most


def test_the_vector_of_the_paper():
    p = rig_vector(paper_rig())
    assert p[places.A11] == pytest.approx(302.2e-5 + 11.34e-5 + 0.21e-5)
    assert p[places.A12] == pytest.approx(11.34e-5 + 4.4 * 0.21e-5)
    assert p[places.A22] == pytest.approx(11.34e-5 + 4.4**2 * 0.21e-5)
    assert (p[places.B], p[places.D1], p[places.D2]) == (78e-3, 5.485e-4, -2.996e-4)
    assert p[places.VISCOUS_P] == p[places.VISCOUS_N] == 1.144e-3


def test_motion_needs_inertia_and_gravity():
    with pytest.raises(InputError, match=r"axis\.inertia"):
        constants(paper_rig(**{"axis.inertia": None}))
    with pytest.raises(InputError, match=r"axis\.gravity_torque"):
        constants(paper_rig(**{"axis.gravity_torque": "unknown"}))


def test_an_impossible_mass_matrix_is_refused():
    values = {"axis.inertia": -1e-5, "drive.wheel.inertia": 1e-4, "drive.motor.rotor_inertia": 1e-5}
    with pytest.raises(InputError, match="a12"):
        vector(values)


def test_a_rig_without_a_wheel_has_no_reaction():
    p = rig_vector(free_rig())
    assert p[places.A12] == 0.0
    assert p[places.A11] == 302.2e-5
    assert np.isinf(p[places.WHEEL_STATIC])
