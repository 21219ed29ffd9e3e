"""Bodies that spin without turning points: coast-downs with and without a known body, torque steps, ratios."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import swingid as sw
from refusals import coded
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.uncertainty.budget import Parameter

TEXT = """
name = "wheel"
[axis]
gravity_torque = 0
inertia = {inertia}
model_uncertainty = 0
[axis.friction]
coulomb = {coulomb}
viscous = 2e-6
quadratic = 1.5e-8
[drive]
kind = "{drive}"
[sensors]
nonlinearity = 0
latency = 0
counts_per_turn = {counts}
[log]
clock = 0
{log}
"""

J, RING, FC = 1.134e-4, 1.2e-4, 2e-4
"""The paper's reaction wheel, a ring to put on it, and the Coulomb friction of its bearing."""


def wheel(inertia: float = J, counts: int = 64, drive: str = "none", coulomb: float = FC, log: str = "") -> sw.Rig:
    """The wheel of the tests on its motor, the bridge open."""
    return sw.Rig.from_text(TEXT.format(inertia=inertia, counts=counts, drive=drive, coulomb=coulomb, log=log))


def coast(seed: int, added: float = 0.0, *, coulomb: float = FC, seconds: float = 45.0) -> sw.Recording:
    """A coast-down from 135 to 165 rad/s by an encoder of 64 counts."""
    rng = np.random.default_rng(seed)
    rig = wheel(J + added, coulomb=coulomb)
    begin = {"initial_speed": rng.uniform(135, 165), "initial_angle": rng.uniform(0, 2 * np.pi)}
    return sw.simulate(rig, duration=seconds, rate=200.0, seed=seed, **begin)


def covers(parameter: Parameter, true: float) -> bool:
    """Whether the interval contains the true value."""
    assert parameter.interval95 is not None
    return parameter.interval95[0] <= true <= parameter.interval95[1]


def test_two_coast_downs_with_and_without_a_ring_give_inertia_and_drag() -> None:
    result = sw.identify([coast(1), coast(2, RING)], wheel(), added=[0, RING])
    assert result.status == "ok"
    assert result.inertia.value == pytest.approx(J, rel=5e-4)
    for name, true in (("inertia", J), ("coulomb", FC), ("viscous", 2e-6), ("quadratic", 1.5e-8)):
        assert covers(result.parameters[name], true), name
    assert any(n.code == "common-friction" and "repeat a log with the same body" in n.message for n in result.notes)


@pytest.mark.long
def test_intervals_of_two_coast_downs_cover() -> None:
    """100 pairs of logs, 64 counts per turn: every error below 0.1 %, 0.01 % in the mean, 90 % and more covered."""
    errors, covered = [], []
    for seed in range(100):
        found = sw.identify([coast(2 * seed), coast(2 * seed + 1, RING)], wheel(), added=[0, RING])
        errors.append(found.inertia.value / J - 1)
        covered.append([covers(found.inertia, J), covers(found.parameters["coulomb"], FC)])
    assert np.max(np.abs(errors)) < 1e-3
    assert np.sqrt(np.mean(np.square(errors))) < 1e-4
    assert np.all(np.mean(covered, axis=0) >= 0.9)


def test_the_uncertainty_of_the_ring_is_that_of_the_inertia() -> None:
    """J is proportional to what was added: 0.2 % of the ring are 0.2 % of the wheel."""
    result = sw.identify([coast(1), coast(2, RING)], wheel(), added=[0, f"{RING} ± 0.2 % kg*m^2"])
    entry = next(e for e in result.budget if e.source.startswith("added body") and e.parameter == "inertia")
    assert entry.type == "B"
    assert entry.standard_uncertainty == pytest.approx(2e-3 * J, rel=0.01)


