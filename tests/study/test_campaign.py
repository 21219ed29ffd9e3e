"""Campaigns as they run: the same bytes however they are run, failures as rows, effects known in closed form."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from refusals import coded
from swingid.cli import main
from swingid.cli.campaign import progress_line
from swingid.errors import InputError, UsageError
from swingid.study.campaign import run_campaign, summarise, trial
from swingid.study.campaign.loading import plan_from_text
from swingid.study.experiment import Experiment

PLAN = """
name = "small"
repeats = 6
block = 1
[base]
reference = "sine 0.8 rad 8.5 rad/s"
duration = 5
both.sensors.noise = 1e-3
[factors.rate]
key = "rate"
values = [250, 500]
"""


def results(folder: Path) -> bytes:
    return (folder / "results.parquet").read_bytes()


def command(out: str, workers: int) -> list[str]:
    return [sys.executable, "-m", "swingid", "campaign", "plan.toml", "--out", out, "--workers", str(workers)]


@pytest.mark.long
def test_killed_and_started_again_it_ends_with_the_same_bytes_for_any_number_of_workers(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN)
    whole = subprocess.Popen(command("whole", 2), cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    process = subprocess.Popen(command("killed", 1), cwd=tmp_path, stderr=subprocess.DEVNULL)
    parts = tmp_path / "killed" / "parts"
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline and (not parts.is_dir() or len(list(parts.glob("part-*"))) < 2):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    there = sorted(parts.glob("part-*"))
    assert 2 <= len(there) < 12
    before = {path: path.stat().st_mtime_ns for path in there}
    assert not (tmp_path / "killed" / "results.parquet").exists()
    again = subprocess.run(command("killed", 1), cwd=tmp_path, capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    assert f"{len(there)} of 12 runs were there already" in again.stderr
    assert {path: path.stat().st_mtime_ns for path in there} == before
    assert whole.wait() == 0
    assert results(tmp_path / "killed") == results(tmp_path / "whole")


def test_a_folder_belongs_to_one_plan(tmp_path: Path) -> None:
    plan = plan_from_text(PLAN.replace("repeats = 6", "repeats = 1"))
    run_campaign(plan, tmp_path / "one", workers=1)
    before = results(tmp_path / "one")
    run_campaign(plan, tmp_path / "one", workers=1)
    assert results(tmp_path / "one") == before
    other = plan_from_text(PLAN.replace("repeats = 6", "repeats = 1").replace("duration = 5", "duration = 6"))
    with pytest.raises(InputError, check=coded("other-plan", "plan.base.duration")):
        run_campaign(other, tmp_path / "one", workers=1)
    with pytest.raises(InputError) as caught:
        run_campaign(plan.with_runs(1), tmp_path / "one", workers=1)
    assert caught.value.code == "other-plan"
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("x")
    with pytest.raises(InputError) as caught:
        run_campaign(plan, tmp_path / "full", workers=1)
    assert caught.value.code == "not-a-campaign"
    with pytest.raises(UsageError, match="--workers is 0"):
        run_campaign(plan, tmp_path / "one", workers=0)


def test_two_processes_do_not_write_into_one_folder(tmp_path: Path) -> None:
    plan = plan_from_text(PLAN.replace("repeats = 6", "repeats = 1"))

    def again(*_: int) -> None:
        with pytest.raises(InputError) as caught:
            run_campaign(plan, tmp_path / "one", workers=1)
        assert caught.value.code == "busy"

    run_campaign(plan, tmp_path / "one", workers=1, progress=again)


def test_a_failed_trial_is_a_row_with_its_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = PLAN.replace("repeats = 6", "repeats = 2").replace('key = "rate"', 'key = "duration"')
    plan = plan_from_text(text.replace("[factors.rate]", "[factors.length]").replace("[250, 500]", "[0.3, 5]"))
    unlucky = plan.seed(1, 1)
    real = Experiment.log

    def drawn(experiment: Experiment, seed: int) -> object:
        if seed == unlucky:
            raise ZeroDivisionError("by chance")
        return real(experiment, seed)

    monkeypatch.setattr(Experiment, "log", drawn)
    rows = pq.read_table(run_campaign(plan, tmp_path / "one", workers=1)).to_pylist()
    assert [row["status"] for row in rows] == ["refused", "refused", "ok", "failed"]
    assert rows[0]["message"].endswith(".")
    assert rows[3]["code"] == "bug-ZeroDivisionError"
    assert rows[3]["message"] == "by chance"
    assert np.isnan(rows[3]["value"])
    summary = summarise(plan, tmp_path / "one")
    assert summary.failures == {"bug-ZeroDivisionError": 1}
    assert summary.of("momentum").answered == 1
    assert summary.of("momentum").refusals[rows[0]["code"]] == 2
    assert summary.at("length", "5", "momentum").runs == 2


def test_a_wrong_wheel_inertia_does_what_row_one_says(tmp_path: Path) -> None:
    """Without gravity row (I) gives a11/a12, so J1^ = (J1 + J2 + Jr) a12^/a12 - J2^ - Jr."""
    plan = plan_from_text("""
