"""Faults planted into a known motion: found where they are, nowhere else, and the motion comes back."""

from __future__ import annotations

import cProfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from long_cases import quick_first
from recording_cases import columns_of, rig_with, swing, write_columns
from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.recording import Recording
from swingid.recording.continuity import find_jumps, find_spikes, is_wrapped, unwrap

TURN = 2.0 * np.pi
LOG = swing(rate=200.0)
LONG = swing(duration=9.0)


def load(tmp_path, rig=None, **columns):
    """LOG with these columns in the place of its own, through a CSV file."""
    return Recording.load(write_columns(tmp_path / "log.csv", {**columns_of(LOG), **columns}), rig or rig_with())


def codes(recording):
    return [(finding.code, finding.level) for finding in recording.findings]


def rows_in_order(tmp_path, order, rig=None):
    """LOG with its rows in this order."""
    path = write_columns(tmp_path / "log.csv", {name: column[order] for name, column in columns_of(LOG).items()})
    return Recording.load(path, rig or rig_with())


def test_rows_out_of_order_are_sorted_with_a_warning(tmp_path):
    order = np.arange(1000)
    order[[100, 101]] = order[[101, 100]]
    order[[500, 503]] = order[[503, 500]]
    loaded = rows_in_order(tmp_path, order)
    assert np.array_equal(loaded.time, LOG.time)
    assert np.array_equal(loaded.angle, LOG.angle)
    assert codes(loaded) == [("unsorted", "warning")]
    assert "after 3 of 1000 rows (the first is row 101)" in loaded.findings[0].message


def test_a_block_in_the_wrong_place_is_sorted(tmp_path):
    loaded = rows_in_order(tmp_path, np.roll(np.arange(1000), 300))
    assert np.array_equal(loaded.angle, LOG.angle)
    assert codes(loaded) == [("unsorted", "warning")]


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (np.arange(1000)[::-1], "time in column 't' runs backwards, from 4.995 to 0 s; if the rows are stored newest"),
        (np.random.default_rng(1).permutation(1000), r"column 't' runs backwards after \d+ of 1000 rows"),
    ],
)
def test_many_rows_out_of_order_are_refused(tmp_path, order, why):
    with pytest.raises(InputError, match=why) as caught:
        rows_in_order(tmp_path, order)
    assert caught.value.code in ("unsorted", "backwards")


def test_two_runs_in_one_file_are_refused(tmp_path):
    """One step back in time only; but sorted by time the two motions would be shuffled into each other."""
    columns = {name: np.concatenate([column, column]) for name, column in columns_of(LOG).items()}
    columns["q1"][1000:] *= -0.7
    columns["t"][1000:] += 0.001
    with pytest.raises(InputError) as caught:
        Recording.load(write_columns(tmp_path / "log.csv", columns), rig_with())
    assert caught.value.code == "unsorted"


def test_copies_of_rows_go_with_a_note(tmp_path):
    loaded = rows_in_order(tmp_path, np.sort(np.r_[np.arange(1000), [3, 3, 700]]))
    assert np.array_equal(loaded.angle, LOG.angle)
    assert codes(loaded) == [("repeated-rows", "note")]
    assert loaded.findings[0].message.startswith("3 of 1003 rows")


def test_few_contradicting_stamps_keep_the_first_row_and_warn(tmp_path):
    time = LOG.time.copy()
    time[[51, 700]] = time[[50, 699]]
    loaded = load(tmp_path, t=time)
    assert np.array_equal(loaded.angle, np.delete(LOG.angle, [51, 700]))
    assert codes(loaded) == [("repeated-times", "warning"), ("gaps", "note")]
    assert "(the first is row 52)" in loaded.findings[0].message


def test_a_time_column_with_too_few_digits_is_refused_where_rows_may_be_missing(tmp_path):
    kept = np.delete(np.arange(1000), [300, 301, 302, 303])
    columns = {name: column[kept] for name, column in columns_of(LOG).items()}
    columns["t"] = np.round(columns["t"], 2)
    with pytest.raises(InputError) as caught:
        Recording.load(write_columns(tmp_path / "log.csv", columns), rig_with())
    assert caught.value.code == "repeated-times"


