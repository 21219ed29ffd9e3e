"""The stage before every method: what is taken off a log and left out of it, decided once, and what each method makes
of it."""

from __future__ import annotations

import ast
from dataclasses import replace
from functools import cache, reduce
from pathlib import Path

import numpy as np
import pytest

import swingid
from swingid.balance.rows import Signals
from swingid.batch import energy_batch, momentum_batch, plan_batch
from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.errors import InputError
from swingid.identification import identify
from swingid.methods.equation_error.grid import even_grid
from swingid.model.rig import Rig
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion
from swingid.preparation.prepared import prepare
from swingid.simulation import simulate
from swingid.simulation.ensemble import simulate_ensemble
from swingid.study.validate import validate
from twin_logs import INERTIA, PAPER, error, given, twin, without

SOURCES = Path(swingid.__file__).parent

# A direct drive, whose angle is read late

VISCOUS, LATE = 9.152e-3, 2e-3
"""Friction (N m s) and latency (s): what is not taken off makes the inertia wrong by −VISCOUS LATE, 0.6 %."""

DIRECT = Rig.builtin("paper").changed(
    {
        "drive": {"kind": "direct"},
        "log": {"torque": "tau"},
        "sensors.latency": {"value": LATE, "std": 1e-5},
        "axis.friction": None,
        "axis.friction.viscous": VISCOUS,
    }
)

METHODS = ("momentum", "energy", "equation-error", "output-error")


@cache
def late_run():
    """Eight seconds of the late twin under a sine of torque, after four in which it settles."""
    time = np.arange(12_001) / 1000
    return simulate(DIRECT, duration=12.0, rate=1000.0, drive=0.12 * np.sin(8.5 * time)).segment(4.0, 12.0)


def late_log(*off: str):
    """The log of the late twin with repairs switched off."""
    return reduce(without, off, late_run())


@pytest.mark.parametrize("method", METHODS)
def test_every_method_takes_the_latency_of_a_direct_drive_off(method):
    result = identify(late_log(), given(DIRECT), method)
    assert abs(error(result)) < 3e-4
    assert result.status == "ok"
    (told,) = result.provenance["preparation"]["corrections"]
    assert told == {
        "channel": "angle",
        "kind": "latency",
        "value": LATE,
        "standard_uncertainty": 1e-5,
        "unit": "s",
        "origin": "stated",
    }
    (named,) = result.provenance["repairs"]
    assert (named["repair"], named["done"]) == ("latency", True)


@pytest.mark.parametrize("method", METHODS)
def test_what_is_not_taken_off_biases_every_method_as_theory_says(method):
    """J y'' + b sin y + f y' = τ with the y of t + δ: the friction that comes too early takes f δ off the inertia."""
    exact = given(DIRECT).changed({"sensors.latency": LATE})  # without freedom to find it
    result = identify(late_log("latency", "calibrate"), exact, method)
    assert result.inertia.value - INERTIA == pytest.approx(-VISCOUS * LATE, rel=0.1)
    (told,) = result.provenance["preparation"]["corrections"]
    assert (told["origin"], told["value"]) == ("switched off", LATE)
    assert "latency-left" in {note.code for note in result.notes}
    silent = given(DIRECT).changed({"sensors.latency": "0 s"})
    other = identify(late_log("calibrate"), silent, method)
    assert other.inertia.value == pytest.approx(result.inertia.value, rel=1e-12)


@pytest.mark.parametrize("late", [2e-3, -1.3e-3])
def test_a_held_torque_is_moved_on_the_grid_as_a_measured_one(late):
    """The mean over a row of a held torque, on the clock of an angle that is read `late` after it."""
    log = late_log()
    encoders = Encoders.of(DIRECT).with_latency("angle", late, None)
    inner = slice(100, -100)
    motion = find_motion(log.time, log.angle, 0.0)
    found = even_grid(Signals.of(log, DIRECT, motion, encoders)).torque[inner]
    expected = np.interp(log.time + late - 0.5e-3, log.time, log.torque)[inner]  # a held value lags by half a row
    assert np.abs(found - expected).max() < 2e-3 * np.abs(log.torque).max()


# Decided once


def test_preparing_twice_changes_nothing():
    rig = given(DIRECT).changed({"sensors.nonlinearity_cosine": "1 mrad"})
    once = prepare(late_log(), rig)
    twice = prepare(once.log, rig)
    assert twice.log is once.log
    assert twice.corrections == once.corrections
    assert {one.kind for one in once.corrections} == {"latency", "nonlinearity_cosine"}
    assert not np.array_equal(once.log.angle, late_log().angle)


def test_a_switch_is_honest():
    """Nothing of the angles is moved; the latency that is left for methods to take off is 0, its uncertainty stays."""
    off = prepare(late_log("latency"), given(DIRECT))
    assert np.array_equal(off.log.angle, late_log().angle)
    assert (off.encoders.angle.latency.value, off.encoders.angle.latency.std) == (0.0, 1e-5)
    bent = given(DIRECT).changed({"sensors.nonlinearity_cosine": "1 mrad"})
    kept = prepare(late_log("encoders"), bent)
    assert np.array_equal(kept.log.angle, late_log().angle)
    assert [one.origin for one in kept.corrections] == ["stated", "switched off"]


