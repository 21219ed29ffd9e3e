"""Propagation of distributions: known ones come out, every declared source is drawn, a linear budget agrees."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import factories
import swingid as sw
from swingid.cli.app import run
from swingid.errors import UnanswerableError, UsageError
from swingid.report.measurement import render
from swingid.result.result import Parameter, Result
from swingid.study import monte_carlo as study
from swingid.study.monte_carlo import Draw, Experiment, distributed, monte_carlo, uncertain_constants
from swingid.uncertainty.budget import BudgetEntry, Source, scatter, stated, systematic

RIG = """
name = "bench"
[axis]
gravity_torque = "0.08 ± 0.008 N*m"
tilt = "0 ± 2 deg"
[drive]
kind = "reaction-wheel"
[drive.wheel]
inertia = "1.1e-4 ± 1e-6 kg*m^2"
tilt = 0
[drive.motor]
rotor_inertia = 0
gear_ratio = 4.4
torque_per_volt = "5e-3 ± 1e-4 N*m/V"
[sensors]
latency = "0 ± 0.5 ms"
nonlinearity = "0.1 deg"
[log]
clock = "0 ± 200 ppm"
voltage_scale = "1 ± 0.01"
"""


def log() -> sw.Recording:
    time = np.arange(2001) / 1000
    angle = 0.5 * np.sin(8 * time)
    return sw.Recording(time=time, angle=angle, wheel_angle=-10 * angle, voltage=np.cos(8 * time))


def result(u: float, *budget: BudgetEntry, value: float = 6.4e-3) -> Result:
    provenance: dict[str, object] = {"preparation": {"noise": {"angle": 1e-3, "wheel": 0.0}}}
    return Result("fake", "ok", {"inertia": Parameter.of(value, u, "kg m^2")}, budget=budget, provenance=provenance)


def fake(monkeypatch: pytest.MonkeyPatch, of: Any) -> None:
    def identify(recording: sw.Recording, rig: sw.Rig, method: str, **options: object) -> Result:
        return Result("fake", "ok", {"inertia": Parameter.of(of(recording, rig), 1e-6, "kg m^2")})

    monkeypatch.setattr(study, "identify", identify)


def test_the_shortest_interval_of_an_exponential_sample_begins_at_zero() -> None:
    """Of exp(−x) it is [0, −ln 0.05]; the symmetric one would be [0.025, 3.69]."""
    values = np.random.default_rng(2).permutation(-np.log1p(-(np.arange(20000) + 0.5) / 20000))
    found = distributed(values, (-0.96, 2.96), 1.0)
    assert found.interval95 == pytest.approx((0.0, -math.log(0.05)), abs=0.01)
    assert found.symmetric95 == pytest.approx((-math.log(0.975), -math.log(0.025)), abs=0.01)
    assert found.mean == pytest.approx(1.0, abs=1e-3)
    assert found.standard_uncertainty == pytest.approx(1.0, abs=0.01)
    assert found.agrees is False


def test_agreement_is_decided_by_the_last_place_and_by_the_number_of_draws() -> None:
    generator = np.random.default_rng(1)
    u = 3e-6  # δ = 0.5e-6
    values = generator.normal(0, u, 40000)
    assert distributed(values, (-1.96 * u, 1.96 * u), u).agrees is True
    assert distributed(values, (-2.4 * u, 2.4 * u), u).agrees is False
    assert distributed(values[:200], (-1.96 * u, 1.96 * u), u).agrees is None
    assert distributed(values, (-1.96 * u, 1.96 * u), u).tolerance == pytest.approx(0.5e-6)


def test_the_constants_that_are_drawn_are_those_with_an_uncertainty() -> None:
    found = uncertain_constants(sw.Rig.from_text(RIG))
    keys = {"axis.gravity_torque", "axis.tilt", "drive.wheel.inertia", "drive.motor.torque_per_volt"}
    assert set(found) == keys | {"log.clock", "log.voltage_scale"}
    text = factories.FREE + '[axis.cogging]\namplitude = "1 ± 0.1 mN*m"\norder = 6\nphase = "0 ± 0.1 rad"\n'
    assert {"axis.cogging.amplitude", "axis.cogging.phase"} <= set(uncertain_constants(sw.Rig.from_text(text)))


def test_a_square_has_the_mean_and_the_spread_of_a_square(monkeypatch: pytest.MonkeyPatch) -> None:
    """J = b² with b = 0.08 ± 0.008: E = b² + σ², variance 4 b² σ² + 2 σ⁴, 95 % by the normal quantiles of b."""
    fake(monkeypatch, lambda recording, rig: rig.axis.gravity_torque.value**2)
    rig, b, s = sw.Rig.from_text(RIG), 0.08, 0.008
    linear = result(2 * b * s, BudgetEntry(stated("b", "axis.gravity_torque"), "inertia", 2 * b * s, 2 * b))
    found = monte_carlo(log(), rig, "fake", linear, 1200, workers=1).monte_carlo
    assert found is not None
    one = found.parameters["inertia"]
    spread = math.sqrt(4 * b**2 * s**2 + 2 * s**4)
    assert one.mean == pytest.approx(b**2 + s**2, abs=4 * spread / math.sqrt(1200))
    assert one.standard_uncertainty == pytest.approx(spread, rel=0.1)
    assert (found.draws, found.answered, found.refusals) == (1200, 1200, {})


def test_what_is_not_drawn_is_added_by_its_distribution(monkeypatch: pytest.MonkeyPatch) -> None:
    fake(monkeypatch, lambda recording, rig: 6.4e-3)
    budget = (
        BudgetEntry(systematic("grid", "rectangular"), "inertia", 3e-6),
        BudgetEntry(scatter("scatter of the windows"), "inertia", 4e-6),
        BudgetEntry(stated("b", "axis.gravity_torque"), "inertia", 9e-6, 1.0),  # drawn, so not added
        BudgetEntry(Source("angle latency", "B", "sensors.latency"), "inertia", 9e-6, 1.0),
    )
    found = monte_carlo(log(), sw.Rig.from_text(RIG), "fake", result(1e-5, *budget), 1200, workers=1).monte_carlo
    assert found is not None
    assert found.parameters["inertia"].standard_uncertainty == pytest.approx(5e-6, rel=0.1)


def test_the_sensors_noise_is_not_counted_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """The method turns the noise into 3e-6, the budget's scatter is 5e-6: what is added is 4e-6."""
    weight = 3e-6 / (1e-3 / math.sqrt(2001))
    clean = log().angle
    fake(monkeypatch, lambda recording, rig: 6.4e-3 + weight * float(np.mean(recording.angle - clean)))
    rig = sw.Rig.from_text(
        RIG.replace('latency = "0 ± 0.5 ms"\nnonlinearity = "0.1 deg"', "noise = 0\nlatency = 0\nnonlinearity = 0")
    )
    linear = result(5e-6, BudgetEntry(scatter("scatter of the windows"), "inertia", 5e-6))
    found = monte_carlo(log(), rig, "fake", linear, 1200, workers=1).monte_carlo
    assert found is not None
    assert found.parameters["inertia"].standard_uncertainty == pytest.approx(5e-6, rel=0.1)


