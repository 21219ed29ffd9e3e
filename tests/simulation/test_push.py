"""Pushes by hand: the twin's, found and left out, and what is none; the motion after a push is used."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from long_cases import quick_first
from refusals import coded
from swingid.cli import main
from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.errors import UsageError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.preparation.motion import find_motion
from swingid.preparation.push import find_pushes, without_pushes
from swingid.preparation.segment import longest_run
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from swingid.simulation.twin import simulate_run
from twin_logs import INERTIA, given, twin

GRAVITY = 78e-3
TWIN = twin("Stribeck", counts_per_turn=16384)
GIVEN = given(TWIN)


def half_sine(time, at, length, peak):
    """Torque (N m) of a push from `at` on, `length` s long."""
    share = (time - at) / length
    return np.where((share > 0) & (share < 1), peak * np.sin(np.pi * share), 0.0)


def run(rig=TWIN, pushes=(), reference="sine 0.8 rad 8.5 rad/s", *, duration=25.0, rate=1000.0, seed=1):
    """A closed loop with the paper's gains and pushes of (at, length, share of the gravity torque)."""
    time = np.arange(round(duration * rate) + 1) / rate
    push = sum((half_sine(time, at, length, share * GRAVITY) for at, length, share in pushes), np.zeros(len(time)))
    controller = Compensator.paper(rig, sample_time=1 / rate)
    return simulate(
        rig,
        parse_reference(reference),
        controller,
        duration=duration,
        rate=rate,
        seed=seed,
        push=push if pushes else None,
    )


def fine(result):
    """Within 0.1 %, or covered, or with a warning."""
    low, high = result.inertia.interval95
    return abs(result.inertia.value / INERTIA - 1) < 1e-3 or low <= INERTIA <= high or bool(result.warnings)


# The twin


def balanced(**friction):
    """A balanced axis with a direct drive, 2e-3 kg m^2."""
    keys = {f"axis.friction.{name}": value for name, value in friction.items()}
    return Rig.from_text(
        'name = "axis"\n[axis]\nkind = "rotary"\ngravity_torque = 0\ninertia = 2e-3\n[drive]\nkind = "direct"\n'
    ).changed(keys)


def test_a_push_gives_the_axis_its_impulse():
    time = np.arange(2001) / 1000
    push = half_sine(time, 0.5, 0.3, 0.02)
    truth = simulate_run(balanced(), duration=2.0, drive=np.zeros(2001), push=push).truth
    assert truth.speed[-1] == pytest.approx(push.sum() / 1000 / 2e-3, rel=1e-12)
    assert truth.speed[499] == 0.0


def test_a_push_below_static_friction_moves_nothing():
    time = np.arange(2001) / 1000
    weak, strong = (half_sine(time, 0.5, 0.3, peak) for peak in (0.99e-3, 1.01e-3))
    rig = balanced(coulomb=1e-3)
    moved = [
        simulate_run(rig, duration=2.0, drive=np.zeros(2001), push=push).truth.angle[-1] for push in (weak, strong)
    ]
    assert moved[0] == 0.0
    assert 0.0 < moved[1] < 1e-2


def test_no_push_changes_no_digit():
    plain, none = (
        run(duration=4.0),
        simulate(
            TWIN,
            parse_reference("sine 0.8 rad 8.5 rad/s"),
            Compensator.paper(TWIN),
            duration=4.0,
            seed=1,
            push=np.zeros(4001),
        ),
    )
    assert np.array_equal(plain.angle, none.angle)
    assert np.array_equal(plain.voltage, none.voltage)


def test_a_push_of_wrong_length_is_a_usage_error():
    with pytest.raises(UsageError, check=coded("bad-push", "1001")):
        simulate(TWIN, duration=1.0, push=np.zeros(3))


# Found and left out


@pytest.mark.parametrize(
    ("length", "share"), [(0.05, 1.0), (0.2, 0.2), (1.0, 0.2), (0.2, -1.0), (1.0, -1.0), (0.05, 5.0), (0.2, 5.0)]
)
def test_a_push_is_found_where_it_is(length, share):
    at = 11.3
    found = find_pushes(run(pushes=[(at, length, share)]), GIVEN)
    assert len(found) == 1
    # all that matters of a half sine, and not much more
    assert found[0].start < at + 0.1 * length
    assert found[0].stop > at + 0.9 * length
    assert found[0].stop - found[0].start < length + 0.15
    assert np.sign(found[0].torque) == np.sign(share)
    assert abs(found[0].torque) < 1.1 * abs(share) * GRAVITY


