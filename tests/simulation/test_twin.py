"""The twin's manners: the same seed gives the same log, commands are held and bounded, arguments make sense."""

from __future__ import annotations

import json

import numpy as np
import pytest

from swingid.control.compensator import Compensator
from swingid.errors import InputError, UsageError
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation import simulate, simulate_run
from twin_cases import direct_rig, free_rig, paper_rig, sine, warm_compensator

IMPERFECT = {"sensors.nonlinearity": 0.01, "sensors.noise": 1e-3, "sensors.jitter": 1e-4, "sensors.dropouts": 0.01}


def run(rig, seed=0, **options):
    return simulate(rig, sine(0.8, 8.5), warm_compensator(rig), duration=0.5, seed=seed, **options)


def test_a_seed_decides_everything():
    rig = paper_rig(**IMPERFECT, **{"drive.wheel.inertia": "1134 ± 5 g*cm^2"})
    for draw in (False, True):
        one, two, other = (run(rig, seed, draw=draw) for seed in (3, 3, 4))
        for channel in ("time", "angle", "wheel_angle", "voltage", "adaptive_gain"):
            assert np.array_equal(getattr(one, channel), getattr(two, channel))
        assert one.metadata == two.metadata
        assert not np.array_equal(one.voltage[:100], other.voltage[:100])


def test_draw_makes_another_rig():
    rig = paper_rig(**{"drive.wheel.inertia": "1134 ± 5 g*cm^2"})
    stated, drawn = run(rig).metadata["truth"], run(rig, draw=True).metadata["truth"]
    assert stated["constants"]["drive.wheel.inertia"] == 11.34e-5
    assert drawn["constants"]["drive.wheel.inertia"] != 11.34e-5
    assert drawn["inertia"] == stated["inertia"] == 302.2e-5


def test_the_experiments_gains_settle_where_the_issue_says():
    rig = Rig.builtin("paper")
    log = simulate(rig, sine(0.8, 8.5), duration=25.0)
    assert log.adaptive_gain[-1] == pytest.approx(13.3, abs=0.3)
    assert log.adaptive_gain[-1] == log.adaptive_gain[15_000]
    assert np.abs(log.voltage).max() == 10.0
    assert len(log) == 25_001


def test_channels_by_drive():
    wheel, direct = run(paper_rig()), simulate(direct_rig(), duration=0.1, drive=np.ones(101))
    free = simulate(free_rig(), duration=0.1, initial_angle=0.3)
    assert (wheel.torque, direct.voltage, free.voltage, free.torque) == (None, None, None, None)
    assert direct.wheel_angle is None
    assert direct.reference is None
    assert (direct.torque == 1.0).all()
    assert wheel.reference == pytest.approx(sine(0.8, 8.5)(wheel.time))


def test_a_reference_in_words_is_the_function_that_it_names():
    words, function = (simulate(paper_rig(), one, duration=0.5) for one in ("sine 0.8 rad 8.5 rad/s", sine(0.8, 8.5)))
    assert np.array_equal(words.angle, function.angle)


def test_a_direct_drive_follows_a_reference():
    rig = direct_rig("coulomb")
    controller = Compensator(delta0=0.02, sigma0=1e4, lambda0=0.2, k_tilde_max=0.3, plant_sign=1)
    log = simulate(rig, sine(0.5, 3.0), controller, duration=6.0)
    assert np.abs(log.angle - log.reference)[3000:].max() < 0.04
    assert log.torque is not None


def test_the_rigs_voltage_limit_bounds_open_loop_commands():
    log = simulate(paper_rig(), duration=0.1, drive=np.linspace(-30.0, 30.0, 101))
    assert (log.voltage.min(), log.voltage.max()) == (-10.0, 10.0)


def test_a_linear_axis_is_the_same_equation_in_kilograms():
    text = """
    name = "slide"
    [axis]
    kind = "linear"
    inertia = 95.0
    friction = {viscous = 200.0, coulomb = 20.0}
    [drive]
    kind = "direct"
    [log]
    torque = "f"
    """
    log = simulate(Rig.from_text(text), duration=1.0, drive=np.full(1001, 50.0))
    rate = 200.0 / 95.0
    expected = 30.0 / 200.0 * (log.time - (1.0 - np.exp(-rate * log.time)) / rate)
    assert log.angle == pytest.approx(expected, abs=1e-12)


