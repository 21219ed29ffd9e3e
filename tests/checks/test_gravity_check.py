"""The stated gravity torque against the one that the balance shows: what is wrong is named, what is right is not."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from long_cases import quick_first
from swingid.control.references import Multisine, Sine
from swingid.errors import UnanswerableError
from swingid.identification import identify
from twin_logs import INERTIA, given, logged, twin

TONES = Multisine((Sine(0.5, 5.0), Sine(0.3, 8.5)))
RIG = given(twin("viscous"))
STATED = 78e-3


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return logged(twin("viscous"), tmp_path_factory.mktemp("log"), TONES, duration=20.0)


def warning(result) -> str | None:
    found = [one.message for one in result.warnings if one.code == "gravity-torque-disagrees"]
    return found[0] if found else None


def test_right_constants_give_no_warning(log):
    result = identify(log, RIG)
    assert result.status == "ok"


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_a_wheel_that_is_stated_wrong_is_named(log, factor):
    """All that the balance shows is in proportion to a12 = J2 + N Jr, so b too: the ratio J1/b stays."""
    wheel, rotor, gear = 11.34e-5, 0.21e-5, 4.4
    stated = RIG.changed({"drive.wheel.inertia": wheel * factor})
    scale = (wheel * factor + gear * rotor) / (wheel + gear * rotor)
    text = warning(identify(log, stated))
    assert text is not None
    seen, by_drive, by_gravity = (
        float(re.search(pattern, text)[1]) for pattern in (r"of \(([\d.]+) ", r"is ([\d.e-]+) kg", r", ([\d.e-]+) kg")
    )
    seen *= 1e-3 if seen > 1 else 1.0
    assert seen == pytest.approx(STATED * scale, rel=1e-3)
    carried = wheel * factor + rotor
    whole = INERTIA + wheel + rotor
    assert by_drive == pytest.approx(whole * scale - carried, rel=1e-3)
    assert by_gravity == pytest.approx(whole - carried, rel=1e-3)


def test_a_clock_that_is_off_shows_as_gravity(log):
    """Time stretched by 1 % makes b 2 % smaller against the accelerations."""
    text = warning(identify(replace(log, time=1.01 * log.time), RIG))
    assert text is not None
    assert float(re.search(r", ([-+][\d.]+) % from", text)[1]) == pytest.approx(-1.97, abs=0.1)


def test_a_doubt_that_is_stated_is_no_contradiction(log):
    stated = RIG.changed({"drive.wheel.inertia": {"value": 11.34e-5 * 1.03, "std": 0.03 * 11.34e-5}})
    assert warning(identify(log, stated)) is None


def test_one_tone_that_tells_no_gravity_gives_no_warning(tmp_path):
    rig = twin("viscous")
    result = identify(logged(rig, tmp_path), RIG.changed({"drive.wheel.inertia": 11.34e-5 * 1.001}))
    assert warning(result) is None


@pytest.mark.parametrize("stiffness", [0.02, 0.1, 1.0])
def test_a_spring_that_is_not_there_is_never_ok(tmp_path, stiffness):
    """At one frequency it acts as gravity does; where it is more than that, gravity would have to be negative.

    Of a spring of a hundred times gravity nothing is seen: the drive is too small against it.
    """
    one_tone = logged(twin("viscous"), tmp_path)
    stated = RIG.changed({"axis.stiffness": {"value": stiffness, "std": 0.01 * stiffness}})
    try:
        result = identify(one_tone, stated)
    except UnanswerableError as error:
        assert error.code == "contradiction"
    else:
        assert result.status == "warning"
        low, high = result.inertia.interval95
        assert low < INERTIA < high


@pytest.mark.parametrize(
    ("method", "options"),
    quick_first(1, [("energy", {}), ("equation-error", {}), ("output-error", {"input": "wheel"})]),
)
def test_every_method_names_a_wheel_that_is_stated_wrong(log, method, options):
    result = identify(log, RIG.changed({"drive.wheel.inertia": 11.34e-5 * 0.97}), method, **options)
    assert result.status == "warning"
    assert warning(result) is not None
    assert warning(identify(log, RIG, method, **options)) is None


def test_a_conflict_widens_the_interval_of_equation_error(log):
    stated = RIG.changed({"drive.wheel.inertia": 11.34e-5 * 0.97})
    wrong = identify(log, stated, "equation-error").inertia
    assert wrong.interval95[0] < INERTIA < wrong.interval95[1]
    assert identify(log, RIG, "equation-error").inertia.standard_uncertainty < 0.01 * wrong.standard_uncertainty
