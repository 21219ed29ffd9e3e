"""What `identify` prints: at most 15 lines and the warnings, with the expanded uncertainty and what would reduce it."""

from __future__ import annotations

import re
from dataclasses import replace
from math import sqrt

import pytest

import factories
from swingid.result.brief import brief, expanded
from swingid.result.result import Message, Parameter
from swingid.uncertainty.budget import BudgetEntry, Source, scatter, stated, systematic


def rows(text: str) -> dict[str, str]:
    found = (re.split(r"  +", line, maxsplit=1) for line in text.splitlines() if line[:1].strip())
    return {one[0]: one[-1] for one in found}


def test_a_clean_result() -> None:
    found = rows(brief(factories.clean_result()))
    assert found["inertia"].startswith("(3.023 ± 0.013)e-3 kg m²  (95 %, k = ")
    assert found["inertia"].endswith("u = 0.21 %)")
    assert found["status"].startswith("ok")
    assert "a.csv, 1.20 to 10.00 s" in found["log"]
    assert found["notes"] == "segment (-v shows them)"


@pytest.mark.parametrize(
    ("source", "words", "left"),
    [
        (scatter("scatter of the windows"), "four times as many swings", sqrt(1.0 - 0.75 * 0.64)),
        (stated("axis.gravity_torque", "axis.gravity_torque"), "measure axis.gravity_torque", sqrt(1.0 - 0.75 * 0.64)),
        (stated("sensors.nonlinearity", "sensors.nonlinearity"), "--encoders", sqrt(1.0 - 0.75 * 0.64)),
        (systematic("drift with the length of the windows"), "more swings do not reduce", None),
    ],
)
def test_the_largest_contribution_and_what_halves_it(source: Source, words: str, left: float | None) -> None:
    main = Parameter.of(2.0, 0.02, "kg m²")  # 1 %, of which the largest contribution is 0.8 %
    budget = (BudgetEntry(source, "inertia", 0.016), BudgetEntry(scatter("sensor noise"), "inertia", 0.012))
    result = replace(factories.clean_result(), parameters={"inertia": main}, budget=budget)
    text = brief(result)
    assert rows(text)["budget"].startswith("0.80 %")
    assert words in rows(text)["to reduce"]
    if left is not None:
        halved = re.search(r"becomes ± ([\d.]+) %", " ".join(text.split()))
        assert halved is not None
        assert float(halved[1]) == pytest.approx(1.96 * left, rel=0.02)


def test_many_parameters_logs_and_warnings() -> None:
    clean = factories.clean_result()
    many = {f"parameter_{k}": Parameter.of(float(k), 0.1, "N m") for k in range(12)}
    warned = Message("balance-open", "the balance leaves 39 % of the larger of its terms.")
    each = tuple(replace(clean, provenance={"log": f"runs/{k}.csv"}) for k in range(9))
    notes = tuple(Message(f"a-note-with-a-long-name-{k}", "words.") for k in range(6))
    result = replace(
        clean, status="warning", parameters=clean.parameters | many, per_log=each, warnings=(warned,), notes=notes
    )
    text = brief(result)
    before = text.split("balance-open")[0].splitlines()
    assert len(before) <= 15
    assert next(iter(rows(text))) == "inertia"
    assert warned.message in " ".join(text.split())
    assert "6 more logs: -v" in text
    assert max(map(len, text.splitlines())) <= 100


def test_an_unknown_uncertainty() -> None:
    assert expanded(Parameter.of(0.3, None, "rad/s")) == "0.3 rad/s  (uncertainty unknown)"


def test_refused() -> None:
    refused = factories.refused_result()
    assert brief(refused) == refused.summary()


@pytest.mark.parametrize(
    ("part", "words"), [("axis.lever", "measure axis.lever again"), ("axis.g", "state axis.latitude")]
)
def test_of_a_computed_constant_the_largest_part_is_named(part: str, words: str) -> None:
    """What halves a part of 0.8 of the constant's uncertainty leaves 1 - 0.75 of 0.64 of its variance."""
    entry = BudgetEntry(stated("axis.gravity_torque", "axis.gravity_torque"), "inertia", 1e-6, 1.0)
    clean = factories.clean_result()
    value = Parameter.of(3e-3, 1e-6, "kg m^2")
    made_of = {"axis.gravity_torque": {"axis.mass": 0.6, part: 0.8}}
    result = replace(
        clean,
        parameters=clean.parameters | {"inertia": value},
        budget=(entry,),
        provenance=clean.provenance | {"made_of": made_of},
    )
    found = rows(brief(result))["to reduce"]
    assert words in found
    before, after = (float(number) for number in re.findall(r"± ([\d.]+) %", found))
    assert after / before == pytest.approx(sqrt(1 - 0.75 * 0.64), rel=0.02)
