"""Logs that are read in parts: averaging is exact where it says so, parts join without a seam, answers agree."""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import large_logs
import swingid as sw
from closed_form_logs import INERTIA
from large_logs import GIVEN, RATE, make_parts_small, write_large_log
from long_cases import quick_first
from refusals import coded
from swingid.cli import main
from swingid.cli.progress import Progress
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.recording.large import LargeLog, is_large
from swingid.recording.large.parts import averaged, block_length
from swingid.recording.recording import Recording

ROWS = 450_000


@pytest.fixture
def small_parts(monkeypatch):
    make_parts_small(monkeypatch, 60_000, 12_000)


@pytest.fixture(scope="module")
def parquet(tmp_path_factory) -> Path:
    """45 s at 10 kHz."""
    return write_large_log(tmp_path_factory.mktemp("large") / "log.parquet", ROWS, row_group=100_000)


def columns_of(path: Path) -> dict[str, np.ndarray]:
    """The columns of a Parquet file."""
    table = pq.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def rewritten(path: Path, folder: Path, **changes) -> str:
    """The file with other columns."""
    table = pa.table(columns_of(path) | changes)
    pq.write_table(table, folder / "changed.parquet")
    return str(folder / "changed.parquet")


def recordings(large: LargeLog) -> list[Recording]:
    """The parts of a log."""
    found = [part for _, part in large.parts()]
    assert all(isinstance(part, Recording) for part in found), found
    return found


@pytest.mark.parametrize("method", quick_first(1, ["momentum", "energy"]))
def test_the_parts_together_say_what_the_whole_log_says(small_parts, parquet, method):
    whole = sw.identify(Recording.load(parquet, GIVEN), GIVEN, method)
    large = sw.identify(LargeLog(str(parquet), GIVEN), GIVEN, method)
    assert len(large.provenance["parts"]) > 2
    assert large.provenance["rows"] == ROWS
    assert large.status == whole.status == "ok"
    spread = np.hypot(whole.inertia.standard_uncertainty, large.inertia.standard_uncertainty)
    assert abs(large.inertia.value - whole.inertia.value) < 2 * spread
    assert large.inertia.interval95[0] < INERTIA < large.inertia.interval95[1]
    assert large.inertia.standard_uncertainty < 1e-4 * INERTIA
    if method == "momentum":
        assert large.parameters["viscous"].value == pytest.approx(large_logs.VISCOUS, rel=2e-3)
        assert large.parameters["coulomb"].value == pytest.approx(large_logs.COULOMB, rel=2e-3)


