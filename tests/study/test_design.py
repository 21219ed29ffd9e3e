"""The planned motion: rows (I) and (II) hold on it, its prediction is the spread of fits, limits are kept."""

from __future__ import annotations

import json
import shlex

import numpy as np
import pytest

import swingid as sw
from long_cases import quick_first
from refusals import coded
from swingid.balance.motor import motor_torque
from swingid.cli.app import run
from swingid.control.references import Multisine, Sine
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.recording.recording import Recording
from swingid.study.design import design
from swingid.study.design.information import predict, with_errors
from swingid.study.design.motions import Limits, candidates, course_of
from swingid.study.design.proposal import controller_of
from swingid.study.rehearse import rehearse
from twin_logs import GIVEN, INERTIA, PAPER

PAIR = Multisine((Sine(0.48, 5.0), Sine(0.32, 8.5)))
NOISY = {"sensors.counts_per_turn": None, "sensors.noise": 1e-2}
UNSURE = {
    "axis.gravity_torque": "78e-3 ± 0.2 % N*m",
    "drive.wheel.inertia": "11.34e-5 ± 0.1 % kg*m^2",
    "sensors.latency": "0 ± 0.3 ms",
    "sensors.wheel.latency": "0 ± 0.3 ms",
}


def slope(values: np.ndarray, step: float) -> np.ndarray:
    return (values[2:] - values[:-2]) / (2 * step)


@pytest.mark.parametrize("reference", [Sine(0.8, 7.0), PAIR])
def test_the_course_solves_both_rows(reference):
    rate = 4000.0
    course, drive = course_of(PAPER, reference, 4.0, rate), PAPER.drive
    v1, v2 = course.speed[1:-1], course.wheel_speed[1:-1]
    a1, a2 = slope(course.speed, 1 / rate), slope(course.wheel_speed, 1 / rate)
    np.testing.assert_allclose(slope(course.wheel_angle, 1 / rate), v2, atol=1e-3 * np.abs(v2).max())
    a11 = INERTIA + drive.wheel.inertia.value + drive.motor.rotor_inertia.value
    first = a11 * a1 + drive.a12 * a2 + 78e-3 * np.sin(course.angle[1:-1]) + 1.144e-3 * v1
    assert np.abs(first).max() < 1e-4 * np.abs(a11 * a1).max()
    motor, gear = drive.motor, drive.motor.gear_ratio.value
    drag = motor.viscous.value * gear * v2 + motor.coulomb.value * np.sign(v2)
    second = drive.a12 * a1 + drive.a22 * a2 - gear * (motor_torque(motor, course.voltage[1:-1], v2) - drag)
    assert np.quantile(np.abs(second), 0.99) < 1e-3 * np.abs(drive.a22 * a2).max()


def test_a_direct_drive_needs_the_torque_of_the_equation():
    rig = sw.Rig.from_text(
        '[axis]\nkind = "linear"\ninertia = 2.0\n[axis.friction]\nviscous = 3.0\n[drive]\nkind = "direct"\n'
    )
    course = course_of(rig, Sine(0.1, 5.0, unit="m"), 2.0, 500.0)
    t = course.time
    expected = -2.0 * 0.1 * 25 * np.sin(5 * t) + 3.0 * 0.5 * np.cos(5 * t)
    np.testing.assert_allclose(course.torque, expected, atol=1e-12)
    assert course.voltage is None


@pytest.mark.parametrize(
    ("sensors", "unknown"),
    quick_first(1, [(NOISY, False), (NOISY, True), ({"sensors.counts_per_turn": 512}, False)]),
    ids=["noise", "noise, gravity unknown", "coarse encoder"],
)
def test_the_prediction_is_the_spread_of_fits(sensors, unknown):
    """Sensor errors on one and the same motion, 60 times: 1/sqrt(120) = 9 % is the error of the spread itself."""
    expected = PAPER.changed(sensors)
    rig = GIVEN.changed(sensors | ({"axis.gravity_torque": "unknown"} if unknown else {}))
    log = course_of(expected, PAIR, 9.0, 500.0).recording(0.0)
    said = predict(log, rig, expected)
    random = np.random.default_rng(5)
    found = [identify(with_errors(log, rig, random), rig).inertia.value for _ in range(60)]
    assert np.std(found) == pytest.approx(said.parameters["inertia"].standard_uncertainty, rel=0.27)
    assert ("gravity_torque" in said.parameters) == unknown


