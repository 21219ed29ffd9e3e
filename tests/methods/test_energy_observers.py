"""The paper's post-processing in energy: observers (23) both ways, the drive through W_f; what each costs."""

from __future__ import annotations

import numpy as np
import pytest

from closed_form_logs import ONE_TONE, direct_log, direct_rig
from swingid.errors import UsageError
from swingid.identification import identify
from swingid.methods.energy.chain import Chain, filtered_drive, held_between
from swingid.numerics.quadrature import GaussNodes
from swingid.recording.recording import Recording
from twin_logs import INERTIA, PAPER, error, given, logged, twin


@pytest.fixture(scope="module")
def paper_log(tmp_path_factory) -> Recording:
    """14 bit, 1 kHz, 25 s at 8.5 rad/s: like the paper's experiment."""
    return logged(twin(), tmp_path_factory.mktemp("paper"), seed=1)


def of(log: Recording, **options: object):
    return identify(log, given(PAPER), "energy", **options)


@pytest.mark.parametrize(("variant", "most"), [("better", 1e-3), ("printed", 5e-3)])
def test_observers_alone_cost_little(paper_log: Recording, variant: str, most: float) -> None:
    result = of(paper_log, variant=variant, velocities="observers", filter_time=0)
    assert abs(error(result)) < most
    assert abs(result.inertia.value - INERTIA) < 2 * result.inertia.standard_uncertainty
    assert abs(error(of(paper_log, variant=variant))) < 0.4 * most
    assert result.status == "ok"


@pytest.mark.parametrize("variant", ["better", "printed"])
def test_w_f_costs_what_the_motor_s_strength_does(paper_log: Recording, variant: str) -> None:
    """W_f keeps 1/(1 + (8.5 T)^2) = 98.9 % of the drive, which is as if c1 were 1.1 % too small."""
    result = of(paper_log, variant=variant, velocities="observers")
    lost = 1 - 1 / (1 + (8.5 * 0.0125) ** 2)
    c1 = PAPER.drive.motor.torque_per_volt.value
    expected = -lost * of(paper_log).sensitivities["drive.motor.torque_per_volt"] * c1 / INERTIA
    assert error(result) == pytest.approx(expected, rel=0.15)
    assert -0.16 < error(result) < -0.12


def test_w_f_is_told_and_stands_in_the_budget(paper_log: Recording) -> None:
    result = of(paper_log, velocities="observers")
    assert [warning.code for warning in result.warnings] == ["filtered-drive"]
    assert abs(result.inertia.value - INERTIA) < 1.5 * result.inertia.standard_uncertainty
    entry = next(e for e in result.budget if e.source == "what observers and filter move" and e.parameter == "inertia")
    assert entry.standard_uncertainty == pytest.approx(abs(result.inertia.value - INERTIA), rel=0.01)
    assert {e.parameter for e in result.budget} <= set(result.parameters)
    assert result.provenance["options"] == {"variant": "better", "velocities": "observers", "filter_time": 0.0125}


def test_a_filter_that_is_short_costs_with_its_square(paper_log: Recording) -> None:
    bare = error(of(paper_log, velocities="observers", filter_time=0))
    short, shorter = (error(of(paper_log, velocities="observers", filter_time=t)) - bare for t in (8e-3, 4e-3))
    assert short / shorter == pytest.approx(4.0, rel=0.15)


def test_closed_form_of_a_direct_drive() -> None:
    """A torque of one tone: W_f scales it, and so the inertia, by its share of that frequency."""
    time = np.arange(20_001) / 1000
    rig = direct_rig(**{"axis.gravity_torque": 1e-12})
    log = direct_log(ONE_TONE, lambda v: 0.0 * v, time, b=0.0)
    plain = identify(log, rig, "energy", velocities="observers", filter_time=0).inertia.value
    filtered = identify(log, rig, "energy", velocities="observers", filter_time=0.02).inertia.value
    assert plain == pytest.approx(INERTIA, rel=1e-4)
    assert filtered / plain == pytest.approx(1 / (1 + (8.5 * 0.02) ** 2), rel=1e-4)


def test_a_held_drive_through_a_short_filter_is_itself() -> None:
    time = np.arange(2001) / 1000
    nodes = GaussNodes(time, 2)
    values = np.sin(8.5 * time)
    middle = values[:-1] + np.diff(values) / 2
    filtered = filtered_drive(nodes, values, 1e-3, held=False)[50:-50]
    assert np.abs(filtered.mean(axis=1) - middle[50:-50]).max() < 2e-4
    late = filtered_drive(nodes, values, 1e-3, held=True)[50:-50]
    assert np.abs(late.mean(axis=1) - values[50:-51]).max() < 2e-4


def test_lost_rows_are_held_on_a_straight_line() -> None:
    time = np.array([0.0, 1.0, 2.0, 5.0, 6.0])
    np.testing.assert_allclose(held_between(time, time), [0.0, 1.0, 3.0, 5.0])  # 2, 3, 4 held a second each


@pytest.mark.parametrize(
    "options",
    [
        {"velocities": "guessed"},
        {"filter_time": 0.01},
        {"velocities": "observers", "filter_time": -1.0},
        {"velocities": "observers", "filter_time": "long"},
    ],
)
def test_options_that_cannot_be(paper_log: Recording, options: dict[str, object]) -> None:
    with pytest.raises(UsageError, match=r"velocities|filter_time"):
        of(paper_log, **options)


def test_the_paper_s_filter_is_the_default() -> None:
    assert Chain.of("observers", None) == Chain(True, 0.0125)
    assert Chain.of("smoothed", None) == Chain()
