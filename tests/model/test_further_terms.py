"""Springs, cogging and friction by load: in the twin, in three methods, and a made-up term from the registry alone."""

from __future__ import annotations

import numpy as np
import pytest

import swingid as sw
from long_cases import quick_first
from motion_by_events import motion
from refusals import coded
from swingid.control.references import Multisine, Sine
from swingid.errors import InputError, UnanswerableError
from swingid.methods.output_error.partials import sliding_row, sliding_slopes
from swingid.model.dynamics import axis_load
from swingid.model.energy import drive_power, kinetic_energy, motor_friction_power, potential_energy
from swingid.model.friction import sliding_friction
from swingid.model.further import DRY, WET, further_torque
from swingid.model.parameters import COEFFICIENT, FIRST_SLOT, FURTHER, SHIFT, SIZE, SLOT, constants, rig_vector, vector
from swingid.model.terms import TERMS, Term, rig_terms
from swingid.simulation import simulate_run
from swingid.simulation.ensemble import simulate_ensemble
from swingid.study.validate import model_vector
from twin_cases import FURTHER as CASES
from twin_cases import body_of, direct_rig, free_rig, paper_rig, sine, warm_compensator

TWO_TONES = Multisine((Sine(0.5, 8.5), Sine(0.5, 4.7)))
METHODS = ("momentum", "energy", "equation-error", "output-error")
SENSORS = {"sensors.counts_per_turn": 16384}
SOUGHT = {
    "spring": {"axis.stiffness": "unknown", "axis.spring_zero": None},
    "cogging": {"axis.cogging": {"order": 7.0, "amplitude": "unknown"}},
    "load": {},
    "drag": {},
}
TRUE = {
    "spring": {"stiffness": 0.05},
    "cogging": {"cogging_sine": 4e-3 * np.cos(0.7), "cogging_cosine": 4e-3 * np.sin(0.7)},
    "load": {"load": 6e-3},
    "drag": {"drag": 4e-4},
}


def axis_friction(q, v, side, p):
    """All friction (N m) of an axis that slides."""
    return sliding_friction(v, side, 0.0, p) + further_torque(q, v, side, DRY | WET, p)


def off(parameter, truth):
    """Deviation from the truth in standard uncertainties."""
    return abs(parameter.value - truth) / parameter.standard_uncertainty


def made_log(rig, reference=TWO_TONES, duration=20.0):
    return sw.simulate(rig, reference, duration=duration, rate=500.0, seed=1)


@pytest.fixture(scope="module", params=SOUGHT)
def case(request):
    """A term, the twin's rig with it, and a log of two tones."""
    friction = "coulomb" if request.param == "load" else "viscous"
    rig = paper_rig(friction, **CASES[request.param], **SENSORS)
    return request.param, rig, made_log(rig)


# The twin.


@pytest.mark.parametrize("name", CASES)
def test_the_twin_follows_the_independent_motion(name):
    rig = paper_rig("coulomb", **CASES[name])
    run = simulate_run(rig, sine(0.8, 6.0), warm_compensator(rig), duration=2.0, rate=100.0)
    states = motion(body_of(rig), run.truth.command[:-1], 0.01, (0.0, 0.0, 0.0, 0.0))
    assert run.truth.mode_changes > 3
    assert np.abs(run.truth.angle - states[:, 0]).max() < 1e-7
    assert np.abs(run.truth.speed - states[:, 1]).max() < 1e-6
    assert np.array_equal(run.truth.speed == 0.0, states[:, 1] == 0.0)


def test_an_axis_held_by_its_load_rests_where_the_independent_motion_does():
    rig = free_rig("coulomb", **CASES["all"])
    run = simulate_run(rig, duration=3.0, rate=100.0, initial_angle=1.3)
    states = motion(body_of(rig), np.zeros(300), 0.01, (1.3, 0.0, 0.0, 0.0))
    assert run.truth.speed[-1] == 0.0
    assert np.abs(run.truth.angle - states[:, 0]).max() < 1e-7


@pytest.mark.parametrize("name", ["spring", "cogging"])
def test_a_frictionless_swing_keeps_its_energy(name):
    rig = free_rig("viscous", **{"axis.friction.viscous": None}, **CASES[name])
    p, truth = rig_vector(rig), simulate_run(rig, duration=20.0, rate=50.0, initial_angle=1.2).truth
    energy = [kinetic_energy(v, 0.0, p) + potential_energy(q, p) for q, v in zip(truth.angle, truth.speed, strict=True)]
    assert np.ptp(energy) < 1e-8 * np.ptp([potential_energy(q, p) for q in truth.angle])
    step = 1e-6
    for q in np.linspace(-2.0, 2.0, 9):
        slope = (potential_energy(q + step, p) - potential_energy(q - step, p)) / (2 * step)
        assert -axis_load(q, 0.0, p) == pytest.approx(slope, abs=1e-9)


