"""All methods on one log: who agrees, who does not and why, in text, JSON, picture and page."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from factories import clean_result, refused_result, rotary_log, rotary_rig
from refusals import coded
from swingid.cli import main
from swingid.errors import UnanswerableError
from swingid.methods.table import METHODS
from swingid.report.figures.studies import draw_forest
from swingid.report.html import write_comparison
from swingid.result.result import Message, Parameter
from swingid.study.compare import Trial, compare
from swingid.study.compare.comparison import Assumptions, Comparison, assumptions, deviation, verdict
from swingid.uncertainty.budget import BudgetEntry, stated
from swingid.uncertainty.budget import scatter as scattering
from twin_logs import INERTIA, given, logged, twin

RIG = twin("Coulomb", counts_per_turn=16384)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return logged(RIG, tmp_path_factory.mktemp("compare"), duration=15.0)


@pytest.fixture(scope="module")
def comparison(log):
    return compare(log, given(RIG), ["momentum", "energy"])


def answer(value, scatter, *shared):
    """A result with an inertia whose budget is scatter and shared (signed) contributions of constants."""
    budget = [BudgetEntry(scattering("scatter"), "inertia", scatter)]
    budget += [BudgetEntry(stated(key, key), "inertia", abs(u), float(np.sign(u))) for key, u in shared]
    total = float(np.sqrt(scatter**2 + sum(u**2 for _, u in shared)))
    return replace(
        clean_result(), parameters={"inertia": Parameter.of(value, total, "kg m^2")}, budget=tuple(budget), warnings=()
    )


def trial(method, result, *, motor=False, friction="any", truth=None):
    return Trial("a.csv", method, result, 0.01, Assumptions("wheel inertia", motor, True, friction, "none"), truth)


def test_both_methods_answer_and_agree(comparison):
    assert [t.method for t in comparison.trials] == ["momentum", "energy"]
    assert all(t.truth == INERTIA for t in comparison.trials)
    assert all(abs(t.error) < 3e-3 for t in comparison.trials)
    assert comparison.verdicts[0].apart == ()


def test_rows_too_far_apart_for_one_method_leave_the_others_rows(tmp_path):
    """Fourteen rows a second, and rows with a gap of 3 s: the adaptation of the paper takes neither."""
    log = logged(RIG, tmp_path, duration=30.0)
    for time, kept in (("slow", slice(None, None, 70)), ("gap", np.r_[0:8000, 11000:30000])):
        rows = {name: getattr(log, name)[kept] for name in ("time", "angle", "wheel_angle", "voltage")}
        rows |= {"reference": None, "adaptive_gain": None}
        found = {t.method: t.result for t in compare(replace(log, **rows), given(RIG)).trials}
        assert found["momentum"].parameters, time
        assert found["backstepping"].error.code == "slow-rows", time


def test_a_crash_of_one_method_leaves_the_others_rows(log, monkeypatch):
    def crash(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setitem(METHODS, "energy", replace(METHODS["energy"], load=lambda: crash))
    found = compare(log, given(RIG), ["momentum", "energy"])
    assert found.trials[0].result.status != "refused"
    assert found.trials[1].result.error.code == "bug-LinAlgError"
    assert "a bug of swingid, LinAlgError" in found.summary()
    assert json.loads(found.to_json())["results"][1]["status"] == "refused"


def test_text_and_json_hold_every_method(comparison):
    text = comparison.summary()
    assert "verdict: all methods agree with momentum" in text
    data = json.loads(comparison.to_json())
    assert data["schema"] == "swingid.compare/1"
    assert [r["schema"] for r in data["results"]] == ["swingid.result/1"] * 2
    assert data["results"][1]["comparison"]["assumptions"]["motor"] is True
    assert data["results"][0]["comparison"]["relative_error"] == comparison.trials[0].error


def test_a_shared_constant_cancels_in_the_difference():
    a, b = answer(1.00, 0.01, ("wheel", 0.5)), answer(1.03, 0.01, ("wheel", 0.5))
    assert deviation(b, a) == pytest.approx(0.03 / (0.01 * np.sqrt(2)))
    opposite = answer(1.03, 0.01, ("wheel", -0.5))
    assert deviation(opposite, a) == pytest.approx(0.03 / np.hypot(1.0, 0.01 * np.sqrt(2)))


def test_an_unknown_uncertainty_says_nothing_of_agreement():
    vague = replace(clean_result(), parameters={"inertia": Parameter.of(1.0, None, "kg m^2")})
    assert deviation(vague, answer(2.0, 0.1)) is None


def test_agreement_with_a_method_that_warns_is_not_reassuring():
    warned = replace(answer(1.0, 0.1), warnings=(Message("gravity-torque-disagrees", "b is off."),))
    found = verdict("a.csv", [trial("momentum", warned), trial("energy", answer(1.0, 0.1))])
    assert found.apart == ()
    assert "but gravity-torque-disagrees of momentum" in found.message


def test_who_rests_on_the_motor_is_told_apart():
    trials = [
        trial("momentum", answer(1.0, 0.001)),
        trial("energy", answer(1.1, 0.001), motor=True, friction="basis"),
        trial("equation-error", answer(1.001, 0.001), friction="a law"),
    ]
    found = verdict("a.csv", trials)
    assert found.apart == ("energy",)
    assert "motor's constants" in found.message


def test_who_assumes_a_friction_law_is_told_apart():
    trials = [trial("momentum", answer(1.0, 0.001)), trial("equation-error", answer(1.1, 0.001), friction="a law")]
    assert "it assumes a friction law" in verdict("a.csv", trials).message


def test_a_difference_that_is_small_beside_both_uncertainties_stands_nobody_apart():
    # alike in the wheel, which makes nearly all of what either is uncertain by
    trials = [
        trial("momentum", answer(1.0, 1e-5, ("wheel", 0.01))),
        trial("equation-error", answer(1.0002, 1e-5, ("wheel", 0.01)), friction="a law"),
    ]
    assert abs(deviation(trials[1].result, trials[0].result)) > 10
    assert verdict("a.csv", trials).apart == ()


def test_a_refusal_is_a_row_and_a_reason(comparison):
    trials = (comparison.trials[0], replace(comparison.trials[1], result=refused_result()))
    text = replace(comparison, trials=trials).summary()
    assert "refused" in text
    assert refused_result().error.message.split(";")[0] in " ".join(text.split())


def test_no_answer_at_all_is_an_error():
    still = replace(rotary_log(), angle=np.zeros(5001), wheel_angle=np.zeros(5001))
    with pytest.raises(UnanswerableError, check=coded("no-motion", "momentum")):
        compare(still, rotary_rig(), ["momentum", "energy"])


def test_every_method_says_what_it_rests_on():
    rig = rotary_rig()
    for method in METHODS:
        assert assumptions(method, rig, clean_result()).scale == "wheel inertia"
    assert assumptions("energy", rig, clean_result()).motor
    assert assumptions("momentum", rig, clean_result()).words() == "wheel inertia, gravity torque"


def test_forest_shows_each_answer_at_its_error(comparison):
    (axes,) = draw_forest(comparison).axes
    shown = sorted(float(line.get_xdata()[0]) for line in axes.lines if len(line.get_xdata()) == 1)
    expected = sorted(100 * t.error for t in comparison.trials)
    assert set(np.round(expected, 9)) <= set(np.round(shown, 9))
    assert [label.get_text() for label in axes.get_yticklabels()] == ["momentum", "energy"]


def test_command_writes_page_and_json(tmp_path, capsys):
    rig = twin("viscous")
    log = logged(rig, tmp_path, duration=8.0)
    page, data = tmp_path / "c.html", tmp_path / "c.json"
    methods = ["--method", "momentum", "--method", "energy"]
    command = ["compare", log.source.path, "--rig", "paper", *methods, "--report", str(page), "--json", str(data)]
    assert main(command) == 0
    assert "Verdict" in page.read_text(encoding="utf-8")
    # the names of methods have a hyphen, at which a line would break
    assert page.read_text(encoding="utf-8").count('<td class="name">momentum</td>') == 2
    assert "td.name { white-space: nowrap; }" in page.read_text(encoding="utf-8")
    assert len(json.loads(data.read_text(encoding="utf-8"))["results"]) == 2
    assert "momentum" in capsys.readouterr().out


@pytest.mark.parametrize(("extra", "code"), [(["--report", "-"], 2), (["a.csv"], 2), ([], 3)])
def test_wrong_usage_is_one_sentence(capsys, extra, code):
    assert main(["compare", "a.csv", *extra, "--rig", "paper"]) == code
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_what_several_methods_say_alike_is_said_once(tmp_path):
    reading = Message("clock-jump", "three rows are late.")
    own = Message("motor-balance", "the motor's balance leaves 20 %.")
    trials = (
        trial("momentum", replace(answer(1.0, 0.1), warnings=(reading,))),
        trial("energy", replace(answer(1.0, 0.1), warnings=(reading, own))),
        trial("backstepping", replace(answer(1.0, 0.1), warnings=(reading,))),
    )
    comparison = Comparison(trials, (verdict("a.csv", trials),))
    assert comparison.messages("a.csv") == [("all methods", reading), ("energy", own)]
    assert comparison.summary().count(reading.message) == 1
    assert "all methods, clock-jump: three rows are late." in comparison.summary()
    page = write_comparison(comparison, rotary_rig(), tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count(reading.message) == 1
    assert "energy: the motor" in page
    without = Comparison((*trials[:2], trial("output-error", refused_result())), ())
    assert [who for who, _ in without.messages("a.csv")] == ["momentum, energy", "energy", "output-error"]