def test_type_b_is_the_shift_that_the_method_makes_of_a_wrong_constant():
    changes = UNSURE | {"sensors.counts_per_turn": None, "sensors.noise": 1e-4}
    expected = PAPER.changed(changes)
    rig = GIVEN.changed(changes)
    log = course_of(expected, Sine(0.5, 8.5), 9.0, 1000.0).recording(0.0)
    said = {entry.source: entry for entry in predict(log, rig, expected).budget}
    right = identify(log, rig).inertia.value
    for key in ("axis.gravity_torque", "drive.wheel.inertia"):
        quantity = rig.axis.gravity_torque if key.startswith("axis") else rig.drive.wheel.inertia
        wrong = identify(log, rig.changed({key: f"{quantity.value + quantity.std!r} ± {quantity.std!r}"}))
        assert wrong.inertia.value - right == pytest.approx(said[key].sensitivity * quantity.std, rel=0.02)


def test_candidates_keep_limits_and_stay_away_from_resonance():
    limits = Limits(angle=0.5, speed=120.0, voltage=10.0)
    natural = np.sqrt(78e-3 / INERTIA)
    found = candidates(PAPER, limits, natural, 2.0)
    assert len(found) > 5
    for motion in found:
        peaks = course_of(PAPER, motion, 10.0, 500.0).peaks
        assert peaks["angle"] <= 0.5
        assert peaks["wheel_speed"] <= 121.0
        assert peaks["voltage"] <= 8.1
        if isinstance(motion, Sine):
            assert not 0.6 < motion.frequency / natural < 1.35


@pytest.fixture(scope="module")
def noisy():
    return design(PAPER.changed(NOISY), "0.02 %")


def test_the_proposal_reaches_what_was_asked_in_the_shortest_time(noisy):
    assert noisy.proposal.relative <= 2e-4
    assert all(noisy.proposal.duration <= other.duration for other in noisy.others if other.relative <= 2e-4)
    low, high = noisy.proposal.prediction.parameters["inertia"].interval95
    assert high - low == pytest.approx(2 * 1.96 * noisy.proposal.relative * INERTIA, rel=1e-3)
    assert noisy.trial.passed
    assert noisy.trial.angle < 0.9
    assert noisy.trial.voltage < 10.0