@pytest.mark.parametrize("method", quick_first(1, ["momentum", "energy"]))
def test_any_number_of_processes_gives_the_same_result(small_parts, parquet, tmp_path, method):
    columns = columns_of(parquet)
    columns["q1"][:60_000] = columns["q1"][0]  # a part without motion, whose refusal comes from another process, too
    path = rewritten(parquet, tmp_path, **columns)
    found, told = [], []
    for workers in (1, 2, 3):
        log = LargeLog(path, GIVEN, progress=lambda *rows: told.append(rows), workers=workers)
        found.append(sw.identify(log, GIVEN, method).to_json())
    assert "parts-without-number" in found[0]
    assert found[1] == found[0]
    assert found[2] == found[0]
    assert told == told[: len(told) // 3] * 3
    assert told[-1] == (ROWS, ROWS)


@pytest.mark.long
def test_text_gives_the_same_parts_as_parquet(small_parts, parquet, tmp_path):
    text = tmp_path / "log.csv"
    pc.write_csv(pq.read_table(parquet), text)
    assert is_large(text)
    times = [np.concatenate([part.time for part in recordings(LargeLog(str(p), GIVEN))]) for p in (parquet, text)]
    angles = [np.concatenate([part.angle for part in recordings(LargeLog(str(p), GIVEN))]) for p in (parquet, text)]
    grid = np.arange(1000, 40_000) * 1e-3
    assert np.interp(grid, times[0], angles[0]) == pytest.approx(np.interp(grid, times[1], angles[1]), abs=1e-3)
    results = [sw.identify(LargeLog(str(path), GIVEN), GIVEN).inertia for path in (parquet, text)]
    assert abs(results[0].value - results[1].value) < results[0].standard_uncertainty


def test_nothing_is_lost_from_piece_to_piece(small_parts, parquet):
    found = recordings(LargeLog(str(parquet), GIVEN))
    block = found[0].averaged
    assert block % 2 == 1
    assert block > 5
    assert not any(part.drive_held for part in found)
    for part in found:
        assert np.diff(part.time) == pytest.approx(block / RATE, rel=1e-9)
    used = sum(len(part) for part in found) * block
    assert ROWS - used <= len(found) * 2 * block


@given(st.integers(1, 12), st.integers(20, 200), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_averaging_in_pieces_is_averaging_at_once(half, rows, seed):
    """Means of times and angles, and exact means of a held voltage, however the rows come."""
    block = 2 * half + 1
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.9, 1.1, rows * 3))
    channels = {"time": time, "angle": rng.normal(size=time.size), "voltage": rng.normal(size=time.size)}
    whole, _ = averaged(channels, block, ("voltage",))
    cut = int(rng.integers(1, time.size))
    first, rest = averaged({k: v[:cut] for k, v in channels.items()}, block, ("voltage",))
    second, _ = averaged({k: np.concatenate((rest[k], channels[k][cut:])) for k in rest}, block, ("voltage",))
    for name in ("time", "angle"):
        assert np.array_equal(np.concatenate((first[name], second[name])), whole[name])
    for k in range(1, len(whole["time"]) - 1):
        begin = (whole["time"][k - 1] + whole["time"][k]) / 2
        end = (whole["time"][k] + whole["time"][k + 1]) / 2
        edges = np.concatenate(([begin], time[(time > begin) & (time < end)], [end]))
        held = channels["voltage"][np.searchsorted(time, edges[:-1], "right") - 1]
        assert whole["voltage"][k] == pytest.approx(held @ np.diff(edges) / (end - begin), abs=1e-9)


def test_a_mean_keeps_what_is_linear_in_the_angle(parquet):
    """Of a sine the mean over w is the sine times sin(ωw/2)/(n sin(ωw/2n)), at the middle of the block."""
    time, omega, block = np.arange(30_000) * 1e-4, 8.5, 11
    found, rest = averaged({"time": time, "angle": np.sin(omega * time)}, block, ())
    factor = np.sin(omega * block * 1e-4 / 2) / (block * np.sin(omega * 1e-4 / 2))
    assert found["angle"] == pytest.approx(factor * np.sin(omega * found["time"]), abs=1e-12)
    assert 1 - factor == pytest.approx((omega * block * 1e-4) ** 2 / 24, rel=0.02)
    assert rest["time"][0] == time[len(found["time"]) * block]


def test_blocks_across_a_gap_are_left_out():
    time = np.concatenate((np.arange(1000), np.arange(1500, 2500))) * 1e-3
    found, _ = averaged({"time": time, "angle": time.copy()}, 7, ())
    assert found["angle"] == pytest.approx(found["time"], abs=1e-12)
    assert not ((found["time"] > 1.0) & (found["time"] < 1.5)).any()


@pytest.mark.parametrize(("frequency", "least", "most"), [(0.5, 31, 33), (5.0, 1, 3), (50.0, 1, 1)])
def test_no_swing_is_shortened_to_few_rows(frequency, least, most):
    time = np.arange(100_000) / 10_000
    noise = np.random.default_rng(0).normal(0, 0.02, time.size)
    assert least <= block_length(np.sin(2 * np.pi * frequency * time) + noise) <= most
    assert block_length(noise) == 1


