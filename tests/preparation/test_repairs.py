"""Every repair of a log has a name and a switch and is named where it was made; only a wrong clock is mended."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recording_cases import columns_of, rig_with, swing, write_columns
from refusals import coded
from swingid.cli import main
from swingid.errors import InputError, UsageError
from swingid.identification import identify
from swingid.recording import Recording
from swingid.recording.findings import REPAIRS
from swingid.recording.rows import even_clock

RIG = rig_with(sensors="counts_per_turn = 16384").changed({"axis.gravity_torque": 1.9e-3})
LOG = swing(rate=500.0, duration=12.0)
COUNT = 2 * np.pi / 16384
AS_A_METHOD_ASKS = ("encoders", "latency", "limit", "push", "calibrate", "zero", "device-clock")
"""Repairs that are not made on reading, or not in every log; they have tests of their own."""


def faulty(folder, fault: str):
    """A log that needs the repair `fault`, as a file."""
    columns = {name: column.copy() for name, column in columns_of(LOG).items()}
    for name in ("q1", "q2"):
        columns[name] = np.round(columns[name] / COUNT) * COUNT
    rows = np.arange(len(LOG))
    if fault == "blanks":
        columns["q1"][700:703] = np.nan
    elif fault == "sort":
        rows[[400, 401]] = rows[[401, 400]]
    elif fault == "repeats":
        rows = np.sort(np.r_[rows, [900, 900]])
    elif fault == "clock":
        columns["t"] = columns["t"] + np.random.default_rng(1).normal(0, 2e-4, len(LOG))
    elif fault == "unwrap":
        columns["q2"] = (columns["q2"] + np.pi) % (2 * np.pi) - np.pi
    elif fault == "spikes":
        columns["q1"][[800, 2500]] += [0.5, -0.7]
    elif fault == "lost-rows":
        rows = np.delete(rows, [1500, 2600, 2601, 4030])
        columns["t"][rows] = LOG.time[: len(rows)]
    return write_columns(folder / f"{fault}.csv", {name: column[rows] for name, column in columns.items()})


def repaired(log: Recording) -> list[str]:
    return [found.repair for found in log.findings if found.repair is not None and found.code != "repair-off"]


@pytest.mark.parametrize("fault", [name for name in REPAIRS if name not in AS_A_METHOD_ASKS])
def test_each_repair_is_named_and_can_be_switched_off(tmp_path, fault):
    path = faulty(tmp_path, fault)
    assert repaired(Recording.load(path, RIG)) == [fault]
    off = {fault: False}
    if fault in ("blanks", "sort", "repeats"):  # no recording can be made of such rows
        with pytest.raises(InputError, match=f"without the repair '{fault}', which is switched off") as caught:
            Recording.load(path, RIG, repairs=off)
        assert caught.value.code
        return
    left = Recording.load(path, RIG, repairs=off)
    assert repaired(left) == []
    assert "repair-off" in {found.code for found in left.findings}
    expected = np.loadtxt(path, delimiter=",", skiprows=1)
    for column, channel in ((0, left.time), (1, left.angle), (2, left.wheel_angle)):
        assert np.array_equal(channel, expected[:, column])


def test_a_command_beyond_the_limit_is_the_limit(tmp_path):
    limited_rig = RIG.changed({"drive.motor.voltage_limit": 4.0})
    path = faulty(tmp_path, "none")  # up to 5 V
    log = Recording.load(path, limited_rig)
    assert repaired(log) == ["limit"]
    assert np.array_equal(log.voltage, np.clip(Recording.load(path, RIG).voltage, -4.0, 4.0))
    left = Recording.load(path, limited_rig, repairs={"limit": False})
    assert {found.code for found in left.findings if found.level == "warning"} == {"voltage-beyond-limit"}
    assert np.array_equal(left.voltage, Recording.load(path, RIG).voltage)
    measured = Recording.load(path, limited_rig.changed({"log.drive_held": False}))
    assert measured.findings == ()


def test_a_clean_log_is_not_touched(tmp_path):
    loaded = Recording.load(faulty(tmp_path, "none"), RIG)
    assert loaded.findings == ()
    assert np.array_equal(loaded.time, LOG.time)


def test_result_names_the_repairs_and_a_saved_file_keeps_them(tmp_path):
    log = Recording.load(faulty(tmp_path, "spikes"), RIG)
    again = Recording.load(log.save(tmp_path / "saved.parquet", RIG), RIG, repairs={"unwrap": False})
    for recording, more in ((log, []), (again, [("unwrap", False)])):
        repairs = json.loads(identify(recording, RIG).to_json())["provenance"]["repairs"]
        assert [(one["repair"], one["done"]) for one in repairs] == [("spikes", True), *more]
        assert repairs[0]["what"].startswith("2 of 6000 rows left out")


def test_unknown_repairs_are_refused_with_the_nearest():
    with pytest.raises(UsageError, check=coded("unknown-repair", "spikes")):
        Recording.load("nowhere.csv", RIG, repairs={"spike": False})
    with pytest.raises(UsageError, check=coded("bad-repair", "'spikes' is 'no'")):
        Recording.load("nowhere.csv", RIG, repairs={"spikes": "no"})


# The clock


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 10**6),
    rate=st.sampled_from([100.0, 1000.0]),
    jitter=st.floats(0.06, 0.15),
    lost=st.sampled_from([0.0, 0.05]),
    epoch=st.sampled_from([0.0, 1.7e9]),
)
def test_a_jittered_clock_is_found_to_a_thousandth_of_a_step(seed, rate, jitter, lost, epoch):
    """Stamps with normal jitter, some rows missing: the true instants come back, up to a common offset."""
    rng = np.random.default_rng(seed)
    log = swing(rate=rate, duration=10.0)
    kept = rng.random(len(log)) >= lost
    stamps = log.time + np.clip(rng.normal(0, jitter, len(log)), -0.45, 0.45) / rate
    clock = even_clock(epoch + stamps[kept], [log.angle[kept], log.wheel_angle[kept]])
    assert clock is not None
    off = (clock.time - epoch - log.time[kept]) * rate
    sigma = jitter / np.sqrt(kept.sum())  # of a fitted line, twice that at its ends
    assert np.abs(off).max() < 6 * 2 * sigma + 1e-4


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), spread=st.floats(0.02, 0.15))
def test_rows_taken_at_odd_moments_keep_their_stamps(seed, spread):
    """The same scatter, but the angles are those at the stamps: nothing to mend."""
    rng = np.random.default_rng(seed)
    even = np.arange(2000) / 200.0
    time = even + np.clip(rng.normal(0, spread, 2000), -0.45, 0.45) / 200
    angle, wheel = 0.8 * np.sin(8.5 * time), -20 * np.sin(8.5 * time)
    assert even_clock(time, [np.round(angle / COUNT) * COUNT, np.round(wheel / COUNT) * COUNT]) is None


def test_late_stamps_of_a_busy_computer_are_mended(tmp_path):
    """One row in fifty is stamped late by up to three steps, and the rows behind it wait."""
    rng = np.random.default_rng(3)
    late = np.where(rng.random(len(LOG)) < 0.02, rng.uniform(0, 6e-3, len(LOG)), rng.exponential(5e-5, len(LOG)))
    stamps = np.maximum.accumulate(LOG.time + late) + 1e-6 * np.arange(len(LOG))
    loaded = Recording.load(write_columns(tmp_path / "log.csv", columns_of(LOG) | {"t": stamps}), RIG)
    assert repaired(loaded) == ["clock"]
    off = loaded.time - LOG.time
    assert np.ptp(off - 1e-6 * np.arange(len(LOG))) < 1e-4


def test_stamps_of_too_few_digits_are_mended_where_no_row_is_missing(tmp_path):
    columns = columns_of(LOG) | {"t": np.round(LOG.time, 2)}
    path = write_columns(tmp_path / "log.csv", columns)
    loaded = Recording.load(path, RIG)
    assert repaired(loaded) == ["clock"]
    off = loaded.time - LOG.time
    assert np.ptp(off) < 1e-2 * 2e-3  # the rate; the offset is lost in the rounding
    assert np.abs(off).max() < 5e-3
    with pytest.raises(InputError) as caught:
        Recording.load(path, RIG, repairs={"clock": False})
    assert caught.value.code == "repeated-times"


def test_command_switches_repairs_off(tmp_path, capsys):
    path, rig = faulty(tmp_path, "spikes"), tmp_path / "rig.toml"
    rig.write_text(RIG.text, encoding="utf-8")
    for words, done in ((), True), (("--without-repair", "spikes"), False):
        assert main(["identify", str(path), "--rig", str(rig), "--json", "-", *words]) == 0
        repairs = json.loads(capsys.readouterr().out)["provenance"]["repairs"]
        assert [(one["repair"], one["done"]) for one in repairs] == [("spikes", done)]
    for logs in ([str(path)], [str(path), str(faulty(tmp_path, "sort"))]):
        assert main(["identify", *logs, "--rig", str(rig), "--without-repair", "spike"]) == 2
        assert "the nearest is spikes" in capsys.readouterr().err


def test_command_uses_a_part(tmp_path, capsys):
    path, rig = faulty(tmp_path, "none"), tmp_path / "rig.toml"
    rig.write_text(RIG.text, encoding="utf-8")
    for words, rows in (([], 6000), (["--part", "2:"], 5000), (["--part", "2:9.5"], 3751)):
        assert main(["identify", str(path), "--rig", str(rig), "--json", "-", *words]) == 0
        assert json.loads(capsys.readouterr().out)["provenance"]["rows"] == rows
    for wrong in ("2", "9:2", "a:b"):
        assert main(["identify", str(path), "--rig", str(rig), "--part", wrong]) == 2
        assert "write FROM:TO in seconds" in capsys.readouterr().err