def test_the_used_part_and_the_noise_are_in_the_provenance():
    result = identify(late_log(), given(DIRECT), "equation-error")
    told = result.provenance["preparation"]
    assert told["part"] == [result.details.start, result.details.stop]
    assert told["noise"]["angle"] >= 2 * np.pi / 16384 / np.sqrt(12)
    assert told["noise"]["wheel"] is None


def test_no_method_reads_the_sensors_of_the_rig():
    """They read `Prepared` and `Encoders`, where what is switched off is not seen."""
    folders = ("methods", "recursive", "batch", "balance", "checks")
    for path in (one for folder in folders for one in (SOURCES / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not (isinstance(node, ast.Attribute) and node.attr == "sensors"), f"{path}:{node.lineno}"


def test_a_stream_of_a_recording_corrects_a_latency_unless_that_is_switched_off():
    rig, exact = given(DIRECT), given(DIRECT).changed({"sensors.latency": {"value": 0.0, "std": 1e-5}})
    last = [
        list(swingid.online(of, late_log(*off)))[-1].inertia
        for of, off in ((rig, ()), (rig, ("latency",)), (exact, ()))
    ]
    assert last[1].value == last[2].value
    assert abs(last[0].value / INERTIA - 1) < 1e-3 < abs(last[1].value / INERTIA - 1)


# Many logs at once


def test_many_logs_at_once_take_a_stated_latency_off():
    late = {"latency": "1 ms", "wheel": {"latency": "3 ms"}}
    rig = twin("8 x viscous", counts_per_turn=None, **late)
    runs = simulate_ensemble(rig, lambda t: 0.8 * np.sin(8.5 * t), duration=15.0, seeds=range(4), record="all")
    plan = plan_batch([runs.recording(k) for k in (0, 3)], given(rig))
    silent = given(PAPER)
    channels = [runs.channel(name) for name in ("angle", "wheel_angle", "command")]
    for estimator, read in ((momentum_batch, channels[:2]), (energy_batch, channels)):
        found = estimator(*read, 1000.0, given(rig), plan)
        as_read = estimator(*read, 1000.0, silent, plan)
        assert np.abs(found.inertia / INERTIA - 1).max() < 5e-4
        assert np.abs(as_read.inertia / INERTIA - 1).min() > 3e-3
        off = plan_batch([without(runs.recording(k), "latency") for k in (0, 3)], given(rig))
        assert np.array_equal(estimator(*read, 1000.0, given(rig), replace(plan, latency=off.latency)).u, as_read.u)
    with pytest.raises(InputError) as caught:
        plan_batch([runs.recording(0), without(runs.recording(3), "latency")], given(rig))
    assert caught.value.code == "not-for-batches"
    one = identify(runs.recording(0), given(rig))
    batch = momentum_batch(*channels[:2], 1000.0, given(rig), plan)
    assert batch.inertia[0] == pytest.approx(one.inertia.value, rel=1e-4)


# More pushes than are left out

STRIBECK = twin("Stribeck", counts_per_turn=16384)


def pushed(count: int):
    """A closed loop of 40 s with so many pushes by hand, of half of the gravity torque, from the 8th second on."""
    time = np.arange(40_001) / 1000
    push = np.zeros(len(time))
    for at in 8.0 + 4.3 * np.arange(count):
        share = (time - at) / 0.3
        push += np.where((share > 0) & (share < 1), 0.5 * 78e-3 * np.sin(np.pi * share), 0.0)
    controller = Compensator.paper(STRIBECK, sample_time=1e-3)
    reference = parse_reference("sine 0.8 rad 8.5 rad/s")
    return simulate(STRIBECK, reference, controller, duration=40.0, rate=1000.0, seed=1, push=push)


def test_six_pushes_are_left_out_and_seven_are_named():
    log, rig = pushed(6), given(STRIBECK)
    six = prepare(log, rig)
    assert [one.origin for one in six.corrections] == ["found"] * 6
    assert len(six.log.left_out) == 6
    starts = [one.start for one in six.corrections]
    assert starts == pytest.approx(list(8.0 + 4.3 * np.arange(6)), abs=0.3)
    log = pushed(7)
    seven = prepare(log, rig)
    assert len(seven.log) == len(log)
    assert [one.origin for one in seven.corrections] == ["switched off"] * 7
    result = identify(log, rig)
    (warning,) = [one for one in result.warnings if one.code == "push-left"]
    assert "7 times" in warning.message
    assert len(result.provenance["preparation"]["corrections"]) == 7


def test_a_prediction_leaves_pushes_out_too():
    log, rig = pushed(2), given(STRIBECK)
    result = identify(log, rig, "output-error")
    (prediction,) = validate(result, log, rig).predictions
    outside = [(one["start"], one["stop"]) for one in result.provenance["preparation"]["corrections"]]
    assert len(outside) == 2
    assert not any(((prediction.time > a + 1e-9) & (prediction.time < b - 1e-9)).any() for a, b in outside)
