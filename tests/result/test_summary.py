"""The summary says what the result holds, in the order in which a reader asks."""

from __future__ import annotations

from dataclasses import replace

import pytest

import factories
from swingid.result.result import Message, Parameter, Result
from swingid.result.summary import folded, segment_text, summarise, value_text
from swingid.uncertainty.budget import BudgetEntry, stated


def sections(text: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line.startswith("[["):
            found[line.strip("[]")] = []
        else:
            list(found.values())[-1].append(line.strip())
    return found


def test_a_clean_result_tells_how_what_and_how_sure() -> None:
    found = sections(factories.clean_result().summary())
    assert list(found) == [
        "Identification",
        "Parameters",
        "Uncertainty of the inertia",
        "Friction",
        "Estimates by kind of window",
        "Notes",
    ]
    assert found["Identification"][2] == "log     = runs/a.csv (5001 rows)"
    assert found["Identification"][4].endswith("1.20 s to 10.00 s, 24 turning points, modulating functions of ±0.18 s")
    assert "".join(found["Parameters"][0].split()) == "inertia:(3.0228±0.0064)e-3kgm²(0.21%)95%:[3.0103,3.0353]e-3"
    assert "law: viscous" in found["Friction"][0]
    assert found["Friction"][1].split() == ["coulomb", "+", "viscous", "+6.4"]
    assert found["Estimates by kind of window"][0].endswith("(the estimate)")
    assert "+0.013 %" in found["Estimates by kind of window"][1]
    assert found["Notes"] == ["segment: used the part from 1.2 to 10 s: after the transient."]


def test_the_budget_is_sorted_and_split_by_type() -> None:
    lines = sections(factories.clean_result().summary())["Uncertainty of the inertia"]
    assert [line.split()[0] for line in lines[:3]] == ["B", "B", "A"]
    assert lines[0].endswith("0.20 %")
    # sqrt(6² + 2²)e-6 and 1e-6 of 3.0228e-3
    assert lines[3] == "type A (from the data) 0.033 %; type B (from the rig's constants) 0.21 %"


def test_an_unknown_uncertainty_is_said_and_explained() -> None:
    lines = sections(factories.clean_result().summary())["Parameters"]
    assert "(uncertainty unknown)" in lines[2]
    assert lines[2].startswith("stribeck_speed: 0.3 rad/s  ")
    assert lines[3].startswith("stribeck_speed has no uncertainty: it is found by a search")
    own = Message("no-uncertainty", "the inertia has one pass only, so there is no scatter to judge it by.")
    result = replace(factories.doubtful_result(), notes=(own,))
    assert own.message in " ".join(result.summary().split())


def test_a_value_of_unknown_uncertainty_claims_few_digits() -> None:
    assert value_text(Parameter.of(0.50894123, None, "rad/s")) == "0.5089 rad/s"


def test_warnings_say_what_to_do() -> None:
    found = sections(factories.doubtful_result().summary())
    assert found["Identification"][1].startswith("status  = warning")
    assert found["Warnings"][0] == "near-resonance: the motion is near resonance; drive at 8.5 rad/s or more."
    assert found["Warnings"][1].startswith("spikes: ")


def test_a_refusal_is_one_sentence() -> None:
    text = summarise(factories.refused_result())
    assert text == "momentum: no number, because runs/a.csv: the angle moves by 0.0004 only; record a swing."
    assert "\n" not in summarise(Result("energy", "refused", error=Message("x", "two\nlines..")))


def test_a_linear_axis_has_its_units() -> None:
    text = factories.linear_result().summary()
    assert "(95.10 ± 0.50) kg " in text
    assert "(203.0 ± 4.0) N s/m" in text
    assert "kg m²" not in text


def test_the_least_that_a_method_can_give() -> None:
    bare = Result("m", "ok", parameters={"inertia": factories.clean_result().inertia})
    assert list(sections(bare.summary())) == ["Identification", "Parameters"]


@pytest.mark.parametrize(
    ("sizes", "shown"),
    [
        ([5.0, 4.0, 3.0], 3),
        ([5.0, 4.0, 0.01], 3),  # one small entry is no shorter when folded
        ([5.0, 4.0, 0.01, 0.01], 2),
        ([5.0] * 8, 4),
    ],
)
def test_small_or_surplus_entries_are_folded(sizes: list[float], shown: int) -> None:
    entries = [BudgetEntry(stated(f"s{k}", None), "inertia", size) for k, size in enumerate(sizes)]
    listed, rest = folded(entries, 4)
    assert len(listed) == shown
    assert listed + rest == entries


def test_no_line_is_longer_than_a_terminal_wants() -> None:
    long = Message("long", "word " * 80)
    text = replace(factories.clean_result(), notes=(long,)).summary()
    assert max(map(len, text.splitlines())) <= 110


def test_only_turning_points_of_the_used_part_are_counted() -> None:
    details = factories.clean_result().details
    assert details is not None
    assert "23 turning points" in segment_text(replace(details, start=details.turning_times[0] + 0.01))
    assert "1 turning point," in segment_text(replace(details, stop=details.turning_times[0] + 0.01))
