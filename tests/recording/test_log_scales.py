"""Scale and zero of a logged channel in [log]: how they are read, and what their uncertainty does to the inertia.

Closed forms: without gravity a11 q'' is the torque, so an angle that is logged too large by ε lowers the inertia and
the viscous friction by ε; a wheel's angle that is raises the inertia of the whole axis by ε; a free decay of small
swings does not depend on the scale, for its period does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from swingid.errors import InputError

DIRECT = """
name = "bench"
[axis]
gravity_torque = {b}
inertia = 0.01
friction = {{viscous = 0.02}}
model_uncertainty = 0
[drive]
kind = "{kind}"
[sensors]
nonlinearity = 0
latency = 0
noise = 1e-5
[log]
clock = "0 ± 0 ppm"
"""


def rig(b: float = 0.0, kind: str = "direct", **log: object) -> sw.Rig:
    return sw.Rig.from_text(DIRECT.format(b=b, kind=kind)).changed({f"log.{key}": value for key, value in log.items()})


@pytest.fixture(scope="module")
def driven() -> sw.Recording:
    t = np.arange(2401) / 200
    torque = 0.05 * np.sin(5 * t) + 0.05 * np.sin(9 * t + 1)
    return sw.simulate(rig(), duration=12.0, rate=200, seed=1, drive=torque)


def entry(result: sw.Result, source: str, parameter: str = "inertia") -> float:
    """Relative change of a parameter per unit of a source."""
    slope = next((e.sensitivity for e in result.budget if (e.source, e.parameter) == (source, parameter)), 0.0)
    assert slope is not None
    return slope / result.parameters[parameter].value


def test_a_potentiometer_in_volts_reads_as_its_angle() -> None:
    volts = {"t": np.arange(40) / 20, "q1": 2.47 + np.sin(np.arange(40) / 3)}
    by_zero = sw.Recording.from_columns(volts, rig(0.1, "none", angle_scale="61.3 ± 0.2 deg/V", angle_zero=2.47))
    assert by_zero.angle == pytest.approx(np.radians(61.3) * (volts["q1"] - 2.47))
    offset = f"{-61.3 * 2.47} ± 0.5 deg"
    by_offset = sw.Recording.from_columns(volts, rig(0.1, "none", angle_scale="61.3 deg", angle_offset=offset))
    assert by_offset.angle == pytest.approx(by_zero.angle)
    by_unit = rig(0.1, "none", angle_unit="deg", angle_scale=61.3, angle_zero=2.47)
    assert sw.Recording.from_columns(volts, by_unit).angle == pytest.approx(by_zero.angle)


def test_pulse_width_reads_as_volts() -> None:
    wheel = sw.Rig.load("paper").changed({"log.voltage_scale": "9 V / 255", "log.voltage_sign": -1})
    columns = {name: np.sin(np.arange(40) / 3) for name in ("q1", "q2")} | {"t": np.arange(40) / 20}
    log = sw.Recording.from_columns(columns | {"u": np.linspace(-255, 255, 40)}, wheel)
    assert log.voltage == pytest.approx(np.linspace(9, -9, 40))


def test_a_saved_log_keeps_its_scale(tmp_path) -> None:
    potentiometer = rig(0.1, "none", angle_scale="61.3 ± 0.2 deg", angle_zero=2.47)
    log = sw.Recording(np.arange(40) / 20, np.sin(np.arange(40) / 3))
    path = log.save(tmp_path / "log.csv", potentiometer)
    assert sw.Recording.load(path, potentiometer).angle == pytest.approx(log.angle)
    with pytest.raises(InputError, match="angle_scale"):
        sw.Recording.load(path, rig(0.1, "none", angle_zero=2.47))


@pytest.mark.parametrize("method", ["momentum", "equation-error", "energy", "output-error"])
def test_without_gravity_the_inertia_is_inverse_to_the_scale_of_the_angle(driven: sw.Recording, method: str) -> None:
    result = sw.identify(driven, rig(angle_scale="1 ± 0.01"), method=method)
    assert entry(result, "log.angle_scale") == pytest.approx(-1.0, abs=2e-3)
    inertia = result.parameters["inertia"]
    assert inertia.standard_uncertainty == pytest.approx(0.01 * inertia.value, rel=0.05)
    if "viscous" in result.parameters:
        assert entry(result, "log.angle_scale", "viscous") == pytest.approx(-1.0, abs=0.1)


@pytest.mark.parametrize("method", ["momentum", "equation-error", "output-error"])
def test_an_interval_holds_the_true_inertia_of_an_angle_of_wrong_scale(driven: sw.Recording, method: str) -> None:
    wrong = replace(driven, angle=1.015 * driven.angle)
    exact = sw.identify(wrong, rig(), method=method).inertia
    assert not exact.interval95[0] < 0.01 < exact.interval95[1]
    stated = sw.identify(wrong, rig(angle_scale="1 ± 0.01"), method=method).inertia
    assert stated.interval95[0] < 0.01 < stated.interval95[1]


def test_a_free_decay_of_small_swings_does_not_depend_on_the_scale() -> None:
    log = sw.simulate(rig(0.5, "none"), duration=12.0, rate=200, seed=1, initial_angle=0.1)
    result = sw.identify(log, rig(0.5, "none", angle_scale="1 ± 0.01"))
    assert entry(result, "log.angle_scale") == pytest.approx(0.0, abs=2e-3)
    assert entry(result, "log.angle_scale", "viscous") == pytest.approx(0.0, abs=2e-2)


def test_the_scale_of_a_wheel_raises_the_whole_axis() -> None:
    paper = sw.Rig.load("paper").changed({"axis.gravity_torque": 0})
    log = sw.simulate(paper, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=10.0, rate=500, seed=1)
    result = sw.identify(log, paper.changed({"log.wheel_scale": "1 ± 0.002", "log.angle_scale": "1 ± 0.001"}))
    whole = 1 + paper.drive.carried / result.inertia.value
    assert entry(result, "log.wheel_scale") == pytest.approx(whole, rel=1e-3)
    assert entry(result, "log.angle_scale") == pytest.approx(-whole, rel=1e-3)


def test_the_scale_of_the_voltage_acts_as_the_torque_per_volt() -> None:
    paper = sw.Rig.load("paper").changed({"drive.motor.torque_per_volt": "0.00395 ± 1 %"})
    log = sw.simulate(paper, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=10.0, rate=500, seed=1)
    result = sw.identify(log, paper.changed({"log.voltage_scale": "1 ± 0.01 V"}), method="energy")
    u = {e.source: e.standard_uncertainty for e in result.budget if e.parameter == "inertia"}
    assert u["log.voltage_scale"] == pytest.approx(u["drive.motor.torque_per_volt"], rel=1e-9)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"angle_scale": "61 deg", "angle_unit": "deg"}, "log.angle_unit is given beside an angle_scale with a unit"),
        ({"angle_offset": "1 deg", "angle_zero": 3}, "log.angle_offset is given beside angle_zero"),
        ({"angle_scale": 0}, "log.angle_scale is 0, but must be positive"),
        ({"angle_scale": "61 kg"}, "log.angle_scale is given in 'kg', but is expected in rad"),
        ({"angle_scale": "61 deg/kg"}, "log.angle_scale"),
        ({"voltage_scale": 0.05}, "log.voltage_scale is given, but drive.kind is 'none'"),
    ],
)
def test_contradictions_are_named(keys: dict[str, object], says: str) -> None:
    with pytest.raises(InputError) as problem:
        rig(0.1, "none", **keys)
    assert says in str(problem.value)
