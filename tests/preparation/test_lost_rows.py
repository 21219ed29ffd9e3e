"""Rows that are missing where the time is made of the row number: put back where they were lost, nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from recording_cases import columns_of, rig_with, swing
from swingid.preparation.prepared import prepare
from swingid.recording import Recording
from swingid.recording.lost_rows import find_lost
from swingid.recording.rows import even_places

LOG = swing(duration=8.0)
FREE = {"kind": "none", "rate": 1000.0}
COUNT = 2 * np.pi / 16384


def kept_rows(share: float = 0.005, seed: int = 1) -> np.ndarray:
    """Rows that a logger did not lose; at their start the motion is too slow to show any."""
    kept = np.random.default_rng(seed).random(len(LOG)) >= share
    kept[:1200] = True
    return np.flatnonzero(kept)


def rounded(values: np.ndarray, step: float = COUNT) -> np.ndarray:
    return np.round(values / step) * step


def logged(rows: np.ndarray, **columns: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of these rows, angles as an encoder reads them, and the time made of the row number."""
    found = {name: column[rows] for name, column in columns_of(LOG).items()}
    found |= {name: rounded(found[name]) for name in ("q1", "q2")} | columns
    return {**found, "t": LOG.time[: len(rows)]}


def read(columns: dict[str, np.ndarray], rig=None, **repairs: bool) -> Recording:
    return Recording.from_columns(
        columns, rig or rig_with(), repairs={name.replace("_", "-"): on for name, on in repairs.items()}
    )


def codes(recording: Recording) -> dict[str, str]:
    return {finding.code: finding.level for finding in recording.findings}


@pytest.mark.parametrize("rig", [rig_with(), rig_with(rate=1000.0), rig_with(**FREE)])
@pytest.mark.parametrize("share", [0.002, 0.01])
def test_stamps_are_those_of_the_rows_that_were_kept(rig, share):
    rows = kept_rows(share)
    loaded = read(logged(rows), rig)
    lost = len(LOG) - len(rows)
    assert list(codes(loaded)) == ["lost-rows"]
    off = (loaded.time - LOG.time[rows]) * 1000  # rows
    assert abs(LOG.time[rows[-1]] - 1e-3 * (len(rows) - 1)) * 1000 >= 0.9 * lost
    assert np.abs(off).max() < 3 + 0.15 * lost
    assert np.sqrt(np.mean(off**2)) < 0.1 * lost + 1.5


def test_the_uncertainty_of_the_restored_time_is_that_of_the_clock():
    rows, rig = kept_rows(0.01), rig_with().changed({"log.clock": "0 ± 2e-5"})
    loaded = read(logged(rows), rig)
    unsure = next(finding.of_time for finding in loaded.findings if finding.code == "lost-rows")
    lost = (len(LOG) - len(rows)) / len(rows)
    assert 0.02 * lost < unsure < lost
    assert prepare(loaded, rig).rig.log.clock.std == pytest.approx(np.hypot(2e-5, unsure))
    assert prepare(read(logged(np.arange(len(LOG))), rig), rig).rig is rig


def test_without_sensor_errors_every_row_in_motion_is_located():
    """A pure sine that is never slow but for instants: whatever is lost comes back at its row, or within one of it."""
    time = np.arange(20_000) / 1000
    places = np.flatnonzero(~np.isin(np.arange(20_000), [3000, 5005, 5006, 9100, 9104, 15_017]))
    speed = np.abs(np.cos(3 * time))
    assert speed[[3000, 5005, 9100, 15_017]].min() > 0.1
    found = find_lost(np.arange(len(places)), [np.sin(3 * time[places]), 5 * np.sin(3 * time[places])])
    assert found is not None
    true = places - np.arange(len(places))
    assert np.cumsum(found.before)[-1] == true[-1] == 6
    assert np.flatnonzero(np.cumsum(found.before) != true).size <= 6
    assert found.hidden.sum() < 0.5


def test_the_switch_leaves_the_time_with_a_warning():
    columns = logged(kept_rows(0.01))
    loaded = read(columns, lost_rows=False)
    assert np.array_equal(loaded.time, columns["t"])
    assert codes(loaded) == {"repair-off": "note", "lost-rows": "warning", "jumps": "warning"}
    assert [finding.repair for finding in loaded.findings if finding.code == "lost-rows"] == [None]


def test_a_clock_that_shows_missing_rows_is_left_as_it_is():
    rows = kept_rows(0.01)
    columns = logged(rows) | {"t": LOG.time[rows]}
    loaded = read(columns)
    assert np.array_equal(loaded.time, LOG.time[rows])
    assert codes(loaded) == {"gaps": "note"}
    assert even_places(LOG.time[rows], None) is None


def faults() -> dict[str, dict[str, np.ndarray]]:
    """Logs without lost rows whose readings jump."""
    rng = np.random.default_rng(4)
    every = np.arange(len(LOG))
    uneven = LOG.time + rng.normal(0, 2e-4, len(LOG))
    late = every - (rng.random(len(LOG)) < 0.01)  # a reading of the row before, and the next one in time
    slipped = logged(every)
    slipped["q1"] = slipped["q1"] + np.where(LOG.time > 4.1, 0.02, 0.0)
    spiked = logged(every)
    spiked["q1"][rng.choice(len(LOG), 20, replace=False)] += rng.uniform(-3, 3, 20)
    read_slowly = {
        f"read every {n} rows": logged(every, **{name: logged(every)[name][every // n * n] for name in ("q1", "q2")})
        for n in (2, 5, 20)
    }
    return {
        "clean": logged(every),
        "coarse": logged(every, q1=rounded(LOG.angle, 2 * np.pi / 1000), q2=rounded(LOG.wheel_angle, 2 * np.pi / 1000)),
        "noise": logged(every, q1=LOG.angle + rng.normal(0, 1e-3, len(LOG))),
        "read unevenly": logged(
            every, **{n: rounded(np.interp(uneven, LOG.time, columns_of(LOG)[n])) for n in ("q1", "q2")}
        ),
        "read late": logged(every, **{name: logged(every)[name][np.maximum(late, 0)] for name in ("q1", "q2")}),
        "slipped": slipped,
        "spiked": spiked,
        **read_slowly,
    }


@pytest.mark.parametrize("name", faults())
@pytest.mark.parametrize("rig", [rig_with(), rig_with(**FREE)])
def test_other_faults_are_no_lost_rows(name, rig):
    columns = faults()[name]
    loaded = read(columns, rig)
    assert "lost-rows" not in codes(loaded)


def test_rows_that_are_left_out_are_not_lost():
    """A spike's row is left out: the row number says so, and the next row keeps its time."""
    rows = kept_rows(0.005)
    columns = logged(rows)
    columns["q1"][[2000, 3001, 6003]] += 2.0
    loaded = read(columns, rig_with(rate=1000.0))
    assert set(codes(loaded)) == {"spikes", "gaps", "lost-rows"}
    assert len(loaded) == len(rows) - 3
    assert abs(loaded.time[-1] - LOG.time[rows[-1]]) < 4e-3
