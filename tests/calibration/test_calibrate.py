"""Motor calibration on the twin: the paper's motor is found, its interval holds, and what is not seen is said."""

import re
from dataclasses import replace

import numpy as np
import pytest

from motor_logs import BLANK, ETA, OFF, PAPER, PRODUCTS, TRUE, clamped, given, multisine
from swingid.calibration.motor import calibrate
from swingid.cli import main
from swingid.control.references import Sine
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from twin_logs import INERTIA

BIT14 = {"counts_per_turn": 16384}
T = np.arange(10001) / 1000
UP_ONLY = 4 + 2 * np.sin(3 * T) + 1.5 * np.sin(11 * T)


def codes(messages):
    return {message.code for message in messages}


def scores(result, names=tuple(TRUE)):
    """Errors in standard uncertainties of what was found."""
    found = {name: result.parameters[name] for name in names if name in result.parameters}
    return {name: (p.value - TRUE[name]) / p.standard_uncertainty for name, p in found.items()}


@pytest.fixture(scope="module")
def clean():
    """Calibration of a 14-bit log, from a rig without motor constants."""
    return calibrate(clamped(sensors=BIT14), given(BIT14, **BLANK))


def test_without_noise_every_constant_is_found():
    found = calibrate(clamped(), given(**BLANK))
    for name, true in TRUE.items():
        assert found.result.parameters[name].value == pytest.approx(true, rel=1e-6)
        assert found.first[name] == pytest.approx(true, rel=1e-4)


def test_the_start_does_not_matter(clean):
    other = calibrate(clamped(sensors=BIT14), given(BIT14, **OFF))
    for name, parameter in clean.result.parameters.items():
        assert other.result.parameters[name].value == pytest.approx(parameter.value, rel=1e-9)


def test_with_14_bit_everything_is_known_apart_and_without_doubt(clean):
    assert set(clean.result.parameters) == set(TRUE)
    assert clean.result.status == "ok"
    assert max(map(abs, scores(clean.result).values())) < 3
    for name in PRODUCTS:
        assert clean.result.parameters[name].value == pytest.approx(TRUE[name], rel=1e-5)
        assert clean.first[name] == pytest.approx(TRUE[name], rel=1e-5)
    (kind,) = [note for note in clean.result.notes if note.code == "log-kind"]
    assert "clamped" in kind.message


@pytest.mark.long
def test_spread_over_seeds_is_what_the_interval_says():
    """Twelve draws of place and phase: root mean square of the scores near one, for each product."""
    drawn = []
    for seed in range(12):
        log = clamped(multisine(phase=0.5 * seed), BIT14, seed=seed)
        drawn.append(list(scores(calibrate(log, given(BIT14)).result, PRODUCTS).values()))
    level = np.sqrt(np.mean(np.square(drawn), axis=0))
    # 12 draws: the root mean square of normal scores lies between 0.5 and 1.6 in 99.9 % of cases
    assert level.min() > 0.4
    assert level.max() < 1.6


@pytest.mark.long
@pytest.mark.parametrize("sensors", [BIT14, {"counts_per_turn": 1024}, {"noise": 1e-3}], ids=["14", "10", "1 mrad"])
def test_coverage(sensors):
    """95 % intervals of the products hold in 95 % of 200 runs, within three binomial standard deviations."""
    inside = dict.fromkeys(PRODUCTS, 0)
    for seed in range(200):
        result = calibrate(clamped(multisine(phase=0.37 * seed), sensors, seed=seed), given(sensors)).result
        for name in PRODUCTS:
            low, high = result.parameters[name].interval95
            inside[name] += low <= TRUE[name] <= high
    for name, count in inside.items():
        assert 0.904 <= count / 200 <= 0.996, (name, count)


