"""Encoders that calibrate themselves: closed forms, the twin's draws, what is written, what identify makes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given as for_all
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

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
from refusals import coded
from swingid.calibration.encoders import calibrate_encoders
from swingid.control.references import parse_reference
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.preparation.encoders import corrected, true_angles
from swingid.recording.recording import Recording
from swingid.recursive import swing_estimates
from swingid.simulation.draws import draw
from twin_logs import error, given, logged, twin, without

TIME = np.arange(8_001) / 1000
ANGLE, WHEEL = (
    ("sensors.nonlinearity_cosine", "sensors.nonlinearity_sine"),
    (
        "sensors.wheel.nonlinearity_cosine",
        "sensors.wheel.nonlinearity_sine",
    ),
)
LATENCY = "sensors.wheel.latency"
SLOW = Sines((1.4, 5.0, 0.4))


def friction(v):
    return 1.144e-3 * v


def bent(log: Recording, alphas=(0.0, 0.0), betas=(0.0, 0.0), late: float = 0.0) -> Recording:
    """The log as encoders with these once-per-turn parts (axis, wheel) read it, the wheel `late` seconds late."""
    wheel = CubicSpline(log.time, log.wheel_angle)(log.time + late) if late else log.wheel_angle
    read = [q + a * np.cos(q) + b * np.sin(q) for q, a, b in zip((log.angle, wheel), alphas, betas, strict=True)]
    return replace(log, angle=read[0], wheel_angle=read[1])


@for_all(st.floats(-0.35, 0.35), st.floats(-0.35, 0.35), st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=20))
def test_straightening_is_the_inverse_of_reading(alpha, beta, angles):
    q = np.array(angles)
    assert true_angles(q + alpha * np.cos(q) + beta * np.sin(q), alpha, beta) == pytest.approx(q, abs=1e-12)


def test_parts_of_a_degree_and_a_late_wheel_are_found_exactly():
    # far beyond first order: 1° and 2 ms. The fit is Gauss-Newton, so only noise, here none, is left.
    alphas, betas, late = (0.012, -0.02), (-0.017, 0.011), 2e-3
    logs = [bent(wheel_log(exact_rig(), motion, friction, TIME), alphas, betas, late) for motion in (TWO_TONES, SLOW)]
    found = calibrate_encoders(logs, exact_rig(**{"sensors.nonlinearity": "2 deg", "sensors.latency": "0 ± 5 ms"}))
    values = {name: p.value for name, p in found.result.parameters.items()}
    assert [values[key] for key in ANGLE] == pytest.approx([alphas[0], betas[0]], abs=3e-6)
    assert [values[key] for key in WHEEL] == pytest.approx([alphas[1], betas[1]], abs=3e-5)
    assert values[LATENCY] == pytest.approx(late, abs=2e-6)
    assert set(found.determined) == {*ANGLE, *WHEEL, LATENCY}
    assert set(found.result.correlation) == {*ANGLE, *WHEEL, LATENCY}
    for log in logs:
        assert identify(log, found.rig).inertia.value == pytest.approx(INERTIA, rel=1e-5)


def test_straight_encoders_are_found_straight():
    logs = [wheel_log(exact_rig(), motion, friction, TIME) for motion in (TWO_TONES, SLOW)]
    found = calibrate_encoders(logs, exact_rig())
    for name in ANGLE:
        assert abs(found.result.parameters[name].value) < 1e-6


def test_a_late_torque():
    # an angle read δ after the torque acts, on a direct drive
    late = 1.5e-3
    logs = []
    for motion in (TWO_TONES, SLOW):
        log = direct_log(motion, friction, TIME)
        logs.append(replace(log, angle=motion(TIME + late)))
    found = calibrate_encoders(logs, direct_rig())
    assert found.result.parameters["sensors.latency"].value == pytest.approx(late, abs=1e-6)
    assert set(found.result.parameters) == {*ANGLE, "sensors.latency"}
    assert identify(logs[0], found.rig).inertia.value == pytest.approx(INERTIA, rel=1e-5)


def test_a_free_decay():
    log = free_log(lambda v: 1.144e-4 * v, np.arange(15_001) / 1000, 1.4)
    log = encoded(replace(log, angle=log.angle + 0.004 * np.cos(log.angle) - 0.003 * np.sin(log.angle)))
    found = calibrate_encoders(log, free_rig())
    assert set(found.determined) == set(ANGLE)
    for name, true in zip(ANGLE, (0.004, -0.003), strict=True):
        parameter = found.result.parameters[name]
        assert abs(parameter.value - true) < 4 * parameter.standard_uncertainty < 1.5e-3
    after = identify(log, found.rig).inertia
    assert abs(after.value - INERTIA) < 4 * after.standard_uncertainty < 3e-4 * INERTIA


def test_a_stream_is_straightened_too():
    stated = exact_rig(**{ANGLE[0]: 0.004, ANGLE[1]: -0.003, WHEEL[1]: 0.002})
    straight = wheel_log(exact_rig(), SLOW, friction, TIME)
    read = bent(straight, (0.004, 0.0), (-0.003, 0.002))
    expected = swing_estimates(straight, exact_rig())[-1].inertia.value
    assert swing_estimates(read, stated)[-1].inertia.value == pytest.approx(expected, rel=1e-6)
    assert abs(swing_estimates(read, exact_rig())[-1].inertia.value / expected - 1) > 1e-3


def test_an_uncertain_gravity_torque_is_no_nonlinearity():
    # b is 1 % off; where the rig says that it may be, the motions tell it from the encoders
    rig = exact_rig(**{"axis.gravity_torque": {"value": 78e-3 * 1.01, "std": 1e-3}})
    logs = [wheel_log(exact_rig(), motion, friction, TIME) for motion in (TWO_TONES, SLOW, ONE_TONE)]
    sure = calibrate_encoders(logs, exact_rig(**{"axis.gravity_torque": 78e-3 * 1.01}))
    unsure = calibrate_encoders(logs, rig)
    assert abs(sure.result.parameters[ANGLE[1]].value) > 3e-4
    assert abs(unsure.result.parameters[ANGLE[1]].value) < 3e-5


def test_an_uncertain_clock_is_no_nonlinearity():
    # the clock is fast by 0.1 %, which is a gravity torque that is off by 0.2 %
    logs = [wheel_log(exact_rig(), motion, friction, TIME) for motion in (TWO_TONES, SLOW, ONE_TONE)]
    logs = [replace(log, time=1.001 * log.time) for log in logs]
    sure = calibrate_encoders(logs, exact_rig(**{"log.clock": 0}))
    unsure = calibrate_encoders(logs, exact_rig(**{"log.clock": {"value": 0.0, "std": 1e-3}}))
    assert abs(sure.result.parameters[ANGLE[1]].value) > 5e-5
    assert abs(unsure.result.parameters[ANGLE[1]].value) < 5e-6


def test_another_body_is_noticed():
    logs = [wheel_log(exact_rig(), motion, friction, TIME) for motion in (TWO_TONES, SLOW)]
    heavier = replace(logs[1], wheel_angle=1.02 * logs[1].wheel_angle)
    warnings = calibrate_encoders([encoded(logs[0]), encoded(heavier)], exact_rig()).result.warnings
    assert {message.code for message in warnings} == {"logs-differ"}
    assert calibrate_encoders([encoded(log) for log in logs], exact_rig()).result.warnings == ()


MOTIONS = ("sine 0.8 rad 8.5 rad/s", "sine 1.4 rad 5 rad/s", "multisine 0.7 rad 5 rad/s + 0.4 rad 8.5 rad/s")


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """The twin's logs of three motions with one draw of 0.1°, what the draw was, and the rig as the lab has it."""
    rig = twin("viscous", nonlinearity="0.1 deg")
    logs = []
    for k, motion in enumerate(MOTIONS):
        folder = tmp_path_factory.mktemp(f"log{k}")
        logs.append(logged(rig, folder, parse_reference(motion), seed=11))
    true = {}
    for table, encoder in zip(("sensors", "sensors.wheel"), draw(rig, 1, 11).encoders, strict=True):
        true |= {f"{table}.nonlinearity_cosine": encoder.alpha, f"{table}.nonlinearity_sine": encoder.beta}
    return logs, true | {LATENCY: 0.0}, given(twin("viscous"))


