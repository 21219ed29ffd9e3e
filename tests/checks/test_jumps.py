"""Jumps of an angle: what they do to the inertia is in its budget; a note where the rest outweighs it."""

from __future__ import annotations

import numpy as np
import pytest

from closed_form_logs import free_log, free_rig
from swingid.identification import identify
from swingid.recording import Recording
from swingid.recording.findings import JUMPS
from swingid.result.result import Result
from swingid.uncertainty.budget import BudgetEntry, outweighed, systematic

TIME = np.arange(24_001) / 1000
SMOOTH = free_log(lambda v: 1e-4 * v, TIME)


def answer(size: float, at: float, method: str = "momentum") -> Result:
    """Of a free decay whose encoder slips by `size` (rad) at `at` (s), and whose angle has noise of 0.1 mrad."""
    rig = free_rig()
    angle = SMOOTH.angle + np.random.default_rng(1).normal(0, 1e-4, len(TIME)) + size * (at <= TIME)
    columns = {rig.log.time: TIME, rig.log.angle: angle}
    return identify(Recording.from_columns(columns, rig), rig, method)


def effect(found: Result) -> float:
    """Of the jumps, in the budget of the inertia."""
    return sum(one.standard_uncertainty for one in found.budget if (one.parameter, one.source) == ("inertia", JUMPS))


@pytest.mark.parametrize("at", [3.0, 9.7, 16.2])
def test_the_budget_has_what_a_jump_does(at):
    even, slipped = answer(0.0, at), answer(0.02, at)
    assert effect(even) == 0
    # the zero of the decay follows both sides, so that less than all of it may be seen
    assert abs(slipped.inertia.value - even.inertia.value) < 1.1 * effect(slipped)
    assert "jumps" in {one.code for one in slipped.notes}
    assert slipped.status == "ok"


@pytest.mark.parametrize("method", ["energy", "equation-error", "output-error"])
def test_every_method_has_it(method):
    assert effect(answer(0.02, 9.7, method)) > 0


def test_a_jump_outside_of_the_part_does_nothing():
    found = answer(0.2, 16.2)  # the part ends there
    assert effect(found) == 0
    assert "jumps" in {one.code for one in found.notes}


@pytest.mark.parametrize(("jump", "rest", "expected"), [(0.0, 1.0, False), (2.0, 1.0, True), (2.1, 1.0, False)])
def test_an_effect_is_outweighed_up_to_two_standard_uncertainties_of_the_rest(jump, rest, expected):
    entries = [BudgetEntry(systematic(name), "inertia", u) for name, u in ((JUMPS, jump), ("another", rest))]
    assert outweighed(entries, "inertia", JUMPS) is expected
