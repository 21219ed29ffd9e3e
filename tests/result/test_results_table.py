"""``identify --table``, ``inspect --plot``, draws that cannot be made: what commands write for many logs."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from swingid.cli import main
from swingid.report.terminal import dots
from swingid.study.monte_carlo import monte_carlo

RIG = """name = "bob"
[axis]
gravity_torque = {gravity}
[drive]
kind = "none"
[log]
time = "t"
{angle}
"""
TIME = np.arange(0, 20, 0.01)
SWING = 0.2 * np.exp(-0.02 * TIME) * np.cos(5 * TIME)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "rig.toml").write_text(RIG.format(gravity="0.1", angle='angle = "q"'))
    noise = np.random.default_rng(0).normal(0, 1e-4, TIME.size)
    for name, rows in (("a", TIME.size), ("short", 150)):
        np.savetxt(
            tmp_path / f"{name}.csv", np.c_[TIME, SWING + noise][:rows], delimiter=",", header="t,q", comments=""
        )
    return tmp_path


def test_a_table_has_a_row_for_each_log_method_and_parameter(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = [str(files / name) for name in ("a.csv", "short.csv", "missing.csv")]
    out = files / "out.csv"
    methods = ["--method", "momentum", "--method", "equation-error"]
    assert main(["identify", *logs, "--rig", str(files / "rig.toml"), *methods, "--table", str(out)]) == 0
    assert "wrote" in capsys.readouterr().out
    rows = list(csv.DictReader(out.open()))
    assert {(row["log"], row["method"]) for row in rows} == {(log, one) for log in logs for one in methods[1::2]}
    alone = sw.identify(sw.Recording.load(logs[0], rig := sw.Rig.load(files / "rig.toml")), rig)
    first = rows[0]
    assert (first["parameter"], float(first["value"])) == ("inertia", alone.inertia.value)
    assert float(first["standard_uncertainty"]) == alone.inertia.standard_uncertainty
    assert (float(first["low95"]), float(first["high95"])) == alone.inertia.interval95
    refused = {row["log"]: row["codes"] for row in rows if row["status"] == "refused"}
    assert refused[logs[2]] == "missing-file"
    assert logs[1] in refused


def test_a_table_without_any_number_is_written_and_exits_with_4(files: Path) -> None:
    out = files / "out.csv"
    assert main(["identify", str(files / "short.csv"), "--rig", str(files / "rig.toml"), "--table", str(out)]) == 4
    assert "refused" in out.read_text()


@pytest.mark.parametrize("more", [["--json", "a.json"], ["--monte-carlo", "100"], ["--added", "1"]])
def test_what_is_for_one_result_does_not_go_with_a_table(files: Path, more: list[str]) -> None:
    command = ["identify", str(files / "a.csv"), "--rig", str(files / "rig.toml")]
    assert main([*command, "--table", str(files / "out.csv"), *more]) == 2
    assert main([*command, "--method", "momentum", "--method", "energy"]) == 2
    assert main([*command, "--table", str(files / "a.csv")]) == 2


def test_plots_of_an_inspection(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(files / "a.csv")
    assert main(["inspect", log, "--plot", str(files / "look.png")]) == 0
    assert (files / "look.png").read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()
    assert main(["inspect", log, "--plot", "-"]) == 0
    assert "angle from" in capsys.readouterr().out
    assert main(["inspect", log, "--plot", str(files / "look.docx")]) == 2
    assert main(["inspect", log, "--plot", log]) == 2


def test_dots_lie_where_the_points_are() -> None:
    lines = dots(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    assert lines[0].rstrip("\u2800").endswith("\u2808")  # the last column, top right dot
    assert lines[-1][0] == "\u2840"  # bottom left dot
    assert set("".join(dots(np.array([np.nan]), np.array([1.0])))) == {"\u2800"}


def test_no_draws_of_ratios_or_rates(files: Path) -> None:
    rig = sw.Rig.from_text(RIG.format(gravity='"unknown"', angle='angle = "q"'))
    log = sw.Recording.load(files / "a.csv", rig)
    linear = sw.identify(log, rig)
    found = monte_carlo(log, rig, "momentum", linear, 100)
    assert found.parameters == linear.parameters
    assert found.monte_carlo is None
    assert [one.code for one in found.notes if "no draws" in one.message] == ["no-draws"]