@pytest.fixture(scope="module")
def calibrated(three):
    logs, _, rig = three
    return calibrate_encoders(logs, rig)


def test_three_motions_of_the_twin(three, calibrated):
    _, true, _ = three
    for name, parameter in calibrated.result.parameters.items():
        assert abs(parameter.value - true[name]) < 4 * parameter.standard_uncertainty, name
    assert calibrated.result.parameters[ANGLE[1]].standard_uncertainty < 5e-5
    assert calibrated.result.status == "ok"


def test_identify_corrects_and_says_so(three, calibrated):
    logs, _, rig = three
    before, after = identify([without(log, "calibrate") for log in logs], rig), identify(logs, calibrated.rig)
    assert abs(error(before)) > 3e-4
    assert abs(error(after)) < 3e-5
    low, high = after.inertia.interval95
    assert low < INERTIA < high
    assert any(note.code == "encoders" for one in after.per_log for note in one.notes)
    one = identify(logs[0], calibrated.rig)
    assert [made["repair"] for made in one.provenance["repairs"] if made["done"]] == ["latency", "encoders"]


def test_the_repair_can_be_switched_off(three, calibrated, tmp_path):
    logs, _, rig = three
    path = logs[0].save(tmp_path / "again.parquet", rig)
    off = Recording.load(path, calibrated.rig, repairs={"encoders": False})
    assert np.array_equal(corrected(off, calibrated.rig)[0].angle, logs[0].angle)
    assert np.array_equal(off.angle, logs[0].angle)
    once = corrected(logs[0], calibrated.rig)[0]
    assert corrected(once, calibrated.rig)[0] is once


