"""The core on a Cortex-M3, whose doubles are computed in software: the bits of this machine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_firmware_controller import bits, in_python, random_controller, steps

from firmware_emulator import CPUS, EXACT, Emulator, image
from live_host import (
    BOARD,
    STILL,
    Driver,
    arm_frame,
    encode,
    experiment,
    parameter_frames,
    reference_frames,
)
from swingid.control import law
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.live.codes import Mode, State
from swingid.live.devices.twin import TwinDevice
from swingid.live.guard import MOST_ORDER, Limits, Readings, parameters_of
from swingid.live.machine import most_taken
from swingid.live.plant import Plant, board_of
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array

RIG = Rig.load("paper")
SINE = parse_reference("sine 0.8 rad 8.5 rad/s")


@pytest.fixture(autouse=True, scope="module")
def _installed() -> None:
    image()


@pytest.mark.long
@pytest.mark.parametrize("cpu", CPUS)
def test_random_steps_have_the_same_bits(cpu: str) -> None:
    rng, cortex = np.random.default_rng(5), Emulator(cpu=cpu)
    for _ in range(30):
        controller = random_controller(rng)
        parameters = controller.parameters(1e-3)
        inputs = rng.uniform(-1, 1, (100, 3)) * [1.0, 1.0, 100.0]
        start = controller.initial_state()
        state = np.zeros(law.XI + MOST_ORDER)
        state[: len(start)] = start
        voltages, states = cortex.steps(inputs, state, parameters)
        expected = in_python(inputs, start, parameters)
        same(voltages, expected[0], len(controller.k), repr(controller))
        same(states[:, : len(start)], expected[1], len(controller.k), repr(controller))


def same(found: Array, expected: Array, order: int, words: str) -> None:
    """The same bits; by gcc's library and from order 2 on the same numbers to 1e-9 of the largest of their column."""
    if EXACT or order < 2:
        np.testing.assert_array_equal(bits(found), bits(expected), err_msg=words)
    else:
        assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected).max(axis=0)), words


def bytes_of_a_run(seconds: float, *, emulated: bool) -> bytes:
    board = board_of(RIG)
    parameters = parameters_of(Compensator.paper(RIG), board, Limits.of(RIG))
    device = TwinDevice(Plant(RIG), board, machine=Emulator(board) if emulated else None)
    frames, data = experiment(device, parameters, SINE(np.arange(int(seconds * 1000)) / 1000.0))
    assert frames[-1].state == State.IDLE
    return data


def test_a_run_gives_the_bytes_of_the_machine_in_python() -> None:
    assert bytes_of_a_run(1.0, emulated=True) == bytes_of_a_run(1.0, emulated=False)


@pytest.mark.long
def test_the_papers_experiment_gives_the_bytes_of_the_machine_in_python() -> None:
    assert bytes_of_a_run(25.0, emulated=True) == bytes_of_a_run(25.0, emulated=False)


FLOODS = {
    "no end of a frame": b"\xff",
    "no frames": b"\x01\0",
    "Who": encode("Who"),
    "Clear": encode("Clear"),
    "Heartbeat": encode("Heartbeat", session=7),
    "Run": encode("Run", session=7),
    "Stop": encode("Stop", mode=2),
    "Parameters": parameter_frames(),
    "Arm": arm_frame(),
    "Reference": reference_frames([0.1] * 14, start=14),
}


@pytest.mark.parametrize("state", [State.IDLE, State.ARMED, State.RUNNING])
@pytest.mark.parametrize("name", FLOODS)
def test_the_bytes_of_a_sample_cost_at_most_170_instructions_each(name: str, state: State) -> None:
    """The figure with which core/device.h gives reasons for how much is taken per sample."""
    cortex = Emulator(BOARD)
    driver = Driver(cortex)
    driver.tick()
    driver.tell(parameter_frames())
    if state is not State.IDLE:
        driver.tell(arm_frame(mode=Mode.OPEN_LOOP))
    if state is State.RUNNING:
        driver.tell(reference_frames([0.1] * 14, last=False) + encode("Run", session=7))
    cortex.tick(2000, STILL)
    cortex.output()
    most = most_taken(BOARD)
    flood = (FLOODS[name] * most)[:most]
    assert cortex.instructions(lambda: cortex.receive(flood)) <= 170 * most


def test_a_pico_has_the_time_for_order_1_at_500_hz_and_no_more() -> None:
    """firmware/README.md's figures, with 2 cycles an instruction at most: those of loads and of branches taken.

    A Pico's Cortex-M0+ has 133 MHz; a host sends as much as a sample may take, the flood that costs most.
    """
    board = replace(BOARD, rate=500.0)
    counted = []
    for order in (1, 2):
        driver = Driver(Emulator(board, "cortex-m0plus"))
        parameters = parameters_of(steps(order), board, Limits.of(RIG))
        driver.tick(step=2000)
        driver.tell(parameter_frames(parameters) + arm_frame(parameters))
        driver.tell(reference_frames([0.1] * 14, last=False) + encode("Run", session=7))
        flood = (encode("Who") * most_taken(board))[: most_taken(board)]
        device: Any = driver.device

        def sample(device: Any = device, driver: Driver = driver, flood: bytes = flood) -> None:
            device.receive(flood)
            driver.tick(Readings(10, 300), step=2000)

        driver.tick(Readings(5, 150), step=2000)
        counted.append(2 * device.instructions(sample) / (133e6 / 500))
    assert counted[0] < 1.0 < counted[1]
