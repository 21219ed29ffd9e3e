"""The limit by which a ratio of speed counts as worse: no alarm by noise, an alarm by what is slower."""

from __future__ import annotations

import importlib
import json
import math
import random
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "speed"


@pytest.fixture
def history(monkeypatch, tmp_path):
    """benchmarks/speed/history.py with a folder of records of its own."""
    monkeypatch.syspath_prepend(str(FOLDER))
    module = importlib.import_module("history")
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    yield module
    for name in ("history", "case"):
        sys.modules.pop(name, None)


def records(*ratios: float, machine: str = "here") -> list[dict]:
    return [{"time": f"{k:03}", "processor": machine, "ratios": {"a": {"ratio": r}}} for k, r in enumerate(ratios)]


def test_nothing_is_compared_without_a_record(history):
    assert history.limit("a", [], "here") is None
    assert history.limit("b", records(1.0, 1.0, 1.0), "here") is None


def test_three_records_notice_what_is_a_third_slower(history):
    limit = history.limit("a", records(5.4, 5.5, 5.6), "here")
    assert 1.25 * 5.5 < limit < 1.33 * 5.5
    assert history.limit("a", records(*[5.5] * 8), "here") < limit


def test_noise_gives_an_alarm_as_seldom_as_stated(history):
    """Ratios that scatter by `TYPICAL`: one in a thousand is above, so of 4000 about 4, and hardly more than 15."""
    draw = random.Random(1)
    above = 0
    for _ in range(4000):
        made = [math.exp(draw.gauss(0.0, history.TYPICAL)) for _ in range(6)]
        above += made[-1] > history.limit("a", records(*made[:-1]), "here")
    assert above < 15


def test_what_was_recorded_before_a_gain_does_not_hide_its_loss(history):
    before = records(5.5, 5.4, 5.6, 1.1, 1.0, 1.05)
    assert history.limit("a", before, "here") < 1.5
    assert history.limit("a", before[:4], "here") == pytest.approx(2.2)


def test_another_processor_gets_a_wide_limit(history):
    assert history.limit("a", records(0.5, 0.5, 0.5, machine="there"), "here") == pytest.approx(1.0)


def test_a_file_that_is_no_record_is_named(history, tmp_path):
    good = {"time": "2026", "processor": "here", "ratios": {}, "commit": "x"}
    (tmp_path / "good.json").write_text(json.dumps(good))
    assert len(history.records()) == 1
    for text in ("", "{", "[]", "{}", "3"):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(SystemExit, match=r"bad\.json is no record of speed"):
            history.records()