@pytest.mark.parametrize(
    ("rate", "sensors"), [(50.0, BIT14), (1000.0, {"noise": 1e-2}), (200.0, {"counts_per_turn": 256})]
)
def test_slow_noisy_and_coarse_logs(rate, sensors):
    result = calibrate(clamped(sensors=sensors, rate=rate, seed=3), given(sensors)).result
    assert result.status == "ok"
    for name in PRODUCTS:
        assert result.parameters[name].value == pytest.approx(TRUE[name], rel=1e-3)
        assert abs(scores(result)[name]) < 3.5


def test_lost_rows_cost_little():
    """5 % of the rows lost: what the voltage was there is guessed from its neighbours."""
    log = clamped(sensors=BIT14)
    kept = np.random.default_rng(0).random(len(log)) > 0.05
    names = ("time", "angle", "wheel_angle", "voltage")
    result = calibrate(replace(log, **{name: getattr(log, name)[kept] for name in names}), given(BIT14)).result
    assert max(map(abs, scores(result).values())) < 3.5
    assert result.parameters["motor.gain"].value == pytest.approx(TRUE["motor.gain"], rel=3e-5)


# --- what cannot be told apart ---------------------------------------------------------------------------------


def test_a_one_way_test_gives_the_sums_and_says_so():
    rig = given(BIT14, **OFF)
    found = calibrate(clamped(UP_ONLY, BIT14), rig)
    result = found.result
    assert set(result.parameters) == {
        "motor.gain",
        "motor.damping",
        "motor.breakaway_positive",
        "motor.torque_per_volt",
    }
    assert {"back-emf-with-viscous", "coulomb-with-dead-zone", "not-seen"} <= codes(result.notes)
    assert max(map(abs, scores(result).values())) < 3
    # the file keeps what the rig said of the unseen, and puts the rest of each sum beside it
    motor = found.rig.drive.motor
    assert motor.back_emf == rig.drive.motor.back_emf
    assert motor.coulomb == rig.drive.motor.coulomb
    assert ETA * motor.back_emf.value + 4.4 * motor.viscous.value == pytest.approx(TRUE["motor.damping"], rel=1e-5)
    assert motor.coulomb.value + motor.dead_zone[1] == pytest.approx(TRUE["motor.breakaway_positive"], rel=1e-5)
    assert motor.dead_zone[0] == pytest.approx(rig.drive.motor.dead_zone[0])


def test_without_stated_constants_the_sums_go_to_friction():
    found = calibrate(clamped(UP_ONLY, BIT14), given(BIT14, **BLANK))
    motor = found.rig.drive.motor
    assert motor.back_emf.value == 0
    assert 4.4 * motor.viscous.value == pytest.approx(TRUE["motor.damping"], rel=1e-5)
    assert motor.coulomb.value == pytest.approx(TRUE["motor.breakaway_positive"], rel=1e-5)
    assert motor.dead_zone == (0.0, 0.0)


def test_a_held_constant_hands_on_its_uncertainty():
    back_emf = "3.697e-6 ± 0.2e-6"
    found = calibrate(clamped(UP_ONLY, BIT14), given(BIT14, **{"drive.motor.back_emf": f"{back_emf} N*m*s"}))
    u = found.rig.drive.motor.viscous.std
    assert u == pytest.approx(ETA * 0.2e-6 / 4.4, rel=1e-3)


@pytest.mark.parametrize(
    ("voltage", "code"),
    [
        (6 * np.sign(np.sin(2.3 * T) + 1e-9), "not-identifiable"),
        (np.full(10001, 5.0), "not-identifiable"),
        (0.3 * np.sin(4 * T), "no-motion"),
        (np.zeros(10001), "no-motion"),
    ],
    ids=["two levels", "constant", "too weak", "none"],
)
def test_too_plain_a_voltage_is_refused(voltage, code):
    with pytest.raises(UnanswerableError) as caught:
        calibrate(clamped(voltage, BIT14), given(BIT14))
    assert caught.value.code == code
    assert caught.value.exit_code == 4


def test_a_wheel_that_only_coasts_is_refused():
    log = clamped(multisine(), BIT14)
    with pytest.raises(UnanswerableError) as caught:
        calibrate(replace(log, voltage=np.zeros(len(log))), given(BIT14))
    assert caught.value.code == "no-voltage"


