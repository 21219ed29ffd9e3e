"""What momentum refuses and what it doubts: each log wrong in one known way, and the sentence that says so."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from closed_form_logs import (
    INERTIA,
    ONE_TONE,
    TWO_TONES,
    Sines,
    direct_log,
    direct_rig,
    encoded,
    exact_rig,
    free_log,
    free_rig,
    wheel_log,
)
from long_cases import quick_if
from refusals import coded
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.preparation.motion import find_motion
from swingid.preparation.segment import part_of
from swingid.preparation.zero import centre_of
from swingid.recording.recording import Finding, Recording
from swingid.simulation import simulate

TIME = np.arange(15_001) / 1000
PAPER = Rig.builtin("paper")


def friction(v):
    return 1.144e-3 * v


def wheel(motion=ONE_TONE):
    return encoded(wheel_log(exact_rig(), motion, friction, TIME))


def codes(messages):
    return [message.code for message in messages]


# what the motion cannot tell


def one_tone(amplitude, noise):
    log = wheel(Sines((amplitude, 8.5, 0.0)))
    rng = np.random.default_rng(1)
    return replace(
        log,
        angle=log.angle + noise * rng.standard_normal(len(TIME)),
        wheel_angle=log.wheel_angle + noise * rng.standard_normal(len(TIME)),
    )


@pytest.mark.parametrize("amplitude", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_one_tone_does_not_tell_inertia_from_gravity(amplitude, noise):
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")) as caught:
        identify(one_tone(amplitude, noise), PAPER.changed({"axis.gravity_torque": "unknown"}))
    assert caught.value.exit_code == 4


@pytest.mark.parametrize("amplitude", quick_if(lambda amplitude: amplitude in (0.4, 1.0), [0.4, 0.6, 0.8, 1.0]))
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3, 1e-2])
def test_one_large_tone_is_refused_doubted_or_rightly_uncertain(amplitude, noise):
    # A large swing has a third harmonic in sin q1, so that perfect encoders can tell the two.
    try:
        result = identify(one_tone(amplitude, noise), PAPER.changed({"axis.gravity_torque": "unknown"}))
    except UnanswerableError as refused:
        assert "add a second frequency" in refused.message
    else:
        assert abs(result.inertia.value - INERTIA) < 3 * result.inertia.standard_uncertainty
        doubtful = result.inertia.standard_uncertainty > 0.02 * INERTIA
        assert codes(result.warnings) == (["gravity-and-inertia"] if doubtful else [])


def test_one_tone_with_a_torque_does_not_either():
    rig = direct_rig(**{"axis.gravity_torque": "unknown"})
    for amplitude in (0.05, 0.1, 0.2):
        with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
            identify(direct_log(Sines((amplitude, 8.5, 0.0)), friction, TIME), rig)
    # ONE_TONE is large, so that sin q has a third harmonic, by which a perfect log determines both
    large = identify(direct_log(ONE_TONE, friction, TIME), rig)
    assert large.inertia.value == pytest.approx(INERTIA, rel=1e-6)
    assert large.inertia.standard_uncertainty < 1e-4 * INERTIA


def test_a_weak_second_tone_is_doubted():
    log = wheel(Sines((0.1, 8.5, 0.0), (0.01, 5.0, 0.0)))
    rng = np.random.default_rng(1)
    noisy = replace(log, angle=log.angle + 0.01 * rng.standard_normal(len(TIME)))
    try:
        result = identify(noisy, PAPER.changed({"axis.gravity_torque": "unknown"}))
    except UnanswerableError as refused:
        assert "add a second frequency" in refused.message
    else:
        assert codes(result.warnings) == ["gravity-and-inertia"]
        assert abs(result.inertia.value - INERTIA) < 3 * result.inertia.standard_uncertainty


def test_a_free_decay_needs_gravity():
    log = free_log(friction, TIME)
    with pytest.raises(UnanswerableError, check=coded("no-scale", "axis.gravity_torque")) as caught:
        identify(log, free_rig(**{"axis.gravity_torque": 0}))
    assert caught.value.exit_code == 4


def test_no_motion_and_no_turning_points():
    still = replace(wheel(), angle=np.full(len(TIME), 0.2))
    with pytest.raises(UnanswerableError) as caught:
        identify(still, PAPER)
    assert caught.value.code == "no-motion"
    turning = replace(wheel(), angle=0.3 * TIME)
    with pytest.raises(UnanswerableError) as caught:
        identify(turning, PAPER)
    assert caught.value.code == "no-turning-points"


@pytest.mark.parametrize("duration", [0.5, 1.2, 1.7, 2.2])
def test_a_short_log_is_refused_or_uncertain(duration):
    short = wheel().segment(0.0, duration)
    try:
        result = identify(short, PAPER)
    except UnanswerableError as refused:
        assert refused.code in ("no-turning-points", "too-short", "not-identifiable")
    else:
        assert abs(result.inertia.value - INERTIA) < 3 * result.inertia.standard_uncertainty


@pytest.mark.parametrize("rows", [1, 3, 5, 20, 60])
def test_few_rows_do_not_crash(rows):
    with pytest.raises(UnanswerableError):
        identify(wheel().segment(0.0, (rows - 0.5) / 1000), PAPER)


# what the log says wrongly


@pytest.mark.parametrize("motion", [ONE_TONE, TWO_TONES, Sines((0.8, 6.0, 0.0)), Sines((0.8, 4.0, 0.0))])
@pytest.mark.parametrize("gravity", [78e-3, "unknown"])
def test_a_wheel_that_turns_the_wrong_way_is_named(motion, gravity):
    turned = replace(wheel(motion), wheel_angle=-wheel(motion).wheel_angle)
    with pytest.raises(InputError, match=r"wheel_angle_sign = -1 under \[log\]") as caught:
        identify(turned, PAPER.changed({"axis.gravity_torque": gravity}))
    assert caught.value.code == "wrong-sign"
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("motion", [ONE_TONE, TWO_TONES, Sines((0.8, 6.0, 0.0))])
@pytest.mark.parametrize("gravity", [78e-3, "unknown"])
def test_wrong_signs_and_zeros_are_told_apart(motion, gravity):
    log, rig = wheel(motion), PAPER.changed({"axis.gravity_torque": gravity})
    wrong = {
        "angle_sign = -1": replace(log, angle=-log.angle),
        'angle_zero = "up"': replace(log, angle=log.angle + np.pi),
        'gravity pulls the wrong way.*wheel_angle_sign = -1.*angle_zero = "up"': replace(log, angle=np.pi - log.angle),
    }
    for told, turned in wrong.items():
        with pytest.raises(InputError, match=told) as caught:
            identify(turned, rig)
        assert caught.value.code == "wrong-sign"
        assert ("gravity" in caught.value.message) == ("angle_zero" in told)


@pytest.mark.parametrize("gravity", [78e-3, "unknown"])
def test_a_wrong_zero_shows_with_a_torque_too(gravity):
    log = direct_log(TWO_TONES, friction, TIME)
    with pytest.raises(InputError, match='angle_zero = "up"'):
        identify(replace(log, angle=log.angle + np.pi), direct_rig(**{"axis.gravity_torque": gravity}))


def test_a_torque_of_the_wrong_sign_is_named():
    log = direct_log(TWO_TONES, friction, TIME)
    with pytest.raises(InputError, match=r"torque_sign = -1 under \[log\]"):
        identify(replace(log, torque=-log.torque), direct_rig())


def test_a_decay_about_the_wrong_zero_is_refused():
    with pytest.raises(UnanswerableError, match="angle_zero") as caught:
        identify(replace(hung_at(np.pi), repairs_off=frozenset(["zero"])), free_rig())
    assert caught.value.code == "negative-inertia"


def test_a_rig_of_another_drive_kind():
    with pytest.raises(InputError, check=coded("missing-torque")):
        identify(wheel(), direct_rig())
    with pytest.raises(InputError, check=coded("missing-wheel-angle")):
        identify(direct_log(ONE_TONE, friction, TIME), PAPER)


@pytest.mark.parametrize("method", ["momentum", "energy", "equation-error", "output-error"])
@pytest.mark.parametrize("value", [0.0, 0.02])
def test_a_drive_that_was_not_logged(method, value):
    log = direct_log(TWO_TONES, friction, TIME)
    with pytest.raises(InputError, match=rf"torque is {value:g} in all rows.*kind = \"none\"") as caught:
        identify(replace(log, torque=np.full(len(log), value)), direct_rig(), method)
    assert caught.value.code == "constant-drive"


def test_a_wheel_that_was_not_logged():
    log = wheel()
    with pytest.raises(InputError) as caught:
        identify(replace(log, wheel_angle=np.zeros(len(log))), PAPER)
    assert caught.value.code == "constant-drive"


def test_several_logs_of_which_one_lacks_its_drive():
    log = direct_log(TWO_TONES, friction, TIME)
    dead = replace(log, torque=np.zeros(len(log)))
    both = identify({"whole": log, "dead": dead}, direct_rig())
    assert "log-refused" in codes(both.warnings)
    assert both.per_log[1].error.code == "constant-drive"
    with pytest.raises(InputError) as caught:
        identify({"one": dead, "two": replace(dead, angle=1.001 * dead.angle)}, direct_rig())
    assert caught.value.code == "constant-drive"


@pytest.mark.parametrize("method", ["momentum", "equation-error", "output-error"])
def test_a_free_decay_on_a_drive_that_rests_is_answered(method):
    log = free_log(lambda v: 2e-4 * v, TIME)
    result = identify(replace(log, torque=np.zeros(len(log))), direct_rig(), method)
    assert result.inertia.value == pytest.approx(INERTIA, rel=2e-3)


def test_unknown_methods_and_options():
    with pytest.raises(UsageError, match="momentum"):
        identify(wheel(), PAPER, method="magic")
    with pytest.raises((UsageError, TypeError)):
        identify(wheel(), PAPER, colour="green")


# where the angle's zero lies


def hung_at(offset):
    log = free_log(lambda v: 2e-4 * v, TIME)
    return replace(log, angle=log.angle + offset)


@pytest.mark.parametrize("offset", quick_if(lambda offset: offset in (0.2, np.pi), [0.2, -0.1, 1.5, np.pi]))
@pytest.mark.parametrize("method", ["momentum", "energy"])
def test_a_free_decay_is_counted_from_where_its_body_hangs(offset, method):
    right = identify(hung_at(0.0), free_rig(), method)
    assert right.inertia.value == pytest.approx(INERTIA, rel=1e-3)
    assert "zero-corrected" not in codes(right.notes)
    found = identify(hung_at(offset), free_rig(), method)
    assert found.warnings == right.warnings == ()
    assert found.inertia.value == pytest.approx(right.inertia.value, rel=2e-5)
    message = next(note.message for note in found.notes if note.code == "zero-corrected")
    assert np.cos(float(re.search(r"angle_zero = (\S+)", message)[1]) - offset) > 1 - 1e-5
    (kept,) = [one for one in found.provenance["preparation"]["corrections"] if one["kind"] == "zero"]
    assert np.cos(kept["value"] - offset) > 1 - 1e-5
    assert kept["origin"] == "found"


@pytest.mark.parametrize("offset", [0.2, -0.1])
def test_a_zero_that_is_off_is_told_with_what_it_costs(offset):
    # With the correction switched off nothing else in equation (I) shows it.
    log = replace(hung_at(offset), repairs_off=frozenset(["zero"]))
    left = identify(log, free_rig())
    (warning,) = left.warnings
    assert warning.code == "zero-off"
    assert f"subtract {offset:g} rad from the angle" in warning.message
    told = float(re.search(r"changes the inertia by ([+-][\d.]+) %", warning.message)[1])
    assert told == pytest.approx(100 * (INERTIA - left.inertia.value) / left.inertia.value, abs=0.06)
    assert codes(identify(log, free_rig(), method="energy").warnings) == ["zero-off"]
    (kept,) = [one for one in left.provenance["preparation"]["corrections"] if one["kind"] == "zero"]
    assert kept["origin"] == "switched off"


@pytest.mark.parametrize("friction", [lambda v: 2e-4 * v, lambda v: 3e-4 * np.sign(v), lambda v: 2e-3 * v])
def test_the_centre_of_a_decay_is_where_it_hangs_whatever_the_friction(friction):
    log = free_log(friction, TIME)
    motion = find_motion(log.time, log.angle + 0.05, 1e-6)
    start, stop, _ = part_of(log, motion, None)
    centre, scatter = centre_of(motion.within(start, stop).turning_angles)
    assert centre == pytest.approx(0.05, abs=2e-4)
    assert scatter < 1e-3


@pytest.mark.parametrize(("motion", "alike"), [(ONE_TONE, False), (TWO_TONES, False), (Sines((0.3, 8.5, 0.0)), True)])
def test_a_driven_axis_tells_its_zero_too(motion, alike):
    log = wheel(motion)
    assert "zero-off" not in codes(identify(log, PAPER).warnings)
    off = identify(replace(log, angle=log.angle + 0.2), PAPER)
    message = next(w.message for w in off.warnings if w.code == "zero-off")
    told = float(re.search(r"\((-?0\.\d+) ± ", message)[1])
    assert told == pytest.approx(0.2, abs=3e-3)
    assert ("unless it is friction that depends on the direction" in message) == alike


def test_a_latency_longer_than_the_log_is_a_typing_error():
    rig = direct_rig(**{"sensors.latency": "4 s"})
    with pytest.raises(InputError, check=coded("long-latency", "sensors.latency", "4 s", "15 s")):
        identify(direct_log(ONE_TONE, friction, TIME), rig)


@pytest.mark.parametrize("step", [200, 125])
def test_energy_refuses_few_rows_per_swing(step):
    log = free_log(lambda v: 2e-4 * v, TIME)
    coarse = replace(log, time=log.time[::step], angle=log.angle[::step])
    with pytest.raises(UnanswerableError):
        identify(coarse, free_rig(), method="energy")


# near resonance


@pytest.mark.parametrize(("omega", "leans"), [(3.0, True), (4.6, True), (4.99, True), (8.5, False), (12.0, False)])
def test_that_a_motion_near_or_below_resonance_leans_on_gravity_is_a_note(omega, leans):
    # sqrt(b / a11) is 4.99 rad/s.
    result = identify(wheel(Sines((0.8, omega, 0.0))), PAPER)
    assert result.status == "ok"
    assert ["drive at 8" in note.message for note in result.notes if note.code == "near-resonance"] == [True] * leans


def test_the_note_of_resonance_states_the_right_leverage():
    log = wheel(Sines((0.8, 4.99, 0.0)))
    message = next(note.message for note in identify(log, PAPER).notes if note.code == "near-resonance")
    more = identify(log, PAPER.changed({"axis.gravity_torque": 78e-3 * 1.001}))
    moved = 1000 * (more.inertia.value - identify(log, PAPER).inertia.value) / (INERTIA + 11.55e-5)
    assert f"(1 % of axis.gravity_torque changes it by {moved:.2g} %)" in message


# what the motor's balance says of the wheel


@pytest.fixture(scope="module")
def twin_log():
    return simulate(PAPER, Sine(0.8, 8.5), Compensator.paper(PAPER), duration=15.0, seed=3)


def test_a_relative_wheel_angle_is_noted(twin_log):
    result = identify(twin_log, PAPER)
    assert result.status == "ok"
    assert "wheel-angle-reading" in codes(result.notes)


def test_an_absolute_wheel_angle_taken_for_relative_is_doubted(twin_log):
    absolute = replace(twin_log, wheel_angle=twin_log.wheel_angle + twin_log.angle)
    result = identify(absolute, PAPER)
    assert codes(result.warnings) == ["wheel-angle-reading"]
    assert 'wheel_angle_is = "absolute"' in result.warnings[0].message
    assert result.inertia.value == pytest.approx(INERTIA - PAPER.drive.a12, rel=1e-3)  # THEORY 5


def test_a_relative_wheel_angle_taken_for_absolute_is_doubted(twin_log):
    # What loading would have made of it: q2 − q1.
    result = identify(
        replace(twin_log, wheel_angle=twin_log.wheel_angle - twin_log.angle),
        PAPER.changed({"log.wheel_angle_is": "absolute"}),
    )
    assert codes(result.warnings) == ["wheel-angle-reading"]
    assert 'wheel_angle_is = "relative"' in result.warnings[0].message


def test_without_a_motor_the_reading_is_an_assumption(twin_log):
    result = identify(replace(twin_log, voltage=None), PAPER)
    assert result.status == "ok"
    assert "not checked" in next(n.message for n in result.notes if n.code == "wheel-angle-reading")


def test_a_turned_voltage_is_named_and_not_used(twin_log):
    result = identify(replace(twin_log, voltage=-twin_log.voltage), PAPER)
    assert codes(result.warnings) == ["voltage-sign"]
    assert result.inertia == identify(twin_log, PAPER).inertia


@pytest.mark.parametrize(
    "off",
    [
        {"torque_per_volt": 52.04e-4 * 1.05},
        {"torque_per_volt": 52.04e-4 * 0.95},
        {"torque_per_volt": 52.04e-4 * 1.1, "coulomb": 1.3 * 302.02e-5},
        {"coulomb": 0.7 * 302.02e-5},
        {"viscous": 4.5e-5},
    ],
)
def test_motor_constants_that_are_off_are_not_taken_for_another_reading(twin_log, off):
    # With 5 % more torque per volt the constants as given fit the absolute reading better than the true one.
    rig = PAPER.changed({f"drive.motor.{key}": value for key, value in off.items()})
    right = identify(twin_log, rig)
    assert "wheel-angle-reading" not in codes(right.warnings)
    absolute = identify(replace(twin_log, wheel_angle=twin_log.wheel_angle + twin_log.angle), rig)
    message = next(m.message for m in absolute.warnings if m.code == "wheel-angle-reading")
    assert message.startswith("wheel_angle seems to be absolute, not relative")
    assert "drive.motor" in message


def test_where_nothing_tells_the_readings_from_a_bad_motor_both_are_named(twin_log):
    # A dead zone that is left out shows in every window, alike under both readings.
    rig = PAPER.changed({"drive.motor.torque_per_volt": 52.04e-4 * 1.05, "drive.motor.dead_zone": [0, 0]})
    (warning,) = identify(twin_log, rig).warnings
    assert warning.code == "wheel-angle-reading"
    assert (
        "either wheel_angle is absolute, not relative, or the motor constants are some per cent off" in warning.message
    )


@pytest.mark.parametrize(("omega", "counts"), [(6.0, 16384), (6.0, 1024), (6.2, 16384), (6.2, 1024)])
def test_a_wheel_that_rests_near_resonance_is_no_bad_motor(omega, counts):
    # The paper's run with the test body: at 6 rad/s the wheel rests half of the time, where its friction is any torque.
    body = Rig.builtin("paper-body").changed({"sensors.counts_per_turn": counts})
    log = simulate(body, Sine(0.8, omega), duration=15.0, seed=3)
    result = identify(log, body)
    assert result.status == "ok"
    (note,) = [one for one in result.notes if one.code == "near-resonance"]
    assert "drive at 10 rad/s or more" in note.message
    assert result.details.extra["motor_balance_residual"] < 0.1
    reading = next(note.message for note in result.notes if note.code == "wheel-angle-reading")
    assert ("the wheel rests" in reading) == (omega == 6.0)


def test_a_voltage_measured_at_the_stamps_meets_a_late_angle():
    rig = PAPER.changed({"sensors.latency": "4 ms"})
    late = simulate(rig, Sine(0.8, 8.5), duration=15.0, seed=3)
    residual = {
        told: identify(late, PAPER.changed({"sensors.latency": told})).details.extra["motor_balance_residual"]
        for told in ("0 ms", "4 ms")
    }
    assert residual["4 ms"] < 0.002
    assert residual["0 ms"] > 10 * residual["4 ms"]


@pytest.mark.parametrize("factor", [0.8, 0.9, 0.95, 1.05, 1.1, 1.3])
def test_wrong_motor_constants_never_refuse_and_never_move_the_inertia(twin_log, factor):
    wrong = PAPER.changed({"drive.motor.torque_per_volt": 52.04e-4 * factor})
    assert identify(twin_log, wrong).inertia == identify(twin_log, PAPER).inertia


def test_findings_of_the_recording_reach_the_result(twin_log):

    told = (Finding("spikes", "3 spikes were dropped.", "warning"), Finding("dropouts", "2 rows are missing.", "note"))
    result = identify(replace(twin_log, findings=told), PAPER)
    assert result.status == "warning"
    assert "spikes" in codes(result.warnings)
    assert "dropouts" in codes(result.notes)


def test_what_is_no_log_or_no_rig_is_told():
    rig = Rig.builtin("paper")
    with pytest.raises(UsageError, check=coded("no-log", "'run.csv'")):
        identify("run.csv", rig)
    with pytest.raises(UsageError, check=coded("no-log", "None")):
        identify(None, rig)
    with pytest.raises(UsageError, check=coded("no-rig", "'paper'", "Rig")):
        identify([], "paper")


def test_a_refusal_names_the_file(tmp_path):
    rig, time = Rig.builtin("paper"), np.arange(3000) / 1000
    still = Recording(time, 1e-4 * np.sin(time), wheel_angle=2e-5 * time, voltage=0 * time)
    path = still.save(tmp_path / "still.csv", rig)
    with pytest.raises(UnanswerableError, check=coded("no-motion", "still.csv")):
        identify(Recording.load(path, rig), rig)
    with pytest.raises(UnanswerableError, check=coded("no-motion")):
        identify(still, rig)
