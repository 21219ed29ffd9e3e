"""Friction of the momentum method: its columns, the delay of turning points, the choice of a law, Stribeck's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from closed_form_logs import INERTIA, ONE_TONE, TWO_TONES, Sines, encoded, exact_rig, wheel_log
from swingid.balance.delays import late_reversals, lateness, share_seen
from swingid.balance.friction_laws import FrictionRows, law_columns, stribeck_slope
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.control.references import parse_reference
from swingid.identification import identify
from swingid.numerics.spline import kinked_slopes
from swingid.numerics.test_functions import phi
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.recording.recording import Recording
from swingid.simulation import simulate
from twin_logs import given, twin

TIME = np.arange(20_001) / 1000


def nothing(v):
    return 0.0 * v


# columns


@pytest.fixture(scope="module")
def columns():
    """Friction columns on windows of a known motion, whose reversals are found to a microsecond."""
    log = wheel_log(exact_rig(), TWO_TONES, nothing, TIME)
    signals = Signals.of(log, exact_rig(), find_motion(log.time, log.angle, 0.0), Encoders.of(exact_rig()))
    rows = rows_of(signals, law_windows(signals, 0.12))
    return FrictionRows.of(signals, rows)


@pytest.mark.parametrize("term", ["coulomb", "viscous", "quadratic", "cubic", "viscous_even", "offset", "stribeck"])
@pytest.mark.parametrize("stribeck_speed", [0.3, 1.5])
def test_the_column_of_a_term_is_its_integral(columns, term, stribeck_speed):
    found = columns.columns @ columns.law((term,), stribeck_speed)[:, 0]
    windows = columns.rows.windows
    for k in range(0, len(windows), 17):
        # midpoints of steps of 12 µs: a jump is placed that well
        s = (np.arange(20_000) + 0.5) / 10_000 - 1
        speeds = TWO_TONES(windows.centres[k] + s * windows.half[k], 1)
        weights = np.array([phi(x, 0) for x in s]) * windows.half[k] / 10_000
        expected = weights @ law_columns((term,), speeds, stribeck_speed)[:, 0]
        scale = weights @ np.abs(law_columns((term,), speeds, stribeck_speed)[:, 0]) + 1e-3 * weights.sum()
        assert found[k] == pytest.approx(expected, abs=3e-3 * scale)


def test_the_slope_by_the_stribeck_speed():
    v = np.linspace(-2, 2, 41)
    step = 1e-6
    higher, lower = (law_columns(("stribeck",), v, 0.4 + d)[:, 0] for d in (step, -step))
    assert stribeck_slope(v, 0.4) == pytest.approx((higher - lower) / (2 * step), abs=1e-8)


# turning points


def test_a_cubic_with_a_kink_has_its_slope():
    time = np.sort(np.random.default_rng(0).uniform(-1, 1, 60))
    at = np.array([0.1])
    s = time - at
    values = 0.3 + 0.7 * s - 2.0 * s**2 + 0.4 * s**3 + 5.0 * s * np.abs(s)
    assert kinked_slopes(time, values, at, 0.6) == pytest.approx([0.7], abs=1e-9)
    assert np.isnan(kinked_slopes(time, values, np.array([3.0]), 0.6)).all()
    # nor does one side alone tell a jump: its columns s² and s|s| are the same there
    ends = np.array([time[0] - 0.1, time[0], time[0] + 0.05, time[-1] + 0.1])
    assert np.isnan(kinked_slopes(time, values, ends, 0.6)).all()


OMEGA, DRY = 6.0, 0.05


def dry_oscillation(time, swings=20):
    """q'' = −ω² q − ω² d sgn q', exactly: half swings of cosines about ±d; its reversals are k π/ω."""
    k = np.minimum(np.floor(time * OMEGA / np.pi), swings).astype(int)
    # amplitude falls by 2 d per half swing; in the k-th the axis moves down for even k
    amplitude = 1.5 - DRY - 2 * DRY * k
    return DRY * (-1.0) ** k + (-1.0) ** k * amplitude * np.cos(OMEGA * time - k * np.pi)


def test_coulomb_friction_delays_turning_points_as_predicted():
    time = np.arange(0.0, 6.0, 1e-3)
    noise = 1e-4
    angle = dry_oscillation(time) + noise * np.random.default_rng(1).normal(size=len(time))
    found = find_motion(time, angle, noise)
    motion = found.reread(time, angle, found.speed.half_width)
    inertia = 2.0
    late = lateness(motion, lambda v: inertia * OMEGA**2 * DRY * np.sign(v), inertia)
    acceleration = np.abs(motion.speed.acceleration(motion.turning_times))
    assert late == pytest.approx(0.078125 * 2 * motion.reach * OMEGA**2 * DRY / acceleration, rel=1e-6)
    true = np.round(motion.turning_times * OMEGA / np.pi) * np.pi / OMEGA
    actual = motion.turning_times - true
    assert np.mean(actual) > 2e-4
    assert np.mean(actual) == pytest.approx(np.mean(late), rel=0.15)
    share, spread = share_seen(motion, time, angle, late, noise)
    assert share == pytest.approx(1.0, abs=4 * spread)
    assert spread < 0.2


def test_friction_that_a_cubic_holds_delays_nothing():
    motion = find_motion(TIME, ONE_TONE(TIME), 0.0)
    motion = motion.reread(TIME, ONE_TONE(TIME), 0.05)
    assert np.abs(lateness(motion, lambda v: 9e-3 * v, 3e-3)).max() < 1e-12
    assert np.abs(lateness(motion, lambda v: 9e-3 * np.abs(v) + 1e-3, 3e-3)).max() < 1e-12


