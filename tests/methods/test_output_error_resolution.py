"""Output error on coarse encoders: the angle's zero within a step of its grid, and where the grid lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.identification import identify
from swingid.methods.output_error.answer import grid_covariance
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.segments import problem_of
from swingid.methods.output_error.unknowns import ZERO, unknowns_of
from swingid.numerics.gauss_newton import solve
from swingid.preparation.encoders import Encoders
from swingid.preparation.noise import channel_noise
from swingid.preparation.scale import equation_of
from swingid.simulation import simulate
from twin_logs import INERTIA, given, twin

RATE = 500.0
STEP = 2 * np.pi / 16384


def steady_log(rig, *, seed=0, zero=(0.0, 0.0), angle=0.0, motion=(0.8, 8.5), rate=RATE):
    controller = Compensator.paper(rig, sample_time=1 / rate)
    options = {"rate": rate, "seed": seed, "encoder_zero": zero, "initial_angle": angle}
    return simulate(rig, Sine(*motion), controller, duration=10.0, **options).segment(5.0, 10.0)


def error(result):
    return result.inertia.value / INERTIA - 1


@pytest.mark.parametrize("law", ["viscous", "auto"])
@pytest.mark.parametrize("zero", [0.5 * STEP, 20e-3])
def test_a_zero_beside_the_hanging_position_is_found(zero, law):
    rig = twin()
    log = steady_log(rig, zero=(zero, 0.0))
    result = identify(log, given(rig), "output-error", law=law)
    assert result.status == "ok"
    assert abs(error(result)) < 1e-5
    assert set(result.parameters) == {"inertia", "viscous"}
    assert ("zero-found" in {note.code for note in result.notes}) == (zero > STEP)


def test_a_zero_does_not_stand_in_for_a_wrong_model():
    rig = twin()
    off = given(rig).changed({"drive.motor.torque_per_volt": 1.05 * 52.04e-4})
    result = identify(steady_log(rig), off, "output-error", law="viscous")
    assert "poor-fit" in {warning.code for warning in result.warnings}
    assert "zero-found" not in {note.code for note in result.notes}


def test_without_gravity_no_zero_is_sought():
    rig = given(twin()).changed({"axis.gravity_torque": 0.0})
    assert ZERO not in unknowns_of(rig, equation_of(rig), "viscous", (), 7.0, 1.0, STEP).names
    hanging = unknowns_of(given(twin()), equation_of(given(twin())), "viscous", (), 7.0, 1.0, STEP)
    assert hanging.items[hanging.zero].std == pytest.approx(STEP / np.sqrt(12))


@pytest.mark.parametrize("source", ["voltage", "wheel"])
def test_the_place_of_the_grid_moves_the_answer_as_the_budget_says(source):
    """The readings are rounded on sixteen shifted grids, and each time the fit is solved anew."""
    rig = given(twin(counts_per_turn=512))
    fine = twin(counts_per_turn=None)
    log, step = steady_log(fine), 2 * np.pi / 512
    noise = channel_noise(replace(log, angle=step * np.rint(log.angle / step)), rig)
    unknowns = unknowns_of(rig, equation_of(rig), "viscous", (), 7.0, 1.0, noise.resolution)
    found = []
    problem = problem_of(log, Encoders.of(rig), noise, source, 1.5, 0.1)
    begin = np.array([INERTIA, 1.144e-3, 0.0])
    for place in np.arange(16) / 16:
        grids = np.where(problem.wheel, noise.wheel_resolution, step)
        coarse = replace(problem, measured=(np.rint(problem.measured / grids + place) - place) * grids)
        fit = solve(coarse.shooting(unknowns), begin, problem.starts)
        found.append(fit.values[0])
    told = np.sqrt(grid_covariance(Searched(coarse, unknowns, fit), noise)[0, 0])
    achieved = np.sqrt(np.mean((np.array(found) - INERTIA) ** 2))
    assert told == pytest.approx(achieved, rel=0.25)


def test_noise_makes_the_grid_harmless():
    """Noise of a whole step is dither: rounding adds a twelfth of a step squared to it, and nothing repeats."""
    rig = twin(counts_per_turn=512, noise=2 * np.pi / 512)
    result = identify(steady_log(rig), given(rig), "output-error", law="viscous")
    assert "place of the encoder's grid" not in {entry.source for entry in result.budget}


@pytest.mark.long
@pytest.mark.parametrize("source", ["voltage", "wheel"])
@pytest.mark.parametrize("counts", [16384, 1024])
def test_intervals_hold_the_truth_on_coarse_encoders(counts, source):
    """100 runs without noise; amplitude, frequency, start and the place of the grid are drawn."""
    rig = twin(counts_per_turn=counts)
    inside, errors, halves = [], [], []
    for seed in range(100):
        draws = np.random.default_rng(seed)
        place = 2 * np.pi / counts * draws.uniform(-0.5, 0.5, 2)
        motion = (draws.uniform(0.5, 1.0), draws.uniform(7.0, 10.0))
        angle = draws.uniform(-0.01, 0.01)
        log = steady_log(rig, seed=seed, zero=tuple(place), angle=angle, motion=motion, rate=1000.0)
        result = identify(log, given(rig), "output-error", law="viscous", input=source)
        low, high = result.inertia.interval95
        inside.append(low <= INERTIA <= high)
        errors.append(error(result))
        halves.append((high - low) / 2 / INERTIA)
    assert np.mean(inside) >= 0.92
    assert 1.6 < np.median(halves) / np.sqrt(np.mean(np.square(errors))) < 3.0
