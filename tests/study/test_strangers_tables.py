"""The tables of the suite of foreign logs: kinds of rigs, exact intervals of shares, the spread of repeats."""

from __future__ import annotations

import runpy
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TABLES = runpy.run_path(str(BENCHMARKS / "strangers_tables.py"))
ENTRY = {"rig": "emps.toml", "evidence": [1.0, 2.0], "held_out": True, "series": 2}


@pytest.fixture
def strangers(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.delitem(sys.modules, "strangers", raising=False)
    import strangers

    return strangers


def row(log: str, status: str = "ok", verdict: str = "meets", **more: object) -> dict[str, object]:
    return {"log": log, "method": "momentum", "status": status, "verdict": verdict, "codes": [], **more}


def test_every_entry_has_a_rig_an_interval_and_a_kind(strangers):
    kinds = Counter()
    for entry in strangers.entries():
        low, high = entry["evidence"]
        assert 0 < low < high, entry["name"]
        assert entry["how"], entry["name"]
        kinds[TABLES["kind"](strangers.HERE / "rigs" / entry["rig"])] += 1
    assert set(kinds) == set(TABLES["KINDS"])
    assert min(kinds.values()) >= 3, kinds


def test_the_second_series_is_held_out_by_its_checksums(strangers):
    later = [entry for entry in strangers.entries() if entry.get("series") == 2]
    assert len(later) >= 60
    for entry in later:
        assert entry["held_out"] == (int(entry["sha256"][0], 16) % 2 == 0), entry["name"]


@pytest.mark.parametrize(("hits", "of", "low", "high"), [(10, 10, 0.025**0.1, 1.0), (0, 5, 0.0, 1 - 0.025**0.2)])
def test_the_interval_of_a_share_is_exact(hits, of, low, high):
    assert TABLES["interval"](hits, of) == pytest.approx((low, high))


def test_shares_count_ok_answers_to_usable_logs():
    entries = dict.fromkeys("abc", ENTRY) | {"d": ENTRY | {"unusable": "no drive"}}
    rows = [row("a"), row("b", verdict="misses", by=1.5), row("c", "warning"), row("d", verdict="misses", by=9.0)]
    head, *parts = TABLES["shares"](rows, entries)
    only = parts[0]
    assert [part[0] for part in parts] == ["second series, held out", "second series, all"]
    found = dict(zip(head, only, strict=True))
    assert (found["answers"], found["ok"], found["of these hold"], found["off by, worst"]) == (
        "3",
        "2",
        "1",
        "1.5 half-widths",
    )


def test_unusable_logs_have_rows_of_their_own():
    entries = {"a": ENTRY, "b": ENTRY | {"unusable": "no drive"}}
    table = list(TABLES["by_kind"]([row("a"), row("b", verdict="misses")], entries, BENCHMARKS / "strangers" / "rigs"))
    assert [line[0] for line in table[1:]] == ["carriage", TABLES["UNUSABLE"]]


def test_the_spread_of_repeats_has_the_distribution_of_chi_squared():
    rng = np.random.default_rng(3)
    u, common = np.array([1.0, 2.0, 0.5, 1.0, 1.5]), np.array([3.0, 3.0, 3.0, -3.0, 0.0])
    covariance = np.diag(u**2) + np.outer(common, common)
    drawn = [
        TABLES["spread"](10 + u * rng.standard_normal(5) + common * rng.standard_normal(), covariance)
        for _ in range(2000)
    ]
    ratios = np.array([ratio for _, ratio, _, _ in drawn])
    _, _, low, high = drawn[0]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.07)  # sqrt(2/4)/sqrt(2000) = 0.016
    assert np.mean((ratios < low) | (ratios > high)) == pytest.approx(0.05, abs=0.02)


def test_a_constant_that_acts_alike_on_all_does_not_widen_the_spread():
    entries = dict.fromkeys("abc", ENTRY)
    rows = [row(name, value=1.0 + 0.1 * k, own=0.1) for k, name in enumerate("abc")]
    _, alone = TABLES["repeats"](rows, entries)
    _, shared = TABLES["repeats"]([one | {"shared": {"gain": 0.5}} for one in rows], entries)
    assert shared == alone


def test_repeats_are_ok_answers_of_one_body():
    entries = dict.fromkeys("abcd", ENTRY) | {"e": ENTRY | {"evidence": [3.0, 4.0]}}
    rows = [row(name, value=1.0 + 0.1 * k, own=0.1) for k, name in enumerate("abc")]
    rows += [row("d", "warning", value=9.0, own=0.1), row("e", value=9.0, own=0.1)]
    _, only = TABLES["repeats"](rows, entries)
    assert only[2] == "3"
    assert only[-1] == "within"