@pytest.mark.parametrize("method", ["momentum", "energy"])
@pytest.mark.parametrize(
    ("length", "share"), quick_first(2, [(0.05, 0.2), (0.2, 5.0), (1.0, 0.05), (0.2, 0.2), (1.0, 1.0)])
)
def test_the_inertia_is_right_in_spite_of_a_push(method, length, share):
    assert fine(identify(run(pushes=[(14.7, length, share)], seed=2), GIVEN, method))


def test_momentum_uses_what_is_before_and_behind_a_push():
    log = run(pushes=[(20.0, 0.2, 1.0)])
    plain, pushed = identify(run(), GIVEN), identify(log, GIVEN)
    assert pushed.details.start == pytest.approx(plain.details.start, abs=1.0)
    assert pushed.inertia.standard_uncertainty < 1.5 * plain.inertia.standard_uncertainty
    assert abs(pushed.inertia.value / INERTIA - 1) < 1e-4
    assert pushed.status == "ok"
    # and no window spans the push
    (begin, end) = without_pushes(log, GIVEN).left_out[0]
    times, half = pushed.details.residual_times, pushed.details.window
    assert not np.any((times - half < end) & (times + half > begin))


def test_without_the_repair_the_rows_stay_and_a_warning_tells():
    log = run(pushes=[(14.7, 0.2, 0.5)])
    off = replace(log, repairs_off=frozenset(["push"]))
    mended, left = identify(log, GIVEN), identify(off, GIVEN)
    assert [(one["repair"], one["done"]) for one in mended.provenance["repairs"]] == [("push", True)]
    assert "from 14." in mended.provenance["repairs"][0]["what"]
    assert [note.code for note in mended.notes].count("push") == 1
    assert [(one["repair"], one["done"]) for one in left.provenance["repairs"]] == [("push", False)]
    assert [warning.code for warning in left.warnings].count("push-left") == 1
    assert left.provenance["rows"] == len(log) > mended.provenance["rows"]
    assert left.inertia.standard_uncertainty > 5 * mended.inertia.standard_uncertainty