def test_metadata_says_how_it_was_made_and_survives_a_file(tmp_path):
    rig = paper_rig("stribeck", **IMPERFECT)
    log = run(rig, seed=7)
    how = log.metadata["simulation"]
    assert (how["seed"], how["rate"], how["duration"]) == (7, 1000.0, 0.5)
    assert log.metadata["truth"]["static"] == 5e-3
    assert {"swingid", "numpy", "numba", "python"} <= set(log.metadata["versions"])
    assert Rig.from_text(log.metadata["rig"]).axis == rig.axis
    json.dumps(log.metadata)
    back = Recording.load(log.save(tmp_path / "run.parquet", rig), rig)
    assert back.angle == pytest.approx(log.angle, abs=1e-12)
    assert back.voltage == pytest.approx(log.voltage, abs=1e-12)


def test_truth_can_be_had_at_any_instants():
    times = np.array([0.0, 0.01234, 0.2, 0.49999])
    rig = paper_rig()
    seen = simulate_run(rig, duration=0.5, initial_angle=0.5, truth_times=times).truth
    rows = simulate_run(rig, duration=0.5, initial_angle=0.5).truth
    assert np.array_equal(seen.time, times)
    assert seen.angle[[0, 2]] == pytest.approx(rows.angle[[0, 200]], abs=1e-14)


@pytest.mark.parametrize(
    ("rig", "options", "words"),
    [
        (paper_rig(), {"duration": 0.0}, "duration"),
        (paper_rig(), {"duration": float("nan")}, "duration"),
        (paper_rig(), {"duration": 1.0, "rate": -1.0}, "rate"),
        (paper_rig(), {"duration": 1e-4}, "two rows"),
        (paper_rig(), {"duration": 1.0, "initial_angle": float("nan")}, "initial_angle must be a finite number"),
        (paper_rig(), {"duration": 1.0, "initial_speed": float("inf")}, "initial_speed must be a finite number"),
        (paper_rig(), {"duration": 1.0, "seed": -1}, "seed must be a whole number"),
        (paper_rig(), {"duration": 1.0, "seed": 1.5}, "seed must be a whole number"),
        (paper_rig(), {"duration": 1.0, "drive": np.zeros(10)}, "drive"),
        (paper_rig(), {"duration": 0.1, "drive": np.full(101, np.nan)}, "drive"),
        (paper_rig(), {"duration": 0.1, "drive": np.zeros(101), "reference": sine(1.0, 1.0)}, "not both"),
        (paper_rig(), {"duration": 0.1, "controller": warm_compensator(paper_rig())}, "reference"),
        (paper_rig(), {"duration": 0.1, "reference": lambda t: 0.0}, "reference"),
        (paper_rig(), {"duration": 0.1, "reference": "sinus 1 rad"}, "sine 0.8 rad 8.5 rad/s"),
        (paper_rig(), {"duration": 0.1, "reference": 1.0}, "function of times"),
        (free_rig(), {"duration": 0.1, "reference": sine(1.0, 1.0)}, "no drive"),
        (free_rig(), {"duration": 0.1, "drive": np.zeros(101)}, "no drive"),
    ],
)
def test_arguments_that_make_no_sense_are_named(rig, options, words):
    with pytest.raises(UsageError, match=words):
        simulate(rig, **options)


def test_a_rig_without_truth_cannot_be_simulated():
    with pytest.raises(InputError, match=r"axis\.inertia"):
        simulate(paper_rig(**{"axis.inertia": None}), duration=1.0)


def test_a_motion_that_runs_away_is_named() -> None:
    """An acceleration of 10^308 rad/s² overflows within the first second."""
    with pytest.raises(UsageError) as caught:
        simulate(direct_rig(), drive=np.full(201, 1e307), duration=2, rate=100)
    assert caught.value.code == "runs-away"


@pytest.mark.parametrize("key", ["axis.stiffness", "axis.gravity_torque"])
def test_a_body_too_stiff_for_its_rows_is_refused(key: str) -> None:
    """Not a second is spent on a row in which it swings a billion times."""
    with pytest.raises(UsageError) as caught:
        simulate(Rig.load("paper").changed({key: 1e23}), duration=1.0, initial_angle=1.0)
    assert caught.value.code == "too-stiff"
