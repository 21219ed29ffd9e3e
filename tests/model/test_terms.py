"""The registry of terms: what its records say is what the equations of the model do."""

import numpy as np
import pytest

from swingid.balance.friction_laws import EXACT, places_of
from swingid.balance.friction_laws import TERMS as OF_SPEED
from swingid.model.energy import potential_energy
from swingid.model.friction import static_curve
from swingid.model.parameters import PLACES, SIZE, WHEEL_STATIC, B, vector
from swingid.model.shapes import STRINGS
from swingid.model.terms import MOTOR_KEYS, TERMS, Term, units_on, words_of
from swingid.report.words import RIG

WITH_A_KEY = [name for name, term in TERMS.items() if term.key]


@pytest.mark.parametrize("name", [name for name in OF_SPEED if TERMS[name].key])
def test_the_torque_of_the_twin_is_the_coefficient_times_the_regressor(name):
    term, speeds = TERMS[name], np.array([-3.0, -0.2, 0.4, 2.0])
    p = vector({"axis.inertia": 1.0, term.key: 0.7}, None)
    assert [static_curve(v, p) for v in speeds] == pytest.approx(0.7 * term.of_speed(speeds))
    parity = -1.0 if term.odd else 1.0
    np.testing.assert_array_equal(term.of_speed(-speeds), parity * term.of_speed(speeds))


@pytest.mark.parametrize("name", [name for name in PLACES if TERMS[name].key])
def test_a_term_moves_the_places_that_it_is_said_to_move(name):
    one = {"axis.inertia": 1.0, "axis.friction.viscous": 0.3, "axis.friction.coulomb": 0.2}
    if name.endswith(("_positive", "_negative")):
        other = name.replace("positive", "x").replace("negative", "positive").replace("x", "negative")
        one |= {TERMS[other].key: 0.1, TERMS[name].key: 0.1}
    before, after = vector(one, None), vector(one | {TERMS[name].key: one.get(TERMS[name].key, 0.0) + 0.5}, None)
    before[WHEEL_STATIC] = after[WHEEL_STATIC] = 0.0  # infinite without a wheel
    changed = after - before
    expected = np.zeros(SIZE)
    expected[list(PLACES[name])] = 0.5
    np.testing.assert_allclose(changed, expected, atol=1e-15)


def test_gravity_is_a_wave_of_the_angle_with_its_potential():
    p, q = np.zeros(SIZE), np.linspace(-3.0, 3.0, 13)
    p[B] = 0.4
    step = 1e-6
    slope = [(potential_energy(x + step, p) - potential_energy(x - step, p)) / (2 * step) for x in q]
    assert slope == pytest.approx(0.4 * TERMS["gravity_torque"].of_angle(q), abs=1e-9)


@pytest.mark.parametrize("name", TERMS)
def test_every_term_has_words_and_the_report_a_word_for_its_key(name):
    term = TERMS[name]
    assert words_of(name) == term.words
    assert units_on(linear=False)[name] == term.unit
    if term.key:
        assert RIG[term.key].unit_on(linear=True) == term.unit_on(linear=True)


@pytest.mark.parametrize("name", WITH_A_KEY)
def test_the_slopes_of_a_regressor_are_its_derivatives(name):
    term, q, step = TERMS[name], np.linspace(-1.4, 1.3, 9), 1e-6
    order = 0.7 if term.kind == STRINGS else 3.0  # strings of finite length end the motion
    between = (term.of_angle(q + step, order, 0.4) - term.of_angle(q - step, order, 0.4)) / (2 * step)
    np.testing.assert_allclose(term.angle_slope(q, order, 0.4), between, atol=1e-8)
    between = (term.of_angle(q, order, 0.4 + step) - term.of_angle(q, order, 0.4 - step)) / (2 * step)
    np.testing.assert_allclose(term.shift_slope(q, order, 0.4), between, atol=1e-8)


def test_a_term_without_a_column_is_no_peak():
    assert places_of(("coulomb", "stribeck")).tolist() == [EXACT.index("coulomb"), -1]
    with pytest.raises(ValueError, match="not in tuple"):
        places_of(("coulomb", "magic"))


def test_the_motor_is_in_the_registry():
    assert MOTOR_KEYS == (
        "rotor_inertia", "gear_ratio", "torque_per_volt", "back_emf", "viscous", "coulomb", "efficiency",
    )  # fmt: skip


def test_a_power_that_is_no_half_is_refused():
    with pytest.raises(ValueError, match=r"power is 1\.25; give 0, 1/2"):
        Term("x", "", "x", power=1.25, odd=True)