def test_a_drive_that_balances_friction_leaves_no_delay():
    # The angle is a sine whatever the friction; the wheel bears the jump.
    log = encoded(wheel_log(exact_rig(), ONE_TONE, lambda v: 3e-3 * np.sign(v), TIME))
    noise = channel_noise(log, exact_rig())
    found = find_motion(log.time, log.angle, noise.angle)
    signals = Signals.of(
        log, exact_rig(), found.reread(log.time, log.angle, found.speed.half_width), Encoders.of(exact_rig())
    )
    predicted = lateness(signals.motion, lambda v: 3e-3 * np.sign(v), INERTIA)
    late = late_reversals(signals, lambda v: 3e-3 * np.sign(v), INERTIA, noise)
    assert np.mean(late) < 0.2 * np.mean(predicted)


def test_directions_follow_small_swings_too():
    # a swing of 2 % within a large one is no turning point, but friction turns around in it
    motion = Sines((1.0, 1.0, 0.0), (0.024, 45.0, 0.3))
    angle = motion(TIME)
    found = find_motion(TIME, angle, 0.0)
    edges, signs = found.directions(TIME[0], TIME[-1])
    assert len(found.ripples) > 10
    assert len(edges) == len(signs) + 1
    inner = (edges[1:-2] + edges[2:-1]) / 2
    assert np.array_equal(signs[1:-1], np.sign(motion(inner, 1)))
    part = found.within(5.0, 15.0)
    assert part.ripples.min() > 5.0
    assert part.ripples.max() < 15.0


# laws

TRUE = {
    "viscous": lambda v: 1e-3 * v,
    "coulomb + viscous": lambda v: 3e-3 * np.sign(v) + 5e-4 * v,
    "coulomb + quadratic": lambda v: 3e-3 * np.sign(v) + 2e-4 * v * np.abs(v),
    "viscous + quadratic": lambda v: 2e-4 * v + 3e-4 * v * np.abs(v),
    "viscous + cubic": lambda v: 2e-4 * v + 5e-5 * v**3,
    "stribeck": lambda v: np.sign(v) * (3e-3 + 2e-3 * np.exp(-((v / 0.8) ** 2))) + 5e-4 * v,
}


@pytest.mark.parametrize("law", TRUE)
@pytest.mark.parametrize(("sensors", "reach"), [("perfect", 1e-3), ("14 bit", 0.03)])
def test_the_true_law_is_chosen(law, sensors, reach):
    log = wheel_log(exact_rig(), TWO_TONES, TRUE[law], TIME)
    result = identify(log if sensors == "perfect" else encoded(log), exact_rig())
    curve = result.details.friction
    assert curve.law == law
    assert min(curve.candidates.values()) == 0.0
    assert curve.law_torques == pytest.approx(TRUE[law](curve.speeds), abs=reach * np.abs(curve.law_torques).max())


def decay_of(law, **sensors):
    rig = twin(law, **sensors).changed({"drive": {"kind": "none"}, "log": {"angle": "q1"}})
    run = simulate(rig, duration=30.0, initial_angle=1.5, seed=1)
    return identify(Recording(time=run.time, angle=run.angle), given(rig))


def test_stribecks_law_comes_out_of_a_decay_with_uncertainties():
    found = decay_of("Stribeck").parameters
    assert set(found) == {"inertia", "coulomb", "static", "viscous", "stribeck_speed"}
    for name, value in {"coulomb": 3e-3, "static": 5e-3, "viscous": 5e-4, "stribeck_speed": 0.3}.items():
        assert found[name].value == pytest.approx(value, rel=0.1)
        assert abs(found[name].value - value) < 3 * found[name].standard_uncertainty
    assert found["stribeck_speed"].standard_uncertainty < 0.1


def test_dry_friction_of_a_decay_has_no_peak():
    found = decay_of("Coulomb").parameters
    assert set(found) == {"inertia", "coulomb", "viscous"}
    assert found["coulomb"].value == pytest.approx(3e-3, rel=2e-3)


def test_the_curve_is_less_certain_where_likely_laws_differ():
    # With noise of 3 mrad Coulomb + viscous and Coulomb + quadratic are both likely at one frequency.
    log = wheel_log(exact_rig(), ONE_TONE, TRUE["coulomb + viscous"], TIME)
    noisy = replace(log, angle=log.angle + 3e-3 * np.random.default_rng(2).normal(size=len(TIME)))
    curve = identify(noisy, exact_rig(**{"sensors.noise": 3e-3})).details.friction
    truth = TRUE["coulomb + viscous"](curve.speeds)
    assert np.sqrt(np.mean(((curve.torques - truth) / curve.uncertainties) ** 2)) < 2
    assert curve.uncertainties.max() < 0.3 * truth.max()


# friction beyond the basis


@pytest.mark.parametrize(
    "friction",
    [
        {"viscous": 5e-4, "coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 1.0},
        {"viscous": 3e-4, "coulomb": 1e-3, "cubic": 2e-5},
    ],
    ids=["peak at rest", "cubic"],
)
def test_fine_encoders_show_friction_beyond_the_basis_and_nothing_else(friction):
    """Without these terms the cubic law biases by 1.4e-5, and the peak looks like nonlinear encoders."""
    changed = {"axis.friction": None} | {f"axis.friction.{name}": value for name, value in friction.items()}
    rig = twin(counts_per_turn=None).changed(changed)
    found = identify(simulate(rig, parse_reference("sine 0.5 rad 12 rad/s"), duration=12.0), given(rig))
    assert found.inertia.value == pytest.approx(rig.axis.inertia.value, rel=1e-6)
    assert not found.warnings
