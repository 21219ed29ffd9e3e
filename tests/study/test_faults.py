"""Faults of the registry: each does something, torques are those of the motion, effects known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from refusals import coded
from swingid.control.compensator import Compensator
from swingid.errors import InputError, SwingidError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.study.campaign.loading import plan_from_text
from swingid.study.campaign.trust import Trust, trust_tables
from swingid.study.experiment import Experiment, without_truth
from swingid.study.faults import FAULTS, Fault, every_fault, parse_fault, with_faults
from swingid.study.faults.effects import YIELDS, Scene, hysteresis, motor_backlash, rolling_base, slipping_wheel
from swingid.study.rehearse import rehearse

NO_WHEEL = {"log.wheel_angle": None, "log.voltage": None, "log.reference": None}


def experiment_on(kind: str) -> Experiment:
    """5 s of the paper's rig driven by its wheel, by a torque, or swinging freely."""
    paper = Rig.load("paper").changed({"log.reference": None})
    rig = paper if kind == "reaction-wheel" else paper.changed({"drive": {"kind": kind}, **NO_WHEEL})
    if kind == "none":
        return Experiment(rig, without_truth(rig), None, None, 5.0, 1000.0, 0.9, False, ())
    gains = Compensator.paper(rig)
    if kind == "direct":
        gains = replace(gains, lambda0=0.2, sigma0=5.0, delta0=0.05)
    motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    return Experiment(rig, without_truth(rig), motion, gains, 5.0, 1000.0, 0.0, False, ())


@pytest.mark.long
def test_every_grade_of_every_fault_changes_the_log_or_its_reading() -> None:
    clean = {}
    for kind in ("reaction-wheel", "none", "direct"):
        base = with_faults(experiment_on(kind), [parse_fault("none")])
        clean[kind] = base.read(base.log(3))
    for text in every_fault():
        drawn = parse_fault(text)
        kind = next(kind for kind in clean if kind in drawn.fault.drives)
        faulty = with_faults(experiment_on(kind), [drawn])
        try:
            log = faulty.read(faulty.log(3))
        except SwingidError as error:
            assert error.code == "implausible-angle", text
            continue
        there, stated = clean[kind], without_truth(experiment_on(kind).twin)
        same = len(log) == len(there) and all(
            np.array_equal(getattr(log, name), getattr(there, name))
            for name in ("time", "angle", "wheel_angle")
            if getattr(there, name) is not None
        )
        assert (same and faulty.stated.text == stated.text) == (text == "none"), text


def test_a_torque_of_the_angle_is_found_as_the_twin_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    stiffness = 4e-3
    spring = Fault("given", "a spring", {"": stiffness}, torque=lambda scene, k: -k * scene.angle)
    monkeypatch.setitem(FAULTS, "given", spring)
    for kind in ("reaction-wheel", "none"):
        base = experiment_on(kind)
        own = replace(base, twin=base.twin.changed({"axis.stiffness": stiffness}))
        pushed, known, without = (e.log(3) for e in (with_faults(base, [parse_fault("given")]), own, base))
        effect = np.max(np.abs(known.angle - without.angle))
        assert effect > 5e-3
        assert np.max(np.abs(pushed.angle - known.angle)) < 0.02 * effect + 4e-4  # a step of the encoder


@pytest.mark.parametrize(
    ("fault", "kind", "error"),
    [
        ("clock: 1000 ppm", "none", 1.001**2 - 1),
        ("gravity torque: 1 %", "none", 0.01),
        ("axis tilted: 5°", "none", 1 / np.cos(np.deg2rad(5)) - 1),
        ("torque gain: 20 %", "direct", 0.2),
    ],
)
def test_effects_on_the_inertia_are_those_of_the_closed_form(fault: str, kind: str, error: float) -> None:
    faulty = with_faults(experiment_on(kind), [parse_fault(fault)])
    if kind == "direct":  # gravity would keep half of the scale
        base = experiment_on(kind)
        unknown = replace(base, stated=base.stated.changed({"axis.gravity_torque": "unknown"}))
        faulty = with_faults(unknown, [parse_fault(fault)])
    found = identify(faulty.read(faulty.log(3)), faulty.stated, "momentum").inertia.value
    assert faulty.twin.axis.inertia is not None
    assert found / faulty.twin.axis.inertia.value - 1 == pytest.approx(error, rel=0.05)


def test_a_cable_with_hysteresis_loses_what_its_parts_slip() -> None:
    """Each part loses 4 (A − w) times its torque per turn between ± A: it does not slip over 2 w after a reversal."""
    time = np.linspace(0.0, 3.0, 30001)
    angle = 0.6 * np.sin(2 * np.pi * time)
    scene = Scene(time, angle, np.gradient(angle, time), Rig.load("paper"), 0, 0.6)
    torque = hysteresis(scene, 0.05)
    lost = -np.trapezoid(torque[20000:], angle[20000:])
    slipping = sum(4 * max(0.6 - width, 0.0) for width in YIELDS) / len(YIELDS)
    assert lost == pytest.approx(0.05 * scene.scale * slipping, rel=1e-3)
    assert np.max(np.abs(torque)) < 0.05 * scene.scale


def small_swing() -> Scene:
    time = np.linspace(0.0, 3.0, 3001)
    angle = 0.05 * np.sin(2 * np.pi * time)
    return Scene(time, angle, np.gradient(angle, time), Rig.load("paper"), 0, 0.05)


def test_a_base_that_rolls_is_less_inertia_at_small_angles() -> None:
    scene = small_swing()
    inertia = scene.rig.axis.inertia.value
    assert rolling_base(scene, 0.01) == pytest.approx(0.01 * inertia * scene.acceleration, abs=1e-4 * inertia)


