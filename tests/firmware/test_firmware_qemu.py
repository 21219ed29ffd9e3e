"""The firmware on an emulated board, in lockstep with the twin: startup, tick and UARTs of a Cortex-M of QEMU."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import pytest
from test_live_twin import frames_of, recording_of

from firmware_qemu import MACHINES, Emulated, image
from live_host import RIG, Driver
from long_cases import quick_first
from swingid import identify
from swingid.control.compensator import Compensator
from swingid.live.codes import FaultCode, Mode, State
from swingid.live.devices.twin import TwinDevice
from swingid.live.guard import Limits, parameters_of
from swingid.live.plant import Plant, board_of
from swingid.model.rig import Rig

BOARD = board_of(RIG, firmware=77)
PARAMETERS = parameters_of(Compensator.paper(RIG), BOARD, Limits.of(RIG))


@pytest.fixture(autouse=True, scope="module")
def _installed() -> None:
    image("mps2-an385")


@contextlib.contextmanager
def emulated(machine: str) -> Iterator[Emulated]:
    device = Emulated(machine)
    try:
        yield device
    finally:
        device.close()


@pytest.mark.parametrize("machine", quick_first(1, MACHINES))
def test_the_board_sends_the_bytes_of_the_machine_in_python(machine: str) -> None:
    with emulated(machine) as device:
        frames, found = frames_of(TwinDevice(Plant(RIG), BOARD, machine=device), 1.0)
    assert found == frames_of(TwinDevice(Plant(RIG), BOARD), 1.0)[1]
    assert frames[-1].state == State.IDLE
    assert sum(frame.name == "Sample" and frame.state == State.RUNNING for frame in frames) == 1000


def test_without_a_heartbeat_it_is_0_volts_within_100_ms() -> None:
    with emulated("mps2-an385") as device:
        driver = Driver(device, answers_late=True)
        driver.start([3.0] * 900, PARAMETERS, mode=Mode.OPEN_LOOP)
        assert [driver.tick() for _ in range(5)] == [3.0] * 5
        voltages = [driver.tick(heartbeat=False) for _ in range(110)]
        assert 0.0 in voltages[:100]
        assert not any(voltages[voltages.index(0.0) :])
        assert driver.last("Fault").code == FaultCode.HEARTBEAT


@pytest.mark.long
@pytest.mark.parametrize("name", ["paper", "paper-body"])
def test_the_papers_experiment_over_it_gives_the_twins_inertia(name: str) -> None:
    rig = Rig.load(name)
    assert rig.axis.inertia is not None
    assert board_of(rig, firmware=77) == BOARD
    with emulated("mps2-an500") as device:
        frames, found = frames_of(TwinDevice(Plant(rig), BOARD, machine=device), 25.0)
    assert found == frames_of(TwinDevice(Plant(rig), BOARD), 25.0)[1]
    inertia = identify(recording_of(frames, 25.0), rig, method="momentum").parameters["inertia"]
    low, high = inertia.interval95
    assert low <= rig.axis.inertia.value <= high
    assert abs(inertia.value / rig.axis.inertia.value - 1) < 2e-4
