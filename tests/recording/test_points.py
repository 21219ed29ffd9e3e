"""Marks of a video: the pivot of their arc, the angle, the formats of trackers, and pixels, which are no angle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from refusals import coded
from swingid.errors import InputError, SwingidError
from swingid.preparation.prepared import as_recorded
from swingid.recording.formats import read_table
from swingid.recording.formats.table import Table
from swingid.recording.inspect import describe, guess_roles
from swingid.recording.points import ANGLE, circle_through, pairs, with_angle
from swingid.study.inspect import inspect_log

RIG = """name = "bob"
[axis]
gravity_torque = "unknown"
[drive]
kind = "none"
[log]
"""
RATE, RATIO, DAMPING = 60.0, 25.0, 0.05
TIME = np.arange(0, 30, 1 / RATE)


def swing(amplitude: float = 0.5) -> np.ndarray:
    """Angle of a viscously damped pendulum, by small steps of a symplectic rule."""
    q, w, fine, found = amplitude, 0.0, 40, []
    step = 1 / RATE / fine
    for _ in TIME:
        found.append(q)
        for _ in range(fine):
            w += step * (-RATIO * np.sin(q) - DAMPING * w)
            q += step * w
    return np.array(found)


ANGLES = swing()


def seen(angle: np.ndarray, *, centre=(640.0, 80.0), lever: float = 400.0, noise: float = 0.3, seed: int = 0):
    """Pixels of a mark: y grows downwards in a picture."""
    rng = np.random.default_rng(seed)
    x = centre[0] + lever * np.sin(angle) + rng.normal(0, noise, angle.size)
    return x, centre[1] + lever * np.cos(angle) + rng.normal(0, noise, angle.size)


def rig_of(lines: str) -> sw.Rig:
    return sw.Rig.from_text(RIG + lines)


POINT = 'time = "t"\npoint = ["x", "y"]\n'


def table_of(angle: np.ndarray = ANGLES, **options) -> Table:
    x, y = seen(angle, **options)
    return Table({"t": TIME[: angle.size], "x": x, "y": y})


@pytest.mark.parametrize("amplitude", [0.2, 0.5, 2.5])
def test_the_centre_of_an_arc_scatters_as_its_covariance_says(amplitude: float) -> None:
    angle = amplitude * np.sin(np.linspace(0, 40, 800))
    off = []
    for seed in range(60):
        circle = circle_through(*seen(angle, seed=seed))
        off.append(
            np.linalg.solve(circle.covariance, np.subtract(circle.centre, (640, 80)))
            @ np.subtract(circle.centre, (640, 80))
        )
    assert 1.4 < np.mean(off) < 2.8  # chi squared with two degrees of freedom has 2 ± 0.26 here


def test_points_far_off_do_not_move_the_centre() -> None:
    x, y = seen(ANGLES)
    x[::40], y[::40] = 3.0, 5.0
    circle = circle_through(x, y)
    assert np.hypot(circle.centre[0] - 640, circle.centre[1] - 80) < 3 * np.sqrt(np.trace(circle.covariance))


def test_lines_and_clouds_are_no_arcs() -> None:
    rng = np.random.default_rng(1)
    line = circle_through(np.linspace(0, 400, 300), 2 * np.linspace(0, 400, 300) + rng.normal(0, 0.5, 300))
    assert line is None or not line.is_arc
    cloud = circle_through(rng.normal(0, 50, 300), rng.normal(0, 50, 300))
    assert cloud is None or not cloud.is_arc
    assert circle_through(np.zeros(300), np.zeros(300)) is None
    assert circle_through(np.full(300, np.nan), np.zeros(300)) is None


def test_the_angle_is_that_of_the_body() -> None:
    log = sw.Recording.from_table(table_of(), rig_of(POINT))
    assert np.sqrt(np.mean((log.angle - ANGLES) ** 2)) < 2e-3
    upwards = table_of()
    upwards = Table({**upwards.columns, "y": -upwards.columns["y"]})
    assert np.allclose(sw.Recording.from_table(upwards, rig_of(POINT)).angle, log.angle, atol=1e-9)
    turned = Table({"t": TIME, "x": upwards.columns["x"], "y": -upwards.columns["y"]})
    turned = Table({"t": TIME, "x": turned.columns["y"], "y": -turned.columns["x"]})  # down is +x
    assert np.allclose(sw.Recording.from_table(turned, rig_of(POINT)).angle, log.angle, atol=1e-9)


def test_turns_are_continuous() -> None:
    turning = 9.0 * TIME
    log = with_angle(table_of(turning), rig_of(POINT + 'point_down = "+y"\n'), "log")[0]
    assert np.allclose(np.diff(log.columns[ANGLE]), 9 / RATE, atol=0.02)


def test_the_ratio_of_a_known_pendulum_lies_in_its_interval() -> None:
    result = sw.identify(sw.Recording.from_table(table_of(), rig_of(POINT)), rig_of(POINT))
    ratio = result.parameters["gravity_torque/inertia"]
    assert ratio.interval95[0] < RATIO < ratio.interval95[1]
    assert ratio.standard_uncertainty < 2e-3 * RATIO
    sources = {entry.source for entry in result.budget if entry.parameter == "gravity_torque/inertia"}
    assert {"angle encoder nonlinearity (sine)", "angle encoder second harmonic (sine 2)"} <= sources


def test_a_second_mark_on_the_pivot_takes_the_place_of_the_circle() -> None:
    px, py = seen(np.zeros_like(TIME), centre=(640, 80), lever=0.0, noise=0.2, seed=5)
    table = Table({**table_of(swing(0.05)).columns, "px": px, "py": py})
    with pytest.raises(InputError) as raised:
        sw.Recording.from_table(table, rig_of(POINT))
    assert raised.value.code == "no-pivot"
    assert "state [log] pivot" in raised.value.message
    for pivot in ('["px", "py"]', "[640, 80]"):
        log = sw.Recording.from_table(table, rig_of(f"{POINT}pivot = {pivot}\n"))
        assert np.sqrt(np.mean((log.angle - swing(0.05)) ** 2)) < 2e-3


def test_the_uncertainty_of_the_pivot_is_that_of_the_angle() -> None:
    rig = rig_of(POINT)
    assert rig.sensors.kind.name == "camera"
    log = sw.Recording.from_table(table_of(), rig)
    cosine, sine = next(one.of_pivot for one in log.findings if one.of_pivot)
    assert 0 < cosine < sine < 0.01  # an arc shows the place across better than along the lever
    sensor = as_recorded(rig, log).sensors.of("angle")
    assert sensor.cosine.std == pytest.approx(cosine)
    assert sensor.sine.std == pytest.approx(np.hypot(sine, 2 * sensor.twice))
    stated = sw.Rig.from_text(RIG.replace("[log]", '[sensors]\nnonlinearity = "0.3 deg"\n[log]') + POINT)
    assert as_recorded(stated, log).sensors.of("angle").sine.std == pytest.approx(np.radians(0.3))


def test_a_wheel_keeps_its_own_encoder() -> None:
    text = RIG.replace('kind = "none"', 'kind = "reaction-wheel"\n[drive.wheel]\ninertia = 1e-4')
    rig = sw.Rig.from_text(text + POINT)
    assert (rig.sensors.kind.name, rig.sensors.of_wheel.kind.name) == ("camera", "unknown")


def test_a_saved_recording_keeps_the_angle_and_its_uncertainty(tmp_path: Path) -> None:
    rig = rig_of(POINT)
    log = sw.Recording.from_table(table_of(), rig)
    log.save(tmp_path / "log.csv", rig)
    again = sw.Recording.load(tmp_path / "log.csv", rig)
    assert np.allclose(again.angle, log.angle)
    assert [one.of_pivot for one in again.findings if one.of_pivot] == [
        one.of_pivot for one in log.findings if one.of_pivot
    ]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('point = "x"\n', 'as ["x", "y"]'),
        ('point = ["x", "y", "z"]\n', "columns of x and y"),
        ("pivot = [1, 2]\n", "log.point is missing beside pivot"),
        (POINT + "pivot = [1, true]\n", "log.pivot must be [x, y]"),
        (POINT + "pivot = [1, nan]\n", "log.pivot must be [x, y]"),
        (POINT + 'angle = "theta"\n', "given beside point"),
        (POINT + 'point_down = "down"\n', "log.point_down"),
    ],
)
def test_keys_that_do_not_fit(lines: str, words: str) -> None:
    with pytest.raises(InputError) as raised:
        rig_of(lines)
    assert words.replace("as [", "such as [") in raised.value.message


def test_a_mark_is_on_no_linear_axis() -> None:
    with pytest.raises(InputError, check=coded("contradiction")):
        sw.Rig.from_text('name = "a"\n[axis]\nkind = "linear"\n[drive]\nkind = "none"\n[log]\n' + POINT)


def test_names_that_differ_in_x_and_y() -> None:
    names = dict.fromkeys(["bob x", "bob y", "pixelx", "pixely", "index", "X", "Y", "max", "x_red", "y_red"])
    assert pairs(names) == [("bob x", "bob y"), ("pixelx", "pixely"), ("X", "Y"), ("x_red", "y_red")]


X, Y = seen(ANGLES)
PX, PY = seen(np.zeros_like(TIME), lever=0.0, seed=3)
FORMATS = {
    "opencv": ("frame,time,cx,cy\n", lambda k: f"{k},{TIME[k]:.5f},{X[k]:.1f},{Y[k]:.1f}"),
    "tracker": ("mass_A\t\t\nt\tx\ty\n", lambda k: f"{TIME[k]:.6E}\t{X[k] / 800:.6E}\t{-Y[k] / 800:.6E}"),
    "tracker-pixels": (
        ",mass A,,,,,\nt,frame,x,y,pixelx,pixely,\n",
        lambda k: f"{TIME[k]:.6E},{k},{X[k] / 800:.5E},{-Y[k] / 800:.5E},{X[k]:.5E},{Y[k]:.5E},",
    ),
    "tracker-two": (
        "#multi:\n,mass A,,mass B,,\nt,x,y,x,y,\n",
        lambda k: f"{TIME[k]:.6E},{X[k]:.3f},{Y[k]:.3f},{PX[k]:.3f},{PY[k]:.3f},",
    ),
    "deeplabcut": (
        "scorer,DLC,DLC,DLC,DLC,DLC,DLC\nbodyparts,bob,bob,bob,pin,pin,pin\ncoords,x,y,likelihood,x,y,likelihood\n",
        lambda k: f"{k},{X[k]:.3f},{Y[k]:.3f},{0.1 if k % 300 == 7 else 0.99},{PX[k]:.3f},{PY[k]:.3f},0.98",
    ),
    "no-header": ("", lambda k: f"{TIME[k]:.4f} {X[k]:.2f} {Y[k]:.2f}"),
    "merged-cells": (
        "Time;Bob;;Pin;\n;x;y;x;y\n".replace("Time;", "Time;"),
        lambda k: f"{TIME[k]:.4f};{X[k]:.2f};{Y[k]:.2f};{PX[k]:.2f};{PY[k]:.2f}".replace(".", ","),
    ),
}


@pytest.mark.parametrize("kind", FORMATS)
def test_what_trackers_write_is_found_and_read(kind: str, tmp_path: Path) -> None:
    head, row = FORMATS[kind]
    path = tmp_path / "log.csv"
    path.write_text(head + "\n".join(row(k) for k in range(TIME.size)) + "\n")
    roles = guess_roles(describe(read_table(path.read_bytes(), str(path))))
    assert roles.has_motion
    assert "angle" not in roles.found
    time = f"rate = {RATE}\n" if kind == "deeplabcut" else f"time = {roles.column('time')!r}\n"
    rig = rig_of(f"{time}point = [{roles.column('point_x')!r}, {roles.column('point_y')!r}]\n".replace("'", '"'))
    log = sw.Recording.load(path, rig)
    rows = np.round(log.time * RATE).astype(int)
    assert np.sqrt(np.mean((log.angle - ANGLES[rows]) ** 2)) < 3e-3
    if kind in ("tracker-two", "deeplabcut", "merged-cells"):
        assert "pivot_x" in roles.found
    if kind == "deeplabcut":
        assert len(log) == TIME.size - np.count_nonzero(np.arange(TIME.size) % 300 == 7)


@pytest.mark.parametrize("columns", [("x",), ("x", "y"), ("x [px]", "y [px]")])
def test_pixels_are_never_degrees(columns: tuple[str, ...], tmp_path: Path) -> None:
    """Of swings too small for a pivot, or of one coordinate only."""
    x, y = seen(swing(0.03))
    rows = "\n".join(
        ",".join(f"{one:.2f}" for one in (t, a, b)[: 1 + len(columns)]) for t, a, b in zip(TIME, x, y, strict=True)
    )
    path = tmp_path / "log.csv"
    path.write_text(",".join(("t", *columns)) + "\n" + rows + "\n")
    found = inspect_log(path)
    assert found.verdict.status == "unusable"
    assert "angle" not in found.roles.found
    assert "pixels are no angle" in found.verdict.line


@pytest.mark.parametrize("name", ["x_px", "x [px]", "angle pixels"])
def test_pixels_that_a_rig_file_calls_an_angle_are_refused(name: str, tmp_path: Path) -> None:
    x, _ = seen(swing(0.03))
    path = tmp_path / "log.csv"
    path.write_text(f"t,{name}\n" + "\n".join(f"{t:.4f},{a:.2f}" for t, a in zip(TIME, x, strict=True)) + "\n")
    rig = rig_of(f'time = "t"\nangle = "{name.partition(" [")[0]}"\nangle_unit = "deg"\n')
    with pytest.raises(SwingidError, match="states px, no unit of an angle"):
        sw.Recording.load(path, rig)
    assert inspect_log(path, rig).verdict.status == "unusable"


def test_damaged_logs_of_marks_are_refused_in_one_sentence(tmp_path: Path) -> None:
    head, row = FORMATS["deeplabcut"]
    whole = (head + "\n".join(row(k) for k in range(TIME.size)) + "\n").encode()
    rig = rig_of('rate = 60\npoint = ["bob x", "bob y"]\npivot = ["pin x", "pin y"]\n')
    rng = np.random.default_rng(2)
    path = tmp_path / "log.csv"
    for _ in range(20):
        damaged = bytearray(whole[: rng.integers(1, len(whole))] if rng.random() < 0.5 else whole)
        for at in rng.integers(0, len(damaged), rng.integers(0, 30)):
            damaged[at] = rng.integers(0, 256)
        path.write_bytes(bytes(damaged))
        try:
            sw.Recording.load(path, rig)
            inspect_log(path)
        except SwingidError as error:
            assert str(path) in error.message
            assert "\n" not in error.message