def test_an_encoder_on_the_motor_is_ahead_of_the_axis_by_half_of_the_play() -> None:
    scene = small_swing()
    log = sw.Recording(time=scene.time, angle=scene.angle, torque=-scene.scale * np.sin(scene.angle * 20))
    ahead = (motor_backlash(log, scene, 2e-3).angle - log.angle) * np.sign(log.torque)
    assert np.max(ahead) == pytest.approx(1e-3, abs=np.pi / 16384)  # half a count of the encoder
    assert np.mean(ahead) == pytest.approx(1e-3, rel=0.1)


def test_a_wheel_that_slips_is_read_too_far_forward_only() -> None:
    scene = small_swing()
    wheel = np.concatenate([np.linspace(0, 10, 1501), np.linspace(10, 4, 1500)])
    log = sw.Recording(time=scene.time, angle=scene.angle, wheel_angle=wheel)
    read = slipping_wheel(log, scene, 0.01).wheel_angle
    assert read is not None
    assert read[1500] == pytest.approx(10.1)
    assert read[-1] == pytest.approx(4.1)


def test_lost_rows_shorten_the_log_and_leave_its_rate() -> None:
    faulty = with_faults(experiment_on("none"), [parse_fault("lost rows: 3 %")])
    log = faulty.log(3)
    assert 0.015 * 5001 < 5001 - len(log) < 0.05 * 5001
    assert np.allclose(np.diff(log.time), 1e-3)
    assert faulty.read(log).duration == pytest.approx(5.0, rel=0.01)  # which reading restores


def test_two_faults_at_once_do_both() -> None:
    faulty = with_faults(experiment_on("none"), [parse_fault("clock: 1000 ppm"), parse_fault("gravity torque: 1 %")])
    found = identify(faulty.read(faulty.log(3)), faulty.stated, "momentum").inertia.value
    assert faulty.twin.axis.inertia is not None
    assert found / faulty.twin.axis.inertia.value == pytest.approx(1.001**2 * 1.01, rel=5e-4)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(UsageError, check=coded("unknown-fault", "'gremlins'")):
        parse_fault("gremlins")
    with pytest.raises(UsageError, check=coded("unknown-fault", "'7 %'")):
        parse_fault("gravity torque: 7 %")
    assert str(parse_fault("clock")) == "clock: 200 ppm"
    with pytest.raises(UnanswerableError, check=coded("no-such-fault", "'wheel late'")):
        with_faults(experiment_on("none"), [parse_fault("wheel late")]).log(0)


PLAN = """
name = "small"
design = "latin-hypercube"
points = 8
[base]
duration = 5
reference = "sine 0.8 rad 8.5 rad/s"
[factors.fault]
key = "faults.first"
"""


def test_a_plan_takes_every_fault_and_says_which_is_unknown() -> None:
    values = plan_from_text(PLAN).tables.factors["fault"].values
    assert values is not None
    assert set(values) == set(every_fault())
    assert 0.1 < values.count("none") / len(values) < 0.13
    with pytest.raises(InputError, check=coded("unknown-fault", "'gremlins'")):
        plan_from_text(PLAN + 'values = ["gremlins"]')
    with pytest.raises(InputError, check=coded("no-faults")):
        plan_from_text(PLAN.replace("duration", 'methods = ["momentum-batch"]\nduration'))
    with pytest.raises(InputError, check=coded("wrong-value")):
        plan_from_text(PLAN + '[factors.known]\nkey = "uncertainty"\nvalues = ["1 %"]')


def test_trust_counts_what_is_ok_and_wrong() -> None:
    columns = {
        "fault": np.array(["none", "clock: 1 %", "clock: 1 %", "clock: 2 %", "stop", "stop", "stop"], dtype=object),
        "method": np.array(["momentum"] * 7, dtype=object),
        "status": np.array(["ok", "ok", "ok", "warning", "refused", "refused", "failed"], dtype=object),
        "code": np.array(["", "", "", "", "too-short", "bug-TypeError", "no-such-fault"], dtype=object),
        "value": np.array([1.0, 1.16, 1.14, 9.0, np.nan, np.nan, np.nan]),
        "truth": np.ones(7),
        "low": np.array([0.9, 1.06, 1.04, 8.9, np.nan, np.nan, np.nan]),
        "high": np.array([1.1, 1.26, 1.24, 9.1, np.nan, np.nan, np.nan]),
    }
    whole = Trust.of(columns, np.ones(7, bool))
    assert whole == Trust(answers=6, ok=3, wrong=1, warned=1, refused=1, crashed=1)
    by_fault, by_level = (table.texts() for table in trust_tables(plan_from_text(PLAN), columns))
    assert [row[0] for row in by_fault] == ["fault", "nothing wrong", "**any fault**", "clock", "stop"]
    assert by_fault[3][1:] == ["3", "2", "1 = 50 %", "33 %", "–", "–", "1 of 2"]
    assert by_level[1] == ["method momentum", "5", "2", "1 = 50 %", "20 %", "20 %", "20 %"]


def test_rehearse_with_a_fault_expects_its_error() -> None:
    rig = experiment_on("none").twin
    found = rehearse(
        rig,
        duration=5,
        runs=5,
        initial_angle=0.9,
        methods=["momentum"],
        faults=["gravity torque: 1 %"],
        workers=1,
    )
    assert found.of("momentum").bias == pytest.approx(0.01, rel=0.02)
    assert "with the fault gravity torque: 1 %: gravity torque stated wrong." in found.notes
