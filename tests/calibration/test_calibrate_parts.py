"""Parts of the motor calibration: the simulated wheel, the rig file edited in place, the command."""

import json
import tomllib

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from motor_logs import BLANK, PAPER, TRUE, clamped, given, multisine
from swingid.balance.wheel_equation import COUNT, COUPLING, products_of
from swingid.calibration.motor.output_error import STATES as INITIAL
from swingid.calibration.motor.output_error import Shots
from swingid.cli.app import run
from swingid.model.rig import Rig
from swingid.model.rig.edit import edited
from swingid.units import Quantity

TRUE_PRODUCTS = products_of(PAPER)


def wheel(values, voltage, q=0.0, v=0.0, kicks=None, step=1e-3):
    """Angles of the simulated wheel, and derivatives by products and initial values; kicks (n−1,): of q1' (rad/s)."""
    rows = len(voltage)
    kicks = np.zeros(rows - 1) if kicks is None else kicks
    time, none = step * np.arange(rows), np.zeros(rows)
    axis = np.append(0.0, np.cumsum(np.cumsum(kicks) * step))
    start = np.array([[q, v]])
    shots = Shots(np.array([0, rows]), np.array([0]), time, none, axis, none, voltage, start)
    motion = shots.moved(values, start)
    return motion.outputs, np.roll(shots.slopes(values, motion.steps), -INITIAL, axis=1)


STATES = COUNT + INITIAL


def test_the_simulated_wheel_is_the_twins():
    """Closed form from event to event against the twin's integrator, through rests, reversals and the dead zone."""
    log = clamped()
    assert np.abs(wheel(TRUE_PRODUCTS, log.voltage)[0] - log.wheel_angle).max() < 1e-10


def test_a_coasting_wheel_stops_where_the_closed_form_says():
    """Inside the dead zone q2'' = −λ q2' − f from v0: it stops at t = ln(1 + λ v0/f)/λ after v0/λ − f t/λ rad."""
    rate, friction, v0 = 4.0, 50.0, 30.0
    values = np.array([100.0, rate, 0.0, friction + 1e6, friction + 1e6, friction, 0.0])
    stop = np.log1p(rate * v0 / friction) / rate
    angles, _ = wheel(values, np.zeros(1000), v=v0)
    assert angles[-1] == pytest.approx(v0 / rate - friction / rate * stop, rel=1e-12)
    assert angles[int(stop / 1e-3) + 1] == angles[-1]


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-3, 4.7])
def test_damping_may_vanish(damping):
    values = np.array([100.0, damping, 0.0, 10.0, 10.0, 10.0, 0.0])
    angles, _ = wheel(values, np.full(1001, 1.0))
    a = 90.0
    expected = 0.5 * a if damping == 0 else a / damping * (1 + np.expm1(-damping) / damping)
    assert angles[-1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("v", [0.0, 25.0], ids=["from rest", "moving"])
def test_sensitivities_are_derivatives(v):
    """Against central differences, with kicks of a moving axis, rests, reversals and both edges of the dead zone."""
    voltage = multisine(5.0)
    kicks = 0.02 * np.sin(9e-3 * np.arange(len(voltage) - 1))
    start = np.append(TRUE_PRODUCTS, [0.1, v])
    _, slopes = wheel(TRUE_PRODUCTS, voltage, 0.1, v, kicks)

    def moved(x):
        return wheel(x[:-2], voltage, x[-2], x[-1], kicks)[0]

    for k in range(STATES - (v == 0.0)):  # from rest the speed at the start has no derivative
        step = np.zeros(STATES)
        step[k] = 1e-6 * max(abs(start[k]), 1e-3)
        numeric = (moved(start + step) - moved(start - step)) / (2 * step[k])
        assert np.abs(numeric - slopes[:, k]).max() < 1e-3 * np.abs(slopes[:, k]).max()


def test_a_kick_turns_the_wheel_against_the_axis():
    """Without torques and friction q2 + ρ q1 moves straight."""
    values = np.zeros(7)
    values[COUPLING] = 0.8
    rng = np.random.default_rng(1)
    axis = np.cumsum(rng.normal(size=200)) * 1e-3
    kicks = np.append(0.0, np.diff(np.diff(axis) / 1e-3))
    speed = -0.8 * (axis[1] - axis[0]) / 1e-3
    angles, _ = wheel(values, np.zeros(200), v=speed, kicks=kicks)
    assert np.allclose(angles, -0.8 * (axis - axis[0]), atol=1e-12)


# --- the rig file ----------------------------------------------------------------------------------------------


def test_edited_text_keeps_comments_and_order():
    text, kept = edited(
        PAPER.text, {"drive.motor.coulomb": Quantity(3e-3, 1e-6), "drive.motor.dead_zone": [-1e-4, 2e-4]}
    )
    assert kept
    old, new = PAPER.text.splitlines(), text.splitlines()
    changed = [(a, b) for a, b in zip(old, new, strict=True) if a != b]
    assert changed == [
        ("coulomb = 302.02e-5         # f3", "coulomb = {value = 0.003, std = 1e-06}         # f3"),
        ("dead_zone = [-2.996e-4, 5.485e-4]  # d2, d1", "dead_zone = [-0.0001, 0.0002]  # d2, d1"),
    ]
    assert Rig.from_text(text).drive.motor.coulomb == Quantity(3e-3, 1e-6)


def test_a_missing_key_joins_its_table_and_a_missing_table_the_file():
    text, kept = edited("[a] # one\nx = 1\n\n[b]\ny = 2\n", {"a.z": 3.5, "c.d.w": 4})
    assert kept
    assert text == "[a] # one\nx = 1\nz = 3.5\n\n[b]\ny = 2\n\n[c.d]\nw = 4\n"


def test_none_takes_a_line_away():
    assert edited("[a]\nx = 1 # one\ny = 2\n", {"a.x": None, "a.z": None, "b.c": None})[0] == "[a]\ny = 2\n"


@pytest.mark.parametrize(
    "text",
    ["drive.motor.coulomb = 1\n", "[drive]\nmotor = {coulomb = 1}\n", "[drive.motor]\ncoulomb = [\n1,\n2,\n]\n"],
    ids=["dotted", "inline", "several lines"],
)
def test_other_ways_of_writing_are_written_anew(text):
    new, kept = edited(text, {"drive.motor.coulomb": 2.5})
    assert not kept
    assert tomllib.loads(new) == {"drive": {"motor": {"coulomb": 2.5}}}


@settings(deadline=None, max_examples=60)
@drawn(
    st.dictionaries(
        st.sampled_from([f"drive.motor.{key}" for key in ("torque_per_volt", "viscous", "coulomb", "new")]),
        st.floats(0, 1, allow_subnormal=False),
        max_size=4,
    )
)
def test_editing_changes_what_it_should_and_nothing_else(values):
    text, kept = edited(PAPER.text, values)
    assert kept
    expected = tomllib.loads(PAPER.text)
    for key, value in values.items():
        expected["drive"]["motor"][key.rpartition(".")[2]] = value
    assert tomllib.loads(text) == expected


# --- the command -----------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a log of a voltage test and a rig without motor constants."""
    monkeypatch.chdir(tmp_path)
    sensors = {"counts_per_turn": 16384}
    rig = given(sensors, **BLANK)
    (tmp_path / "rig.toml").write_text(rig.text, encoding="utf-8")
    clamped(multisine(), sensors).save(tmp_path / "test.csv", rig)
    return tmp_path


def test_the_command_writes_a_rig_that_loads(folder, capsys):
    code = run(["calibrate", "test.csv", "--rig", "rig.toml", "--out", "new.toml", "--json", "r.json"])
    assert code == 0
    assert "motor.torque_per_volt:" in capsys.readouterr().out
    data = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    assert (data["schema"], data["method"], data["status"]) == ("swingid.result/1", "calibrate", "ok")
    motor = Rig.load(folder / "new.toml").drive.motor
    gain = data["parameters"]["motor.torque_per_volt"]
    assert motor.torque_per_volt.value == pytest.approx(TRUE["motor.torque_per_volt"], rel=1e-5)
    assert motor.torque_per_volt.std == pytest.approx(gain["standard_uncertainty"], rel=1e-2)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["test.csv", "--out", "rig.toml"], 2, "overwrite"),
        (["test.csv", "--out", "new.txt"], 2, ".toml"),
        (["test.csv", "test.csv"], 2, "twice"),
        (["none.csv"], 3, "none.csv"),
        (["test.csv", "--out", "no/new.toml"], 3, "new.toml"),
    ],
)
def test_wrong_use_is_one_sentence(folder, capsys, arguments, code, words):
    assert run(["calibrate", *arguments, "--rig", "rig.toml"]) == code
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert words in said


