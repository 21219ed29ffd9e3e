"""Backstepping on recorded logs: its adaptation against a dense integration, its answer against the twin's truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swingid.control.backstepping import Backstepping
from swingid.control.references import Sine
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.methods.backstepping.adaptation import Gains, adapted
from swingid.methods.backstepping.curve import Curve, remaining, scatter_of_mean, settled_part
from swingid.methods.backstepping.signals import (
    Channels,
    Signals,
    Widths,
    inertia_of,
    resting,
    signals_of,
    viscous_of,
)
from swingid.model.parameters import rig_vector
from swingid.model.printed import alphas
from swingid.model.rig import Rig
from swingid.simulation import simulate, simulate_run
from twin_logs import INERTIA, PAPER, error, given, logged, twin

ALPHA = alphas(rig_vector(PAPER))
VISCOUS = 1.144e-3


def of(log, rig=PAPER, **options):
    return identify(log, given(rig), "backstepping", **options)


@pytest.fixture(scope="module")
def paper_log(tmp_path_factory):
    """14 bit, 1 kHz, 25 s at 8.5 rad/s, through a file."""
    return logged(twin(), tmp_path_factory.mktemp("paper"), seed=1)


@pytest.fixture(scope="module")
def answer(paper_log):
    return of(paper_log)


def prescribed(rate: float, end: float = 6.0) -> tuple[Signals, float, float]:
    """x1 = 0.8 sin 8.5t, and the drive that α2 = 25, α3 = 0.4 ask for: φ = (x2' + α3 x2)/α2."""
    time = np.linspace(0, end, round(end * rate) + 1)
    t = np.column_stack([time[:-1], (time[:-1] + time[1:]) / 2, time[1:]])
    speed, bend = 6.8 * np.cos(8.5 * t), -57.8 * np.sin(8.5 * t)
    return Signals(time, speed, np.sin(0.8 * np.sin(8.5 * t)), (bend + 0.4 * speed) / 25.0), 25.0, 0.4


@pytest.mark.parametrize("law", ["printed", "consistent"])
def test_the_adaptation_is_its_differential_equation(law: str) -> None:
    """Against a dense integration, with the order of Runge-Kutta 4."""
    gains = Gains(law, gamma1=0.1, gamma2=20.0, alpha2=20.0, alpha3=1.0)  # the lower bound is never met

    def rates(t: float, state: np.ndarray) -> list[float]:
        x1, x2, bend = 0.8 * np.sin(8.5 * t), 6.8 * np.cos(8.5 * t), -57.8 * np.sin(8.5 * t)
        phi = (bend + 0.4 * x2) / 25.0
        model, a2, a3 = state
        e = x2 - model
        pushed = phi if law == "consistent" else -np.sin(x1)
        return [-a3 * x2 + a2 * phi + 10.0 * e, 20.0 * e * pushed, -0.1 * e * x2]

    exact = solve_ivp(rates, (0, 1.0), [6.8, 20.0, 1.0], rtol=1e-12, atol=1e-12, method="DOP853").y[1:, -1]
    errors = []
    for rate in (100, 200, 400):
        signals, _, _ = prescribed(rate, 1.0)
        errors.append(np.abs(np.array([values[-1] for values in adapted(signals, gains)]) - exact).max())
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 4.0, atol=0.4)


@pytest.mark.parametrize("law", ["printed", "consistent"])
def test_exact_signals_lead_to_the_exact_constants(law: str) -> None:
    signals, truth2, truth3 = prescribed(1000, 12.0)
    alpha2, alpha3 = adapted(signals, Gains(law))
    assert alpha2[-1] == pytest.approx(truth2, rel=1e-6)
    assert alpha3[-1] == pytest.approx(truth3, rel=1e-5)


