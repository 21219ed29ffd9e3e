"""Inspection of logs of the twin with planted faults: what is there is found, with its size, and nothing else."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

import swingid as sw
from long_cases import long, quick_first
from recording_cases import write_columns
from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.errors import InputError, SwingidError
from swingid.recording.formats.table import Table
from swingid.simulation import simulate
from swingid.study.inspect import Inspection, inspect_log
from swingid.study.inspect.inspection import inspect_table
from swingid.study.inspect.motion import independent, spectrum
from twin_logs import GIVEN, PAPER, twin

TWO_SINES = parse_reference("multisine 0.5 rad 5 rad/s + 0.4 rad 9 rad/s")
Columns = dict[str, np.ndarray]


def run(rig=PAPER, *, duration=20.0) -> Columns:
    """Columns that a rig logs while it swings at two frequencies."""
    controller = Compensator.paper(rig, sample_time=1e-3)
    log = simulate(rig, TWO_SINES, controller, duration=duration, rate=1000.0, seed=3)
    return {"t": log.time.copy(), "q1": log.angle.copy(), "q2": log.wheel_angle.copy(), "u": log.voltage.copy()}


@pytest.fixture(scope="module")
def clean() -> Columns:
    """20 s of the paper's rig with Stribeck friction, 14 bit, without faults."""
    return run(twin("Stribeck"))


@pytest.fixture
def look(tmp_path):
    """Inspect columns as a file, against the paper's rig without what is sought, or without a rig."""

    def call(columns, rig=GIVEN) -> Inspection:
        return inspect_log(write_columns(tmp_path / "log.csv", columns), rig)

    return call


def remedies(found: Inspection) -> list[str]:
    return [check.remedy for check in found.checks if check.level == "repair"]


def test_clean_log_is_ready_and_every_small_quantity_is_zero_within_its_uncertainty(clean, look) -> None:
    found = look(clean)
    assert found.verdict.status == "ready"
    assert found.verdict.line == "ready."
    assert {check.level for check in found.checks} <= {"ok", "note"}
    for check in found.checks:
        assert any(character.isdigit() for character in check.evidence), check
        assert check.evidence.endswith("."), check
    for code in ("latency", "zero"):
        values = found.check(code).values
        assert abs(values[code]) < 3 * values["uncertainty"]
    assert found.check("latency").values["uncertainty"] < 2e-5
    assert found.check("zero").values["uncertainty"] < 1e-3
    for code in ("angle-encoder", "wheel-encoder"):
        values = found.check(code).values
        assert values["amplitude_once"] < 4 * values["uncertainty_once"]
        assert values["uncertainty_once"] < np.radians(0.03)


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        (lambda c: {"q2": -c["q2"]}, "set wheel_angle_sign = -1 under [log]"),
        long((lambda c: {"q1": -c["q1"]}, "set angle_sign = -1 under [log]")),
        (lambda c: {"q1": c["q1"] + np.pi}, 'set angle_zero = "up" under [log]'),
        long((lambda c: {"u": -c["u"]}, "set voltage_sign = -1 under [log]")),
        (
            lambda c: {"q2": c["q2"] + c["q1"]},
            'set wheel_angle_is = "absolute" under [log] if the sensor says so',
        ),
        long((lambda c: {"q2": np.degrees(c["q2"])}, 'set wheel_angle_unit = "deg" under [log]')),
    ],
    ids=["wheel sign", "angle sign", "zero at the top", "voltage sign", "absolute wheel", "wheel in degrees"],
)
def test_wrong_convention_is_named_and_is_all_that_is_wrong(clean, look, change, remedy) -> None:
    found = look({**clean, **change(clean)})
    assert found.verdict.line == f"ready after these repairs: {remedy}."
    assert remedies(found) == [remedy]


@pytest.mark.long
def test_degrees_in_both_angles_are_two_repairs(clean, look) -> None:
    found = look({**clean, "q1": np.degrees(clean["q1"]), "q2": np.degrees(clean["q2"])})
    assert sorted(remedies(found)) == ['set angle_unit = "deg" under [log]', 'set wheel_angle_unit = "deg" under [log]']
    assert found.tried == {"log.angle_unit": "deg", "log.wheel_angle_unit": "deg"}
    assert found.check("angle").values["counts_per_turn"] == pytest.approx(16384, rel=1e-6)