def test_single_precision_and_rounded_stamps_are_no_fault(tmp_path):
    for time in (LOG.time.astype(np.float32), np.round(LOG.time, 3), LOG.time + 1.7e9):
        loaded = load(tmp_path, t=time)
        assert {finding.code for finding in loaded.findings} <= {"from-epoch"}
        begin = time[0] if time[0] > 1e8 else 0.0
        assert np.array_equal(loaded.time, time.astype(float) - begin)


@pytest.mark.parametrize("stamp", [0.0, -5.0, 1e300, 400.0])
def test_a_stamp_that_fits_neither_neighbour_costs_its_row(tmp_path, stamp):
    time = LOG.time.copy()
    time[500] = stamp
    loaded = load(tmp_path, t=time)
    assert np.array_equal(loaded.time, np.delete(LOG.time, 500))
    assert np.array_equal(loaded.angle, np.delete(LOG.angle, 500))
    (found, gaps) = loaded.findings
    assert found.code == ("absurd-numbers" if stamp == 1e300 else "wrong-stamps")
    assert found.level == "warning"
    assert "row 501" in found.message
    assert gaps.code == "gaps"
    with pytest.raises(InputError, match="cannot be used without the repair"):
        Recording.load(loaded.source.path, rig_with(), repairs={found.repair: False})


@pytest.mark.parametrize("channel", ["q1", "q2", "u"])
def test_a_number_that_no_rig_gives_costs_its_row(tmp_path, channel):
    values = columns_of(LOG)[channel].copy()
    values[500] = -1e300
    loaded = load(tmp_path, **{channel: values})
    assert np.array_equal(loaded.time, np.delete(LOG.time, 500))
    assert codes(loaded) == [("absurd-numbers", "warning"), ("gaps", "note")]
    assert f"column '{channel}' holds -1e+300 in row 501" in loaded.findings[0].message


def test_uneven_stamps_and_missing_rows_stay_as_they_are(tmp_path):
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.002, 0.008, 1000))
    kept = np.sort(rng.choice(1000, 950, replace=False))
    columns = {name: np.interp(time, LOG.time, column)[kept] for name, column in columns_of(LOG).items()}
    columns["t"] = time[kept]
    loaded = Recording.load(write_columns(tmp_path / "log.csv", columns), rig_with())
    assert np.array_equal(loaded.time, time[kept])
    assert {level for _, level in codes(loaded)} <= {"note"}


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), counts=st.sampled_from([0, 16384, 256]), rate=st.sampled_from([1000.0, 50.0]))
def test_planted_spikes_are_found_and_nothing_else(data, counts, rate):
    """At 1 kHz and 50 Hz, exact and rounded to 14 and 8 bit, spikes of 0.4 rad and more a dozen samples apart."""
    log = swing(rate=rate)
    rows = len(log)
    gaps = data.draw(st.lists(st.integers(13, 30), min_size=1, max_size=8))
    spikes = np.cumsum(gaps) + data.draw(st.integers(0, rows - sum(gaps) - 10))
    sizes = np.array(data.draw(st.lists(st.floats(0.4, 1e3), min_size=len(gaps), max_size=len(gaps))))
    signs = np.where(np.arange(len(gaps)) % 2, 1.0, -1.0)
    for channel in (log.angle, log.wheel_angle):
        values = np.floor(channel * counts / TURN) * TURN / counts if counts else channel.copy()
        assert not find_spikes(log.time, values).any()
        values[spikes] += sizes * signs
        assert set(np.flatnonzero(find_spikes(log.time, values))) == set(spikes)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2, 1e-1])
@pytest.mark.parametrize("counts", [0, 16384, 1024, 256])
@pytest.mark.parametrize("uneven", [False, True])
def test_clean_motions_have_no_spikes(noise, counts, uneven):
    """Noise, rounding, rest, starts and stops, Coulomb kinks of the speed's slope and a hand that lets go."""
    rng = np.random.default_rng(3)
    time = np.arange(20000) / 1000.0
    if uneven:
        time = np.sort(rng.choice(time, 19000, replace=False)) + rng.uniform(0.0, 0.0008, 19000)
    decay = np.where(time < 3.0, 1.2, 1.2 * np.cos(5.0 * (time - 3.0)) * np.maximum(0.0, 1.0 - (time - 3.0) / 14.0))
    bounce = np.abs(np.sin(2.0 * time))  # kinks: the speed itself jumps
    for motion in (swing(1000.0, 20.0).wheel_angle[: time.size], decay, bounce):
        values = motion + noise * rng.normal(size=time.size)
        values = np.floor(values * counts / TURN) * TURN / counts if counts else values
        assert not find_spikes(time, values).any()
        assert find_jumps(time, values) == []


