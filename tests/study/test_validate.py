"""Validation: the fit is MATLAB's, a true model predicts to the sensor's noise, a wrong one does not."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given as sampled
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from refusals import coded
from swingid.cli import main
from swingid.control.references import Multisine, Sine
from swingid.errors import InputError, UnanswerableError
from swingid.identification import identify
from swingid.report.figures.studies import draw_validation
from swingid.result.file import load_result
from swingid.result.result import Parameter
from swingid.study.validate import fit_percent, validate
from twin_logs import given, logged, twin

RIG = twin("Coulomb", counts_per_turn=16384)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    return identify(logged(RIG, tmp_path_factory.mktemp("fit"), duration=15.0), given(RIG))


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """A log of another motion."""
    folder = tmp_path_factory.mktemp("other")
    return logged(RIG, folder, Sine(1.1, 10.0), duration=12.0, seed=5)


def test_fit_is_that_of_matlab():
    y = np.array([1.0, 2.0, 3.0, 4.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(4, 2.5)) == pytest.approx(0.0)
    assert fit_percent(y, y + np.array([0.1, -0.1, 0.1, -0.1])) == pytest.approx(100 * (1 - 0.2 / np.sqrt(5)))
    assert fit_percent(y, np.full(4, np.nan)) == float("-inf")


@sampled(arrays(np.float64, 8, elements=st.floats(-10, 10)), st.floats(0.1, 10), st.floats(-5, 5))
def test_fit_does_not_depend_on_unit_and_zero(error, scale, zero):
    y = np.linspace(0, 1, 8)
    assert fit_percent(scale * y + zero, scale * (y + error) + zero) == pytest.approx(
        fit_percent(y, y + error), abs=1e-6
    )


@pytest.mark.parametrize("source", ["wheel", "voltage"])
def test_a_true_model_predicts_another_motion_to_the_noise(fitted, other, source):
    (found,) = validate(fitted, other, given(RIG), input=source).predictions
    assert found.input == source
    assert found.free_rms < 3 * found.noise
    assert found.swing_fit > 99.5  # each swing starts from a measured speed, which is what limits it
    assert found.free_fit > 99.9


def test_a_wrong_inertia_shows(fitted, other):
    inertia = fitted.inertia
    wrong = replace(fitted, parameters=fitted.parameters | {"inertia": replace(inertia, value=1.05 * inertia.value)})
    right, off = (validate(r, other, given(RIG)).predictions[0] for r in (fitted, wrong))
    assert off.free_rms > 20 * right.free_rms
    assert off.swing_rms > 3 * right.swing_rms


def test_the_stated_inertia_and_friction_of_the_rig_are_not_read(fitted, other):
    with_truth = validate(fitted, other, RIG).to_dict()
    without = validate(fitted, other, given(RIG)).to_dict()
    assert with_truth == without


def test_several_logs_make_a_table_and_plain_data(fitted, other):
    found = validate(fitted, [other, other], given(RIG))
    assert found.summary().count("measured wheel") == 2
    data = json.loads(found.to_json())
    assert data["schema"] == "swingid.validate/1"
    assert data["logs"][0]["free_run_fit_percent"] > 99.9


def test_a_model_that_runs_away_is_said_to(fitted, other):
    friction = {"viscous": Parameter.of(-5.0, None, "N m s")}
    runaway = replace(fitted, parameters={"inertia": fitted.inertia, **friction})
    found = validate(runaway, other, given(RIG))
    assert found.predictions[0].free_fit < 0
    json.loads(found.to_json())


def test_refusals(fitted, other):
    refused = replace(fitted, parameters={}, status="refused")
    with pytest.raises(InputError) as caught:
        validate(refused, other, given(RIG))
    assert caught.value.code == "refused-result"
    mass = replace(fitted, parameters={"inertia": Parameter.of(95.0, 0.5, "kg")})
    with pytest.raises(InputError, check=coded("other-axis")):
        validate(mass, other, given(RIG))
    with pytest.raises(UnanswerableError, check=coded("no-motor-constants")):
        validate(fitted, replace(other, voltage=None), given(RIG), input="voltage")


def test_figure_shows_the_error_of_both_predictions(fitted, other):
    (found,) = validate(fitted, other, given(RIG)).predictions
    top, bottom = draw_validation(found).axes
    assert [line.get_label() for line in top.lines][:2] == ["measured", "free run from the start of the log"]
    assert [line.get_label() for line in bottom.lines] == [
        f"free run, fit {found.free_fit:.2f} %",
        f"one swing ahead, fit {found.swing_fit:.2f} %",
    ]
    assert bottom.get_xlabel() == "time, s"


def test_command(fitted, other, tmp_path, capsys):
    (tmp_path / "r.json").write_text(fitted.to_json(), encoding="utf-8")
    (tmp_path / "rig.toml").write_text(given(RIG).text, encoding="utf-8")
    words = ["validate", str(tmp_path / "r.json"), other.source.path, "--rig", str(tmp_path / "rig.toml")]
    assert main([*words, "--report", str(tmp_path / "v.html"), "--json", str(tmp_path / "v.json")]) == 0
    assert "one swing ahead" in capsys.readouterr().out
    assert "<svg" in (tmp_path / "v.html").read_text(encoding="utf-8")
    assert main(["validate", other.source.path, other.source.path, "--rig", "paper"]) == 3
    assert main(["validate", str(tmp_path / "none.json"), other.source.path, "--rig", "paper"]) == 3


def test_a_motion_of_two_frequencies_is_predicted(fitted, tmp_path):
    log = logged(RIG, tmp_path, Multisine((Sine(0.5, 8.5), Sine(0.4, 5.0))), duration=10.0)
    (found,) = validate(fitted, log, given(RIG)).predictions
    assert found.free_fit > 99.9


def test_a_fitted_log_and_another_rig_are_said(fitted, other):
    assert validate(fitted, other, given(RIG)).notes == ()
    again = validate(replace(fitted, provenance={"log_sha256": other.source.sha256}), other, given(RIG))
    assert "no test of the model" in again.notes[0]
    assert again.notes[0] in json.loads(again.to_json())["notes"]
    heavier = given(RIG).changed({"drive.wheel.inertia": 1.3e-4})
    told, moves = validate(fitted, other, heavier).notes
    assert told.endswith("found with another drive.wheel.inertia.")
    assert "does not move as the model" in moves


def test_signs_are_checked_before_anything_is_predicted(fitted, other):
    with pytest.raises(InputError, check=coded("wrong-sign", "wheel_angle")):
        validate(fitted, replace(other, wheel_angle=-other.wheel_angle), given(RIG))
    (note,) = validate(fitted, replace(other, voltage=-other.voltage), given(RIG), input="voltage").notes
    assert "the voltage's sign" in note


def test_constants_that_a_fit_has_moved_are_predicted_with(other, tmp_path):
    stated = {
        "drive.motor.torque_per_volt": "51.7e-4 ± 0.2e-4 N*m/V",
        "drive.wheel.inertia": "11.4e-5 ± 0.03e-5 kg*m^2",
    }
    rig = given(RIG).changed(stated)
    result = identify(logged(RIG, tmp_path, duration=12.0, rate=250.0), rig, "output-error", law="coulomb + viscous")
    (tmp_path / "moved.json").write_text(result.to_json(), encoding="utf-8")
    (found,) = validate(load_result(tmp_path / "moved.json"), other, rig, input="voltage").predictions
    assert found.free_rms < 3 * found.noise


def test_the_first_swing_is_predicted_as_well_as_the_others(fitted, other):
    (found,) = validate(fitted, other, given(RIG)).predictions
    error = np.abs(found.swing - found.measured)
    assert error[found.time < found.time[0] + 0.3].max() < 2 * error[found.time > found.time[0] + 0.6].max()


def test_a_log_given_twice_is_a_wrong_usage(other):
    log = other.source.path
    assert main(["validate", "r.json", log, log, "--rig", "paper"]) == 2
    folder, _, name = log.rpartition("/")
    assert main(["compare", log, f"{folder}/./{name}", "--rig", "paper"]) == 2