@pytest.mark.parametrize("late", [1e-3, pytest.param(-0.3e-3, marks=pytest.mark.long)])
def test_latency_of_the_wheel_is_found(look, late) -> None:
    found = look(run(twin("Stribeck", **{"wheel.latency": late})))
    values = found.check("latency").values
    assert abs(values["latency"] - late) < 3 * values["uncertainty"] < 1e-4
    assert [remedy for remedy in remedies(found) if "latency" in remedy] == remedies(found) != []


def test_declared_latency_is_no_finding(look) -> None:
    columns = run(twin("Stribeck", **{"wheel.latency": 1e-3}))
    found = look(columns, GIVEN.changed({"sensors.wheel.latency": "1 ms"}))
    assert found.check("latency").level == "ok"


@pytest.mark.parametrize(("channel", "code"), [("q2", "wheel-encoder"), ("q1", "angle-encoder")])
@pytest.mark.parametrize(
    ("often", "size"),
    [pytest.param(1, 0.2, id="once per turn"), pytest.param(2, 0.1, id="twice per turn", marks=pytest.mark.long)],
)
def test_encoder_error_is_found_with_its_size(clean, look, channel, code, often, size) -> None:
    angle = clean[channel]
    found = look({**clean, channel: angle + np.radians(size) * np.cos(often * angle + 1.0)})
    check = found.check(code)
    word = {1: "once", 2: "twice"}[often]
    amplitude, uncertainty = check.values[f"amplitude_{word}"], check.values[f"uncertainty_{word}"]
    assert abs(amplitude - np.radians(size)) < 3.5 * uncertainty < np.radians(0.1)
    assert amplitude > 5 * uncertainty
    assert check.level == ("repair" if often == 1 else "note")
    other = found.check({"wheel-encoder": "angle-encoder", "angle-encoder": "wheel-encoder"}[code])
    assert other.level == "ok"


def test_zero_beside_hanging_is_found(clean, look) -> None:
    found = look({**clean, "q1": clean["q1"] + 0.02})
    values = found.check("zero").values
    assert abs(values["zero"] - 0.02) < 3 * values["uncertainty"] < 3e-3
    assert found.check("zero").level == "advice"  # no key of a rig file takes an offset off


def test_drive_and_gravity_of_different_scale_contradict_each_other(clean, look) -> None:
    wheel = GIVEN.drive.wheel.inertia.value
    rotor = GIVEN.drive.a12 - wheel
    heavy = GIVEN.changed({"drive.wheel.inertia": 1.1 * wheel})
    check = look(clean, heavy).check("gravity-torque-disagrees")
    seen = float(re.search(r"gravity torque of \(([0-9.]+) ±", check.evidence)[1])
    # row (I) is homogeneous: with a12 too large all of it comes out too large
    assert seen == pytest.approx(0.078 * (1.1 * wheel + rotor) / (wheel + rotor), rel=0.005)
    assert "drive.wheel.inertia" in check.remedy


def test_one_frequency_does_not_tell_an_encoder_error_of_small_swings_from_scale(tmp_path) -> None:
    rig = twin("viscous")
    log = simulate(rig, parse_reference("sine 0.3 rad 9 rad/s"), Compensator.paper(rig), duration=15.0, rate=1000.0)
    found = inspect_log(log.save(tmp_path / "log.parquet", GIVEN), GIVEN)
    assert not found.check("angle-encoder").values["told_once"]
    assert found.check("angle-encoder").level in ("ok", "unknown")
    assert found.verdict.status == "ready"


def test_clipped_voltage_is_told_with_its_share(clean, look) -> None:
    clipped = np.clip(clean["u"], -6.0, 6.0)
    found = look({**clean, "u": clipped})
    share = np.mean(np.abs(clipped) == 6.0)
    assert found.check("voltage-saturated").values["share"] == pytest.approx(share, abs=0.005)
    assert "-6" in found.check("voltage-saturated").evidence