def test_work_along_a_trajectory_is_the_change_of_energy():
    rig, left = paper_rig("quadratic", **CASES["all"]), []
    p = rig_vector(rig)
    for rows in (161, 321):
        times = np.linspace(0.0, 0.1, rows)
        t = simulate_run(rig, duration=0.25, rate=4.0, drive=[6.0, 6.0], initial_angle=0.9, truth_times=times).truth
        assert (t.speed[1:] < 0.0).all()
        power = [
            drive_power(6.0, v1, v2, p) - axis_friction(q, v1, -1, p) * v1 - motor_friction_power(v2, 1, p)
            for q, v1, v2 in zip(t.angle, t.speed, t.wheel_speed, strict=True)
        ]
        weights = np.full(rows, 2.0)
        weights[1::2], weights[[0, -1]] = 4.0, 1.0
        energies = [kinetic_energy(t.speed[i], t.wheel_speed[i], p) + potential_energy(t.angle[i], p) for i in (0, -1)]
        left.append(weights @ power * (0.1 / (rows - 1)) / 3.0 - (energies[1] - energies[0]))
    assert abs(left[-1]) < 1e-10
    assert abs(left[-1]) < 0.1 * abs(left[0])


@pytest.mark.parametrize("side", [1, -1])
def test_partial_derivatives_are_those_of_the_torques(side):
    p, q, v, step = rig_vector(paper_rig("stribeck", **CASES["all"])), 0.6, 1.3 * side, 1e-7

    def torque(q, v, p):
        return axis_friction(q, v, side, p) - axis_load(q, 0.0, p)

    by_angle = (torque(q + step, v, p) - torque(q - step, v, p)) / (2 * step)
    by_speed = (torque(q, v + step, p) - torque(q, v - step, p)) / (2 * step)
    row = np.zeros(SIZE)
    sliding_row(q, np.sin(q), v, side, p, row)
    assert sliding_slopes(q, np.cos(q), v, side, p) == pytest.approx((by_angle, by_speed), rel=1e-6)
    for slot in range(int(p[FURTHER])):
        for place in (FIRST_SLOT + SLOT * slot + COEFFICIENT, FIRST_SLOT + SLOT * slot + SHIFT):
            up, down = p.copy(), p.copy()
            up[place] += step
            down[place] -= step
            assert -row[place] == pytest.approx((torque(q, v, up) - torque(q, v, down)) / (2 * step), abs=1e-8)


def test_an_ensemble_keeps_a_term_that_its_lanes_do_not_know():
    rig = paper_rig("viscous", **CASES["spring"])
    together = simulate_ensemble(rig, Sine(0.8, 8.5), seeds=[1, 2], duration=1.0, rate=500.0)
    alone = sw.simulate(rig, Sine(0.8, 8.5), duration=1.0, rate=500.0, seed=2)
    assert together.alone.all()
    np.testing.assert_allclose(together.channel("angle")[1], alone.angle, atol=1e-12)


# The methods.


@pytest.mark.parametrize("method", quick_first(2, METHODS))
def test_a_method_finds_the_inertia_and_the_term(case, method):
    name, rig, log = case
    found = sw.identify(log, rig.changed(SOUGHT[name]), method=method)
    assert off(found.inertia, 302.2e-5) < 3
    assert abs(found.inertia.value / 302.2e-5 - 1) < 5e-3
    for key, truth in TRUE[name].items():
        assert off(found.parameters[key], truth) < 3
        # by energies a drag is hardly told from viscous and quadratic friction
        least = 8e-4 if (name, method) == ("drag", "energy") else 0.1 * 6e-3
        assert found.parameters[key].standard_uncertainty < least + 0.05 * abs(truth)
        assert found.parameters[key].unit == TERMS[key].unit