def test_the_commands_name_a_push(tmp_path, capsys):
    log, rig = tmp_path / "log.parquet", tmp_path / "rig.toml"
    run(pushes=[(14.7, 0.2, 0.5)]).save(log, GIVEN)
    rig.write_text(GIVEN.text, encoding="utf-8")
    codes = {}
    for words in ((), ("--without-repair", "push")):
        assert main(["identify", str(log), "--rig", str(rig), "--json", "-", *words]) == 0
        result = json.loads(capsys.readouterr().out)
        codes[len(words)] = [one["code"] for one in (*result["warnings"], *result["notes"])]
    assert "push" in codes[0]
    assert {"push-left", "repair-off"} <= set(codes[2])
    assert main(["inspect", str(log), "--rig", str(rig), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"]["line"] == "ready; swingid itself repairs external disturbance torques (pushes)."
    assert any(check["code"] == "push" and "from 14." in check["evidence"] for check in found["checks"])


DIRECT = """
name = "direct"
[axis]
kind = "{kind}"
gravity_torque = {gravity}
inertia = {inertia}
friction = {{ viscous = {viscous}, coulomb = {coulomb} }}
[drive]
kind = "direct"
[sensors]
latency = 0
resolution = {resolution}
"""


@pytest.mark.parametrize(
    ("constants", "size", "speeds"),
    [
        (("rotary", 78e-3, 3e-3, 1e-3, 2e-3, 3.8e-4), 0.05, (7.0, 11.0)),
        (("linear", 0, 95.0, 100.0, 10.0, 1e-6), 60.0, (3.0, 5.0)),
    ],
    ids=["pendulum", "slide"],
)
def test_a_direct_drive_tells_a_push_too(constants, size, speeds):
    names = ("kind", "gravity", "inertia", "viscous", "coulomb", "resolution")
    rig = Rig.from_text(DIRECT.format(**dict(zip(names, constants, strict=True))))
    time = np.arange(15001) / 1000
    drive = size * (np.sin(speeds[0] * time) + 0.7 * np.sin(speeds[1] * time))
    push = half_sine(time, 8.2, 0.3, 1.5 * size)
    assert find_pushes(simulate(rig, duration=15.0, drive=drive), given(rig)) == []
    log = simulate(rig, duration=15.0, drive=drive, push=push)
    (found,) = find_pushes(log, given(rig))
    assert found.start < 8.25
    assert 8.45 < found.stop < 9.0
    assert abs(identify(log, given(rig)).inertia.value / constants[2] - 1) < 1e-3


def test_an_unknown_gravity_torque_is_no_hindrance():
    rig = GIVEN.changed({"axis.gravity_torque": "unknown"})
    reference = "multisine 0.5 rad 5 rad/s + 0.3 rad 8.5 rad/s"
    assert find_pushes(run(reference=reference), rig) == []
    assert len(find_pushes(run(pushes=[(14.0, 0.3, 0.5)], reference=reference), rig)) == 1


def test_several_pushes_are_told_apart():
    pushes = [(6.0, 0.1, 0.5), (13.0, 0.6, -0.5), (13.9, 0.1, 0.5), (20.0, 0.3, 2.0)]
    found = find_pushes(run(pushes=pushes), GIVEN)
    assert [np.sign(one.torque) for one in found] == [1, -1, 1, 1]
    assert [one.start < at + length / 2 < one.stop for one, (at, length, _) in zip(found, pushes, strict=True)] == [
        True
    ] * 4
    assert abs(identify(run(pushes=pushes), GIVEN).inertia.value / INERTIA - 1) < 1e-4


@pytest.mark.parametrize("at", [2.0, 24.85])
def test_a_push_at_an_end_is_left_out_to_it(at):
    log = run(pushes=[(at, 0.3, 1.0)])
    assert len(find_pushes(log, GIVEN)) == 1
    assert abs(identify(log, GIVEN).inertia.value / INERTIA - 1) < 1e-4


def test_a_push_within_the_transient_leaves_it_a_transient():
    log = run(pushes=[(1.0, 0.2, 5.0)])
    result = identify(log, GIVEN)
    assert result.details.start > 3.0
    assert fine(result)


def test_no_speed_is_made_up_in_a_gap():
    """A cubic through the rows at one side of a long gap runs away from them."""
    log = run(duration=10.0)
    largest = np.abs(find_motion(log.time, log.angle, 1e-4).speed.speed).max()
    for stop in np.arange(7.47, 7.50, 0.003):
        kept = (log.time < 6.42) | (log.time > stop)
        speed = find_motion(log.time[kept], log.angle[kept], 1e-4).speed.speed
        assert np.abs(speed).max() < 1.5 * largest  # 14 times with the cubics in the gap


def test_backstepping_takes_the_longest_run():
    log = run(pushes=[(9.0, 0.2, 1.0)])
    used = longest_run(without_pushes(log, GIVEN))
    assert used.time[0] == pytest.approx(9.2, abs=0.1)
    assert used.time[-1] == log.time[-1]
    assert longest_run(log) is log


@pytest.mark.parametrize(
    ("kind", "key", "value"), [("lost rows", "sensors.dropout", 0.05), ("noise", "sensors.noise", 2e-3)]
)
def test_a_push_is_found_in_poor_readings(kind, key, value):
    rig = twin("Stribeck", counts_per_turn=4096)
    log = run(rig, [(11.3, 0.3, 0.5)])
    rng = np.random.default_rng(5)
    if kind == "lost rows":
        kept = rng.random(len(log)) >= value
        log = Recording(**{name: getattr(log, name)[kept] for name in ("time", "angle", "wheel_angle", "voltage")})
    else:
        log = replace(log, angle=log.angle + rng.normal(0, value, len(log)))
    (push,) = find_pushes(log, given(rig))
    assert push.start < 11.4
    assert 11.5 < push.stop < 11.8


# What is none


@pytest.mark.parametrize(
    ("law", "reference"),
    [
        ("sticking", "sine 0.8 rad 8.5 rad/s"),
        ("sticking", "sine 0.4 rad 3 rad/s"),
        ("sharp Stribeck", "sine 0.4 rad 3 rad/s"),
        ("LuGre", "sine 1.4 rad 5 rad/s"),
        ("cubic", "multisine 0.3 rad 3 rad/s + 0.2 rad 7.1 rad/s + 0.1 rad 11 rad/s"),
        ("Stribeck", "chirp 0.5 rad 0.3 Hz 2 Hz 20 s"),
        ("sticking", "triangle 30 deg 0.5 Hz 0.05 s"),
        ("sticking", "strokes 0.6 rad 0.7 s 1 s"),
    ],
)
def test_friction_and_motion_are_no_push(law, reference):
    rig = twin(law, counts_per_turn=16384)
    assert find_pushes(run(rig, reference=reference), given(rig)) == []


@pytest.mark.parametrize(
    "sensors",
    [
        {"counts_per_turn": 256},
        {"counts_per_turn": None, "noise": 0.01},
        {"counts_per_turn": 16384, "wheel": {"latency": "5 ms"}},
        {"counts_per_turn": 16384, "nonlinearity": "0.5 deg"},
    ],
    ids=["8 bit", "noise", "late wheel", "nonlinear"],
)
def test_poor_sensors_are_no_push(sensors):
    rig = twin("Stribeck", **sensors)
    plain = given(rig).changed({"sensors.wheel": None, "sensors.nonlinearity": 0})
    assert find_pushes(run(rig), plain) == []


def test_wrong_constants_are_no_push():
    wrong = GIVEN.changed({"drive.wheel.inertia": 12.5e-5, "axis.gravity_torque": 60e-3})
    assert find_pushes(run(), wrong) == []


def test_a_slow_log_is_searched_too():
    log = run(pushes=[(11.3, 0.5, 1.0)])
    slow = Recording(
        **{name: getattr(log, name)[::20] for name in ("time", "angle", "wheel_angle", "voltage")}, drive_held=False
    )
    plain = run()
    none = replace(slow, angle=plain.angle[::20], wheel_angle=plain.wheel_angle[::20], voltage=plain.voltage[::20])
    assert len(find_pushes(slow, GIVEN)) == 1
    assert find_pushes(none, GIVEN) == []


def test_what_comes_with_every_swing_is_no_push():
    """An end stop that the axis meets at every second turning point."""
    time = np.arange(25001) / 1000
    phase = (8.5 * time / (2 * np.pi)) % 1
    stop = np.where((time > 4) & (phase > 0.2) & (phase < 0.3), -0.05, 0.0)
    log = simulate(TWIN, parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(TWIN), duration=25.0, push=stop)
    assert find_pushes(log, GIVEN) == []


def test_free_decays_and_short_logs_are_not_searched():
    body = Rig.builtin("paper-body")
    decay = simulate(body, duration=10.0, initial_angle=0.5)
    assert without_pushes(decay, body) is decay
    short = run(duration=0.5)
    assert without_pushes(short, GIVEN) is short


# Real logs


@pytest.mark.parametrize(("name", "free", "pushed"), [("energy_shaping", 4.6, [16.1]), ("sac", 4.4, [18.1, 22.1])])
def test_pushes_of_a_real_pendulum(data_dir, name, free, pushed):
    """Its readme: "pushed by hand later on"; upright, the hand's torque beats the motor's limit by far."""
    rig = Rig.load("examples/rigs/dfki_pendulum.toml")
    log = Recording.load(data_dir / "dfki_pendulum" / f"{name}.csv", rig)
    assert find_pushes(log.segment(0, free), rig) == []
    found = find_pushes(log, rig)
    assert [one.start < at < one.stop for one, at in zip(found, pushed, strict=True)] == [True] * len(pushed)
    assert without_pushes(log, rig).findings[-1].level == "warning"


def test_real_logs_without_pushes(data_dir):
    rig = Rig.load("examples/rigs/emps.toml")
    assert find_pushes(Recording.load(data_dir / "emps" / "DATA_EMPS.mat", rig), rig) == []