def test_a_draw_changes_readings_clock_and_scales_as_declared() -> None:
    rig = sw.Rig.from_text(RIG)
    own = log()
    experiment = Experiment(own, rig, "momentum", {}, (1e-3, 0.0), uncertain_constants(rig))

    def drawn(**units: float) -> sw.Recording:
        return experiment._log(Draw({key.replace("__", "."): one for key, one in units.items()}, None))

    assert np.array_equal(drawn().angle, own.angle)
    late = drawn(sensors__angle__latency=1.0).angle
    inside = slice(100, -100)
    assert late[inside] == pytest.approx((0.5 * np.sin(8 * (own.time - 0.5e-3)))[inside], abs=1e-7)
    bent = drawn(sensors__angle__sine=-2.0).angle
    assert bent == pytest.approx(own.angle - 2 * math.radians(0.1) * np.sin(own.angle))
    assert drawn(log__clock=1.0).time == pytest.approx(own.time * 1.0002)
    volts = drawn(log__voltage_scale=3.0).voltage
    assert own.voltage is not None
    assert volts == pytest.approx(1.03 * own.voltage)
    noisy = experiment._log(Draw({}, 7))
    assert np.std(noisy.angle - own.angle) == pytest.approx(1e-3, rel=0.1)
    tilted = experiment._rig(Draw({"axis.tilt": 1.5, "drive.wheel.inertia": 2.0}, None))
    assert tilted.axis.tilt.value == pytest.approx(math.radians(3))
    assert tilted.axis.tilt.std is None
    assert tilted.drive.wheel is not None
    assert tilted.drive.wheel.inertia.value == pytest.approx(1.12e-4)


