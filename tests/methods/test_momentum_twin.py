"""Momentum on logs of the twin: clean ones give no warning, whatever the friction; the friction comes out right."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from long_cases import quick_first
from swingid.control.references import Multisine, Sine
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from twin_logs import DRY, INERTIA, LAWS, PAPER, error, given, logged, result_of, static_friction, twin

MEMORYLESS = [
    law for law in LAWS if "lugre" not in LAWS[law] and law not in ("none", "sticking", "direction-dependent")
]
BASIS = 1e-5
"""How well the basis of friction stands for the laws outside of it, relative to the inertia."""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of the laws by name, each computed once."""
    folder = tmp_path_factory.mktemp("logs")
    return cache(lambda law: result_of(twin(law), folder, seed=1))


@pytest.mark.parametrize("law", quick_first(5, LAWS))
def test_a_clean_log_gives_no_warning(results, law):
    result = results(law)
    assert result.status == "ok"
    assert result.warnings == ()
    assert result.error is None


@pytest.mark.parametrize("law", quick_first(5, LAWS))
def test_the_interval_holds_the_truth(results, law):
    result = results(law)
    assert abs(error(result)) < 3 * np.hypot(result.inertia.standard_uncertainty / INERTIA, BASIS)
    assert result.inertia.standard_uncertainty < 1e-3 * INERTIA


def test_the_transient_of_the_controller_is_left_out(results):
    result = results("viscous")
    assert 0.5 < result.details.start < 8.0
    assert result.details.stop == pytest.approx(25.0)
    assert "segment" in {note.code for note in result.notes}
    assert result.details.turning_times[0] > result.details.start


@pytest.mark.parametrize("law", MEMORYLESS)
def test_friction_is_within_three_per_cent_where_there_is_data(results, law):
    # A swing at 8.5 rad/s crosses speeds below a tenth of its highest within 6 % of its time.
    curve = results(law).details.friction
    truth = static_friction(law, curve.speeds)
    seen = np.abs(curve.speeds) > 0.1 * np.abs(curve.speeds).max()
    assert seen.sum() > 8
    assert curve.law_torques[seen] == pytest.approx(truth[seen], abs=0.03 * np.abs(truth).max())
    known = seen & (curve.uncertainties < 0.01 * np.abs(truth).max())
    assert known.sum() >= 4
    assert curve.torques[known] == pytest.approx(truth[known], abs=0.03 * np.abs(truth).max())


@pytest.mark.parametrize("law", ["viscous", "Coulomb", "quadratic", "cubic"])
def test_friction_parameters(results, law):
    found = results(law).parameters
    assert set(found) == {"inertia", *LAWS[law]}
    for name, value in LAWS[law].items():
        assert found[name].value == pytest.approx(value, rel=0.03)


def test_friction_by_direction(results):
    found = results("direction-dependent").parameters
    for name, value in LAWS["direction-dependent"].items():
        assert found[name].value == pytest.approx(value, rel=0.01)


def test_gravity_is_identified_from_two_tones(tmp_path):
    reference = Multisine((Sine(0.5, 8.5), Sine(0.4, 5.3)))
    log = logged(twin("Coulomb"), tmp_path, reference, seed=2)
    result = identify(log, given(twin("Coulomb")).changed({"axis.gravity_torque": "unknown"}))
    assert result.status == "ok"
    assert abs(error(result)) < 2e-4
    assert result.parameters["gravity_torque"].value == pytest.approx(78e-3, rel=2e-4)


def test_the_test_body_is_weighed_near_resonance_with_a_note(tmp_path):
    # The paper's run with the body, 6 rad/s against 6.2 rad/s (THEORY 5).
    body = Rig.builtin("paper-body")
    result = result_of(body, tmp_path, Sine(0.8, 6.0), seed=1)
    assert "near-resonance" in {note.code for note in result.notes}
    assert result.status == "ok"
    assert result.inertia.value == pytest.approx(398.3e-5, rel=1e-4)


def decay(rig, folder, duration):
    free = rig.changed({"drive": {"kind": "none"}, "log": {"angle": "q1"}})
    run = simulate(free, duration=duration, initial_angle=1.5)
    log = Recording.load(run.save(folder / "decay.csv", given(free)), given(free))
    return identify(log, given(free))


def test_a_free_decay_of_the_twin(tmp_path):
    result = decay(PAPER, tmp_path, 20.0)
    assert abs(error(result)) < 1e-4
    assert result.status == "ok"
    assert result.parameters["viscous"].value == pytest.approx(1.144e-3, rel=0.01)


def test_a_decay_that_dry_friction_ends(tmp_path):
    result = decay(twin("Coulomb"), tmp_path, 30.0)
    assert abs(error(result)) * INERTIA < 4 * result.inertia.standard_uncertainty
    assert abs(error(result)) < 1e-3
    assert result.parameters["coulomb"].value == pytest.approx(DRY["coulomb"], rel=0.03)
    assert result.details.stop < 25.0  # at rest afterwards