def test_the_consistent_law_lets_the_lyapunov_function_fall() -> None:
    """V' = -l e^2 by the consistent law, so the constants' errors, weighted, can't end above where they began."""
    signals, truth2, truth3 = prescribed(1000)
    gains = Gains("consistent", alpha2=20.0)
    alpha2, alpha3 = adapted(signals, gains)
    bound = (truth2 - alpha2) ** 2 / (2 * gains.gamma2) + (truth3 - alpha3) ** 2 / (2 * gains.gamma1)
    assert np.all(bound <= bound[0] * (1 + 1e-9))
    assert bound[-1] < 1e-6 * bound[0]


def test_the_printed_law_is_the_faster_one_below_the_natural_frequency_and_the_slower_above() -> None:
    """Rates ~ w^2/a2 and (w^2/a2)^2: they meet at w = sqrt(a2) = 5 rad/s."""

    def seconds(omega: float, law: str) -> float:
        time = np.linspace(0, 150, 30_001)
        t = np.column_stack([time[:-1], (time[:-1] + time[1:]) / 2, time[1:]])
        speed = 0.5 * omega * np.cos(omega * t)
        phi = (-omega * omega * 0.5 * np.sin(omega * t) + 0.4 * speed) / 25.0
        signals = Signals(time, speed, np.sin(0.5 * np.sin(omega * t)), phi)
        alpha2, _ = adapted(signals, Gains(law, gamma2=20.0, alpha2=20.0, alpha3=0.4))
        return float(time[np.nonzero(np.abs(alpha2 / 25.0 - 1) > 0.02)[0][-1]])

    assert seconds(2.5, "printed") < 0.5 * seconds(2.5, "consistent")
    assert seconds(9.0, "consistent") < 0.7 * seconds(9.0, "printed")


def test_u2_is_what_acts_whatever_controller_made_the_voltage() -> None:
    """a2 phi = c7 a2 x4 - c4 a2 u2 - a2 sin x1 is x2' + a3 x2 on the twin's true motion; no u1, u3 is assumed."""
    rig = twin(counts_per_turn=None)
    run = simulate_run(rig, Sine(0.8, 8.5), duration=6.0)
    log, truth = run.recording, run.truth
    thrice = [np.repeat(values[:-1, None], 3, axis=1) for values in (truth.angle, truth.speed, truth.wheel_speed)]
    channels = Channels(log.time, *thrice, np.repeat(log.voltage[:-1, None], 3, axis=1))
    phi = signals_of(channels, rig).phi[:, 0]
    turns = np.abs(truth.wheel_speed[:-1]) > 1.0  # at rest friction is any torque
    rise = np.diff(truth.speed) / 1e-3
    off = ALPHA[2] * phi + -ALPHA[3] * truth.speed[:-1] - rise
    assert np.median(np.abs(off[turns])) < 0.01 * np.abs(rise).max()


def test_equation_22() -> None:
    assert float(inertia_of(np.array(ALPHA[2]), PAPER)) == pytest.approx(INERTIA, rel=1e-12)
    assert float(viscous_of(np.array(ALPHA[2]), np.array(ALPHA[3]), PAPER)) == pytest.approx(VISCOUS, rel=1e-12)


# On the twin: the wanted figure is 1 % with exact motor constants and viscous friction.


@pytest.mark.parametrize("law", ["printed", "consistent"])
def test_the_paper_s_rig(paper_log, law: str) -> None:
    result = of(paper_log, law=law)
    assert abs(error(result)) < 2e-4
    assert abs(result.inertia.value - INERTIA) < 4 * result.inertia.standard_uncertainty
    assert result.parameters["viscous"].value == pytest.approx(VISCOUS, rel=2e-3)
    assert result.status == "ok"
    within = result.details.convergence.within
    assert within["5 %"] <= within["1 %"] < 5.0


def test_speeds_by_observers_cost_what_the_budget_says(paper_log) -> None:
    result = of(paper_log, velocities="observers")
    assert 5e-4 < abs(error(result)) < 5e-3
    assert abs(result.inertia.value - INERTIA) < 2 * result.inertia.standard_uncertainty
    assert "disagreement: smoothed velocities" in [entry.source for entry in result.budget]