@pytest.mark.parametrize("channel", ["q1", "q2"])
def test_dead_channel_makes_the_log_unusable(clean, look, channel) -> None:
    found = look({**clean, channel: np.full_like(clean[channel], 0.25)})
    assert found.verdict.status == "unusable"
    assert repr(channel) in found.verdict.line
    assert "0.25 in all 20001 rows" in found.summary()


def test_wrapped_wheel_is_mended_on_reading_and_nothing_is_left_to_do(clean, look) -> None:
    found = look({**clean, "q2": np.mod(clean["q2"], 2 * np.pi)})
    assert found.verdict.status == "ready"
    assert found.check("unwrapped").level == "note"


@pytest.mark.parametrize("bits", [10, pytest.param(12, marks=pytest.mark.long), 14])
def test_counts_per_turn_are_read_off_the_grid(look, bits) -> None:
    found = look(run(twin("viscous", counts_per_turn=2**bits), duration=10.0))
    for code in ("angle", "wheel_angle"):
        assert found.check(code).values["counts_per_turn"] == pytest.approx(2**bits, rel=1e-6)
        assert f"{bits} bit" in found.check(code).evidence
    wanted = [] if bits == 14 else [f"state counts_per_turn = {2**bits} under [sensors{w}]" for w in ("", ".wheel")]
    assert remedies(found) == wanted


def test_noise_of_a_channel_is_that_of_the_sensor(look) -> None:
    sensors = {"counts_per_turn": None, "noise": 1e-3}
    found = look(run(twin("viscous", **sensors), duration=10.0), GIVEN.changed({"sensors.counts_per_turn": None}))
    for code in ("angle", "wheel_angle"):
        assert found.check(code).values["noise"] == pytest.approx(1e-3, rel=0.1)
        assert found.check(code).values["step"] == 0


def test_clock_rate_jitter_gaps_and_copies(clean, look) -> None:
    rng = np.random.default_rng(1)
    keep = np.ones(20001, dtype=bool)
    keep[5000:5050] = keep[9000] = False
    rows = np.sort(np.concatenate([np.flatnonzero(keep), [100, 200, 300]]))
    columns = {name: values[rows] for name, values in clean.items()}
    found = look(columns)
    assert found.check("rate").values["rate"] == pytest.approx(1000.0)
    assert found.check("gaps").values == {"gaps": 2, "lost": 51}
    assert found.check("repeated-rows").values == {"repeated": 3, "copies": 3}
    jittered = look({**clean, "t": clean["t"] + rng.normal(0, 5e-5, 20001)})
    assert jittered.check("rate").values["jitter"] == pytest.approx(5e-5 * np.sqrt(2), rel=0.05)


def test_spectrum_of_two_sines() -> None:
    time = np.arange(20000) / 1000
    lines = spectrum(time, 0.5 * np.sin(5 * time) + 0.4 * np.sin(9 * time + 1) + 3, 0, 19.999, 1.0)
    assert np.array(lines[:2]) == pytest.approx(np.array([[5 / math.tau, 0.5], [9 / math.tau, 0.4]]), rel=0.01)
    assert len(independent(lines)) == 2
    assert len(independent(((1.0, 0.8), (3.0, 0.1), (1.05, 0.3)))) == 1
    assert len(independent(((1.0, 0.8), (2.0, 0.7)))) == 2


def test_seconds_that_serve_each_method(clean, look) -> None:
    seconds = {service.method: service.seconds for service in look(clean).services}
    assert 15 < seconds["momentum"] <= 20
    silent = look({k: clean[k] for k in ("t", "q1", "q2")}, GIVEN.changed({"log.voltage": None}))
    without = {service.method: service for service in silent.services}
    assert without["energy"].seconds == 0
    assert without["energy"].why == "no voltage"
    assert without["momentum"].seconds == seconds["momentum"]


def test_seconds_exclude_gaps(clean, look) -> None:
    steady = {name: values[clean["t"] >= 5] for name, values in clean.items()}
    keep = (steady["t"] < 12) | (steady["t"] > 14)
    whole, cut = look(steady), look({name: values[keep] for name, values in steady.items()})
    assert whole.check("rest") is cut.check("rest") is None
    assert whole.services[0].seconds - cut.services[0].seconds == pytest.approx(2.0, abs=0.05)


