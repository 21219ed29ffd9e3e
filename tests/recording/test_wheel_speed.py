"""Logs with the wheel's speed in place of its angle, as student rigs write them."""

from __future__ import annotations

import numpy as np
import pytest

from refusals import coded
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.errors import InputError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.numerics.spline import spline_slopes
from swingid.recording import Recording
from swingid.simulation import simulate
from twin_logs import INERTIA, error, given, twin

COUNTS = 4096
UNITS = {
    "rad/s": 1.0,
    "deg/s": np.pi / 180,
    "turns/s": 2 * np.pi,
    "rpm": 2 * np.pi / 60,
    "counts/s": 2 * np.pi / COUNTS,
}


def rig_of(law: str = "Stribeck", **log: object) -> Rig:
    """The paper's rig with coarse encoders, not told its inertia and friction, whose log has the wheel's speed `w2`."""
    keys = {"wheel_angle": None, "wheel_speed": "w2", "drive_held": False, **log}
    return given(twin(law, counts_per_turn=COUNTS)).changed({f"log.{key}": value for key, value in keys.items()})


@pytest.fixture(scope="module")
def runs() -> dict[str, Recording]:
    """Motions of the twin at 1 kHz with perfect sensors, by friction law."""
    found = {}
    for law in ("Stribeck", "viscous"):
        rig = twin(law, counts_per_turn=None)
        found[law] = simulate(
            rig, Sine(0.8, 8.5), Compensator.paper(rig, sample_time=1e-3), duration=25.0, rate=1000.0, seed=3
        )
    return found


def table_of(run: Recording, rate: float, seed: int, *, step: float = 0.1, noise: float = 0.1, **how: object):
    """Columns of a log at `rate`: coarse angle, speed (rad/s) with noise and in steps; how: mean, absolute."""
    rng = np.random.default_rng(seed)
    every = round(1000 / rate)
    rows = np.arange(rng.integers(every), len(run), every)
    turned = run.wheel_angle + run.angle if how.get("absolute") else np.array(run.wheel_angle)
    time = np.array(run.time[rows])
    if how.get("mean"):
        speed = np.concatenate([[0.0], np.diff(turned[rows]) / np.diff(time)])
    else:
        speed = spline_slopes(np.array(run.time), turned)[rows]
    speed = speed + rng.normal(0, noise, len(rows))
    count = 2 * np.pi / COUNTS
    return {
        "t": time,
        "q1": np.round(run.angle[rows] / count) * count,
        "w2": np.round(speed / step) * step if step else speed,
        "u": np.array(run.voltage[rows]),
    }


@pytest.mark.parametrize("mean", [False, True], ids=["instant", "mean"])
@pytest.mark.parametrize("law", ["Stribeck", "viscous"])
@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0])
def test_inertia_from_the_speed_of_the_wheel(runs, rate, law, mean):
    rig = rig_of(law, wheel_speed_is="mean" if mean else "instant")
    result = identify(Recording.from_columns(table_of(runs[law], rate, 1, mean=mean), rig), rig)
    assert abs(error(result)) < 5e-4  # 20 times better than asked
    low, high = result.inertia.interval95
    assert low < INERTIA < high
    assert result.status == "ok"
    assert "wheel-angle-integrated" in {note.code for note in result.notes}


def test_intervals_cover_with_noise_that_counts(runs):
    """1 rad/s of noise in steps of 1 rad/s at 20 Hz: the scatter of the result is that of its uncertainty."""
    scores = []
    for seed in range(30):
        rig = rig_of()
        table = table_of(runs["Stribeck"], 20.0, seed, noise=1.0, step=1.0)
        inertia = identify(Recording.from_columns(table, rig), rig).inertia
        scores.append((inertia.value - INERTIA) / inertia.standard_uncertainty)
    assert np.sum(np.abs(scores) > 1.96) <= 5  # 1.5 expected; more than 5 of 30 once in 500
    assert np.sqrt(np.mean(np.square(scores))) > 0.4  # and not by intervals far too wide


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("absolute", [False, True], ids=["relative", "absolute"])
def test_units_signs_and_readings_give_the_same_angle(runs, unit, absolute):
    plain = Recording.from_columns(table_of(runs["viscous"], 100.0, 0, step=0, noise=0), rig_of())
    table = table_of(runs["viscous"], 100.0, 0, step=0, noise=0, absolute=absolute)
    table["w2"] = -table["w2"] / UNITS[unit]
    reading = "absolute" if absolute else "relative"
    rig = rig_of(wheel_speed_unit=unit, wheel_angle_sign=-1, wheel_angle_is=reading)
    log = Recording.from_columns(table, rig)
    # an angle of 0 at the first row, and the coarse angle of the pendulum where that is taken off
    assert log.wheel_angle - log.wheel_angle[0] == pytest.approx(
        plain.wheel_angle, abs=4 * 2 * np.pi / COUNTS if absolute else 1e-9
    )