name = "wheel"
[base]
reference = "sine 0.8 rad 8.5 rad/s"
duration = 8
both.axis.gravity_torque = 0.0
both.sensors.counts_per_turn = "absent"
[factors.wheel]
key = "stated.drive.wheel.inertia"
relative = true
values = [0.9, 1.0, 1.2]
""")
    run_campaign(plan, tmp_path / "one", workers=1)
    summary = summarise(plan, tmp_path / "one")
    j1, j2, jr, n = 302.2e-5, 11.34e-5, 0.21e-5, 4.4
    for factor in (0.9, 1.0, 1.2):
        known = ((j1 + j2 + jr) * (factor * j2 + n * jr) / (j2 + n * jr) - factor * j2 - jr) / j1 - 1
        assert summary.at("wheel", f"{factor:g}", "momentum").bias[0] == pytest.approx(known, abs=2e-6)
    (effect,) = summary.effects
    assert (effect.low[1], effect.high[1], effect.rmse[1]) == ("0.9", "1.2", "1.2")


def test_the_command_writes_results_summary_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["campaign", "efficiency", "--runs", "2", "--out", str(out), "--workers", "1", "--json", "-"]) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary["schema"] == "swingid.campaign/1"
    assert [cell["method"] for cell in summary["overall"]] == ["momentum", "energy", "output-error", "equation-error"]
    assert "2 of 2 runs" in captured.err
    page = (out / "report.html").read_text()
    assert "Cramér–Rao" in page
    assert "<svg" in page
    assert re.findall(r'(?:src|href)="(?!#)', page) == []
    assert re.findall(r"\bnan\b|\bNone\b", page) == []
    assert main(["campaign", "--list"]) == 0
    assert "paper-variants" in capsys.readouterr().out
    assert main(["campaign"]) == 2
    assert main(["campaign", "coverage", "--workers", "1", "--scheduler", "tcp://x:1"]) == 2


@pytest.mark.long
def test_runs_done_together_are_those_of_a_single_log(tmp_path: Path) -> None:
    """Batched estimates of 40 runs in blocks of 16: each run's truth, and the error of single logs."""
    text = (
        PLAN.replace("repeats = 6", "repeats = 20")
        .replace("block = 1", "block = 16")
        .replace("duration = 5", "duration = 8")
    )
    text = text.replace("[base]\n", '[base]\nmethods = ["momentum-batch"]\n')
    text = text.replace("both.sensors.noise = 1e-3", 'both.sensors.noise = 1e-3\nboth.axis.inertia = "3.022e-3 ± 3e-5"')
    plan = plan_from_text(text)
    rows = pq.read_table(run_campaign(plan, tmp_path / "one", workers=1)).to_pylist()
    assert [(row["trial"], row["point"], row["repeat"]) for row in rows] == [(k, *divmod(k, 20)) for k in range(40)]
    truth, value, u = (np.array([row[name] for row in rows]) for name in ("truth", "value", "u"))
    assert np.std(truth / 3.022e-3) == pytest.approx(0.01, rel=0.4)
    assert np.sqrt(np.mean((value / truth - 1) ** 2)) < 2e-4
    # windows of so short a log are few, so that the least uncertainty that the sensors allow is often the one told
    assert 0.4 < np.sqrt(np.mean(((value - truth) / u) ** 2)) < 1.6
    alone = trial.experiment_at(plan, 1).log(rows[25]["seed"])
    assert alone.metadata["truth"]["inertia"] == rows[25]["truth"]


def test_progress_says_what_is_left() -> None:
    assert progress_line(0, 100, 0, 0.0) == "0 of 100 runs"
    assert progress_line(40, 100, 40, 0.1) == "40 of 100 runs were there already"
    assert progress_line(60, 100, 40, 10.0) == "60 of 100 runs, 20 s left"
    assert progress_line(10, 1000, 0, 10.0) == "10 of 1000 runs, 16 min left"
    assert progress_line(100, 100, 0, 5.0) == "100 of 100 runs, 5 s"