def test_json_is_the_schema_and_has_no_nan(clean, look) -> None:
    found = look({**clean, "note": ["a"] * 20001})
    data = json.loads(found.to_json(), parse_constant=lambda name: pytest.fail(name))
    assert data["schema"] == "swingid.inspect/1"
    assert data["verdict"]["status"] == "ready"
    assert {check["code"] for check in data["checks"]} >= {"rate", "angle", "signs", "latency", "wheel-encoder"}
    assert {column["name"]: column["kind"] for column in data["columns"]}["note"] == "text"


def test_unreadable_file_is_an_input_error(tmp_path) -> None:
    (tmp_path / "log.csv").write_text("")
    for name in ("log.csv", "none.csv"):
        with pytest.raises(InputError):
            inspect_log(tmp_path / name)


@pytest.mark.parametrize(
    ("channel", "factor", "key"),
    [
        long(("q2", 180 / np.pi, "wheel_angle_unit")),
        ("q1", 180 / np.pi, "angle_unit"),
        long(("q2", 0.5 / np.pi, "wheel_angle_unit")),
    ],
)
def test_wrong_unit_is_said_first_and_counts_are_those_of_the_right_one(clean, look, channel, factor, key) -> None:
    unit = "deg" if factor > 1 else "turns"
    found = look({**clean, channel: clean[channel] * factor})
    assert remedies(found) == [f'set {key} = "{unit}" under [log]']
    code = "angle" if channel == "q1" else "wheel_angle"
    order = [check.code for check in found.checks]
    assert order.index("units") < order.index(code)
    assert f"looks like {'degrees' if unit == 'deg' else 'turns'}" in found.check("units").evidence
    assert found.check(code).values["counts_per_turn"] == pytest.approx(16384, rel=1e-4)
    alone = look({**clean, channel: clean[channel] * factor}, None)
    assert alone.roles.found[code].unit == unit
    assert alone.check(code).values["counts_per_turn"] == pytest.approx(16384, rel=1e-4)


def test_a_wheel_in_degrees_without_steps_is_told_by_the_balance(clean, look) -> None:
    smooth = np.degrees(clean["q2"]) + np.random.default_rng(1).normal(0, 0.01, clean["q2"].size)
    found = look({**clean, "q2": smooth})
    assert 'set wheel_angle_unit = "deg" under [log]' in remedies(found)
    assert not any("gravity_torque" in remedy for remedy in remedies(found))


def test_what_would_serve_better_is_advice_beside_the_verdict(clean, look) -> None:
    few = clean["t"] < 3.0
    found = look({name: values[few] for name, values in clean.items()})
    assert found.check("motion").level == "advice"
    assert found.verdict.status == "ready"
    assert "longer" not in found.verdict.line
    assert "record a longer motion" in found.verdict.advice
    assert "advice: record a longer motion" in found.summary().splitlines()[1]
    assert json.loads(found.to_json())["verdict"]["advice"] == found.verdict.advice


def test_what_swingid_repairs_itself_is_in_the_line(clean, look) -> None:
    angle = clean["q1"].copy()
    angle[[4000, 9000]] += 0.3
    found = look({**clean, "q1": angle, "q2": np.mod(clean["q2"], 2 * np.pi)})
    assert found.verdict.status == "ready"
    assert found.verdict.line == "ready; swingid itself repairs angles within one turn; spikes."


@pytest.mark.parametrize("rows", [1, 2, 9])
def test_a_log_of_a_row_or_two_says_so(clean, look, rows) -> None:
    for rig in (GIVEN, None):
        found = look({name: values[:rows] for name, values in clean.items()}, rig)
        word = "1 row of numbers" if rows == 1 else f"{rows} rows of numbers"
        assert found.verdict.line == f"not usable: the log has {word}, too few for a motion; log some swings."


def test_time_that_runs_backwards_is_called_so_once(clean, look) -> None:
    for rig in (GIVEN, None):
        found = look({name: values[::-1] for name, values in clean.items()}, rig)
        assert found.verdict.line.startswith("not usable: the time in column 't' runs backwards, from 20 to 0 s; if")
        assert found.verdict.line.count("backwards") == 1