def test_convergence_times_are_those_of_the_curve_against_the_truth(paper_log) -> None:
    curve = of(paper_log).details.convergence
    full = Curve(curve.times, curve.values, np.arange(0.5, 25.0, np.pi / 8.5))
    for name, band in (("5 %", 0.05), ("1 %", 0.01)):
        assert full.convergence_time(band, INERTIA) == pytest.approx(curve.within[name], abs=0.8)
    late = curve.values[curve.times > curve.within["1 %"] + 0.5]
    assert np.abs(late / INERTIA - 1).max() < 0.012


def test_at_2_rad_per_s_the_consistent_law_has_not_converged_and_says_so(tmp_path) -> None:
    log = logged(twin(), tmp_path, Sine(0.8, 2.0), seed=1)
    slow = of(log, law="consistent")
    assert "not-converged" in [warning.code for warning in slow.warnings]
    assert slow.inertia.standard_uncertainty is None or (
        abs(slow.inertia.value - INERTIA) < 2 * slow.inertia.standard_uncertainty
    )
    printed = of(log)
    assert "not-converged" not in [warning.code for warning in printed.warnings]
    assert abs(error(printed)) < 1e-3
    assert printed.details.convergence.within["1 %"] < 15.0
    assert abs(error(of(log, law="consistent", gamma2=4000.0))) < 2e-3


@pytest.mark.parametrize("law", ["Coulomb", "Stribeck", "quadratic", "direction-dependent", "LuGre"])
def test_other_friction_stays_within_1_per_cent_and_its_interval(law: str) -> None:
    rig = twin(law)
    result = of(simulate(rig, Sine(0.8, 8.5), duration=25.0, seed=1), rig)
    assert abs(error(result)) < 5e-3
    assert abs(result.inertia.value - INERTIA) < 2 * result.inertia.standard_uncertainty


BODY = Rig.builtin("paper-body")
"""At 6 rad/s it is near its resonance, and the wheel rests half of the time."""


def near_resonance(folder, seed: int, rig: Rig = BODY, frequency: float = 6.0):
    place = tuple(np.random.default_rng(seed).uniform(-0.5, 0.5, 2) * 2 * np.pi / 16384)
    return of(logged(rig, folder, Sine(0.8, frequency), seed=seed, encoder_zero=place), rig)


def test_near_resonance_friction_holds_the_wheel(tmp_path) -> None:
    result = near_resonance(tmp_path, 1)
    truth = BODY.axis.inertia.value
    assert abs(result.inertia.value / truth - 1) < 2e-3  # f3 at its full size would be 2.6 % off
    low, high = result.inertia.interval95
    assert low < truth < high
    assert result.status == "ok"
    assert "near-resonance" in {note.code for note in result.notes}


def test_a_wheel_at_rest_is_told_from_one_that_turns_around() -> None:
    time = np.arange(0, 4, 1e-3)
    middles = (time[1:] + time[:-1]) / 2
    held = (np.abs(middles - 1) < 0.1) | (np.abs(middles - 3) < 0.1)
    speed = np.where(held, 0.0, np.sign(np.sin(np.pi * middles)) * 20 * np.abs(np.sin(np.pi * middles)))
    found = resting(time, np.repeat(speed[:, None], 3, axis=1), Widths(0.02, 0.01, 0.1))[:, 1]
    # half of the half-width more at either end; the reversal at 2 s is none
    assert found.sum() == pytest.approx(420, abs=12)
    assert not found[np.abs(middles - 2) < 0.3].any()


@pytest.mark.long
@pytest.mark.parametrize(
    ("rig", "frequency"), [(BODY, 6.0), (PAPER, 6.0), (PAPER, 8.5)], ids=["body, 6 rad/s", "6 rad/s", "8.5 rad/s"]
)
def test_coverage_with_encoders_near_resonance_and_beyond(rig: Rig, frequency: float, tmp_path) -> None:
    truth = rig.axis.inertia.value
    inside = 0
    for seed in range(40):
        low, high = near_resonance(tmp_path, seed, rig, frequency).inertia.interval95
        inside += low < truth < high
    assert inside >= 34  # 95 % less three binomial standard deviations