def test_mean_speeds_integrate_to_the_angle_itself(runs):
    run = runs["viscous"]
    log = Recording.from_columns(table_of(run, 20.0, 0, step=0, noise=0, mean=True), rig_of(wheel_speed_is="mean"))
    rows = np.searchsorted(run.time, log.time - 1e-9)
    assert log.wheel_angle == pytest.approx(run.wheel_angle[rows] - run.wheel_angle[rows[0]], abs=1e-9)


def test_the_integral_of_instant_speeds_converges_with_the_fourth_power():
    rig, errors = rig_of(), []
    for rows in (101, 201, 401):
        time = np.linspace(0, 4 * np.pi / 3, rows)  # cos(3 t), bent nowhere at its ends, where a natural spline is not
        table = {"t": time, "q1": 0.5 * np.sin(3 * time), "w2": 3 * np.sin(3 * time), "u": 0 * time}
        log = Recording.from_columns(table, rig)
        errors.append(np.abs(log.wheel_angle - (1 - np.cos(3 * time))).max())
    slopes = np.diff(np.log2(errors))
    assert slopes == pytest.approx([-4, -4], abs=0.2)


@pytest.mark.parametrize("reading", ["instant", "mean"])
def test_a_log_comes_back_from_a_file(runs, tmp_path, reading):
    rig = rig_of(wheel_speed_is=reading)
    log = Recording.from_columns(table_of(runs["viscous"], 50.0, 0), rig)
    again = Recording.load(log.save(tmp_path / "log.parquet", rig), rig)
    for name in ("time", "angle", "wheel_angle", "wheel_speed", "voltage"):
        assert np.array_equal(getattr(again, name), getattr(log, name))
    made = Recording.load(runs["viscous"].save(tmp_path / "made.csv", rig), rig)  # the twin on such a rig
    turned = runs["viscous"].wheel_angle - runs["viscous"].wheel_angle[0]
    assert made.wheel_angle == pytest.approx(turned, abs=1e-3)


def test_header_units_of_the_speed(runs, tmp_path):
    table = table_of(runs["viscous"], 50.0, 0)
    table["w2 [rpm]"] = table.pop("w2") * 60 / (2 * np.pi)
    lines = [",".join(table), *(",".join(map(repr, map(float, row))) for row in zip(*table.values(), strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(lines), encoding="utf-8")
    log = Recording.load(tmp_path / "log.csv", rig_of())
    plain = Recording.from_columns(table_of(runs["viscous"], 50.0, 0), rig_of())
    assert log.wheel_angle == pytest.approx(plain.wheel_angle, rel=1e-9, abs=1e-9)
    assert "unit-of-header" in {found.code for found in log.findings}


def test_output_error_takes_the_wheel_as_input_and_refuses_the_voltage(runs):
    rig = rig_of("viscous")
    log = Recording.from_columns(table_of(runs["viscous"], 50.0, 1), rig)
    result = identify(log, rig, "output-error", law="viscous")
    assert abs(error(result)) < 1e-3
    with pytest.raises(InputError, check=coded("needs-wheel-angle", 'input="wheel"')):
        identify(log, rig, "output-error", input="voltage")


@pytest.mark.parametrize(("method", "within"), [("equation-error", 1e-3), ("energy", 0.1)])
def test_other_methods_answer_too(runs, method, within):
    """energy leans on the motor, whose voltage is held for 1 ms but logged each 10 ms."""
    rig = rig_of("viscous")
    log = Recording.from_columns(table_of(runs["viscous"], 100.0, 1), rig)
    assert abs(error(identify(log, rig, method))) < within
