"""Late channels: what the momentum balance makes of them beyond first order, and the voltage's latency in inspect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from closed_form_logs import INERTIA, ONE_TONE, TWO_TONES, direct_log, direct_rig, exact_rig, wheel_log
from long_cases import quick_first
from swingid.identification import identify
from swingid.recording.recording import Recording
from swingid.study.inspect import inspect_log
from twin_logs import PAPER, given, logged, twin, without

TIME = np.arange(12_001) / 1000
DECLARED = {"sensors.wheel.latency": "0 ± 5 ms"}


def friction(v):
    return 5e-4 * v + 3e-3 * np.sign(v)


def late(log: Recording, delay: float) -> Recording:
    """The wheel as read `delay` seconds late, exactly."""
    inner = slice(20, -20)
    wheel = CubicSpline(log.time, log.wheel_angle)(log.time + delay)
    return Recording(time=log.time[inner], angle=log.angle[inner], wheel_angle=wheel[inner])


@pytest.fixture(scope="module", params=[ONE_TONE, TWO_TONES], ids=["one tone", "two tones"])
def log(request):
    return wheel_log(exact_rig(), request.param, friction, TIME)


def codes(messages) -> list[str]:
    return [message.code for message in messages]


@pytest.mark.parametrize("delay", [5e-3, -5e-3])
def test_a_declared_latency_is_right_beyond_first_order(log, delay):
    # (ω δ)²/2 is 0.1 % at 8.5 rad/s
    result = identify(late(log, delay), exact_rig(**DECLARED))
    assert result.inertia.value == pytest.approx(INERTIA, rel=2e-5)
    assert result.status == "ok"
    told = next(note.message for note in result.notes if note.code == "latency-told")
    assert float(told.split("(")[1].split(" ±")[0]) == pytest.approx(1e3 * delay, abs=0.1)


@pytest.mark.parametrize("delay", [5e-3, -5e-3])
def test_a_latency_that_nobody_declared_is_named(log, delay):
    result = identify(without(late(log, delay), "calibrate"), exact_rig())
    assert abs(result.inertia.value / INERTIA - 1) > 2e-4
    message = next(one.message for one in result.warnings if one.code == "late-channel")
    assert "sensors.wheel.latency" in message
    assert float(message.split("(")[1].split(" ±")[0]) == pytest.approx(1e3 * delay, abs=0.1)


@pytest.mark.parametrize("method", quick_first(1, ["equation-error", "output-error"]))
def test_every_method_names_a_late_channel_as_momentum_does(log, method):
    known = without(late(log, 5e-3), "calibrate")
    message, same = (
        next(one.message for one in identify(known, exact_rig(), which).warnings if one.code == "late-channel")
        for which in (method, "momentum")
    )
    assert message == same
    assert "late-channel" not in codes(identify(log, exact_rig(), method).warnings)


def test_a_late_angle_of_a_direct_drive():
    delay = 5e-3
    log = replace(direct_log(TWO_TONES, friction, TIME), angle=TWO_TONES(TIME + delay))
    assert "late-channel" in codes(identify(without(log, "calibrate"), direct_rig()).warnings)
    told = identify(log, direct_rig(**{"sensors.latency": "0 ± 5 ms"}))
    assert told.inertia.value == pytest.approx(INERTIA, rel=1e-4)
    assert told.status == "ok"


def test_channels_in_time_are_left_alone(log):
    assert identify(log, exact_rig()).status == "ok"
    result = identify(log, exact_rig(**DECLARED))
    assert result.status == "ok"
    assert "latency-told" not in codes(result.notes)


def test_a_latency_that_a_noisy_log_cannot_tell():
    noisy = wheel_log(exact_rig(), ONE_TONE, friction, TIME[:6001])
    scatter = np.random.default_rng(3).normal(0, 5e-3, (2, len(noisy)))
    noisy = replace(noisy, angle=noisy.angle + scatter[0], wheel_angle=noisy.wheel_angle + scatter[1])
    result = identify(noisy, exact_rig(**{"sensors.wheel.latency": "0 ± 30 ms"}))
    assert "latency-squared" in codes(result.warnings)


@pytest.mark.parametrize("delay", quick_first(2, [0.0, 2.0, -2.0]))
def test_inspect_finds_when_the_voltage_acts(tmp_path, delay):
    rig = twin("viscous", latency=f"{delay} ms")
    known = given(twin("viscous"))
    run = logged(rig, tmp_path, duration=15.0)
    found = inspect_log(run.source.path, known)
    values = found.check("voltage-latency").values
    assert abs(values["latency"] - 1e-3 * delay) < 3 * values["uncertainty"]
    assert values["uncertainty"] < 2e-4
    assert found.check("voltage-latency").level == ("note" if delay else "ok")
    assert found.check("latency").level == "ok"  # both angles are late alike
    assert found.verdict.status == "ready"


def test_no_voltage_tells_no_latency(tmp_path):
    known = given(PAPER)
    run = replace(logged(PAPER, tmp_path, duration=8.0), voltage=None)
    found = inspect_log(run.save(tmp_path / "without.parquet", known), known)
    assert found.check("voltage-latency") is None


@pytest.mark.parametrize("method", quick_first(1, ["momentum", "energy", "equation-error"]))
def test_a_stated_latency_is_named_and_has_a_switch(tmp_path, method):
    """Switched off, the result is that of a rig file that states no latency."""
    stated = PAPER.changed({"sensors.wheel.latency": "2 ms", "sensors.latency": "0.3 ms"})
    path = logged(stated, tmp_path, duration=10.0, seed=1).source.path
    known = given(stated)
    right = identify(Recording.load(path, known), known, method)
    (named,) = right.provenance["repairs"]
    assert (named["repair"], named["done"]) == ("latency", True)
    assert "0.3 ms of the angle and 2 ms of the wheel's angle" in named["what"]
    off = identify(Recording.load(path, known, repairs={"latency": False}), known, method)
    repairs = {one["repair"]: one["done"] for one in off.provenance["repairs"]}
    assert repairs["latency"] is False
    silent = given(PAPER)
    other = identify(Recording.load(path, silent), silent, method)
    assert abs(off.inertia.value - other.inertia.value) < 0.05 * abs(off.inertia.value - right.inertia.value) + 3e-8
    if method != "momentum":  # which finds the latency itself
        assert abs(off.inertia.value / right.inertia.value - 1) > 1e-4