@pytest.mark.parametrize("drive", ["direct", "none"])
def test_other_drives(drive: str) -> None:
    rig = twin().changed({"drive": {"kind": drive}, "log": {"torque": "tau"} if drive == "direct" else {"angle": "q1"}})
    if drive == "direct":
        time = np.arange(20_001) / 1000
        log = simulate(rig, duration=20.0, drive=0.12 * np.sin(8.5 * time + 0.3), seed=1)
    else:
        log = simulate(rig, duration=20.0, initial_angle=1.0, seed=1)
    result = of(log, rig)
    assert abs(error(result)) < 1e-3
    assert result.status == "ok"


def test_rows_lost_at_random_and_uneven_stamps() -> None:
    rig = twin(dropouts=0.05, jitter=5e-5)
    result = of(simulate(rig, Sine(0.8, 8.5), duration=25.0, seed=2), rig)
    assert abs(error(result)) < 2e-3
    assert result.status == "ok"


def test_a_log_of_the_backstepping_controller_itself() -> None:
    rig = twin()
    log = simulate(rig, Sine(0.8, 8.5), Backstepping.paper(rig), duration=20.0, seed=1)
    assert abs(error(of(log, rig))) < 2e-3


def test_neither_reference_nor_controller_nor_truth_is_read(paper_log, answer) -> None:
    bare = replace(
        paper_log, reference=np.cos(paper_log.time), adaptive_gain=paper_log.time, metadata={"truth": {"inertia": 1.0}}
    )
    assert of(bare).inertia == answer.inertia


# Uncertainty.


def test_sensitivities_are_those_of_a_second_identification(paper_log, answer) -> None:
    for key in ("drive.motor.torque_per_volt", "drive.wheel.inertia", "axis.gravity_torque", "drive.motor.gear_ratio"):
        value = given(PAPER)
        for part in key.split("."):
            value = getattr(value, part)
        more = of(paper_log, PAPER.changed({key: 1.01 * value.value}))
        slope = (more.inertia.value - answer.inertia.value) / (0.01 * value.value)
        assert answer.sensitivities[key] == pytest.approx(slope, rel=0.05)


def test_declared_uncertainties_reach_the_budget(paper_log, answer) -> None:
    c1 = PAPER.drive.motor.torque_per_volt.value
    rig = PAPER.changed({"drive.motor.torque_per_volt": f"{c1} ± {0.02 * c1} N*m/V", "sensors.nonlinearity": "0.1 deg"})
    result = of(paper_log, rig)
    entries = {entry.source: entry for entry in result.budget if entry.parameter == "inertia"}
    motor = entries["drive.motor.torque_per_volt"]
    slope = abs(answer.sensitivities["drive.motor.torque_per_volt"])
    assert motor.standard_uncertainty == pytest.approx(0.02 * c1 * slope, rel=1e-3)
    assert entries["angle encoder nonlinearity (sine)"].shared_id == "sensors.nonlinearity.sine"
    assert result.inertia.standard_uncertainty > answer.inertia.standard_uncertainty


def test_the_encoder_s_nonlinearity_moves_the_answer_as_the_budget_says(paper_log) -> None:
    bent = replace(paper_log, angle=paper_log.angle + 1e-3 * np.sin(paper_log.angle))
    declared = PAPER.changed({"sensors.nonlinearity": 1e-3})
    entry = next(e for e in of(paper_log, declared).budget if e.source == "angle encoder nonlinearity (sine)")
    moved = of(bent).inertia.value - of(paper_log).inertia.value
    assert entry.standard_uncertainty == pytest.approx(abs(moved), rel=0.1)