def test_slow_logs_are_not_averaged(small_parts, parquet, tmp_path):
    thin = {name: values[::10] for name, values in columns_of(parquet).items()}
    many = {name: np.concatenate([values[:-1]] * 3) for name, values in thin.items()}
    many["t"] = np.arange(len(many["q1"])) / 1000.0
    many["q2"] = many["q2"] + np.repeat(np.arange(3) * thin["q2"][-1], len(thin["q1"]) - 1)
    path = tmp_path / "slow.parquet"
    pq.write_table(pa.table(many), path)
    found = recordings(LargeLog(str(path), GIVEN))
    assert {part.averaged for part in found} == {1}
    assert sum(len(part) for part in found) == len(many["t"])


def test_angles_within_one_turn_go_on_over_pieces(small_parts, parquet, tmp_path):
    columns = columns_of(parquet)
    fast = columns["q2"] + 40.0 * columns["t"]
    path = rewritten(parquet, tmp_path, q2=np.mod(fast, 2 * np.pi))
    found = recordings(LargeLog(path, GIVEN))
    straight = recordings(LargeLog(rewritten(parquet, tmp_path, q2=fast), GIVEN))
    for one, other in zip(found, straight, strict=True):
        assert "unwrapped" in {finding.code for finding in one.findings}
        apart = one.wheel_angle - other.wheel_angle
        assert np.ptp(apart) < 1e-9


def test_spikes_before_averaging_are_found_after_it(small_parts, parquet, tmp_path):
    angle = columns_of(parquet)["q1"].copy()
    angle[[100_017, 200_234]] += 1.0
    result = sw.identify(LargeLog(rewritten(parquet, tmp_path, q1=angle), GIVEN), GIVEN)
    assert "spikes" in {message.code for message in (*result.warnings, *result.notes)}
    assert result.inertia.interval95[0] < INERTIA < result.inertia.interval95[1]


@pytest.mark.parametrize("repaired", [True, False])
def test_spikes_of_an_angle_within_one_turn_are_left_out_as_of_a_whole_log(monkeypatch, tmp_path, repaired):
    from swingid.recording.large import log, parts

    for module, name, value in ((log, "LARGE", 0), (log, "PIECE", 400), (parts, "ENOUGH", 300)):
        monkeypatch.setattr(module, name, value)
    time, spikes = np.arange(1200) / 100, [150, 300, 555, 900]
    angle = 3.0 * np.sin(2 * time) + 3.7
    angle[spikes] += 2.5
    path = tmp_path / "log.csv"
    pc.write_csv(pa.table({"t": time, "q1": np.mod(angle, 2 * np.pi)}), path)
    rig = sw.Rig.from_text('drive = {kind = "none"}', "rig.toml")
    read = [part for _, part in LargeLog(str(path), rig, repairs={"spikes": repaired}).parts()]
    whole = Recording.load(path, rig, repairs={"spikes": repaired})
    assert np.array_equal(np.concatenate([part.time for part in read]), whole.time)
    code = "spikes" if repaired else "spikes-left"
    assert [[f.code for f in part.findings].count(code) for part in (*read, whole)] == [1, 1, 1, 1]


def test_no_repair_is_silent(small_parts, parquet, tmp_path):
    wheel = columns_of(parquet)["q2"].copy()
    wheel[[1000, 300_000]] = np.nan
    result = sw.identify(LargeLog(rewritten(parquet, tmp_path, q2=wheel), GIVEN), GIVEN)
    assert "rows-without-numbers" in {message.code for message in result.notes}
    assert [one["repair"] for one in result.provenance["repairs"]] == ["blanks"]
    assert len({message.code for message in result.notes}) == len(result.notes)


def test_a_part_that_stands_apart_is_named(small_parts, parquet, tmp_path):
    columns = columns_of(parquet)
    wheel = columns["q2"].copy()
    late = columns["t"] > 36.0
    wheel[late] = wheel[late][0] + 1.01 * (wheel[late] - wheel[late][0])
    result = sw.identify(LargeLog(rewritten(parquet, tmp_path, q2=wheel), GIVEN), GIVEN)
    assert result.status == "warning"
    # a wheel's scale that is wrong in a part contradicts gravity there, which widens the interval of that part
    assert {"parts-disagree", "gravity-torque-disagrees"} & {message.code for message in result.warnings}
    assert result.inertia.interval95[0] < INERTIA < result.inertia.interval95[1]


