"""A gravity torque from mass, lever and free fall."""

from __future__ import annotations

import math

import pytest

from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.model.rig.gravity import normal_gravity

NONE = '[drive]\nkind = "none"\n[axis]\n'


def weighed(text: str) -> Rig:
    return Rig.from_text(NONE + text)


@pytest.mark.parametrize("lever", ["lever", "centre_of_mass"])
def test_the_gravity_torque_is_the_product_with_its_uncertainty(lever):
    b = weighed(f'mass = "107 ± 1 g"\n{lever} = "23 ± 0.1 cm"\ng = "9.81 m/s^2"').axis.gravity_torque
    assert b.value == pytest.approx(0.107 * 0.23 * 9.81)
    assert b.std == pytest.approx(b.value * math.hypot(1 / 107, 0.1 / 23))
    assert dict(b.parts) == pytest.approx({"axis.mass": b.value / 107, f"axis.{lever}": b.value * 0.1 / 23})


def test_free_fall_is_taken_for_anywhere_unless_the_place_is_stated():
    anywhere, there = weighed("mass = 1\nlever = 1"), weighed('mass = 1\nlever = 1\nlatitude = "45 deg"')
    assert anywhere.axis.gravity_torque.value == pytest.approx(9.80665)
    assert anywhere.axis.gravity_torque.std == pytest.approx(0.015)
    assert there.axis.gravity_torque.value == pytest.approx(9.806199, abs=1e-6)  # Moritz (2000)
    assert weighed("mass = 1\nlever = 1\ng = 9.81").axis.gravity_torque.std is None


def test_normal_gravity_at_equator_and_pole():
    assert normal_gravity(0.0) == pytest.approx(9.7803267715)
    assert normal_gravity(math.pi / 2) == pytest.approx(9.8321863685)  # Moritz (2000)


@pytest.mark.parametrize(
    ("text", "code", "key"),
    [
        ("mass = 1\nlever = 1\ngravity_torque = 1", "contradiction", "axis.gravity_torque"),
        ("mass = 1\nlever = 1\ncentre_of_mass = 1", "contradiction", "axis.lever"),
        ("mass = 1\nlever = 1\ng = 9.8\nlatitude = 0", "contradiction", "axis.g"),
        ("mass = 1", "missing-key", "axis.lever"),
        ("g = 9.8", "missing-key", "axis.mass"),
        ('mass = "1 m"\nlever = 1', "wrong-unit", "axis.mass"),
        ("mass = -1\nlever = 1", "out-of-range", "axis.mass"),
        ('mass = 1\nlever = 1\nlatitude = "100 deg"', "out-of-range", "axis.latitude"),
        ('mass = 1\nlever = 1\nlatitude = "north"', "not-a-quantity", "axis.latitude"),
        ('kind = "linear"\nmass = 1\nlever = 1', "contradiction", "axis.gravity_torque"),
    ],
)
def test_what_contradicts_or_is_missing_is_named(text, code, key):
    with pytest.raises(InputError) as raised:
        weighed(text)
    assert raised.value.code == code
    assert key in raised.value.message


def test_a_changed_gravity_torque_takes_the_place_of_mass_and_lever():
    rig = weighed('mass = "107 ± 1 g"\nlever = "23 cm"\nlatitude = "45 deg"\ninertia = 1')
    other = rig.changed({"axis.gravity_torque": 0.25})
    assert other.axis.gravity_torque.value == 0.25
    assert other.axis.mass is other.axis.lever is other.axis.latitude is None
    assert other.axis.inertia == rig.axis.inertia
    assert rig.changed({"axis.inertia": 2}).axis.gravity_torque == rig.axis.gravity_torque
    with pytest.raises(InputError):
        rig.changed({"axis.gravity_torque": 0.25, "axis.mass": 1})