@pytest.mark.long
def test_coverage_under_white_noise() -> None:
    rig = twin(counts_per_turn=None, noise=1e-3)
    inside = 0
    for seed in range(100):
        result = of(simulate(rig, Sine(0.8, 8.5), duration=25.0, seed=seed), rig)
        inside += abs(result.inertia.value - INERTIA) < 1.96 * result.inertia.standard_uncertainty
    assert inside >= 88  # 95 less three binomial standard deviations


# The curve.


def test_the_scatter_of_a_mean_knows_correlated_neighbours() -> None:
    """First-order autoregressions with r = 0.6, 50 values each: how often the interval holds the mean, which is 0."""
    generator = np.random.default_rng(4)
    means, stated = [], []
    for _ in range(800):
        values = np.zeros(60)
        for k in range(1, 60):
            values[k] = 0.6 * values[k - 1] + generator.standard_normal()
        means.append(values[10:].mean())
        stated.append(scatter_of_mean(values[10:]))
    assert 0.93 < np.mean(np.abs(means) < 1.96 * np.array(stated)) < 0.99
    assert 0.9 < np.median(stated) / np.std(means) < 1.4


def test_a_geometric_approach_tells_its_end() -> None:
    values = 3.0 + 0.8 * np.exp(-np.arange(30) / 20)
    assert remaining(values) == pytest.approx(values.mean() - 3.0, rel=1e-6)
    assert remaining(3.0 + 0.5 * np.arange(30)) is None
    assert remaining(3.0 + 1e-3 * np.random.default_rng(0).standard_normal(30)) == 0.0


def test_convergence_times_of_a_known_curve() -> None:
    """J (1 + 0.5 exp(-t)) averaged over periods of 0.2 s."""
    time, turning = np.linspace(0, 20, 20_001), np.arange(0.1, 20, 0.1)
    curve = Curve(time, 2.0 * (1 + 0.5 * np.exp(-time)), turning)
    for band in (0.05, 0.01):
        assert curve.convergence_time(band) == pytest.approx(np.log(0.5 / band), abs=0.2)
    settled = settled_part(curve)
    assert settled.converged
    assert settled.mean == pytest.approx(2.0, rel=1e-4)


# What cannot be answered.


@pytest.mark.parametrize(
    ("changes", "code"),
    [({"axis.gravity_torque": "unknown"}, "no-gravity-torque"), ({"axis.gravity_torque": 0}, "no-gravity-torque")],
)
def test_without_gravity_there_is_no_answer(paper_log, changes: dict[str, object], code: str) -> None:
    with pytest.raises(UnanswerableError) as caught:
        of(paper_log, PAPER.changed(changes))
    assert caught.value.code == code


def test_without_voltage_or_motor(paper_log) -> None:
    with pytest.raises(InputError, match="backstepping"):
        of(replace(paper_log, voltage=None))
    with pytest.raises(UnanswerableError, match="torque_per_volt"):
        of(paper_log, PAPER.changed({"drive.motor": None}))
    with pytest.raises(InputError, match="voltage_sign"):
        of(replace(paper_log, voltage=-paper_log.voltage))


def test_a_log_of_few_swings(paper_log) -> None:
    with pytest.raises(UnanswerableError) as caught:
        of(paper_log.segment(10.0, 12.5))
    assert caught.value.code == "too-short"


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"law": "other"}, "law"),
        ({"velocities": "guessed"}, "velocities"),
        ({"gamma2": -1.0}, "gamma2"),
        ({"gain": "high"}, "gain"),
        ({"alpha2": float("nan")}, "alpha2"),
        ({"gamma2": 1e9}, "lower them"),
        ({"steps": 3}, "steps"),
    ],
)
def test_options_that_cannot_be(paper_log, options: dict[str, object], word: str) -> None:
    with pytest.raises(UsageError, match=word):
        of(paper_log, **options)


def test_the_report_shows_the_curve(paper_log, answer) -> None:
    from swingid.report.measurement import render

    page = render(answer, paper_log, PAPER)
    assert 'id="convergence"' in page
    assert "within 1 % after" in page
    assert '"within": {' in answer.to_json()