def test_refused_draws_are_counted_and_too_many_refuse(monkeypatch: pytest.MonkeyPatch) -> None:
    def sometimes(share: float) -> Any:
        def of(recording: sw.Recording, rig: sw.Rig) -> float:
            if abs(recording.angle[0] * 1e6) % 1 < share:
                raise UnanswerableError("no", code="not-identifiable")
            return 6.4e-3

        return of

    rig = sw.Rig.from_text(RIG)
    fake(monkeypatch, sometimes(0.2))
    found = monte_carlo(log(), rig, "fake", result(1e-6), 400, workers=1).monte_carlo
    assert found is not None
    assert 40 < found.refusals["not-identifiable"] < 140
    assert found.answered == 400 - found.refusals["not-identifiable"]
    fake(monkeypatch, sometimes(0.8))
    with pytest.raises(UnanswerableError, match="not-identifiable"):
        monte_carlo(log(), rig, "fake", result(1e-6), 400, workers=1)
    with pytest.raises(UsageError) as caught:
        monte_carlo(log(), rig, "fake", result(1e-6), 10)
    assert caught.value.code == "few-draws"


def test_summary_json_and_report_have_the_distribution(monkeypatch: pytest.MonkeyPatch) -> None:
    fake(monkeypatch, lambda recording, rig: rig.axis.gravity_torque.value * 0.08)
    entry = BudgetEntry(stated("b", "axis.gravity_torque"), "inertia", 6.4e-4, 0.08)
    found = monte_carlo(log(), sw.Rig.from_text(RIG), "fake", result(6.4e-4, entry), 400, workers=1)
    assert "400 of 400 draws" in found.summary()
    data = json.loads(found.to_json())["monte_carlo"]
    assert data["draws"] == 400
    assert len(data["parameters"]["inertia"]["values"]) == 400
    assert set(data["parameters"]["inertia"]) >= {"interval95", "agrees", "tolerance", "standard_uncertainty"}
    page = render(replace(found, method="momentum"), None, None)
    assert '<section id="distributions">' in page
    assert "Distribution of the inertia by random draws" in page
    assert "monte_carlo" not in json.loads(result(1e-6).to_json())


def test_the_command_takes_one_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["identify", "a.csv", "b.csv", "--rig", "paper", "--monte-carlo", "200"]) == 2
    assert "one log" in capsys.readouterr().err


@pytest.mark.long
def test_the_linear_budget_of_momentum_agrees_with_the_draws() -> None:
    """Gravity torque and wheel inertia enter nearly linearly, so both give the same."""
    rig = sw.Rig.load("paper").changed(
        {"axis.gravity_torque": "78e-3 ± 1e-4", "drive.wheel.inertia": "11.34e-5 ± 3e-7"}
    )
    motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    own = sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=15.0, rate=1000.0, seed=1)
    linear = sw.identify(own, rig)
    found = monte_carlo(own, rig, "momentum", linear, 400).monte_carlo
    assert found is not None
    one = found.parameters["inertia"]
    u = linear["inertia"].standard_uncertainty
    assert u is not None
    assert one.standard_uncertainty == pytest.approx(u, rel=0.15)
    assert one.mean == pytest.approx(linear["inertia"].value, abs=0.2 * u)
    assert one.agrees is not False
