"""The controller of the firmware against the compiled one of the twin: the same bits."""

from __future__ import annotations

import ctypes
import decimal
import math
from dataclasses import replace

import numpy as np
import pytest

from firmware_build import SIM, library
from swingid.control import law
from swingid.control.compensator import Compensator
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit

MOST_ORDER = 4
PAPER = Compensator.paper(Rig.load("paper"))
DOUBLES = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")


@njit
def _run(inputs: Array, state: Array, parameters: Array, voltages: Array, states: Array) -> None:
    for i in range(len(inputs)):
        voltages[i] = law.compensator_step(inputs[i, 0], inputs[i, 1], inputs[i, 2], state, parameters)
        states[i] = state


def in_python(inputs: Array, start: Array, parameters: Array) -> tuple[Array, Array]:
    """Voltages and states (rows, states) of the numba controller."""
    voltages, states = np.empty(len(inputs)), np.empty((len(inputs), len(start)))
    _run(inputs, start.copy(), parameters, voltages, states)
    return voltages, states


def in_c(inputs: Array, start: Array, parameters: Array) -> tuple[Array, Array]:
    """Voltages and states of the controller of the firmware."""
    core = library(SIM)
    core.sim_steps.argtypes = [ctypes.c_int, DOUBLES, DOUBLES, DOUBLES, DOUBLES, DOUBLES]
    core.sim_steps.restype = None
    size = law.XI + MOST_ORDER
    state = np.zeros(size)
    state[: len(start)] = start
    voltages, states = np.empty(len(inputs)), np.empty((len(inputs), size))
    core.sim_steps(len(inputs), np.ascontiguousarray(inputs), state, parameters, voltages, states)
    return voltages, states[:, : len(start)]


def bits(values: Array) -> Array:
    """Their bits, which tell 0 from -0 and hold one NaN equal to itself."""
    return np.ascontiguousarray(values).view(np.uint64)


def random_controller(rng: np.random.Generator) -> Compensator:
    """A controller with gains of any size that `Compensator` takes, of relative degree 1 to 5."""
    order = int(rng.integers(0, MOST_ORDER + 1))
    roots = -(10.0 ** rng.uniform(-1, 1, order))
    k_roots = -(10.0 ** rng.uniform(-1, 1, order))
    return replace(
        PAPER,
        delta0=10.0 ** rng.uniform(-4, 0),
        sigma0=10.0 ** rng.uniform(-3, 2),
        lambda0=10.0 ** rng.uniform(-1, 3),
        k_tilde0=float(rng.choice([0.0, 1.0, 30.0])),
        k_tilde_max=None if rng.random() < 0.5 else 40.0,
        filter_time=float(rng.choice([0.0, 0.0125])),
        wheel_filter_time=float(rng.choice([0.0, 0.003])),
        alpha=tuple(10.0 ** rng.uniform(-1, 1) * np.poly(roots)) if order else (1.0,),
        k=tuple(np.poly(k_roots)[:0:-1]) if order else (),
        voltage_limit=None if rng.random() < 0.2 else 10.0,
        dead_zone_switch="exact" if rng.random() < 0.5 else "printed",
        plant_sign=int(rng.choice([-1, 1])),
        differentiate_gain=bool(rng.random() < 0.5),
    )


def steps(order: int) -> Compensator:
    """The paper's controller with a chain of so many filters; its gains cost what others cost."""
    alpha = np.polynomial.polynomial.polyfromroots([-1.0 - i for i in range(order)])
    k = np.polynomial.polynomial.polyfromroots([-2.0 - i for i in range(order)])[:-1]
    return replace(PAPER, alpha=tuple(alpha[::-1]), k=tuple(k), k_tilde0=30.0)


def compare(rng: np.random.Generator, runs: int, steps: int) -> None:
    for _ in range(runs):
        controller = random_controller(rng)
        parameters = controller.parameters(float(rng.choice([1e-4, 1e-3, 0.01])))
        inputs = rng.uniform(-1, 1, (steps, 3)) * [1.0, 1.0, 100.0]
        inputs[rng.random(steps) < 0.2] = 0.0
        start = controller.initial_state()
        expected, found = in_python(inputs, start, parameters), in_c(inputs, start, parameters)
        for one, other in zip(expected, found, strict=True):
            np.testing.assert_array_equal(bits(one), bits(other), err_msg=repr(controller))
        assert np.isfinite(expected[0]).all()


def test_random_steps_have_the_same_bits() -> None:
    compare(np.random.default_rng(1), 100, 100)


@pytest.mark.long
def test_a_million_random_steps_have_the_same_bits() -> None:
    compare(np.random.default_rng(2), 2000, 500)


def test_decay_is_the_exponential_to_one_unit_in_the_last_place() -> None:
    rng = np.random.default_rng(3)
    core = library(SIM)
    core.swingid_decay.argtypes, core.swingid_decay.restype = [ctypes.c_double], ctypes.c_double
    with decimal.localcontext() as context:
        context.prec = 40
        for x in map(float, np.concatenate([10.0 ** rng.uniform(-12, 2.85, 2000), rng.uniform(0, 1, 2000)])):
            found = law.decay(x)
            error = decimal.Decimal(found) - (-decimal.Decimal(x)).exp()
            assert abs(float(error)) <= math.ulp(found)
            assert core.swingid_decay(x) == found


@pytest.mark.parametrize(("x", "expected"), [(0.0, 1.0), (-1.0, 1.0), (709.0, 0.0), (math.inf, 0.0), (math.nan, 1.0)])
def test_decay_outside_its_range(x: float, expected: float) -> None:
    assert law.decay(x) == expected


def test_paper_gains_over_a_tracked_sine() -> None:
    """25 s of the paper's experiment with a perfect plant: angle a late copy of the reference."""
    t = np.arange(25_000) * 1e-3
    reference = 0.8 * np.sin(8.5 * t)
    step = 2 * np.pi / 16384
    angle = step * np.rint(0.9 * np.interp(t - 0.02, t, reference) / step)
    inputs = np.column_stack([reference, angle, -20 * angle])
    for one, other in zip(
        in_python(inputs, PAPER.initial_state(), PAPER.parameters(1e-3)),
        in_c(inputs, PAPER.initial_state(), PAPER.parameters(1e-3)),
        strict=True,
    ):
        np.testing.assert_array_equal(bits(one), bits(other))
