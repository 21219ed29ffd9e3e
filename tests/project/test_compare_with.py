"""The comparer of two trees: what counts as equal, differing, added, intended or only reworded. No tree is run."""

from __future__ import annotations

import sys
from copy import deepcopy
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parents[2] / "tools"
sys.path.insert(0, str(TOOLS))

from compare_with.comparing import differences, same  # noqa: E402
from compare_with.verdict import Intended, matches, read_intended, rounding, text_of, verdict  # noqa: E402

RESULT = {
    "exit": 0,
    "stdout": "inertia 3.022e-3",
    "json": {
        "method": "momentum",
        "status": "warning",
        "parameters": {
            "inertia": {"value": 3.022e-3, "standard_uncertainty": 1e-6, "interval95": [3.02e-3, 3.024e-3]},
            "offset": {"value": 1e-19, "standard_uncertainty": 1e-6, "interval95": [-2e-6, 2e-6]},
        },
        "warnings": [{"code": "gaps", "message": "3 gaps."}, {"code": "spikes", "message": "1 spike."}],
        "budget": [
            {"source": "scatter", "parameter": "inertia", "standard_uncertainty": 1e-6, "sensitivity": None},
            {"source": "scatter", "parameter": "offset", "standard_uncertainty": 1e-21, "sensitivity": None},
        ],
        "provenance": {"versions": {"swingid": "0.1.0"}, "rows": 15001},
        "details": {"residuals": [1.0, -2.0, 1e-17, float("nan")]},
    },
}


def changed(path, value):
    """The result with another value at a path of keys and places."""
    new = deepcopy(RESULT)
    *tables, key = path
    at = new
    for name in tables:
        at = at[name]
    at[key] = value
    return new


def kinds(new, old=RESULT):
    return [(one.path, one.kind) for one in differences(old, new)]


def outcomes(**cases):
    return {name: {"outcome": one, "seconds": 0.1} for name, one in cases.items()}


def test_the_same_is_equal_with_nan_and_null():
    assert kinds(deepcopy(RESULT)) == []


INERTIA = ("json", "parameters", "inertia", "value")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (INERTIA, 3.022e-3 * (1 + 5e-10)),
        (("json", "parameters", "offset", "value"), -1e-19),  # against an uncertainty of 1e-6
        (("json", "details", "residuals", 2), -3e-17),  # beside 2
        (("json", "budget", 1, "standard_uncertainty"), 5e-21),  # beside 1e-6
        (("json", "provenance", "versions"), {"swingid": "9", "numpy": "3"}),
    ],
)
def test_rounding_and_what_is_excluded_are_equal(path, value):
    assert kinds(changed(path, value)) == []


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (INERTIA, 3.022e-3 * (1 + 2e-9)),
        (INERTIA, None),
        (INERTIA, float("nan")),
        (("exit",), 3),
        (("json", "status"), "ok"),
        (("json", "method"), "energy"),
        (("json", "provenance", "rows"), 15000),
        (("json", "details", "residuals", 3), 0.0),
        (("json", "details", "residuals", 3), None),
        (("json", "details", "residuals"), [1.0, -2.0]),
        (("json", "warnings"), RESULT["json"]["warnings"][:1]),
        (("json", "warnings"), [*RESULT["json"]["warnings"], {"code": "new", "message": "new."}]),
        (("json", "warnings"), RESULT["json"]["warnings"][::-1]),
    ],
)
def test_what_differs(path, value):
    found = differences(RESULT, changed(path, value))
    assert len(found) == 1
    assert found[0].kind in ("value", "missing")
    assert verdict(outcomes(case=RESULT), outcomes(case=changed(path, value)), []).failed


def test_true_is_not_one_and_text_is_no_number():
    assert not same(True, 1)
    assert not same("1", 1)
    assert same(1, 1.0)
    assert not same(float("inf"), 1e308)


