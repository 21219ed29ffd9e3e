"""The Recording itself, and that a file gives back what was saved, in every convention."""

from __future__ import annotations

import hashlib
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recording_cases import rig_with, swing
from refusals import coded
from swingid.errors import InputError, SwingidError, UnanswerableError
from swingid.recording import Finding, Recording
from swingid.recording.recording import CHANNELS

TURN = 2.0 * np.pi


def test_channels_are_own_copies_and_read_only():
    time = np.arange(20.0)
    angle = np.sin(time)
    recording = Recording(time, angle)
    angle[3] = 99.0
    assert recording.angle[3] == np.sin(3.0)
    with pytest.raises(ValueError, match="read-only"):
        recording.angle[3] = 1.0
    with pytest.raises(AttributeError):
        recording.angle = angle


@pytest.mark.parametrize(
    ("channels", "code"),
    [
        ({"angle": np.zeros(3)}, "bad-channel"),
        ({"angle": np.zeros((4, 1))}, "bad-channel"),
        ({"angle": ["a", "b", "c", "d"]}, "bad-channel"),
        ({"angle": [0.0, np.nan, 0.0, 0.0]}, "not-finite"),
        ({"time": [0.0, 1.0, 1.0, 2.0]}, "time-order"),
        ({"time": []}, "bad-channel"),
    ],
)
def test_channels_that_do_not_fit_are_refused(channels, code):
    whole = {"time": np.arange(4.0), "angle": np.arange(4.0), **channels}
    with pytest.raises(InputError) as caught:
        Recording(**whole)
    assert caught.value.code == code


def test_length_rate_duration_and_segment():
    recording = swing(rate=200.0, duration=4.0)
    assert len(recording) == 800
    assert recording.rate == pytest.approx(200.0)
    assert recording.duration == pytest.approx(799 / 200)
    part = recording.segment(1.0, 2.0)
    assert (part.time[0], part.time[-1], len(part)) == (1.0, 2.0, 201)
    assert np.array_equal(part.wheel_angle, recording.wheel_angle[200:401])
    with pytest.raises(UnanswerableError, check=coded("empty-segment", "10 s", "12 s", "0 s", "3.995 s")):
        recording.segment(10.0, 12.0)


CONVENTIONS = [
    {},
    {"angle_sign": -1, "wheel_angle_sign": -1, "voltage_sign": -1},
    {"angle_unit": "deg", "angle_zero": "up", "wheel_angle_unit": "turns"},
    {"angle_unit": "turns", "wheel_angle_unit": "deg", "wheel_angle_sign": -1, "wheel_scale": 0.25},
    {"angle_unit": "counts", "wheel_angle_unit": "counts", "angle_sign": -1, "wheel_angle_is": "absolute"},
    {
        "time": "zeit in s",
        "angle": "Winkel, rad",
        "wheel_angle": "w",
        "voltage": "U",
        "reference": "soll",
        "drive_held": False,
    },
]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("log", CONVENTIONS)
def test_load_gives_back_what_save_wrote(tmp_path, log, ending):
    rig = rig_with(sensors="counts_per_turn = 4096", **log)
    recording = swing(duration=2.0)
    loaded = Recording.load(recording.save(tmp_path / f"run.{ending}", rig), rig)
    for channel in CHANNELS:
        expected = getattr(recording, channel)
        if expected is None:
            assert getattr(loaded, channel) is None
        else:
            assert np.abs(getattr(loaded, channel) - expected).max() < 1e-13 * max(1.0, np.abs(expected).max())
    assert loaded.findings == ()
    assert loaded.drive_held is True