@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2])
@pytest.mark.parametrize("counts", [0, 16384, 1024])
@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("size", [-1.0, 0.3])
def test_a_planted_jump_is_found_with_its_size(noise, counts, uneven, size):
    rng = np.random.default_rng(4)
    time = np.arange(8000) / 1000.0
    if uneven:
        time += rng.uniform(0.0, 0.0008, 8000)
    values = np.interp(time, LONG.time, LONG.angle) + noise * rng.normal(size=8000) + size * (np.arange(8000) >= 5000)
    values = np.floor(values * counts / TURN) * TURN / counts if counts else values
    assert [row for row, _ in find_jumps(time, values)] == [5000]
    assert find_jumps(time, values)[0][1] == pytest.approx(
        size, abs=6 * noise + (3 * TURN / counts if counts else 1e-3)
    )


def test_a_jump_warns(tmp_path):
    loaded = load(tmp_path, q2=LOG.wheel_angle + 3.0 * (np.arange(1000) >= 700))
    assert codes(loaded) == [("jumps", "warning")]
    assert f"'q2' jumps by 3 at {LOG.time[700]:g} s" in loaded.findings[0].message


def test_few_spikes_are_dropped_counted_and_noted(tmp_path):
    angle, wheel = LOG.angle.copy(), LOG.wheel_angle.copy()
    angle[[200, 206]] += 1.0
    wheel[640] = 0.0
    loaded = load(tmp_path, q1=angle, q2=wheel)
    assert np.array_equal(loaded.angle, np.delete(LOG.angle, [200, 206, 640]))
    assert codes(loaded) == [("spikes", "note"), ("gaps", "note")]
    assert loaded.findings[0].message == "3 of 1000 rows left out: isolated spikes of an angle at 1, 1.03, 3.2 s."


def wrapped(values, unit, base):
    return np.mod(values / TURN * unit - base, unit) + base


@pytest.mark.parametrize("base", ["zero", "centred", "anywhere"])
@pytest.mark.parametrize(("unit", "turn"), [("rad", TURN), ("deg", 360.0), ("turns", 1.0), ("counts", 4096.0)])
def test_angles_wrapped_to_a_turn_are_continued(tmp_path, unit, turn, base):
    start = {"zero": 0.0, "centred": -turn / 2, "anywhere": 0.3 * turn}[base]
    rig = rig_with(sensors="counts_per_turn = 4096", angle_unit=unit, angle_zero="up", wheel_angle_unit=unit)
    loaded = load(
        tmp_path,
        rig,
        q1=wrapped(LOG.angle - np.pi, turn, start),
        q2=wrapped(LOG.wheel_angle, turn, start),
        ym=wrapped(LOG.reference - np.pi, turn, start),
    )
    assert np.allclose(loaded.angle, LOG.angle, atol=1e-9)
    assert np.allclose(loaded.reference, LOG.reference, atol=1e-9)
    turns = (loaded.wheel_angle - LOG.wheel_angle) / TURN
    assert np.allclose(turns, np.round(turns[0]), atol=1e-9)
    assert set(codes(loaded)) == {("unwrapped", "note")}


@pytest.mark.parametrize(("rate", "missing"), [(1000.0, 0.05), (100.0, 0.05), (50.0, 0.0)])
@pytest.mark.parametrize("first", [0, 237])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_fast_wheel_is_followed_over_more_than_half_a_turn_per_row(rate, missing, first, noise):
    """At 50 Hz the wheel does 0.54 turns per row; with missing rows at 100 Hz up to 0.8."""
    rng = np.random.default_rng(4)
    log = swing(rate=rate, duration=20.0)
    kept = np.flatnonzero(rng.random(len(log)) >= missing)[first:]
    time, wheel = log.time[kept], log.wheel_angle[kept] + noise * rng.normal(size=kept.size)
    if missing == 0.0:
        assert np.abs(np.diff(wheel)).max() > np.pi
    folded = np.mod(wheel, TURN)
    assert is_wrapped(folded, TURN)
    assert not is_wrapped(wheel, TURN)
    result = unwrap(time, folded, TURN)
    assert np.allclose(result.values - result.values[0], wheel - wheel[0], atol=1e-9)
    guessed = first > 0 and rate == 50.0  # begun at full speed, one turn more per row would look the same
    assert (result.ambiguous > 0) == guessed
    assert not result.spikes.any()