def test_parts_without_motion_are_left_out(small_parts, parquet, tmp_path):
    columns = columns_of(parquet)
    still = 200_000
    longer = {name: np.concatenate((np.full(still, values[0]), values)) for name, values in columns.items()}
    longer["t"] = np.arange(len(longer["t"])) / RATE
    path = tmp_path / "rest.parquet"
    pq.write_table(pa.table(longer), path)
    result = sw.identify(LargeLog(str(path), GIVEN), GIVEN)
    assert "parts-without-number" in {message.code for message in result.notes}
    assert result.inertia.interval95[0] < INERTIA < result.inertia.interval95[1]


def test_time_that_goes_back_is_refused(small_parts, parquet, tmp_path):
    time = columns_of(parquet)["t"].copy()
    time[240_000:] -= 5.0
    with pytest.raises(InputError, check=coded("unsorted")):
        sw.identify(LargeLog(rewritten(parquet, tmp_path, t=time), GIVEN), GIVEN)


def test_a_fault_behind_the_first_rows_is_named_by_its_rows_of_the_file(small_parts, parquet, tmp_path):
    angle = columns_of(parquet)["q1"].copy()
    angle[130_000:165_000] = np.nan
    with pytest.raises(InputError) as refused:
        sw.identify(LargeLog(rewritten(parquet, tmp_path, q1=angle), GIVEN), GIVEN)
    where = "(rows 120001 to 180000) has no number in column 'q1' in 35000 of 60000 rows (the first is row 130001)"
    assert where in refused.value.message


def test_a_short_part_is_read_as_any_log(small_parts, parquet):
    short = LargeLog(str(parquet), GIVEN, span=(5.0, 12.0)).small()
    assert short is not None
    assert short.averaged == 1
    assert (short.time[0], short.time[-1], len(short)) == (5.0, 12.0, 70_001)
    assert LargeLog(str(parquet), GIVEN, span=(5.0, 25.0)).small() is None
    found = recordings(LargeLog(str(parquet), GIVEN, span=(5.0, 25.0)))
    assert found[0].time[0] >= 5.0
    assert found[-1].time[-1] <= 25.0
    with pytest.raises(UnanswerableError) as caught:
        LargeLog(str(parquet), GIVEN, span=(60.0, 70.0)).small()
    assert caught.value.code == "empty-segment"


def test_other_methods_say_what_to_do(small_parts, parquet):
    with pytest.raises(UsageError, check=coded("too-large", "--part FROM:TO", "momentum", "energy")):
        sw.identify(LargeLog(str(parquet), GIVEN), GIVEN, "output-error")


def test_damage_is_said_in_one_sentence(small_parts, parquet, tmp_path):
    content = bytearray(parquet.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 4000] = bytes(4000)
    path = tmp_path / "damaged.parquet"
    path.write_bytes(content)
    with pytest.raises(InputError, check=coded("not-a-table", "Parquet")):
        sw.identify(LargeLog(str(path), GIVEN), GIVEN)
    path.write_bytes(content[:-10])
    with pytest.raises(InputError, check=coded("not-a-table", "Parquet")):
        is_large(path)


def test_the_command_reads_a_large_log(small_parts, parquet, tmp_path, capfd):
    rig = tmp_path / "rig.toml"
    rig.write_text(GIVEN.text)
    target = tmp_path / "result.json"
    assert main(["identify", str(parquet), "--rig", str(rig), "--json", str(target)]) == 0
    said = json.loads(target.read_text())
    assert said["provenance"]["log_sha256"] == Recording.load(parquet, GIVEN).source.sha256
    assert said["provenance"]["rows"] == ROWS
    assert len(said["provenance"]["parts"]) > 2
    assert len(said["details"]["turning_times"]) > 100
    assert main(["identify", str(parquet), "--rig", str(rig), "--method", "equation-error"]) == 2
    assert (
        main(["identify", str(parquet), "--rig", str(rig), "--part", "3:9", "--report", str(tmp_path / "r.html")]) == 0
    )
    capfd.readouterr()