def test_a_refusal_is_written_too(folder, capsys):
    rig = Rig.load("rig.toml")
    clamped(np.full(5001, 5.0), {"counts_per_turn": 16384}).save("constant.csv", rig)
    assert run(["calibrate", "constant.csv", "--rig", "rig.toml", "--out", "new.toml", "--json", "-"]) == 4
    data = json.loads(capsys.readouterr().out)
    assert data["status"] == "refused"
    assert data["error"]["code"] == "not-identifiable"
    assert not (folder / "new.toml").exists()


def test_simulate_takes_a_voltage(folder, capsys):
    (folder / "twin.toml").write_text(PAPER.changed({"axis.friction": {"coulomb": 10.0}}).text, encoding="utf-8")
    words = "multisine 3 V 1.1 rad/s + 2.5 V 0.5 Hz"
    assert run(["simulate", "--rig", "twin.toml", "--voltage", words, "--duration", "2", "--out", "run.parquet"]) == 0
    from swingid.recording.recording import Recording

    log = Recording.load("run.parquet", PAPER, still_axis=True)
    assert np.ptp(log.angle) == 0
    assert log.voltage == pytest.approx(3 * np.sin(1.1 * log.time) + 2.5 * np.sin(np.pi * log.time))


@pytest.mark.parametrize("words", ["sine 3 rad 1 rad/s", "3 V"])
def test_a_voltage_in_other_words_is_refused(folder, capsys, words):
    assert run(["simulate", "--rig", "rig.toml", "--voltage", words, "--duration", "2", "--out", "run.csv"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_voltage_and_reference_contradict(folder, capsys):
    both = ["--voltage", "sine 3 V 1 rad/s", "--reference", "sine 0.8 rad 8.5 rad/s"]
    assert run(["simulate", "--rig", "paper", *both, "--duration", "2", "--out", "run.csv"]) == 2