def test_a_turned_voltage_is_named():
    log = clamped(multisine(), BIT14)
    with pytest.raises(UnanswerableError) as caught:
        calibrate(replace(log, voltage=-log.voltage), given(BIT14))
    assert caught.value.code == "wrong-sign"
    assert "voltage_sign" in caught.value.message


def test_a_motor_without_dead_zone_has_none():
    rig = {"drive.motor.dead_zone": [0, 0]}
    result = calibrate(clamped(sensors=BIT14, **rig), given(BIT14)).result
    assert result.parameters["motor.coulomb"].value == pytest.approx(TRUE["motor.coulomb"], rel=2e-5)
    assert abs(result.parameters["motor.dead_zone.positive"].value) < 1e-7
    assert "motor.back_emf" not in result.parameters  # apart only inside a dead zone


# --- other kinds of logs ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def driven():
    return simulate(PAPER, Sine(0.8, 8.5), duration=15)


def test_a_closed_loop_log_calibrates_too(driven):
    result = calibrate(driven, given(BIT14)).result
    assert max(map(abs, scores(result).values())) < 3
    for name in PRODUCTS:
        assert result.parameters[name].value == pytest.approx(TRUE[name], rel=1e-4)
    assert "back-emf-with-viscous" in codes(result.notes)
    (kind,) = [note for note in result.notes if note.code == "log-kind"]
    assert "both move" in kind.message


def test_a_moving_axis_shows_the_rotor():
    log = simulate(PAPER, duration=20, drive=multisine(20.0))
    result = calibrate(log, given(BIT14, **{"drive.motor.rotor_inertia": None})).result
    rotor = result.parameters["motor.rotor_inertia"]
    assert rotor.value == pytest.approx(0.21e-5, rel=0.05)
    assert abs(rotor.value - 0.21e-5) < 3 * rotor.standard_uncertainty
    assert max(map(abs, scores(result).values())) < 3
    assert "rotor-found" in codes(result.notes)


def test_a_clamped_log_cannot_show_the_rotor():
    rig = given(BIT14, **{"drive.motor.rotor_inertia": None})
    result = calibrate(clamped(sensors=BIT14), rig).result
    assert "rotor-unknown" in codes(result.notes)
    # everything is relative to a22, which lacks N² Jr
    scale = 11.34e-5 / PAPER.drive.a22
    assert result.parameters["motor.gain"].value == pytest.approx(scale * TRUE["motor.gain"], rel=1e-5)


def test_several_logs_are_one_answer(clean, driven):
    result = calibrate([clamped(sensors=BIT14), driven], given(BIT14)).result
    assert max(map(abs, scores(result).values())) < 3
    gain = result.parameters["motor.gain"].standard_uncertainty
    assert gain < 1.1 * clean.result.parameters["motor.gain"].standard_uncertainty
    assert len([note for note in result.notes if note.code == "log-kind"]) == 2


def test_a_free_swing_gives_gravity_over_inertia_and_friction():
    log = simulate(PAPER, duration=20, initial_angle=0.5)
    found = calibrate(log, given(BIT14, **{"axis.gravity_torque": 78e-3}))
    a11 = INERTIA + 11.34e-5 + 0.21e-5
    result = found.result
    ratio = result.parameters["gravity_per_inertia"]
    assert ratio.value == pytest.approx(78e-3 / a11, rel=5e-5)
    assert result.parameters["axis.friction.viscous"].value == pytest.approx(1.144e-3, rel=2e-3)
    assert result.parameters["axis.inertia"].value == pytest.approx(INERTIA, rel=1e-4)
    assert found.rig.axis.friction.viscous.value == pytest.approx(1.144e-3, rel=2e-3)
    assert found.rig.drive == given(BIT14).drive
    assert set(result.correlation) == set(result.parameters)
    assert result.correlation["gravity_per_inertia"]["axis.inertia"] == pytest.approx(-1.0, abs=1e-6)
    unknown = calibrate(log, given(BIT14, **{"axis.gravity_torque": "unknown"})).result
    assert set(unknown.parameters) == {"gravity_per_inertia"}
    assert unknown.parameters["gravity_per_inertia"].value == pytest.approx(ratio.value)