def test_drag_that_differs_between_logs_shows_in_repeated_ones_and_widens_the_interval() -> None:
    """2 % more Coulomb friction in one log of four: an error beyond the sensors', which repetitions reveal."""
    logs = [coast(1), coast(2, RING), coast(3, coulomb=1.02 * FC), coast(4, RING)]
    even = sw.identify([coast(1), coast(2, RING), coast(3), coast(4, RING)], wheel(), added=[0, RING, 0, RING])
    result = sw.identify(logs, wheel(), added=[0, RING, 0, RING])
    source = "friction that differs between logs"
    drag = next(e.standard_uncertainty for e in result.budget if e.source == source and e.parameter == "inertia")
    assert 2e-3 * J < drag < 3e-2 * J
    assert covers(result.inertia, J)
    assert not any(e.source == source and e.standard_uncertainty > 3e-4 * J for e in even.budget)


def test_one_coast_down_gives_friction_over_inertia_and_says_what_gives_kg_m2() -> None:
    result = sw.identify(coast(5), wheel())
    assert result.ratios
    for name, true in (("coulomb", FC), ("viscous", 2e-6), ("quadratic", 1.5e-8)):
        assert covers(result.parameters[f"{name}/inertia"], true / J), name
    assert result.parameters["coulomb/inertia"].value == pytest.approx(FC / J, rel=5e-3)
    assert result.parameters["coulomb/inertia"].unit == "rad/s^2"
    assert any(note.code == "no-scale" and "--added" in note.message for note in result.notes)


@pytest.mark.parametrize("width", [10.0, 20.0])
@pytest.mark.parametrize("share", [0.05, 0.1])
def test_friction_of_another_law_widens_the_interval(width: float, share: float) -> None:
    """Dry friction that rises by twice `share` about 70 rad/s, which no term of the fit describes."""

    def slowed(_: float, state: np.ndarray) -> list[float]:
        torque = FC * (1 + share * np.tanh((state[1] - 70) / width)) + 2e-6 * state[1]
        return [state[1], -torque / J if state[1] > 0.5 else 0.0]

    time, step = np.arange(0, 55, 1 / 200), 2 * np.pi / 1024
    found = solve_ivp(slowed, (0, 55), [0, 150], t_eval=time, rtol=1e-10, atol=1e-10)
    log = sw.Recording(time=time, angle=np.round(found.y[0] / step) * step).segment(
        0.0, float(time[found.y[1] > 5][-1])
    )
    result = sw.identify(log, wheel(counts=1024))
    assert covers(result.parameters["coulomb/inertia"], FC * (1 - share) / J)


def test_what_is_before_the_greatest_speed_is_not_used() -> None:
    """A hand spins the wheel up for 5 s; its torque is not part of the model."""
    log = coast(6)
    ramp = np.arange(0, 5, 0.005)
    speed = (log.angle[1] - log.angle[0]) / 0.005
    up = speed * ramp**2 / 10
    shifted = log.angle + up[-1] + speed * 0.005 - log.angle[0]
    spun = sw.Recording.from_columns(
        {"t": np.concatenate([ramp, log.time + 5.0]), "q1": np.concatenate([up, shifted])}, wheel()
    )
    result = sw.identify(spun, wheel())
    assert result.details is not None
    assert 4.9 < result.details.start < 12.0
    assert covers(result.parameters["coulomb/inertia"], FC / J)