def test_what_is_stated_is_passed_on_and_not_found_again(three, calibrated):
    logs, _, _ = three
    name = ANGLE[1]
    result = identify(logs[0], calibrated.rig)
    entry = next(e for e in result.budget if e.source == "angle encoder nonlinearity (sine)")
    stated = calibrated.rig.sensors.of("angle").sine
    step = 1e-4
    moved = [
        identify(logs[0], calibrated.rig.changed({name: {"value": stated.value + s, "std": stated.std}})).inertia.value
        for s in (step, -step)
    ]
    # a reading that is β sin q too high is one that was taken to be too low by as much
    assert entry.sensitivity == pytest.approx(-(moved[0] - moved[1]) / (2 * step), rel=0.05)
    assert entry.standard_uncertainty == pytest.approx(abs(entry.sensitivity) * stated.std, rel=1e-9)


def test_a_large_nonlinearity_without_values_is_warned_of(three):
    logs, rig = three[0], three[2].changed({"sensors.nonlinearity": "0.5 deg"})
    (warning,) = corrected(logs[0], rig)[0].findings[len(logs[0].findings) :]
    assert (warning.code, warning.level) == ("large-nonlinearity", "warning")
    assert "calibrate --encoders" in warning.message
    assert corrected(corrected(logs[0], rig)[0], rig)[0].findings.count(warning) == 1
    for known in ({"sensors.nonlinearity": "0.2 deg"}, {"sensors.nonlinearity_sine": 0.001}):
        assert warning not in corrected(logs[0], rig.changed(known))[0].findings


def test_the_rig_file_keeps_its_comments_and_what_was_declared(three):
    logs = three[0][1:2]
    text = given(twin("viscous", nonlinearity="0.1 deg")).text + "\n# the end\n"
    rig = Rig.from_text("# a comment\n" + text)
    found = calibrate_encoders(logs, rig)
    assert found.rig.text.startswith("# a comment\n")
    assert "# the end" in found.rig.text
    assert found.rig.sensors.nonlinearity == pytest.approx(np.radians(0.1))
    again = calibrate_encoders(logs, found.rig)  # starts from the readings, not from its own answer
    for name, parameter in found.result.parameters.items():
        assert again.result.parameters[name].value == pytest.approx(parameter.value, rel=1e-3, abs=1e-9)


def test_a_log_that_tells_little_writes_little(tmp_path):
    rig = twin("viscous", nonlinearity="0.1 deg")
    log = logged(rig, tmp_path, parse_reference("sine 0.3 rad 8.5 rad/s"), duration=8.0, seed=2)
    found = calibrate_encoders(log, given(rig))
    undetermined = set(found.result.parameters) - set(found.determined)
    assert ANGLE[0] in undetermined
    assert found.rig.sensors.nonlinearity_cosine is None
    assert any(note.code == "not-told" for note in found.result.notes)


def test_refusals():
    linear = Rig.from_text('name = "x"\n[axis]\nkind = "linear"\n[drive]\nkind = "none"\n')
    log = wheel_log(exact_rig(), ONE_TONE, friction, TIME)
    with pytest.raises(UsageError) as caught:
        calibrate_encoders([], exact_rig())
    assert caught.value.code == "no-log"
    with pytest.raises(InputError) as caught:
        calibrate_encoders(log, linear)
    assert caught.value.code == "nothing-to-calibrate"
    with pytest.raises(InputError, check=coded("missing-wheel-angle")):
        calibrate_encoders(replace(log, wheel_angle=None), exact_rig())
    with pytest.raises(UnanswerableError) as caught:
        calibrate_encoders(replace(log, angle=0 * log.angle), exact_rig())
    assert caught.value.code == "no-motion"


def test_command(capfd, three, tmp_path):
    import json

    from swingid.cli import main

    logs, _, rig = three
    paths = [str(log.save(tmp_path / f"{k}.parquet", rig)) for k, log in enumerate(logs)]
    (tmp_path / "rig.toml").write_text(rig.text, encoding="utf-8")
    out, page = tmp_path / "new.toml", tmp_path / "report.html"
    common = ["calibrate", "--encoders", "--rig", str(tmp_path / "rig.toml")]
    assert main([*common, *paths, "--out", str(out), "--json", "-", "--report", str(page)]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["method"] == "calibrate-encoders"
    found = Rig.load(out).sensors.of("angle").sine
    assert found.value == pytest.approx(told["parameters"][ANGLE[1]]["value"], rel=1e-4)
    assert "once per turn" in page.read_text(encoding="utf-8")
    assert main([*common, paths[0], paths[0]]) == 2
    assert main([*common, str(tmp_path / "none.csv")]) == 3


@pytest.mark.long
def test_intervals_cover():
    # 60 draws of one log; 95 % of them within, to three binomial standard deviations
    import sys
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    import encoders

    rows = [
        encoders.on_one_draw(encoders.MOTIONS["one log, 8.5 rad/s"], "Stribeck", True, seed)[-1] for seed in range(60)
    ]
    errors, says, _ = np.array(rows, dtype=float).T
    assert np.mean(np.abs(errors) <= 1.96 * says) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 60)
    assert np.percentile(np.abs(errors), 95) < 0.05
