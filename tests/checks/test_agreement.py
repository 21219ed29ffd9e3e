"""Every method beside momentum's answer: made once, compared by sources, and no two green answers that exclude it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from swingid.checks import momentum as against
from swingid.checks.momentum import DISAGREES, MomentumCheck, overlapping
from swingid.errors import UnanswerableError
from swingid.methods.momentum.method import momentum
from swingid.preparation.prepared import prepare
from swingid.result.result import Result
from swingid.study.compare import compare
from swingid.study.compare.comparison import Assumptions, Trial, _warned
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter, scatter, systematic

RIG = sw.Rig.from_text(
    'name = "arm"\n[axis]\ngravity_torque = "0.0255 ± 0.5 %"\ninertia = 9.6e-4\n[axis.friction]\nviscous = 1e-4\n'
    'coulomb = 3e-4\n[drive]\nkind = "none"\n[sensors]\ncounts_per_turn = 16384\nnoise = 2e-4\n'
)
"""A free decay, whose inertia is proportional to the gravity torque by every method."""


@pytest.fixture(scope="module")
def log() -> sw.Recording:
    return sw.simulate(RIG, duration=15.0, rate=200.0, initial_angle=1.2, seed=3)


@pytest.fixture(scope="module")
def check(log: sw.Recording) -> MomentumCheck:
    return MomentumCheck(prepare(log, RIG), momentum)


def answer(value: float, u: float, freedom: float = np.inf) -> Evaluated:
    parameter = Parameter.of(value, u, "kg m^2", freedom)
    entry = BudgetEntry(scatter("scatter", freedom), "inertia", u)
    return Evaluated({"inertia": parameter}, [entry], {"inertia": {"inertia": 1.0}})


def test_what_two_intervals_lack_to_meet_makes_them_meet() -> None:
    draws, apart = np.random.default_rng(5), 0
    for _ in range(300):
        one = answer(draws.normal(0.0, 3.0), draws.uniform(0.1, 1.0), draws.choice([1.5, 4.0, 30.0, np.inf]))
        other = answer(draws.normal(0.0, 3.0), draws.uniform(0.1, 1.0)).parameters["inertia"]
        tau, before = overlapping(one.parameters["inertia"], other), one.parameters["inertia"]
        low, high = (pick(p.interval95[k] for p in (before, other)) for k, pick in ((0, max), (1, min)))
        assert (tau > 0) == (low > high)
        apart += low > high
        after = one.widened(systematic(DISAGREES), "inertia", tau).parameters["inertia"]
        assert max(after.interval95[0], other.interval95[0]) <= min(after.interval95[1], other.interval95[1]) + 1e-12
    assert 50 < apart < 250


def test_it_grows_from_nothing_where_the_intervals_touch() -> None:
    other = Parameter.of(0.0, 1.0, "")
    gaps = [overlapping(Parameter.of(2 * 1.959964 + step, 1.0, ""), other) for step in (1e-6, 1e-3, 1e-1, 100.0)]
    assert gaps[0] < 2e-2  # as the root of the gap, as variances add
    assert sorted(gaps) == gaps
    assert gaps[-1] == pytest.approx(100 / 1.96, rel=0.03)


def test_a_constant_that_both_share_hides_no_difference(check: MomentumCheck) -> None:
    """Of 0.5 % of gravity, half a standard uncertainty apart: the interval holds it, and yet it is an error."""
    found = check.result()
    parameter = found.parameters["inertia"]
    shift = 0.5 * parameter.standard_uncertainty
    off = replace(parameter, value=parameter.value + shift)
    same, moved = (
        Evaluated(found.parameters | {"inertia": one}, list(found.budget), found.correlation)
        for one in (parameter, off)
    )
    for one, low, high in ((same, 0.0, 0.1), (moved, 0.9, 1.1)):
        widened, checked = check.compared(one, "the test")
        budget = {entry.source: entry.standard_uncertainty for entry in widened.budget if entry.parameter == "inertia"}
        assert low <= budget.get(DISAGREES, 0.0) / shift <= high
        assert not checked.warnings  # it is within the interval, which nobody would act upon


def test_a_difference_that_matters_is_a_warning(check: MomentumCheck) -> None:
    found = answer(1.05 * check.result().inertia.value, 1e-3 * check.result().inertia.value)
    widened, checked = check.compared(found, "the test")
    assert [one.code for one in checked.warnings] == ["disagrees-with-momentum"]
    assert "5.0 % more" in checked.warnings[0].message
    assert overlapping(widened.parameters["inertia"], check.result().inertia) == 0.0
    assert widened.parameters["inertia"].standard_uncertainty == pytest.approx(
        0.05 * check.result().inertia.value, rel=0.1
    )


def test_a_refusal_of_momentum_is_asked_for_once_and_leaves_the_method_as_it_is(
    log: sw.Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def refuses(check: MomentumCheck) -> Result:
        asked.append(check)
        raise UnanswerableError("no", code="not-identifiable")

    check, found = MomentumCheck(prepare(log, RIG), refuses), answer(1.0, 0.1)
    assert check.compared(found, "")[0] is check.compared(found, "")[0] is found
    assert len(asked) == 1
    with pytest.raises(UnanswerableError):
        check.result()


def test_several_methods_of_one_log_are_compared_with_one_answer(
    log: sw.Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    chosen = against.chosen_at_level
    monkeypatch.setattr(against, "chosen_at_level", lambda *given: made.append(given) or chosen(*given))
    trials = compare([log], RIG, ["energy", "equation-error"]).trials
    assert len(made) == 1
    assert all("momentum" in trial.result.details.checks for trial in trials)
    made.clear()
    assert sw.identify(log, RIG, "energy").inertia == trials[0].result.inertia
    assert len(made) == 1
    made.clear()
    compare([log], RIG, ["momentum", "energy"])
    assert len(made) == 2  # timed twice


def test_compare_shows_no_two_green_answers_that_exclude_each_other() -> None:
    nothing = Assumptions("", motor=False, gravity=False, friction="any", speed="none")

    def trial(method: str, value: float, log: str = "log", status: str = "ok") -> Trial:
        result = Result(method, status, {"inertia": Parameter.of(value, 1.0, "kg m^2")})  # type: ignore[arg-type]
        return Trial(log, method, result, 0.0, nothing, None)

    first = [trial("momentum", 10.0), trial("energy", 13.0), trial("equation-error", 7.0), trial("other", 7.0, "two")]
    shown = [_warned(one, first[:k]) for k, one in enumerate(first)]
    assert [one.status for one in shown] == ["ok", "ok", "warning", "ok"]
    assert shown[2].warnings[0].code == "excludes-another-method"
    assert "energy" in shown[2].warnings[0].message
    assert _warned(first[2], [trial("energy", 13.0, status="warning")]).status == "ok"