def test_free_swing_and_voltage_test_together(clean):
    swing = simulate(PAPER, duration=20, initial_angle=0.5)
    result = calibrate([swing, clamped(sensors=BIT14)], given(BIT14)).result
    assert {*TRUE, "gravity_per_inertia", "axis.friction.viscous"} <= set(result.parameters)
    assert set(result.correlation) == set(result.parameters)
    assert result.correlation["motor.gain"]["motor.torque_per_volt"] > 0.9
    assert result.correlation["motor.gain"]["axis.inertia"] == 0.0  # the wheel counts as exact
    expected = clean.result.parameters["motor.gain"].value
    assert result.parameters["motor.gain"].value == pytest.approx(expected, rel=1e-9)


# --- uncertainties and what becomes of them --------------------------------------------------------------------


def test_the_wheels_inertia_sets_the_scale():
    """1 % of J2 is J2/a22 % of every torque, whatever else; both signs of the change are linear enough."""
    result = calibrate(
        clamped(sensors=BIT14), given(BIT14, **{"drive.wheel.inertia": "11.34e-5 ± 0.1134e-5 kg*m^2"})
    ).result
    share = 0.01 * 11.34e-5 / PAPER.drive.a22
    for name in PRODUCTS:
        parameter = result.parameters[name]
        assert parameter.standard_uncertainty / parameter.value == pytest.approx(share, rel=1e-3)
    (entry,) = [e for e in result.budget if e.parameter == "motor.gain" and e.shared_id == "drive.wheel.inertia"]
    assert entry.type == "B"
    assert entry.sensitivity == pytest.approx(TRUE["motor.gain"] / PAPER.drive.a22, rel=1e-4)
    # which all constants share
    assert result.correlation["motor.gain"]["motor.breakaway_positive"] == pytest.approx(1.0, abs=1e-3)


def test_a_declared_latency_is_taken_off_and_its_uncertainty_felt():
    late = {**BIT14, "latency": "2 ± 0.3 ms"}
    twin = {**BIT14, "latency": 2e-3}
    result = calibrate(clamped(sensors=twin), given(late)).result
    for name in PRODUCTS:
        assert result.parameters[name].value == pytest.approx(TRUE[name], rel=1e-4)
    # the same log 0.3 ms off moves the gain by what the budget says
    other = calibrate(clamped(sensors=twin), given({**BIT14, "latency": 1.7e-3})).result
    (entry,) = [e for e in result.budget if e.parameter == "motor.gain" and e.source == "wheel latency"]
    moved = other.parameters["motor.gain"].value - result.parameters["motor.gain"].value
    assert abs(moved) == pytest.approx(entry.standard_uncertainty, rel=0.05)


def test_an_undeclared_delay_is_spoken_of():
    """The note's per cent are those by which a log read 1 ms later differs."""
    results = [calibrate(clamped(sensors=s), given(BIT14)).result for s in (BIT14, {**BIT14, "latency": 1e-3})]
    (note,) = [note for note in results[0].notes if note.code == "delay"]
    first, second = (result.parameters["motor.gain"].value for result in results)
    said = float(re.search(r"by about ([-+\d.]+) %", note.message)[1])
    assert said == pytest.approx(100 * (second / first - 1), rel=0.2)


def test_calibration_mends_the_energy_method(tmp_path):
    """Motor constants 5 % wrong put the energy method off by per cents; the calibrated rig puts it right."""
    swing = simulate(PAPER, Sine(0.8, 8.5), duration=20, seed=1)
    wrong = given(BIT14, **OFF)
    before = identify(swing, wrong, method="energy").inertia.value / INERTIA - 1
    path = tmp_path / "new.toml"
    path.write_text(calibrate(clamped(sensors=BIT14), wrong).rig.text, encoding="utf-8")
    after = identify(swing, Rig.load(path), method="energy").inertia
    assert abs(before) > 0.03
    assert abs(after.value / INERTIA - 1) < 0.003
    assert after.interval95[0] <= INERTIA <= after.interval95[1]


