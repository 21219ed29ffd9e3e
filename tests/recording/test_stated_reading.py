"""What the rig file states of a log, and the log contradicts or nobody states: grids, the torque's scale, the wheel's
reading; and findings outside of the used rows.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from long_cases import quick_first
from recording_cases import columns_of, rig_with, swing, write_columns
from swingid import Recording, identify
from swingid.control.references import Multisine, Sine
from swingid.errors import UnanswerableError
from swingid.recording.findings import Finding
from swingid.recording.grid import GRID
from twin_logs import INERTIA, given, logged, twin

LOG = swing()
ONE_TONE = Sine(0.8, 8.5)
TWO_TONES = Multisine((Sine(0.5, 5.0), Sine(0.3, 8.5)))
TURN = 2 * np.pi
UNITS = {"rad": TURN, "deg": 360.0, "turns": 1.0}


def on_grid(values, counts, phase=0.0):
    return (np.round(values * counts / TURN + phase) - phase) * TURN / counts


def grids(path):
    def found(rig, angle, wheel):
        write_columns(path, columns_of(replace(LOG, angle=angle, wheel_angle=wheel)))
        return [one.message for one in Recording.load(path, rig).findings if one.code == GRID]

    return found


@pytest.mark.parametrize("channel", ["angle", "wheel_angle"])
@pytest.mark.parametrize(
    ("unit", "stated", "seen", "scale", "words"),
    [
        ("deg", 4096, 4096, 1.0, '4096 in a turn, which they are in rad; set {key}_unit = "rad" under [log]'),
        ("turns", 4096, 4096, 1.0, 'set {key}_unit = "rad" under [log]'),
        ("deg", None, 8192, 1.0, "in rad they are 8192 in a turn, a power of two, as encoders have; set {key}_unit ="),
        ("rad", 4000, 4096, 1.0, "4096 in a turn, but [{table}] states 4000 in a turn; state counts_per_turn = 4096"),
        ("rad", 4096, 4000, 1.0, "4000 in a turn, but [{table}] states 4096 in a turn; state counts_per_turn = 4000"),
        ("rad", 4096, 4096, 2.0, "2048 in a turn, but [{table}] states 4096"),
        ("rad", 4096, 4096, 4.0, "the values would be 4 times too large"),
        ("rad", 4096, 4096, 0.5, "8192 in a turn, but [{table}] states 4096"),
    ],
)
def test_a_grid_that_contradicts_the_rig_file_is_a_warning(tmp_path, channel, unit, stated, seen, scale, words):
    table = "sensors" if channel == "angle" else "sensors.wheel"
    head = "" if stated is None or channel == "angle" else "[sensors.wheel]\n"
    sensors = "" if stated is None else f"{head}counts_per_turn = {stated}"
    rig = rig_with(sensors=sensors, **{f"{channel}_unit": unit})
    values = {name: getattr(LOG, name) for name in ("angle", "wheel_angle")}
    values[channel] = scale * on_grid(values[channel], seen)
    (message,) = grids(tmp_path / "log.csv")(rig, values["angle"], values["wheel_angle"])
    assert words.format(key=channel, table=table) in message
    assert message.startswith("column 'q1' (angle)" if channel == "angle" else "column 'q2' (wheel angle)")


def test_a_coarse_grid_shows_though_rows_are_a_step_apart_at_most(tmp_path):
    angle = on_grid(LOG.angle, 500)
    assert np.abs(np.diff(angle)).max() < 1.5 * TURN / 500
    rig = rig_with(sensors="counts_per_turn = 1000\n[sensors.wheel]\nresolution = 1e-9")
    (message,) = grids(tmp_path / "log.csv")(rig, angle, LOG.wheel_angle)
    assert "500 in a turn, but [sensors] states 1000" in message


@pytest.mark.parametrize("counts", [1200, 2400, 4096])
def test_a_row_for_each_edge_of_the_encoder_shows_its_step(tmp_path, counts):
    filled = np.arange(0.0, LOG.time[-1], 1e-4)
    dense = on_grid(np.interp(filled, LOG.time, LOG.angle), counts)
    edges = np.flatnonzero(np.diff(dense)) + 1
    assert np.allclose(np.abs(np.diff(dense[edges])), TURN / counts)
    rig = rig_with("none", sensors=f"counts_per_turn = {counts}")
    path = write_columns(tmp_path / "log.csv", {"t": filled[edges], "q1": dense[edges]})
    assert [one for one in Recording.load(path, rig).findings if one.code == GRID] == []


@pytest.mark.parametrize("unit", quick_first(1, UNITS))
def test_a_grid_that_is_as_stated_is_none(tmp_path, unit):
    rng = np.random.default_rng(3)
    found = grids(tmp_path / "log.csv")
    for counts in (500, 1000, 2000, 3600, 4000, 4096, 5880, 14400, 2**14, 2**18):
        sensors = f"counts_per_turn = {counts}"
        turn = UNITS[unit]
        angle, wheel = (on_grid(values, counts, rng.uniform()) * turn / TURN for values in (LOG.angle, LOG.wheel_angle))
        stated = rig_with(sensors=sensors, angle_unit=unit, wheel_angle_unit=unit)
        assert found(stated, angle, wheel) == []
        if counts != 4096:  # 1/4096 of a turn is a power of two in turns: then nothing is contradicted either
            assert found(rig_with(angle_unit=unit, wheel_angle_unit=unit), angle, wheel) == []
        noisy = angle + rng.normal(0, np.diff(np.unique(angle)).min(), len(angle))
        assert found(stated, noisy, wheel) == []


@pytest.mark.parametrize("digits", [2, 3, 4, 5])
def test_written_digits_are_no_grid(tmp_path, digits):
    rig = rig_with(sensors="counts_per_turn = 4096", angle_unit="deg", wheel_angle_unit="deg")
    angle, wheel = (np.round(np.degrees(values), digits) for values in (LOG.angle, LOG.wheel_angle))
    assert grids(tmp_path / "log.csv")(rig, angle, wheel) == []


def test_a_rounded_resolution_fits(tmp_path):
    angle = on_grid(LOG.angle, 4096)
    for resolution, found in ((0.0015, 0), (0.0016, 0), (0.003, 0), (0.0008, 1)):
        rig = rig_with(sensors=f"resolution = {resolution}\n[sensors.wheel]\nresolution = 1e-9")
        assert len(grids(tmp_path / "log.csv")(rig, angle, LOG.wheel_angle)) == found


def driven(path, header, **log):
    time = np.arange(4000) / 200
    angle = 0.8 * np.sin(3 * time) + 0.3 * np.sin(7 * time)
    acceleration = -7.2 * np.sin(3 * time) - 14.7 * np.sin(7 * time)
    torque = 1e-3 * acceleration + 78e-3 * np.sin(angle)
    write_columns(path, {"t": time, "q1": angle, header: torque})
    rig = rig_with("direct", drive_held=False, **log)
    return Recording.load(path, rig), rig


def test_a_torque_whose_scale_nobody_states_gives_no_answer(tmp_path):
    with pytest.raises(UnanswerableError, match="torque_gain under") as caught:
        identify(*driven(tmp_path / "log.csv", "tau"))
    assert caught.value.code == "no-scale"


@pytest.mark.parametrize(("header", "log"), [("tau [N m]", {}), ("tau", {"torque_gain": 1})])
def test_a_torque_whose_scale_is_stated_gives_one(tmp_path, header, log):
    found = identify(*driven(tmp_path / "log.csv", header, **log))
    assert found.inertia.value == pytest.approx(1e-3, rel=1e-3)
    (note,) = [note.message for note in found.notes if note.code == "exact-constants"]
    assert "log.torque_gain" in note


def wheel_log(path, *, absolute, **log):
    """A motion of an axis of 1 g m² whose wheel, of 0.2 g m², drives it; no motor constants."""
    time = np.arange(6000) / 400
    angle = 0.8 * np.sin(3 * time) + 0.3 * np.sin(7 * time)
    twice = -7.2 * np.sin(3 * time) - 14.7 * np.sin(7 * time)
    inertia, wheel, b = 1e-3, 2e-4, 78e-3
    torque = (inertia + wheel) * twice + b * np.sin(angle)
    steps = np.diff(time)
    speed = np.concatenate([[0.0], np.cumsum((torque[1:] + torque[:-1]) / 2 * steps)]) / -wheel
    turned = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * steps)])
    write_columns(path, {"t": time, "q1": angle, "q2": turned + (angle if absolute else 0.0)})
    exact = dict.fromkeys(("axis.tilt", "drive.wheel.tilt", "axis.model_uncertainty", "log.clock"), 0)
    rig = rig_with(**log).changed({"drive.wheel.inertia": wheel, "drive.motor": None, **exact})
    return Recording.load(path, rig), rig


@pytest.mark.parametrize("method", quick_first(1, ["momentum", "equation-error", "output-error"]))
def test_a_wheel_angle_whose_reading_is_neither_stated_nor_verified_gives_both_numbers(tmp_path, method):
    log, rig = wheel_log(tmp_path / "log.csv", absolute=True)
    found = identify(log, rig, method)
    (warning,) = [one for one in found.warnings if one.code == "wheel-angle-reading"]
    assert found.inertia.value == pytest.approx(0.8e-3, rel=0.01)
    assert re.search(r"and (1e-3|99\de-6|1\.00\de-3) kg m² if it is absolute", warning.message)
    log, rig = wheel_log(tmp_path / "log.csv", absolute=True, wheel_angle_is="absolute")
    found = identify(log, rig, method)
    assert found.inertia.value == pytest.approx(1e-3, rel=0.01)
    assert "wheel-angle-reading" not in {one.code for one in found.warnings}


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("tones", quick_first(1, [TWO_TONES, ONE_TONE]), ids=["two tones", "one tone"])
def test_a_voltage_ranks_the_readings_without_motor_constants(tmp_path, absolute, tones):
    """Two tones reject the wrong reading; one leaves too little of either, so both numbers stay."""
    run = logged(twin("viscous"), tmp_path, tones, duration=12.0)
    constants = ("torque_per_volt", "back_emf", "viscous", "coulomb", "efficiency", "dead_zone")
    rig = given(twin("viscous")).changed({f"drive.motor.{key}": None for key in constants})
    columns = {"t": run.time, "q1": run.angle, "q2": run.wheel_angle + absolute * run.angle, "u": run.voltage}
    found = identify(Recording.from_columns(columns, rig), rig)
    messages = [one.message for one in found.warnings if one.code == "wheel-angle-reading"]
    if tones is TWO_TONES and not absolute:
        assert messages == []
        assert any("taken as relative" in one.message for one in found.notes)
        return
    likelier = "absolute" if absolute else "relative"
    assert f"makes {likelier} the likelier" in messages[0]
    numbers = found.inertia.value, found.inertia.value + rig.drive.a12
    assert numbers[absolute] == pytest.approx(INERTIA, rel=1e-3)
    assert all(f"{1e3 * value:.3f}e-3 kg m²" in messages[0] for value in numbers)
    stated = rig.changed({"log.wheel_angle_is": likelier})
    assert identify(Recording.from_columns(columns, stated), stated).status == "ok"


def test_what_happened_outside_of_the_used_rows_is_a_note(tmp_path):
    log, rig = driven(tmp_path / "log.csv", "tau", torque_gain=1)
    jump = Finding("jumps", "jumps by 3 at 2 s.", "warning", spans=((2.0, 2.0),))
    log = replace(log, findings=(jump,))
    assert "jumps" in {one.code for one in identify(log, rig).warnings}
    after = identify(log.segment(5.0, 20.0), rig)
    assert "jumps" not in {one.code for one in after.warnings}
    assert "jumps" in {one.code for one in after.notes}
    everywhere = replace(log, findings=(replace(jump, spans=()),)).segment(5.0, 20.0)
    assert "jumps" in {one.code for one in identify(everywhere, rig).warnings}
    log.save(tmp_path / "saved.csv", rig)
    assert Recording.load(tmp_path / "saved.csv", rig).findings == (jump,)


@pytest.mark.parametrize(("unit", "turn"), [("rad", TURN), ("deg", 360.0), ("counts", 4096.0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_zero_of_the_angle_may_be_stated_as_the_hanging_reading(tmp_path, unit, turn, sign):
    hangs = 0.23 * turn
    rig = rig_with(sensors="counts_per_turn = 4096", angle_unit=unit, angle_sign=sign, angle_zero=hangs)
    logged = sign * LOG.angle * turn / TURN + hangs
    path = write_columns(tmp_path / "log.csv", columns_of(LOG) | {"q1": logged})
    loaded = Recording.load(path, rig)
    assert np.allclose(loaded.angle, LOG.angle, atol=1e-9)
    loaded.save(tmp_path / "saved.csv", rig)
    assert np.allclose(Recording.load(tmp_path / "saved.csv", rig).angle, LOG.angle, atol=1e-9)


def test_the_zero_of_a_position_may_be_stated(tmp_path):
    rig = rig_with("none", "linear", gravity=0.0, angle="x", angle_unit="mm", angle_zero=120.0)
    path = write_columns(tmp_path / "log.csv", {"t": LOG.time, "x": 1e3 * LOG.angle + 120.0})
    assert np.allclose(Recording.load(path, rig).angle, LOG.angle, atol=1e-9)
