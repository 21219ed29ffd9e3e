"""Rehearsals: what is drawn, what is counted, and that expectations are those of the runs."""

from __future__ import annotations

import json

import numpy as np
import pytest

from refusals import coded
from swingid.cli import main
from swingid.control.references import Sine
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.model.rig import Rig
from swingid.study.experiment import encoder_places
from swingid.study.rehearse import rehearse
from swingid.study.trials import Expectation

PAPER = Rig.builtin("paper")


def expectation(errors, half_widths):
    return Expectation("momentum", np.array(errors), np.array(half_widths), {}, {})


def test_figures_are_those_of_the_errors():
    e = expectation([0.01, -0.03, np.nan, 0.02], [0.02, 0.02, np.nan, 0.04])
    assert e.answered == 3
    assert e.bias == pytest.approx(0.0)
    assert e.rmse == pytest.approx(np.sqrt((1 + 9 + 4) / 3) / 100)
    assert e.half_width == 0.02
    assert e.coverage[0] == pytest.approx(2 / 3)


def test_the_error_of_full_coverage_is_not_zero():
    assert expectation([0.0] * 20, [1.0] * 20).coverage[1] > 0.02


def test_an_uncertain_scale_shows_as_that_error():
    """Without gravity a11 is proportional to the wheel's inertia, and nothing else is drawn."""
    rig = PAPER.changed({"drive.wheel.inertia": "11.34e-5 ± 1 % kg*m^2", "axis.gravity_torque": 0.0})
    found = rehearse(rig, Sine(0.8, 8.5), duration=8.0, runs=12, methods=["momentum"], workers=1).of("momentum")
    assert 0.005 < found.rmse < 0.02
    assert found.half_width == pytest.approx(1.96 * 0.01, rel=0.15)


def test_runs_do_not_depend_on_the_number_of_workers():
    plan = {"duration": 6.0, "runs": 6, "methods": ["momentum"], "seed": 3}
    rig = PAPER.changed({"sensors.noise": 1e-3})
    one = rehearse(rig, Sine(0.8, 8.5), workers=1, **plan)
    two = rehearse(rig, Sine(0.8, 8.5), workers=2, **plan)
    assert one.to_json() == two.to_json()
    assert len(set(one.of("momentum").errors)) == 6


def test_a_twin_needs_to_know_gravity():
    rig = PAPER.changed({"axis.gravity_torque": "unknown"})
    with pytest.raises(InputError, match="gravity"):
        rehearse(rig, Sine(0.8, 8.5), duration=6.0, runs=5, methods=["momentum"], workers=1)


def test_a_run_too_short_for_any_method_is_an_error():
    with pytest.raises(UnanswerableError, check=coded("all-refused", "5 runs")):
        rehearse(PAPER, Sine(0.8, 8.5), duration=0.05, runs=5, methods=["momentum"], workers=1)


@pytest.mark.parametrize(
    ("changes", "options", "error", "words"),
    [
        ({"axis.inertia": None}, {}, InputError, "axis.inertia is missing"),
        ({}, {"runs": 2}, UsageError, "too few"),
        ({}, {"methods": ["magic"]}, UsageError, "unknown method"),
    ],
)
def test_bad_plans_are_refused_before_any_run(changes, options, error, words):
    with pytest.raises(error, match=words):
        rehearse(PAPER.changed(changes), Sine(0.8, 8.5), duration=6.0, **options)


def test_command_prints_a_table_and_writes_json(tmp_path, capsys):
    target = tmp_path / "r.json"
    words = ["rehearse", "--rig", "paper", "--reference", "sine 0.8 rad 8.5 rad/s", "--duration", "6", "--runs", "5"]
    assert main([*words, "--method", "momentum", "--json", str(target)]) == 0
    data = json.loads(target.read_text(encoding="utf-8"))
    assert data["schema"] == "swingid.rehearse/1"
    assert data["methods"][0]["answered"] == 5
    assert "5 of 5" in capsys.readouterr().out


def test_a_rehearsal_without_motion_is_wrong_usage(capsys):
    assert main(["rehearse", "--rig", "paper", "--duration", "6"]) == 2
    assert "--reference or --initial-angle" in capsys.readouterr().err


def test_encoders_lie_anywhere_within_half_a_step_of_zero():
    steps = np.array([PAPER.sensors.of(channel).resolution for channel in ("angle", "wheel")])
    places = np.array([encoder_places(PAPER, seed) for seed in range(2000)]) / steps
    assert np.all((places >= -0.5) & (places < 0.5))
    # a uniform draw: mean 0, standard deviation 1/√12
    assert np.abs(places.mean(axis=0)).max() < 4 / np.sqrt(12 * 2000)
    assert places.std(axis=0) == pytest.approx(1 / np.sqrt(12), rel=0.05)
