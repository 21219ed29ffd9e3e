"""Springs, torsion pendulums and bodies on two or three strings, against closed forms and the exact Lagrangian."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import swingid as sw
from refusals import coded
from swingid.cli import main
from swingid.errors import InputError, UnanswerableError
from swingid.model.further import angle_energy, angle_factor, angle_slope
from swingid.model.parameters import FIRST_SLOT, rig_vector
from swingid.model.terms import TERMS
from swingid.pooling import difference
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from swingid.units import Quantity

G = 9.81
HEAD = """
[axis]
{axis}
{strings}
[drive]
kind = "none"
[sensors]
nonlinearity = 0
latency = 0
counts_per_turn = 16384
"""
BIFILAR = """
[axis.bifilar]
mass = {mass}
length = 0.6
distance = 0.2
upper_distance = 0.3
g = 9.81
"""


TWO_TABLES = "[axis.trifilar]\nmass = 1\nradius = 0.2\nlength = 1\n[axis.bifilar]\nmass=1\ndistance=1\nlength=2"


def rig_of(strings="", axis=""):
    return sw.Rig.from_text(HEAD.format(strings=strings, axis=axis))


def exact_swing(inertia, mass, upper, lower, length, *, angle, seconds, rate=200.0, viscous=0.0):
    """The full Lagrangian of a body on strings of circles of radius `upper` and `lower`, rise included."""

    def rhs(_t, x):
        q, v = x
        h = math.sqrt(length**2 - upper**2 - lower**2 + 2 * upper * lower * math.cos(q))
        s, c, k = math.sin(q), math.cos(q), upper * lower
        first = -k * s / h  # dH/dq
        second = -k * c / h - k * k * s * s / h**3
        torque = mass * G * first - viscous * v - mass * first * second * v * v
        return [v, torque / (inertia + mass * first**2)]

    t = np.arange(int(seconds * rate) + 1) / rate
    solved = solve_ivp(rhs, (0.0, t[-1]), [angle, 0.0], t_eval=t, rtol=1e-11, atol=1e-12, method="DOP853")
    return Recording(time=t, angle=solved.y[0])


def test_kappa_and_shape_are_those_of_the_potential_energy():
    """κ and ε against differences of −m g √(L² − R² − r² + 2 R r cos q), unequal distances."""
    strings = rig_of(BIFILAR.format(mass=1.5)).axis.suspension
    upper, lower, length, mass = 0.15, 0.1, 0.6, 1.5

    def energy(q):
        return -mass * G * math.sqrt(length**2 - upper**2 - lower**2 + 2 * upper * lower * math.cos(q))

    term = TERMS["suspension_stiffness"]
    for q in (0.01, 0.3, 1.0):
        torque = (energy(q + 1e-6) - energy(q - 1e-6)) / 2e-6
        assert strings.stiffness.value * term.of_angle(np.array(q), strings.shape) == pytest.approx(torque, rel=1e-6)
    h = math.sqrt(length**2 - (upper - lower) ** 2)
    assert strings.stiffness.value == pytest.approx(mass * G * 0.3 * 0.2 / (4 * h), rel=1e-12)
    assert strings.shape == pytest.approx(2 * upper * lower / h**2, rel=1e-12)


@pytest.mark.parametrize("q", [-1.2, -0.3, 0.0, 0.5, 1.4])
def test_the_compiled_term_is_the_registered_one_and_derives_from_its_energy(q):
    p = rig_vector(rig_of(BIFILAR.format(mass=1.5), "inertia = 4e-3"))
    term, shape = TERMS["suspension_stiffness"], p[FIRST_SLOT + 2]
    for compiled, own in ((angle_factor, term.of_angle), (angle_slope, term.angle_slope)):
        assert compiled(q, FIRST_SLOT, p) == pytest.approx(float(own(np.array(q), shape)), abs=1e-14)
    energy = [angle_energy(x, FIRST_SLOT, p) for x in (q - 1e-5, q, q + 1e-5)]
    assert energy[1] == pytest.approx(float(term.of_angle_integral(np.array(q), shape)), abs=1e-14)
    assert (energy[2] - energy[0]) / 2e-5 == pytest.approx(angle_factor(q, FIRST_SLOT, p), abs=1e-9)


def test_three_strings_are_two_of_the_same_radii():
    two = rig_of(BIFILAR.format(mass=1.5)).axis.suspension
    text = "[axis.trifilar]\nmass = 1.5\nlength = 0.6\nradius = 0.1\nupper_radius = 0.15\ng = 9.81"
    three = rig_of(text).axis.suspension
    assert three.stiffness.value == pytest.approx(two.stiffness.value, rel=1e-14)
    assert three.shape == pytest.approx(two.shape, rel=1e-14)


def test_uncertainties_of_the_geometry_are_those_of_draws():
    text = """
    [axis.bifilar]
    mass = "1.500 ± 0.002 kg"
    length = "0.600 ± 0.001 m"
    distance = "0.200 ± 0.0005 m"
    upper_distance = "0.300 ± 0.0004 m"
    g = "9.81 ± 0.005 m/s^2"
    """
    found = rig_of(text).axis.suspension.stiffness
    rng = np.random.default_rng(1)
    m, length, d, upper, g = (c + s * rng.standard_normal(200_000) for c, s in (
        (1.5, 0.002), (0.6, 0.001), (0.2, 0.0005), (0.3, 0.0004), (9.81, 0.005)))  # fmt: skip
    kappa = m * g * d * upper / (4 * np.sqrt(length**2 - (upper - d) ** 2 / 4))
    assert found.std == pytest.approx(float(np.std(kappa)), rel=0.01)
    equal = rig_of(text.replace('upper_distance = "0.300 ± 0.0004 m"', "")).axis.suspension.stiffness
    parts = [0.002 / 1.5, 0.001 / 0.6, 2 * 0.0005 / 0.2, 0.005 / 9.81]  # one distance, twice in κ
    assert equal.std / equal.value == pytest.approx(math.hypot(*parts), rel=1e-6)


@pytest.mark.parametrize("method", ["momentum", "energy", "equation-error", "output-error"])
def test_every_method_finds_the_inertia_of_a_body_on_strings(method):
    true = rig_of(BIFILAR.format(mass=1.5), "inertia = 4e-3\nfriction = {viscous = 2e-4}")
    log = simulate(true, duration=20.0, rate=250.0, initial_angle=0.7, seed=1)
    result = sw.identify(log, rig_of(BIFILAR.format(mass='"1.500 ± 0.003 kg"')), method)
    assert result.status == "ok"
    assert result.inertia.value == pytest.approx(4e-3, rel=3e-4)
    of_strings = next(
        e for e in result.budget if e.shared_id == "axis.suspension.stiffness" and e.parameter == "inertia"
    )
    assert of_strings.standard_uncertainty == pytest.approx(0.002 * 4e-3, rel=0.01)
    unknown = sw.identify(log, rig_of(BIFILAR.format(mass='"unknown"')), method)
    assert unknown.leading == "suspension_stiffness/inertia"
    kappa = true.axis.suspension.stiffness.value
    assert unknown.main.value == pytest.approx(kappa / 4e-3, rel=3e-4)


@pytest.mark.parametrize("angle", [0.1, 0.35, 0.8])
def test_the_vertical_motion_is_within_the_budget(angle):
    """The exact motion, with its rise: the error is the predicted one and inside the interval."""
    inertia, mass, upper, lower, length = 4e-3, 1.5, 0.15, 0.1, 0.6
    log = exact_swing(inertia, mass, upper, lower, length, angle=angle, seconds=25, viscous=2e-4)
    rig = rig_of(BIFILAR.format(mass=mass), "tilt = 0\nmodel_uncertainty = 0").changed(
        {"sensors.counts_per_turn": None, "log.clock": 0}
    )
    result = sw.identify(log, rig)
    low, high = result.inertia.interval95
    assert low <= inertia <= high
    rise = next(e for e in result.budget if e.source.startswith("vertical motion"))
    assert result.inertia.value - inertia == pytest.approx(rise.standard_uncertainty, rel=0.35)
    assert "vertical-motion" in {note.code for note in result.notes}


def test_the_small_angle_formula_errs_by_the_amplitude():
    """At 0.5 rad a constant κ is 0.9 % off here, the closed form is not."""
    log = simulate(
        rig_of(BIFILAR.format(mass=1.5), "inertia = 4e-3"), duration=15.0, rate=250.0, initial_angle=0.5, seed=1
    )
    kappa = rig_of(BIFILAR.format(mass=1.5)).axis.suspension.stiffness.value
    linear = sw.identify(log, rig_of(axis=f"stiffness = {kappa}"), "equation-error").inertia.value
    # q − q³/6 + ε q³/4: T² grows by A²/8 (1 − 3 ε/2) to this order
    shape = rig_of(BIFILAR.format(mass=1.5)).axis.suspension.shape
    assert linear / 4e-3 - 1 == pytest.approx(0.5**2 / 8 * (1 - 1.5 * shape), rel=0.1)


def test_a_torsion_pendulum_is_identified_within_two_hundredths_of_a_percent():
    true = rig_of(axis="stiffness = 0.05\ninertia = 2e-3\nfriction = {viscous = 1e-4, coulomb = 5e-5}")
    log = simulate(true, duration=60.0, rate=200.0, initial_angle=1.0, seed=1)
    result = sw.identify(log, rig_of(axis="stiffness = 0.05"))
    assert result.status == "ok"
    assert result.inertia.value == pytest.approx(2e-3, rel=2e-4)
    assert "scale-from-spring" in {note.code for note in result.notes}
    ratio = sw.identify(log, rig_of(axis='stiffness = "unknown"'))
    assert ratio.leading == "stiffness/inertia"
    assert ratio.main.unit == "1/s^2"
    assert ratio.main.value == pytest.approx(25.0, rel=2e-4)


def test_two_runs_with_and_without_a_known_body_give_stiffness_and_inertia():
    logs = [
        simulate(
            rig_of(axis=f"stiffness = 0.05\ninertia = {inertia}\nfriction = {{viscous = 1e-4}}"),
            duration=40.0, rate=200.0, initial_angle=1.0, seed=seed,
        )
        for seed, inertia in ((1, 2e-3), (2, 3e-3))
    ]  # fmt: skip
    unknown = rig_of(axis='stiffness = "unknown"')
    tare, loaded = (sw.identify(log, unknown) for log in logs)
    found = difference(tare, loaded, known="1.000 ± 0.001 g*m^2")
    assert found.leading == "tare_inertia"
    for name, true in (("stiffness", 0.05), ("tare_inertia", 2e-3), ("loaded_inertia", 3e-3)):
        one = found.parameters[name]
        assert one.value == pytest.approx(true, rel=5e-4)
        assert one.standard_uncertainty == pytest.approx(1e-3 * true, rel=0.2)  # that of the body
    # k = J_k/(1/r2 - 1/r1): the clock counts twice, as in every period
    clock = next(e for e in found.budget if e.parameter == "stiffness" and e.source == "log.clock")
    assert clock.standard_uncertainty == pytest.approx(2e-4 * 0.05, rel=0.02)
    assert not any(
        e.source == "log.clock" and e.standard_uncertainty > 1e-9 for e in found.budget if "tare" in e.parameter
    )
    with pytest.raises(UnanswerableError) as caught:
        difference(loaded, tare, known=1e-3)
    assert caught.value.code == "difference-lost"


def test_strings_take_no_scale_from_a_body():
    true = rig_of(BIFILAR.format(mass=1.5), "inertia = 4e-3")
    logs = [simulate(true, duration=10.0, rate=200.0, initial_angle=0.4, seed=seed) for seed in (1, 2)]
    results = [sw.identify(log, rig_of(BIFILAR.format(mass='"unknown"'))) for log in logs]
    with pytest.raises(UnanswerableError, check=coded("no-scale")):
        difference(*results, known=1e-3)


def test_the_zero_of_strings_is_found():
    true = rig_of(BIFILAR.format(mass=1.5), "inertia = 4e-3\nfriction = {viscous = 2e-4}")
    log = simulate(true, duration=20.0, rate=250.0, initial_angle=0.7, seed=1)
    turned = Recording(time=log.time, angle=log.angle + 1.3)
    result = sw.identify(turned, rig_of(BIFILAR.format(mass=1.5)))
    assert "zero-corrected" in {note.code for note in result.notes}
    assert result.inertia.value == pytest.approx(4e-3, rel=3e-4)


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("[axis.bifilar]\nmass = 1\ndistance = 0.2", "length", "is missing"),
        ("[axis.bifilar]\nmass = 1\ndistance = 0.2\nlength = 1\nheight = 1", "height", "beside length"),
        ("[axis.bifilar]\nmass = 1\ndistance = 0.2\nlength = 0.05\nupper_distance = 0.4", "length", "too short"),
        ("[axis.bifilar]\nmass = 1\ndistance = 0.2\nlength = 1\ng = 9.8\nlatitude = 0.5", "g", "beside latitude"),
        ('[axis.bifilar]\nmass = "1 m"\ndistance = 0.2\nlength = 1', "mass", "kg"),
        (TWO_TABLES, "bifilar", "keep one"),
        ("[axis.trifilar]\nmass = 1\nradius = -0.2\nlength = 1", "radius", "positive"),
        ("[axis.trifilar]\nmass = 1\nlength = 1", "radius", "missing"),
        ("gravity_torque = 0.1\n[axis.bifilar]\nmass = 1\nlength = 1\ndistance = 0.2", "gravity_torque", "is vertical"),
    ],
)  # fmt: skip
def test_contradictory_strings_are_refused(text, key, words):
    with pytest.raises(InputError, match=words) as caught:
        rig_of(text)
    assert key in caught.value.message


def test_strings_belong_to_a_rotary_axis():
    with pytest.raises(InputError, match="linear"):
        rig_of(BIFILAR.format(mass=1), 'kind = "linear"')


def test_free_fall_is_stated_by_g_or_latitude():
    text = "[axis.bifilar]\nmass = 1\nheight = 1\ndistance = 0.2\n"
    assert rig_of(text).axis.bifilar.free_fall == Quantity(9.80665, 0.015)
    assert rig_of(text + 'latitude = "45 deg"').axis.bifilar.free_fall.value == pytest.approx(9.8062, abs=1e-4)


@pytest.mark.long
def test_a_torsion_pendulum_is_covered():
    """100 seeds: errors below 0.02 % and 95 % intervals that contain the true value."""
    true = rig_of(axis="stiffness = 0.05\ninertia = 2e-3\nfriction = {viscous = 1e-4, coulomb = 5e-5}\ntilt = 0")
    true = true.changed({"sensors.noise": 1e-3})
    stated = rig_of(axis='stiffness = "0.05 ± 0.000005 N*m/rad"').changed({"sensors.noise": 1e-3, "log.clock": 0})
    rng, inside = np.random.default_rng(2), 0
    for seed in range(100):
        stiff = true.changed({"axis.stiffness": 0.05 + 5e-6 * rng.standard_normal()})
        log = simulate(stiff, duration=60.0, rate=100.0, initial_angle=1.0, seed=seed)
        found = sw.identify(log, stated).inertia
        assert found.value == pytest.approx(2e-3, rel=5e-4)
        inside += found.interval95[0] <= 2e-3 <= found.interval95[1]
    assert inside >= 90


@pytest.mark.parametrize("springs", ["[axis.bifilar]\nmass = 1\nlength = 1\ndistance = 0.2\n", "stiffness = 0.05\n"])
def test_simulate_lets_go_a_body_on_strings_or_a_wire(springs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(f'[axis]\ninertia = 4e-3\n{springs}[drive]\nkind = "none"\n')
    command = ["simulate", "--rig", "rig.toml", "--duration", "5", "--out", "run.csv", "--initial-angle", "0.3"]
    assert main(command) == 0
    assert np.ptp(sw.Recording.load("run.csv", sw.Rig.load("rig.toml")).angle) == pytest.approx(0.6, rel=0.01)
    (tmp_path / "rig.toml").write_text('[axis]\ninertia = 4e-3\n[drive]\nkind = "none"\n')
    assert main(command) == 2
    assert "no gravity torque and no spring" in capsys.readouterr().err