def test_out_says_when_the_rig_file_is_unchanged(tmp_path, capsys):
    """A free swing without a known gravity torque gives b/a11 alone, which is no constant of a rig file."""
    text = 'name = "free"\n[axis]\nkind = "rotary"\ngravity_torque = "unknown"\n[drive]\nkind = "none"\n'
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    time = np.arange(4000) / 200
    angle = 0.3 * np.exp(-0.02 * time) * np.cos(5 * time)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time, angle]), delimiter=",", header="t,q1", comments="")
    log, rig, out = (str(tmp_path / name) for name in ("a.csv", "rig.toml", "new.toml"))
    assert main(["calibrate", log, "--rig", rig, "--out", out]) == 0
    assert (tmp_path / "new.toml").read_text(encoding="utf-8") == text
    assert "unchanged" in capsys.readouterr().err


def test_an_error_of_the_wheel_cancels_in_the_energy_method():
    """A wheel 1 % off scales the calibrated torques with it: J1 moves by about 1 %, not by 10 %."""
    swing = simulate(PAPER, Sine(0.8, 8.5), duration=20, seed=1)
    heavy = given(BIT14, **{"drive.wheel.inertia": 1.01 * 11.34e-5})
    alone = identify(swing, heavy, method="energy").inertia.value / INERTIA - 1
    together = (
        identify(swing, calibrate(clamped(sensors=BIT14), heavy).rig, method="energy").inertia.value / INERTIA - 1
    )
    assert alone == pytest.approx(-0.10, abs=0.01)
    assert together == pytest.approx(0.0075, abs=0.001)


# --- bad input -------------------------------------------------------------------------------------------------


def test_a_log_without_voltage_is_refused():
    log = clamped(multisine(5.0), BIT14)
    with pytest.raises(InputError, match="voltage") as caught:
        calibrate(replace(log, voltage=None), given(BIT14))
    assert caught.value.code == "missing-voltage"


def test_a_rig_without_wheel_is_refused():
    rig = Rig.from_text('[axis]\ngravity_torque = 0.2\n[drive]\nkind = "none"\n')
    with pytest.raises(InputError) as caught:
        calibrate(clamped(multisine(5.0), BIT14), rig)
    assert caught.value.code == "other-drive"


def test_no_log_is_refused():
    with pytest.raises(UsageError) as caught:
        calibrate([], given(BIT14))
    assert caught.value.code == "no-log"


def test_a_still_wheel_under_voltage_is_refused():
    swing = simulate(PAPER, duration=10, initial_angle=0.5)
    with pytest.raises(UnanswerableError) as caught:
        calibrate(replace(swing, voltage=np.full(len(swing), 5.0)), given(BIT14))
    assert caught.value.code == "wheel-still"


def test_a_clamped_log_loads_when_asked_to(tmp_path):
    rig = given(BIT14)
    path = clamped(multisine(2.0), BIT14).save(tmp_path / "test.parquet", rig)
    with pytest.raises(UnanswerableError) as caught:
        Recording.load(path, rig)
    assert caught.value.code == "no-motion"
    assert np.ptp(Recording.load(path, rig, still_axis=True).wheel_angle) > 1


def test_friction_of_a_swing_replaces_what_the_rig_said():
    old = given(BIT14, **{"axis.friction": {"coulomb": 1e-3, "static": 2e-3}})
    new = calibrate(simulate(PAPER, duration=20, initial_angle=0.5), old).rig.axis.friction
    assert (new.coulomb, new.static) == (None, None)
    assert new.viscous.value == pytest.approx(1.144e-3, rel=2e-3)