@pytest.mark.parametrize("held", [True, False])
def test_a_saved_file_knows_whether_its_drive_was_held(tmp_path, held):
    whole = swing()
    recording = Recording(whole.time, whole.angle, whole.wheel_angle, whole.voltage, drive_held=held)
    path = recording.save(tmp_path / "x.csv", rig_with())
    assert Recording.load(path, rig_with(drive_held=not held)).drive_held is held


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.integers(10, 60),
    size=st.floats(0.01, 3.0),
    centre=st.floats(-3.0, 3.0),
    step=st.floats(1e-6, 0.4),
    sign=st.sampled_from([1, -1]),
    ending=st.sampled_from(["csv", "parquet"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_radians_come_back_bit_for_bit(tmp_path, rows, size, centre, step, sign, ending, seed):
    uneven = np.random.default_rng(seed).uniform(0.9, 1.1, rows)
    time = centre + np.cumsum(step * uneven)
    angle = centre + size * np.sin(0.2 * np.cumsum(uneven))
    rig = rig_with(angle_sign=sign, wheel_angle_sign=-sign)
    recording = Recording(time, angle, -7.0 * angle, uneven)
    loaded = Recording.load(recording.save(tmp_path / f"x.{ending}", rig), rig)
    assert loaded.findings == ()
    assert np.array_equal(loaded.time, time)
    assert np.array_equal(loaded.angle, angle)
    assert np.array_equal(loaded.wheel_angle, -7.0 * angle)
    assert np.array_equal(loaded.voltage, uneven)


def test_conventions_mean_what_they_say(tmp_path):
    """Numbers written by hand: 0 up, clockwise positive, degrees; wheel absolute in turns of a 2:1 pulley."""
    path = tmp_path / "hand.csv"
    lines = [f"{k / 10},{170 + k},{k / 4},{k}" for k in range(12)]
    path.write_text("\n".join(["t,q1,q2,u", *lines]))
    rig = rig_with(
        angle_unit="deg", angle_zero="up", angle_sign=-1, wheel_angle_unit="turns", wheel_angle_is="absolute",
        wheel_scale=2.0, voltage_sign=-1,
    )  # fmt: skip
    loaded = Recording.load(path, rig)
    rows = np.arange(12)
    expected = np.radians(10.0 - rows)  # 170 deg clockwise from the top is 10 deg counter-clockwise from hanging
    assert np.allclose(loaded.angle, expected, atol=1e-12)
    assert np.allclose(loaded.wheel_angle, rows / 2 * TURN - expected, atol=1e-12)
    assert np.array_equal(loaded.voltage, -rows)


def test_torque_has_gain_and_sign_and_a_linear_axis_no_turns(tmp_path):
    path = tmp_path / "linear.csv"
    rows = np.arange(50)
    position = 10.0 * np.sin(rows / 5)  # metres, more than any turn
    path.write_text(
        "\n".join(["t,x,vir", *(f"{k / 100},{p!r},{k}" for k, p in zip(rows, position.tolist(), strict=True))])
    )
    rig = rig_with("direct", "linear", gravity=0.0, angle="x", torque="vir", torque_gain=35.0, torque_sign=-1)
    loaded = Recording.load(path, rig)
    assert np.array_equal(loaded.angle, position)
    assert np.array_equal(loaded.torque, -35.0 * rows)
    assert loaded.voltage is None
    assert loaded.wheel_angle is None


def test_a_rate_stands_for_the_time_column(tmp_path):
    rig = rig_with(rate=500)
    recording = swing(rate=500.0)
    path = recording.save(tmp_path / "x.csv", rig)
    assert path.read_text().splitlines()[1] == "q1,q2,u,ym,k"
    assert np.allclose(Recording.load(path, rig).time, recording.time, atol=1e-12)
    uneven = Recording(np.cumsum(np.linspace(0.001, 0.003, 50)), np.arange(50.0), np.arange(50.0))
    with pytest.raises(InputError, check=coded("uneven-rows", "rate = 500")):
        uneven.save(tmp_path / "y.csv", rig)


def test_metadata_findings_and_source_are_kept(tmp_path):
    found = (Finding("spikes", "3 rows left out", "warning"),)
    whole = swing()
    metadata = {"rig": "paper", "seed": np.int64(7), "gains": np.array([0.5, 1.0]), "note": "Prüfstand ±"}
    recording = Recording(whole.time, whole.angle, whole.wheel_angle, metadata=metadata, findings=found)
    for ending in ("csv", "parquet"):
        path = recording.save(tmp_path / f"x.{ending}")
        loaded = Recording.load(path, rig_with())
        assert loaded.metadata == {"rig": "paper", "seed": 7, "gains": [0.5, 1.0], "note": "Prüfstand ±"}
        assert loaded.findings == found
        assert loaded.source.path == str(path)
        assert loaded.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_saved_file_is_not_read_by_another_rigs_conventions(tmp_path):
    path = swing().save(tmp_path / "x.csv", rig_with(angle_unit="deg"))
    with pytest.raises(InputError, check=coded("other-conventions", '[log] angle_unit = "deg"', '"rad"')):
        Recording.load(path, rig_with())
    with pytest.raises(InputError, check=coded("other-drive", "[drive]", '"reaction-wheel"', '"none"')):
        Recording.load(path, rig_with("none", angle_unit="deg"))


def test_saving_fails_in_one_sentence(tmp_path):
    with pytest.raises(InputError, check=coded("unknown-ending", ".parquet, .csv")):
        swing().save(tmp_path / "run.xlsx")
    with pytest.raises(SwingidError) as caught:
        swing().save(tmp_path / "nowhere" / "run.csv")
    assert caught.value.code == "cannot-write"
    assert caught.value.exit_code == 3
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(SwingidError) as caught:
        swing().save(tmp_path / "file" / "run.csv")
    assert caught.value.code == "cannot-write"


def test_importing_recording_stays_light():
    heavy = "pyarrow", "scipy", "pint", "matplotlib", "numba"
    code = f"import swingid.recording, sys; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
