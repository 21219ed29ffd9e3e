"""The energy method on the twin's logs and on a real one: identification sees a file and a rig, never the truth."""

from __future__ import annotations

import numpy as np
import pytest

from long_cases import quick_first, quick_if
from swingid.checks.momentum import DISAGREES
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation import simulate

PAPER = Rig.builtin("paper")
TRUTH = PAPER.axis.inertia.value
PAPER_TIMES = (9.023, 9.413, 9.433, 9.823)
STRIBECK = {"viscous": 5e-4, "coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.05}

LAWS = {
    "viscous": {"viscous": 1.144e-3},
    "Coulomb": {"viscous": 5e-4, "coulomb": 3e-3},
    "Stribeck": STRIBECK,
    "quadratic": {"viscous": 2e-4, "quadratic": 3e-4},
    "cubic": {"viscous": 2e-4, "cubic": 5e-5},
    "direction-dependent": {"viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    "LuGre": STRIBECK | {"lugre": {"bristle_stiffness": 3.0, "bristle_damping": 1e-3}},
    "sticking": {"viscous": 5e-4, "coulomb": 25e-3, "static": 30e-3, "stribeck_speed": 0.1},
    "8 x viscous": {"viscous": 9.152e-3},
}


def with_friction(rig, law):
    changes = {"axis.friction.viscous": None} | {f"axis.friction.{key}": value for key, value in LAWS[law].items()}
    return rig.changed(changes)


def through_a_file(log, rig, folder):
    path = log.save(folder / "run.parquet", rig)
    return Recording.load(path, rig)


def error(result):
    return result.inertia.value / TRUTH - 1


@pytest.fixture(scope="module")
def ideal(tmp_path_factory):
    """The paper's simulation: a loop of 10 kHz that reads ideal angles, with the gains of Fig. 7."""
    rig = PAPER.changed({"sensors.counts_per_turn": None})
    log = simulate(rig, Sine(0.8, 8.5), Compensator.paper_simulation(rig), duration=12.0, rate=1e4)
    return through_a_file(log, rig, tmp_path_factory.mktemp("ideal")), rig


def test_the_paper_s_simulation_at_the_paper_s_times(ideal):
    result = identify(*ideal, "energy", variant="printed", nodes=PAPER_TIMES)
    assert abs(error(result)) < 2e-3
    assert result.parameters["viscous"].value == pytest.approx(1.144e-3, rel=0.05)


def test_the_paper_s_simulation_by_the_trapezoid(ideal):
    result = identify(*ideal, "energy", variant="printed", nodes=PAPER_TIMES, work="trapezoid")
    assert 0.02 < abs(error(result)) < 0.1


def test_the_paper_s_simulation_with_nodes_of_its_own(ideal):
    result = identify(*ideal, "energy", variant="printed")
    assert abs(error(result)) < 1e-4
    assert len(result.details.swings.values) > 20


def test_the_paper_s_simulation_by_the_better_form(ideal):
    result = identify(*ideal, "energy")
    assert abs(error(result)) < 1e-5
    assert result.parameters["viscous"].value == pytest.approx(1.144e-3, rel=1e-3)
    assert result.status == "ok"


@pytest.mark.parametrize("law", quick_first(4, LAWS))
def test_with_the_paper_s_encoders_whatever_the_friction(law, tmp_path):
    rig = with_friction(PAPER, law)
    log = simulate(rig, Sine(0.8, 8.5), Compensator.paper(rig), duration=25.0, seed=1)
    log = through_a_file(log, PAPER, tmp_path)
    result = identify(log, PAPER, "energy")
    assert abs(error(result)) < 5e-4
    assert abs(result.inertia.value - TRUTH) < 4 * result.inertia.standard_uncertainty
    assert result.inertia.standard_uncertainty < 1e-3 * TRUTH
    assert result.status == "ok"
    printed = identify(log, PAPER, "energy", variant="printed")
    assert abs(error(printed)) < 3e-3


@pytest.mark.parametrize(
    "law", quick_if(lambda law: law in ("viscous", "sticking"), ["viscous", "Stribeck", "LuGre", "sticking"])
)
def test_direct_drive(law):
    rig = with_friction(PAPER, law).changed({"drive": {"kind": "direct"}, "log": {"torque": "tau"}})
    time = np.arange(20_001) / 1000
    torque = 0.12 * np.sin(8.5 * time + 0.3) + 0.05 * np.sin(5 * time)
    log = simulate(rig, duration=20.0, drive=torque, seed=1)
    for b in (78e-3, "unknown"):
        result = identify(log, rig.changed({"axis.gravity_torque": b}), "energy")
        assert abs(error(result)) < 5e-4
        assert result.status == "ok"


@pytest.mark.parametrize("law", ["viscous", "Stribeck", "LuGre"])
def test_free_decay(law):
    rig = with_friction(PAPER, law).changed({"drive": {"kind": "none"}, "log": {"angle": "q1"}})
    result = identify(simulate(rig, duration=20.0, initial_angle=1.4, seed=1), rig, "energy")
    assert abs(error(result)) < 5e-4
    assert result.status == "ok"


def test_near_resonance_the_wheel_rests_and_only_that_is_noted():
    rig = with_friction(PAPER, "viscous")
    result = identify(simulate(rig, Sine(0.8, 4.8), Compensator.paper(rig), duration=25.0, seed=1), PAPER, "energy")
    assert abs(error(result)) < 1e-3
    assert result.status == "ok"
    assert "near-resonance" in [note.code for note in result.notes]
    low, high = result.inertia.interval95
    assert low < PAPER.axis.inertia.value < high


def test_rows_lost_at_random():
    rig = with_friction(PAPER, "Stribeck").changed({"sensors.dropouts": 0.05})
    log = simulate(rig, Sine(0.8, 8.5), Compensator.paper(rig), duration=25.0, seed=2)
    assert len(log) < 0.97 * 25_001
    assert abs(error(identify(log, rig, "energy"))) < 1e-3


@pytest.mark.long
def test_a_real_free_pendulum(data_dir):
    """Published: 0.003331 kg m² about the axis, by its authors' fit."""
    from pathlib import Path

    rig = Rig.load(Path(__file__).resolve().parents[2] / "examples" / "rigs" / "free_pendulum.toml")
    log = Recording.load(data_dir / "free_pendulum" / "free_swing.csv", rig)
    for variant in ("better", "printed"):
        assert identify(log, rig, "energy", variant=variant).inertia.value == pytest.approx(0.003331, rel=0.01)


def test_a_real_drive_whose_friction_is_not_of_speed_alone_has_an_interval_that_says_so(data_dir):
    """EMPS, published 95.1 kg: long passes see its friction change with time since the reversal; that must show."""
    from pathlib import Path

    rig = Rig.load(Path(__file__).resolve().parents[2] / "examples" / "rigs" / "emps.toml")
    result = identify(Recording.load(data_dir / "emps" / "DATA_EMPS.mat", rig), rig, "energy")
    low, high = result.inertia.interval95
    assert low < 95.1 < high
    budget = {entry.source: entry.standard_uncertainty for entry in result.budget if entry.parameter == "inertia"}
    assert budget[DISAGREES] > 0.01 * 95.1