@pytest.mark.parametrize("seed", range(3))
def test_torque_steps_that_turn_in_one_direction_give_the_inertia(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rig = wheel(drive="direct", counts=4096, log="torque_gain = 1")
    torque = np.repeat(rng.uniform(0.0, 2e-3, 8), 501)[:4001]
    result = sw.identify(sw.simulate(rig, drive=torque, duration=20.0, rate=200.0, seed=seed), rig)
    assert result.inertia.value == pytest.approx(J, rel=1e-4)
    assert result.details is not None
    assert len(result.details.turning_times) == 0


def test_a_torque_of_the_wrong_sign_is_named() -> None:
    rig = wheel(drive="direct", counts=4096, log="torque_gain = 1")
    log = sw.simulate(rig, drive=np.repeat([0.0, 2e-3, 1e-3, 0.0], 1001)[:4001], duration=20.0, rate=200.0)
    with pytest.raises(UnanswerableError, check=coded("no-turning-points", "momentum")):
        sw.identify(log, rig, method="equation-error")
    assert log.torque is not None
    turned = sw.Recording.from_columns({"t": log.time, "q1": log.angle, "tau": -log.torque}, rig)
    with pytest.raises(InputError, match="torque_sign = -1") as caught:
        sw.identify(turned, rig)
    assert caught.value.code == "wrong-sign"


def test_equal_bodies_in_all_logs_set_no_scale() -> None:
    with pytest.raises(UnanswerableError, check=coded("no-scale")):
        sw.identify([coast(1, RING), coast(2, RING)], wheel(), added=[RING, RING])


def test_a_body_that_swings_is_not_taken_for_a_coast_down() -> None:
    rig = sw.Rig.from_text(TEXT.format(inertia=J, counts=4096, drive="none", coulomb=0, log="").replace(
        "gravity_torque = 0", "gravity_torque = 0.02"))  # fmt: skip
    log = sw.simulate(rig, duration=10.0, rate=200.0, initial_angle=0.5)
    with pytest.raises(UnanswerableError, check=coded("no-scale")):
        sw.identify(log, rig.changed({"axis.gravity_torque": 0}))


def test_a_log_that_only_speeds_up_is_refused() -> None:
    log = coast(7, seconds=20.0)
    back = sw.Recording.from_columns({"t": log.time, "q1": (log.angle[-1] - log.angle)[::-1].copy()}, wheel())
    with pytest.raises(UnanswerableError) as caught:
        sw.identify(back, wheel())
    assert caught.value.code == "no-coast-down"


@pytest.mark.parametrize("method", ["energy", "equation-error", "output-error", "backstepping"])
def test_other_methods_name_momentum_for_a_coast_down(method: str) -> None:
    with pytest.raises(UnanswerableError, match=f"which {method} does not identify; use the method momentum") as caught:
        sw.identify(coast(1), wheel(), method=method)
    assert caught.value.code == "no-scale"


def test_other_methods_refuse_known_bodies() -> None:
    with pytest.raises(UsageError, check=coded("unknown-option", "momentum")):
        sw.identify([coast(1), coast(2, RING)], wheel(), method="energy", added=[0, RING])


def test_known_bodies_beside_a_drive_of_unknown_scale_are_refused() -> None:
    """Its constant is the unit, so a body in kg m² beside it was taken in that unit: 26.9 for 3.02e-3 kg m²."""
    rig = sw.Rig.builtin("paper")
    logs = [sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=4.0, seed=k) for k in (1, 2)]
    unknown = rig.changed({"drive.wheel.inertia": "unknown", "drive.motor.rotor_inertia": 0})
    with pytest.raises(UnanswerableError, check=coded("no-scale", "wheel.inertia")):
        sw.identify(logs, unknown, added=[0, 6e-4])


def test_the_command_takes_one_added_inertia_per_log(tmp_path: Path) -> None:
    from swingid.cli.app import app

    rig = tmp_path / "wheel.toml"
    rig.write_text(TEXT.format(inertia=J, counts=64, drive="none", coulomb=FC, log=""))
    logs = [str(coast(k, a).save(tmp_path / f"{k}.csv", wheel())) for k, a in ((1, 0.0), (2, RING))]
    given = ["--added", "0", "--added", "1.2 ± 0.001 kg*cm^2"]
    done = CliRunner().invoke(app, ["identify", *logs, "--rig", str(rig), *given, "--json", str(tmp_path / "r.json")])
    assert done.exit_code == 0, done.output
    written = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert written["parameters"]["inertia"]["value"] == pytest.approx(J, rel=2e-3)
    assert written["provenance"]["added"] == [{"value": 0.0, "std": None}, {"value": RING, "std": pytest.approx(1e-7)}]