def test_drag_is_estimated_with_the_viscous_friction_that_it_resembles(case):
    name, rig, log = case
    if name != "drag":
        pytest.skip("of drag")
    found = sw.identify(log, rig.changed(SOUGHT[name]), method="momentum")
    drag, viscous = found.parameters["drag"], found.parameters["viscous"]
    correlation = found.correlation["drag"]["viscous"]
    assert correlation < -0.9
    assert drag.standard_uncertainty < 0.02 * drag.value
    # their torque together is what the log determines
    speed = 1.5
    share = drag.standard_uncertainty * speed**0.5 / viscous.standard_uncertainty
    assert 1 + share**2 + 2 * share * correlation < 0.3


STATED = {
    "spring": {"axis.stiffness": "50.3 ± 0.3 mN*m/rad", "axis.spring_zero": "0.21 ± 0.01 rad"},
    "cogging": {"axis.cogging": {"order": 7.0, "amplitude": "4.1 ± 0.1 mN*m", "phase": "0.68 ± 0.02 rad"}},
}
KEYS = {
    "spring": {"axis.stiffness", "axis.spring_zero"},
    "cogging": {"axis.cogging.amplitude", "axis.cogging.phase"},
}


@pytest.mark.parametrize("method", quick_first(2, METHODS))
def test_a_stated_term_is_known_with_its_uncertainty(case, method):
    name, rig, log = case
    if name not in STATED:
        return
    found = sw.identify(log, rig.changed(STATED[name]), method=method)
    assert off(found.inertia, 302.2e-5) < 3
    entries = {e.source: e for e in found.budget if e.parameter == "inertia" and e.type == "B"}
    assert KEYS[name] <= set(entries)
    assert all(entries[key].shared_id == key for key in KEYS[name])
    assert found.provenance["constants"].keys() >= KEYS[name]
    assert not set(TRUE[name]) & set(found.parameters)


def test_the_budget_holds_what_a_wrong_constant_does():
    rig = paper_rig(**CASES["spring"], **SENSORS)
    log = made_log(rig)
    # a wrong spring may look like an impulse at the reversals
    exact = sw.identify(log, rig.changed({"axis.stiffness": 0.05}), memory="off")
    wrong = sw.identify(log, rig.changed({"axis.stiffness": 0.0501}), memory="off")
    slope = (wrong.inertia.value - exact.inertia.value) / 1e-4
    assert exact.sensitivities["axis.stiffness"] == pytest.approx(slope, rel=0.1)
    note = next(note.message for note in exact.notes if note.code == "exact-constants")
    assert "axis.stiffness" in note


def test_the_offset_takes_up_the_zero_of_the_spring():
    rig = paper_rig(**CASES["spring"], **SENSORS)
    found = sw.identify(made_log(rig), rig.changed(SOUGHT["spring"]))
    assert off(found.parameters["offset"], -0.05 * 0.2) < 3


def test_inertia_stiffness_and_gravity_torque_move_together_at_one_frequency():
    for noise in (1e-3, 5e-3):
        rig = paper_rig(**{"axis.stiffness": 0.05, "sensors.noise": noise}, **SENSORS)
        both = rig.changed({"axis.gravity_torque": "unknown", "axis.stiffness": "unknown"})
        try:
            warnings = sw.identify(made_log(rig, Sine(0.3, 8.5)), both).warnings
            text = next(m.message for m in warnings if m.code == "gravity-and-inertia")
        except UnanswerableError as error:
            text = error.message
        for words in ("gravity torque", "spring stiffness", "second frequency", "second amplitude", "axis.stiffness"):
            assert words in text


def test_a_spring_alone_sets_the_scale_of_a_free_decay():
    rig = free_rig(**{"axis.gravity_torque": 0.0, "axis.stiffness": "0.05 ± 0.0001 N*m/rad"}, **SENSORS)
    log = sw.simulate(rig, duration=20.0, rate=500.0, initial_angle=0.9, seed=1)
    for method in METHODS:
        found = sw.identify(log, rig, method=method)
        assert off(found.inertia, 302.2e-5) < 3
        assert found.inertia.standard_uncertainty / found.inertia.value == pytest.approx(2e-3, rel=0.2)


def test_a_result_with_terms_predicts_the_log(case):
    name, rig, log = case
    given = rig.changed(
        SOUGHT[name] | {"axis.friction": None} | ({f"axis.friction.{name}": "unknown"} if not SOUGHT[name] else {})
    )
    p = model_vector(sw.identify(log, given), given)
    truth = rig_vector(rig)
    assert p[FURTHER] == truth[FURTHER]
    slots = [p[FIRST_SLOT:], truth[FIRST_SLOT:]]
    assert slots[0][COEFFICIENT] == pytest.approx(slots[1][COEFFICIENT], rel=0.1)