def test_progress_says_how_far_and_how_long(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("swingid.cli.progress.time.monotonic", lambda: now[0])
    progress = Progress("million rows", 1e6)
    for rows, second in ((1_000_000, 20.0), (2_000_000, 21.0), (5_000_000, 36.0), (36_000_000, 60.0)):
        now[0] = second
        progress(rows, 36_000_000)
    assert capsys.readouterr().err.splitlines() == [
        "swingid: 1.0 of 36.0 million rows.",  # which compiled kernels, so nothing is known of the time
        "swingid: 5.0 of 36.0 million rows, 2 min left.",
        "swingid: 36.0 of 36.0 million rows.",
    ]


def test_inspect_convert_and_init_take_large_logs(small_parts, parquet, tmp_path, capfd, monkeypatch):
    text = tmp_path / "log.csv"
    pc.write_csv(pq.read_table(parquet), text)
    assert main(["convert", str(text), str(tmp_path / "back.parquet")]) == 0
    back = columns_of(tmp_path / "back.parquet")
    assert all(np.array_equal(values, back[name]) for name, values in columns_of(parquet).items())
    assert main(["convert", str(text), str(tmp_path / "back.mat")]) == 3
    assert main(["inspect", str(text)]) == 0
    assert "of which the first" in capfd.readouterr().out
    assert main(["init", "--from", str(text), str(tmp_path / "rig")]) == 0
    assert 'angle = "q1"' in (tmp_path / "rig" / "rig.toml").read_text()
    monkeypatch.setattr("swingid.recording.load.MOST_ROWS", ROWS - 1)
    with pytest.raises(InputError, check=coded("too-large")):
        Recording.load(parquet, GIVEN)


def benchmark(monkeypatch):
    """benchmarks/large_log.py."""
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "benchmarks")
    return importlib.import_module("large_log")


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="no wait4 here")
def test_measured_memory_is_that_of_the_command_alone(monkeypatch):
    held = np.ones(40_000_000)  # 320 MB of this process
    found = benchmark(monkeypatch)._timed([sys.executable, "-c", "kept = b'x' * 50_000_000"])
    assert held[0] == 1.0
    assert 0.05 < found["memory"] < 0.15


TWO = """
import subprocess, sys, time
ended = subprocess.Popen([sys.executable, "-c", ""])
own = b"x" * 50_000_000
subprocess.run([sys.executable, "-c", "import time; kept = b'x' * 50_000_000; time.sleep(1)"])
"""


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="no proportional set sizes here")
def test_measured_memory_is_that_of_all_processes_together(monkeypatch):
    """One of which has ended, and is not yet forgotten."""
    found = benchmark(monkeypatch)._timed([sys.executable, "-c", TWO])
    assert 0.1 < found["memory"] < 0.2


@pytest.mark.long
def test_memory_and_speed_of_three_million_rows(tmp_path, monkeypatch):
    """In a process of its own, as a user runs it; a loose bound on the speed, for a busy machine."""
    _command = benchmark(monkeypatch)._command
    path = write_large_log(tmp_path / "log.parquet", 3_000_000)
    for method in ("momentum", "energy"):
        _command(path, method)  # compiles, which takes memory and time of its own
        found = _command(path, method)
        assert found["memory"] < 0.8
        assert found["processor"] < 10.0
        low, high = found["result"]["parameters"]["inertia"]["interval95"]
        assert low < INERTIA < high
        assert high - low < 2e-4 * INERTIA


@pytest.mark.long
def test_intervals_cover_the_truth(tmp_path):
    """Two minutes at 10 kHz, many encoders' noises and places of their grids."""
    missed = 0
    for seed in range(20):
        path = write_large_log(tmp_path / "log.parquet", 1_200_000, seed=seed)
        low, high = sw.identify(LargeLog(str(path), GIVEN), GIVEN).inertia.interval95
        missed += not low < INERTIA < high
    assert missed <= 3