def test_the_command_of_a_design_runs(noisy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = shlex.split(noisy.command)
    assert words[0] == "swingid"
    assert run(words[1:]) == 0
    log = Recording.load(tmp_path / "run.parquet", PAPER)
    assert log.duration == pytest.approx(noisy.proposal.duration)


@pytest.mark.long
def test_more_certainty_takes_more_time():
    rig = PAPER.changed(NOISY)
    loose, tight = (design(rig, share, check=False, rate=500.0).proposal for share in ("0.1 %", "0.015 %"))
    assert tight.duration > loose.duration
    assert tight.relative <= 1.5e-4


@pytest.mark.long
def test_unknown_gravity_takes_two_frequencies():
    plan = design(
        PAPER.changed(NOISY | {"axis.gravity_torque": "unknown"}), "0.2 %", gravity_torque="78 mN*m", rate=500.0
    )
    assert plan.proposal.reference.startswith("multisine")
    assert plan.proposal.prediction.parameters["gravity_torque"].standard_uncertainty > 0
    assert plan.proposal.prediction.seen.together == ("inertia", "gravity_torque")


@pytest.mark.long
def test_what_cannot_be_reached_names_the_constant():
    with pytest.raises(UnanswerableError, check=coded("not-reachable", "axis.gravity_torque")):
        design(PAPER.changed({"axis.gravity_torque": "78e-3 ± 1 % N*m"}), "0.01 %", duration=20.0, rate=500.0)
    with pytest.raises(UnanswerableError, check=coded("not-reachable", "20 s")):
        design(PAPER.changed({"sensors.noise": 0.05}), "0.01 %", duration=20.0, rate=500.0)


def test_relative_and_absolute_uncertainties_are_the_same_question():
    one, other = (
        design(PAPER, u, check=False, rate=100.0, duration=12.0).wanted for u in ("0.05 %", "1.511e-6 kg*m^2")
    )
    assert other == pytest.approx(one, rel=1e-3)


@pytest.mark.parametrize(
    ("rig", "options", "error", "words"),
    [
        (GIVEN, {}, InputError, "axis.inertia is missing"),
        (PAPER.changed({"axis.gravity_torque": "unknown"}), {}, InputError, "--gravity-torque"),
        (PAPER, {"uncertainty": "much"}, UsageError, "no quantity"),
        (PAPER, {"uncertainty": "-1 %"}, UsageError, "above 0"),
        (PAPER, {"max_angle": -1.0}, UsageError, "max_angle must be positive|max_angle must be a positive"),
        (PAPER, {"duration": 7.0}, UsageError, "settle"),
        (PAPER, {"settling": -1.0}, UsageError, "settling must be zero or positive"),
        (PAPER, {"inertia": "-3 kg*m^2"}, UsageError, "inertia is -3"),
        (PAPER, {"max_speed": 0.01}, UnanswerableError, "no motion within the limits"),
    ],
)
def test_refusals_say_what_to_do(rig, options, error, words):
    with pytest.raises(error, match=words):
        design(rig, **options)


def test_a_rig_without_a_drive_has_no_motion_to_choose():
    rig = sw.Rig.from_text('[axis]\ngravity_torque = 0.1\ninertia = 1e-3\n[drive]\nkind = "none"\n')
    with pytest.raises(UnanswerableError, check=coded("no-drive")):
        design(rig)


def test_the_command_line_prints_and_writes_json(capsysbinary, tmp_path):
    target = tmp_path / "design.json"
    assert (
        run(["design", "--rig", "paper", "--uncertainty", "0.05 %", "--max-angle", "40 deg", "--json", str(target)])
        == 0
    )
    printed = capsysbinary.readouterr().out.decode()
    data = json.loads(target.read_text())
    assert data["schema"] == "swingid.design/1"
    assert data["command"] in printed
    assert data["proposal"]["relative_uncertainty"] <= 5e-4
    assert data["proposal"]["peaks"]["angle"] <= np.radians(40)
    assert "condition" in data["proposal"]


def test_a_refusal_is_json_too(tmp_path):
    target = tmp_path / "design.json"
    words = ["design", "--rig", "paper", "--uncertainty", "1e-7 %", "--duration", "12", "--rate", "250"]
    assert run([*words, "--json", str(target)]) == 4
    data = json.loads(target.read_text())
    assert (data["status"], data["error"]["code"]) == ("refused", "not-reachable")


def test_a_wrong_question_is_refused_before_anything_is_compiled(monkeypatch, capsys):
    monkeypatch.setattr("swingid.cli.experiments.compile_first", lambda *_: pytest.fail("compiles already"))
    assert run(["design", "--rig", "paper", "--uncertainty", "much"]) == 2
    assert run(["design", "--rig", "paper", "--uncertainty", "0.05 %", "--duration", "3"]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "wanted"),
    [(NOISY, "0.02 %"), (UNSURE, "0.15 %"), ({"sensors.nonlinearity": "0.1 deg", "sensors.noise": 1e-3}, "0.2 %")],
    ids=["noise", "constants", "nonlinearity"],
)
def test_predicted_and_achieved_spread_agree(changes, wanted):
    """Within 20 %, and three standard errors of a spread over 100 runs."""
    rig = PAPER.changed(changes)
    p = design(rig, wanted).proposal
    motion, controller = sw.parse_reference(p.reference), controller_of(rig, p)
    found = rehearse(rig, motion, controller, duration=p.duration, rate=p.rate, runs=100, methods=["momentum"])
    assert found.of("momentum").rmse == pytest.approx(p.relative, rel=0.2 + 3 / np.sqrt(200))