@pytest.mark.parametrize("channel", quick_first(1, ["t", "q1", "q2", "u"]))
def test_one_absurd_cell_spoils_no_estimate(clean, look, channel) -> None:
    values = clean[channel].copy()
    values[3000] = 1e300
    for rig in (GIVEN, None):
        found = look({**clean, channel: values}, rig)
        assert found.verdict.status == "ready"
        assert "swingid itself repairs" in found.verdict.line
        units = {name: role.unit for name, role in found.roles.found.items()}
        assert units == {"time": "s", "angle": "rad", "wheel_angle": "rad", "voltage": ""}
        assert found.check("wheel_angle").values["counts_per_turn"] == pytest.approx(16384, rel=1e-4)


def test_a_log_without_a_clock_says_so_and_not_that_it_has_no_angle(clean, look) -> None:
    found = look({name: clean[name] for name in ("q1", "q2", "u")}, None)
    assert found.verdict.status == "unusable"
    assert "column of times" in found.verdict.line
    assert "[log] rate" in found.verdict.line
    assert "# rate = 1000" in found.table


@pytest.mark.parametrize(("unit", "factor"), quick_first(1, [("ms", 1e3), ("us", 1e6), ("ns", 1e9)]))
def test_a_clock_in_another_unit_is_said_first(clean, look, unit, factor) -> None:
    found = look({**clean, "t": clean["t"] * factor})
    assert remedies(found) == [f'set time_unit = "{unit}" under [log]']
    assert found.checks[0].code == "time-unit"
    assert f"looks like {unit}" in found.checks[0].evidence
    assert found.check("rate").values["rate"] == pytest.approx(1000)
    assert found.tried == {"log.time_unit": unit}


def test_a_log_that_identify_refuses_is_not_ready() -> None:
    """A body that swings to and fro by a drive that was not logged: every other check passes."""
    time = np.arange(0, 20, 0.01)
    rig = sw.Rig.from_text(
        'name = "a"\n[axis]\ngravity_torque = 1\n[drive]\nkind = "motor"\n[drive.motor]\ntorque_per_volt = 0.1\n'
        '[log]\ntime = "t"\nangle = "q"\nvoltage = "u"\n'
    )
    angle = 0.3 * np.sin(5 * time) * (1 + 0.05 * time)
    found = inspect_table(Table({"t": time, "q": angle, "u": np.zeros_like(time)}), rig)
    with pytest.raises(SwingidError) as refused:
        sw.identify(sw.Recording.from_table(Table({"t": time, "q": angle, "u": np.zeros_like(time)}), rig), rig)
    assert found.verdict.status == "unusable"
    assert found.check(refused.value.code).title == "identify"


def edges(per_turn: int, tick: float) -> Columns:
    """A row per edge of an encoder: time in ticks, and the count. The small swings decay with 38 1/s² and 0.02 1/s."""
    time = np.arange(0, 60, 2e-5)
    angle = 0.05 + 0.4 * np.exp(-0.01 * time) * np.cos(np.sqrt(38 - 1e-4) * time)
    count = np.floor(angle * per_turn / (2 * np.pi))
    at = np.flatnonzero(np.diff(count)) + 1
    return {"timer_ticks": np.round(time[at] / tick), "counts": count[at]}


def test_a_row_per_edge_is_no_row_lost_and_a_tick_has_the_time_that_is_stated(tmp_path) -> None:
    log = Table(edges(2400, 0.5e-6))
    guess = inspect_table(log, None)
    assert '# time_unit = "0.5 us"' in guess.table
    assert guess.verdict.status != "ready"  # the tick is not stated
    text = (
        'name = "edges"\n[axis]\nkind = "rotary"\ngravity_torque = "unknown"\n[drive]\nkind = "none"\n[sensors]\n'
        'counts_per_turn = 2400\n[log]\ntime = "timer_ticks"\ntime_unit = "0,5 us"\nangle = "counts"\n'
        'angle_unit = "counts"\n'
    )
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    found = inspect_table(log, sw.Rig.load(str(tmp_path / "rig.toml")))
    assert found.check("gaps").values["lost"] == 0
    assert found.check("motion").values["half_period"] == pytest.approx(np.pi / np.sqrt(38), rel=0.01)