@pytest.mark.parametrize("rate", [1000.0, 200.0, 50.0])
@pytest.mark.parametrize("size", [0.1, 0.7, 2.0, 3.0, 3.3, 5.0])
def test_spikes_do_not_disturb_the_count_of_turns(tmp_path, rate, size):
    log = swing(rate=rate, duration=10.0)
    spikes = np.array([60, 111, 230, 350, 480])
    folded = np.mod(log.wheel_angle, TURN)
    folded[spikes] += size * np.array([1, -1, 1, -1, 1])
    columns = {**columns_of(log), "q2": folded}
    loaded = Recording.load(write_columns(tmp_path / "log.csv", columns), rig_with())
    good = np.isin(loaded.time, np.delete(log.time, spikes))
    apart = loaded.wheel_angle[good] - log.wheel_angle[np.isin(log.time, loaded.time[good])]
    assert np.ptp(apart) < 1e-9
    assert np.count_nonzero(~good) == 0 or size < 0.5
    assert good.sum() >= len(log) - 8


def test_turns_that_cannot_be_counted_are_warned_of(tmp_path):
    fast = swing(rate=25.0, duration=20.0, wheel=40.0)
    columns = {**columns_of(fast), "q2": np.mod(fast.wheel_angle, TURN)}
    loaded = Recording.load(write_columns(tmp_path / "log.csv", columns), rig_with())
    assert ("ambiguous-turns", "warning") in codes(loaded)


def test_angles_within_a_turn_that_never_jump_are_left_alone(tmp_path):
    wide = 3.0 * np.sin(8.0 * LOG.time)  # most of a turn, and never over its edge
    loaded = load(tmp_path, q1=wide)
    assert np.array_equal(loaded.angle, wide)
    assert loaded.findings == ()


def test_no_row_of_a_clean_log_is_read_by_python_alone(tmp_path):
    """Fewer function calls than rows: a loop over the rows would make one each at least."""
    rig = rig_with()
    log = swing(duration=25.0)
    path = log.save(tmp_path / "log.parquet", rig)
    Recording.load(path, rig)
    with cProfile.Profile() as calls:
        Recording.load(path, rig)
    assert sum(entry.callcount for entry in calls.getstats()) < len(log.time)


@pytest.mark.long
def test_real_logs_load_clean(data_dir):
    """EMPS (MATLAB, 1 kHz linear drive) and a free pendulum whose 0 is up."""
    emps = rig_with("direct", "linear", gravity=0.0, angle="qm", torque="vir", torque_gain=35.1507, reference="qg")
    log = Recording.load(data_dir / "emps" / "DATA_EMPS.mat", emps)
    assert (len(log), log.findings) == (24841, ())
    assert log.duration == pytest.approx(24.84)
    assert np.ptp(log.angle) == pytest.approx(0.2464, abs=2e-4)
    assert np.abs(log.angle - log.reference).max() < 2e-3
    free = rig_with("none", time="t_s", angle="theta_rad(up=0)", angle_zero="up")
    log = Recording.load(data_dir / "free_pendulum" / "free_swing.csv", free)
    assert log.findings == ()
    assert abs(log.angle[0]) < 1e-3
    assert abs(log.angle[-1]) < 1e-3
    assert log.angle.max() == pytest.approx(2.6, abs=0.01)


@pytest.mark.parametrize(
    ("name", "log"), quick_first(1, [("emps", "emps/DATA_EMPS.mat"), ("free_pendulum", "free_pendulum/free_swing.csv")])
)
def test_real_logs_load_with_the_example_rigs(data_dir, name, log):
    toml = Path(__file__).parents[2] / "examples" / "rigs" / f"{name}.toml"
    if not toml.exists():
        pytest.skip(f"no {toml}")
    recording = Recording.load(data_dir / log, Rig.load(toml))
    assert recording.findings == ()
    assert recording.rate == pytest.approx(1000.0, rel=1e-3)
