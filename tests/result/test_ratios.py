"""Rigs in which nothing sets a scale: ratios to the inertia, with intervals that contain the true values."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import swingid as sw
from refusals import coded
from swingid.control.compensator import Compensator
from swingid.errors import InputError, UnanswerableError
from swingid.pooling import difference
from swingid.result.brief import brief
from swingid.result.file import load_result
from swingid.simulation import simulate
from swingid.study.compare import compare
from swingid.uncertainty.budget import combined

J, B, C, D = 2e-3, 0.08, 2e-4, 1e-4
TRUE = f"""
[axis]
inertia = {J}
gravity_torque = {B}
[axis.friction]
coulomb = {C}
viscous = {D}
[drive]
kind = "none"
[sensors]
nonlinearity = 0
latency = 0
noise = 5e-4
counts_per_turn = 4096
"""
RATIOS = {"gravity_torque/inertia": B / J, "coulomb/inertia": C / J, "viscous/inertia": D / J}
FREE = sw.Rig.from_text(TRUE)
BARE = FREE.changed({"axis.inertia": None, "axis.friction": None})
UNSCALED = BARE.changed({"axis.gravity_torque": "unknown"})
DIRECT = FREE.changed({"drive.kind": "direct"})


def swing(seed=1, rig=FREE, **more):
    return simulate(rig, duration=20.0, rate=200.0, seed=seed, **({"initial_angle": 0.8} | more))


@pytest.fixture(scope="module")
def log():
    return swing()


@pytest.fixture(scope="module")
def driven():
    t = np.arange(6000) / 300
    torque = 0.05 * np.sin(3 * t) + 0.03 * np.sin(9.3 * t)
    return simulate(DIRECT, duration=20.0, rate=300.0, drive=torque, seed=1)


@pytest.mark.parametrize("method", ["momentum", "energy", "equation-error", "output-error"])
def test_a_free_swing_without_a_gravity_torque_gives_ratios(log, method):
    result = sw.identify(log, UNSCALED, method)
    assert result.status == "ok"
    assert result.ratios
    assert "inertia" not in result.parameters
    assert result.leading == "gravity_torque/inertia"
    units = {name: one.unit for name, one in result.parameters.items()}
    assert units["gravity_torque/inertia"] == "1/s^2"
    assert units["viscous/inertia"] == "1/s"
    assert units["coulomb/inertia"] == "rad/s^2"
    for name, true in RATIOS.items():
        found = result.parameters[name]
        assert abs(found.value - true) < 3 * found.standard_uncertainty
    assert result.main.value == pytest.approx(B / J, rel=1e-3)
    (scale,) = (line for line in brief(result).splitlines() if line.startswith("scale "))
    assert "axis.gravity_torque" in " ".join(brief(result).split())
    assert "nothing in rig" in scale


def test_ratios_are_those_of_the_result_with_a_known_scale(log):
    """b/J is b over the J that b gives; its uncertainty is that of J without the part by b."""
    known = sw.identify(log, BARE.changed({"axis.gravity_torque": "0.08 ± 0.001 N*m"}))
    ratio = sw.identify(log, UNSCALED)
    assert ratio.main.value * known.inertia.value == pytest.approx(B, rel=1e-9)
    for name in ("coulomb", "viscous"):
        quotient = known.parameters[name].value / known.inertia.value
        assert ratio.parameters[f"{name}/inertia"].value == pytest.approx(quotient, rel=1e-9)
    share = known.inertia.standard_uncertainty / known.inertia.value
    of_b = next(e.standard_uncertainty for e in known.budget if e.source == "axis.gravity_torque")
    left = np.sqrt(share**2 - (of_b / known.inertia.value) ** 2)
    assert ratio.main.standard_uncertainty / ratio.main.value == pytest.approx(left, rel=1e-6)


def test_the_budget_of_every_ratio_adds_up_to_its_uncertainty(log):
    result = sw.identify(log, UNSCALED)
    for name, parameter in result.parameters.items():
        assert combined(result.budget, name) == pytest.approx(parameter.standard_uncertainty, rel=1e-12)
    clock = {e.parameter: e for e in result.budget if e.source == "log.clock"}
    # frequency squared, and rates, in the units of a clock that is 100 ppm fast
    assert clock["gravity_torque/inertia"].standard_uncertainty == pytest.approx(2e-4 * B / J, rel=1e-3)
    assert clock["viscous/inertia"].standard_uncertainty == pytest.approx(
        1e-4 * result.parameters["viscous/inertia"].value, rel=1e-3
    )
    assert "axis.gravity_torque" not in {e.source for e in result.budget}


def test_a_note_says_what_to_measure(log):
    result = sw.identify(log, UNSCALED)
    (note,) = (one.message for one in result.notes if one.code == "no-scale")
    assert "axis.gravity_torque is unknown" in note
    assert "axis.mass and axis.lever" in note
    texts = " ".join(one.message for one in (*result.notes, *result.warnings))
    assert "exact" not in texts
    assert "proportional to axis.gravity_torque" not in texts


def test_summary_json_and_picture_are_of_the_ratio(log, tmp_path):
    result = sw.identify(log, UNSCALED)
    assert "[[Uncertainty of gravity_torque/inertia]]" in result.summary()
    assert "kg" not in result.summary().partition("[[Notes]]")[0]
    data = json.loads(result.to_json())
    assert data["ratios"] is True
    assert (
        data["provenance"]["rig_sha256"] == json.loads(sw.identify(log, UNSCALED).to_json())["provenance"]["rig_sha256"]
    )
    assert "axis.gravity_torque" not in data["provenance"]["constants"]
    path = tmp_path / "result.json"
    path.write_text(result.to_json(), encoding="utf-8")
    again = load_result(path)
    assert again.ratios
    assert again.main.value == result.main.value
    labels = result.plot().get_ylabel()
    assert labels == "gravity_torque/inertia, 1/s²"
    assert result.details.estimates["law"][0] == pytest.approx(result.main.value, rel=1e-9)
    swings = result.details.swings
    assert np.median(swings.values) == pytest.approx(B / J, rel=2e-3)


def test_a_report_of_ratios_compares_parts_of_the_log_in_the_leading_ratio(log, tmp_path):
    from swingid.report import write_report
    from swingid.report.tables import agreement_table

    result = sw.identify(log, UNSCALED)
    rows = agreement_table(result).rows
    assert rows
    for row in rows:
        for cell in row[1:3]:
            assert float(re.search(r"[\d.]+", cell)[0]) == pytest.approx(B / J, rel=2e-3)
            assert cell.endswith("1/s²")
    write_report(result, log, UNSCALED, tmp_path / "report.html")
    assert "gravity_torque/inertia" in (tmp_path / "report.html").read_text("utf-8")


def test_ratios_have_no_inertia(log):
    result = sw.identify(log, UNSCALED)
    with pytest.raises(UnanswerableError, check=coded("no-scale")):
        _ = result.inertia
    with pytest.raises(UnanswerableError, check=coded("no-scale")):
        difference(result, sw.identify(swing(2), UNSCALED))


def test_several_logs_give_one_ratio(log):
    one, both = sw.identify(log, UNSCALED), sw.identify([log, swing(2)], UNSCALED, friction="shared")
    assert both.ratios
    assert all(each.ratios for each in both.per_log)
    assert both.main.value == pytest.approx(B / J, rel=3e-4)
    assert (
        both.parameters["viscous/inertia"].standard_uncertainty < one.parameters["viscous/inertia"].standard_uncertainty
    )


def test_methods_are_compared_by_the_ratio(log):
    text = compare([log], UNSCALED, ["momentum", "equation-error"]).summary()
    assert "gravity_torque/inertia" in text
    assert "verdict: all methods agree" in text


def test_where_the_gain_is_sought_it_is_what_to_give_not_the_gravity_torque_that_is_stated(data_dir):
    text = 'name = "dfki"\n[axis]\ngravity_torque = "2.997 ± 1 %"\n[drive]\nkind = "direct"\n[log]\n'
    text += 'time = "time"\nangle = "position"\ntorque = "torque"\ntorque_gain = "unknown"\ndrive_held = false\n'
    rig = sw.Rig.from_text(text)
    log = sw.Recording.load(data_dir / "dfki_pendulum" / "energy_shaping.csv", rig)
    (warned,) = (each.message for each in sw.identify(log, rig).warnings if each.code == "gravity-and-inertia")
    assert warned.endswith("or give log.torque_gain.")


@pytest.mark.parametrize("method", ["momentum", "equation-error", "output-error"])
def test_an_unknown_gain_of_the_torque_is_a_ratio_or_found_by_gravity(driven, method):
    bare = DIRECT.changed({"axis.inertia": None, "axis.friction": None, "log.torque_gain": "unknown"})
    ratio = sw.identify(driven, bare.changed({"axis.gravity_torque": "unknown"}), method)
    assert list(ratio.parameters)[:2] == ["torque_gain/inertia", "gravity_torque/inertia"]
    assert ratio.main.value == pytest.approx(1 / J, rel=2e-3)
    assert ratio.parameters["gravity_torque/inertia"].value == pytest.approx(B / J, rel=2e-3)
    scaled = sw.identify(driven, bare.changed({"axis.gravity_torque": "80.0 ± 0.4 mN*m"}), method)
    assert not scaled.ratios
    assert scaled.inertia.value == pytest.approx(J, rel=2e-3)
    assert scaled.parameters["torque_gain"].value == pytest.approx(1.0, rel=2e-3)
    of_b = next(e for e in scaled.budget if e.shared_id == "axis.gravity_torque" and e.parameter == "inertia")
    assert of_b.standard_uncertainty == pytest.approx(0.005 * J, rel=2e-2)


def test_an_unknown_wheel_gives_the_inertia_over_it_or_is_found_by_gravity():
    rig = sw.Rig.builtin("paper")
    reference = sw.parse_reference("multisine 0.8 rad 8.5 rad/s + 0.3 rad 4.1 rad/s")
    log = simulate(rig, reference, Compensator.paper(rig, sample_time=1e-3), duration=15.0, seed=1)
    a12 = carried = rig.drive.a12  # the wheel stands for wheel and rotor
    a11 = rig.axis.inertia.value + rig.drive.carried
    unknown = {"drive.wheel.inertia": "unknown", "drive.motor.rotor_inertia": None}
    bare = rig.changed({"axis.inertia": None, "axis.friction": None, **unknown})
    result = sw.identify(log, bare.changed({"axis.gravity_torque": "unknown"}))
    assert result.leading == "inertia/wheel_inertia"
    assert result.main.unit == ""
    assert result.main.value == pytest.approx((a11 - carried) / a12, rel=1e-4)
    known = sw.identify(log, bare)
    assert known.parameters["wheel_inertia"].value == pytest.approx(a12, rel=1e-4)
    with pytest.raises(UnanswerableError, check=coded("no-scale", "energy")):
        sw.identify(log, bare, "energy")


def test_a_rotor_in_kg_beside_an_unknown_wheel_is_refused():
    with pytest.raises(InputError, check=coded("contradiction")):
        sw.Rig.builtin("paper").changed({"drive.wheel.inertia": "unknown"})


def test_the_twin_refuses_an_unknown_scale():
    rig = sw.Rig.builtin("paper").changed({"drive.wheel.inertia": "unknown", "drive.motor.rotor_inertia": None})
    with pytest.raises(InputError) as caught:
        simulate(rig, duration=0.1)
    assert caught.value.code == "unknown-scale"


def test_an_error_names_multiples_of_the_unit(driven):
    wrong = DIRECT.changed({"axis.inertia": None, "axis.friction": None, "log.torque_gain": "unknown"})
    with pytest.raises((UnanswerableError, InputError), match=r"s² × torque_gain\)"):
        sw.identify(driven, wrong.changed({"axis.gravity_torque": 0}))


def test_a_free_swing_is_calibrated_without_a_wheel(log):
    found = sw.calibrate(log, UNSCALED).result
    assert found.parameters["gravity_per_inertia"].value == pytest.approx(B / J, rel=3e-4)


@pytest.mark.long
def test_intervals_of_ratios_cover_the_true_values():
    """100 seeds, 200 Hz, 12 bit, noise of 0.5 mrad; a perfect clock and a level axis, so that type A alone covers."""
    level = UNSCALED.changed({"axis.tilt": 0, "log.clock": 0})
    inside = dict.fromkeys(RATIOS, 0)
    for seed in range(100):
        result = sw.identify(swing(seed), level)
        for name, true in RATIOS.items():
            low, high = result.parameters[name].interval95
            inside[name] += low <= true <= high
    assert min(inside.values()) >= 90