def test_entries_are_paired_by_their_names():
    old = {"budget": [{"source": "a", "parameter": "x", "u": 1.0}, {"source": "b", "parameter": "x", "u": 2.0}]}
    new = {"budget": [{"source": "c", "parameter": "x", "u": 3.0}, *old["budget"]]}
    assert kinds(new, old) == [(".budget[c/x]", "value")]
    twice = {"notes": [{"code": "a", "message": "1"}, {"code": "a", "message": "2"}]}
    assert kinds({"notes": twice["notes"][:1]}, twice) == [(".notes[a #2]", "missing")]


def test_a_missing_key_fails_and_an_added_one_is_told():
    less, more = deepcopy(RESULT), deepcopy(RESULT)
    del less["json"]["budget"][0]["sensitivity"]
    more["json"]["correlation"] = {"inertia": {"offset": 0.1}}
    assert kinds(less) == [(".json.budget[scatter/inertia].sensitivity", "missing")]
    found = verdict(outcomes(case=RESULT), outcomes(case=more), [])
    assert not found.failed
    assert "correlation: 1 times" in text_of(found)


def test_words_are_counted_and_do_not_fail():
    new = changed(("json", "warnings", 0, "message"), "there are 3 gaps.")
    new["stdout"] = "J 3.022e-3"
    found = verdict(outcomes(case=RESULT), outcomes(case=new), [])
    assert not found.failed
    assert "reworded: 2 texts in 1 cases" in text_of(found, words=True)


def test_intended_differences_are_shown_apart():
    new = changed(INERTIA, 3.1e-3)
    wanted = Intended("twin/*", "*.parameters.inertia.*", "a fault is mended")
    unused = Intended("real/*", "*", "nothing")
    found = verdict(outcomes(**{"twin/a": RESULT}), outcomes(**{"twin/a": new}), [wanted, unused])
    assert not found.failed
    assert found.unused == [unused]
    assert "0.003022 -> 0.0031   (a fault is mended)" in text_of(found)
    assert verdict(outcomes(**{"real/a": RESULT}), outcomes(**{"real/a": new}), [wanted]).failed


def test_what_rounding_does_in_the_old_tree_is_no_failure():
    residuals = ("json", "details", "residuals")
    old, first = outcomes(case=RESULT), outcomes(case=changed(residuals, [1.0 + 1e-6, -2.0, 1e-17, float("nan")]))
    noise = rounding(old, first)
    assert noise == {("case", ".json.details.residuals[]"): pytest.approx(5e-7, rel=1e-3)}
    near, far = (outcomes(case=changed((*residuals, 1), -2.0 * (1 + share))) for share in (3e-6, 3e-5))
    assert not verdict(old, near, [], noise).failed
    assert "rounding: 1 paths in 1 cases" in text_of(verdict(old, near, [], noise))
    assert verdict(old, far, [], noise).failed
    assert verdict(old, near, []).failed
    assert verdict(old, outcomes(case=changed(INERTIA, 3.022e-3 * (1 + 5e-6))), [], noise).failed
    assert rounding(old, outcomes(case=changed(("json", "status"), "ok"))) == {}


def test_brackets_of_a_pattern_are_brackets():
    assert matches(".json.budget[a].u", "*.budget[[]a].u") is False
    assert matches(".json.budget[a].u", "*.budget[a].u")
    assert matches(".json.budget[a].u", "*.budget[*].u")


def test_crashes():
    crash = {"case": {"crash": "KeyError: 'x'", "seconds": 0.1}}
    fine = outcomes(case=RESULT)
    assert verdict(fine, crash, []).crashed == {"case": "KeyError: 'x'"}
    assert verdict(crash, fine, []).failed
    both = verdict(crash, crash, [])
    assert both.crashed_before == ["case"]
    assert not both.failed
    assert verdict(fine, {}, []).failed


def test_the_list_of_intended_differences_can_be_read():
    assert all(one.reason for one in read_intended(TOOLS / "compare_with" / "intended.toml"))