def test_backstepping_refuses_the_term_by_its_key(case):
    _, rig, log = case
    with pytest.raises(UnanswerableError, match=r"axis\.(stiffness|cogging|friction\.(load|drag))"):
        sw.identify(log, rig, method="backstepping")


def test_the_twin_refuses_what_is_unknown():
    for change in (SOUGHT["spring"], SOUGHT["cogging"], {"axis.friction.load": "unknown"}):
        with pytest.raises(InputError, match="unknown"):
            constants(paper_rig(**change))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"axis.stifness": 1.0}, "axis.stiffness"),
        ({"axis.stiffness": -1.0}, "negative"),
        ({"axis.stiffness": "soft"}, "unknown"),
        ({"axis.spring_zero": 0.1}, "axis.stiffness is missing"),
        ({"axis.stiffness": "unknown", "axis.spring_zero": "0.1 ± 0.1 rad"}, "axis.spring_zero takes no uncertainty"),
        ({"axis.friction.loud": 1.0}, "axis.friction.load"),
        ({"axis.cogging": {"order": 3}}, "axis.cogging.amplitude is missing"),
        ({"axis.cogging": {"order": 3, "amplitude": 0.1, "phase": "unknown"}}, "make both unknown"),
        ({"axis.friction.load": 1.0, "axis.friction.lugre": {"bristle_stiffness": 1.0}}, "beside load"),
    ],
)
def test_rig_files_name_the_key_that_is_wrong(changes, named):
    with pytest.raises(InputError, match=named):
        paper_rig("coulomb", **changes)


def test_a_linear_axis_has_springs_but_no_load():
    text = (
        '[axis]\nkind = "linear"\ninertia = 2.0\nstiffness = "30 N/m"\nspring_zero = "10 mm"\n[drive]\nkind = "none"\n'
    )
    rig = sw.Rig.from_text(text)
    assert rig.axis.stiffness.value == 30.0
    assert rig.axis.spring_zero.value == pytest.approx(0.01)
    with pytest.raises(InputError, check=coded("contradiction", "axis.friction.load")):
        sw.Rig.from_text(text + "[axis.friction]\nload = 1\n")


def test_more_terms_than_slots_are_refused(monkeypatch):
    for k in range(9):
        monkeypatch.setitem(TERMS, f"more{k}", Term(f"more{k}", f"axis.more{k}", "more", power=0))
    with pytest.raises(InputError, check=coded("too-many")):
        vector({"axis.inertia": 1.0} | {f"axis.more{k}": 1.0 for k in range(9)}, "none")


# A term that nobody has written but in the registry.


@pytest.mark.parametrize(
    ("term", "value"),
    [
        # air friction that grows with the fourth power of the speed
        (Term("quartic", "axis.friction.quartic", "quartic friction", "N m s^4", power=4, odd=True), 5e-6),
        # a torque of the angle: an off-axis mass that is felt twice per turn
        (Term("second", "axis.second", "second harmonic", "N m", power=0, kind=2, order="axis.second_order"), 6e-3),
    ],
    ids=["friction", "position"],
)
def test_a_term_in_the_registry_alone_reaches_twin_and_methods(monkeypatch, term, value):
    monkeypatch.setitem(TERMS, term.name, term)
    rig = direct_rig(**{term.key: value}, **SENSORS)
    assert [one.name for one in rig_terms(rig)] == [term.name]
    time = np.arange(0.0, 20.0, 1e-3)
    torque = 0.12 * np.sin(8.5 * time) + 0.08 * np.sin(4.1 * time)
    log = sw.simulate(rig, drive=torque, duration=20.0, rate=1000.0, seed=1)
    bare = sw.simulate(direct_rig(**SENSORS), drive=torque, duration=20.0, rate=1000.0, seed=1)
    assert np.abs(log.angle - bare.angle).max() > 1e-2
    given = rig if term.key.startswith("axis.friction") else rig.changed({term.key: "unknown"})
    for method in METHODS:
        found = sw.identify(log, given, method=method)
        assert off(found.inertia, 302.2e-5) < 3
        # the smoothed speed is off by some 1e-4, and a power of it by as many times as much
        assert off(found.parameters[term.name], value) < 3 or abs(found.parameters[term.name].value / value - 1) < 1e-3
        assert found.parameters[term.name].unit == term.unit
    assert term.words in found.summary() or term.name in found.summary()
