"""`moteus://`: a drive of the maker's frames on a virtual CAN bus, its plant the twin, in the time of the test."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from live_host import RIG
from refusals import coded
from swingid import identify
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError, UsageError
from swingid.live.codes import FaultCode, State
from swingid.live.commission import commission
from swingid.live.devices.host_loop import COUNTS
from swingid.live.devices.moteus_drive import MoteusDevice
from swingid.live.devices.table import open_device
from swingid.live.guard import Board, Limits, parameters_of
from swingid.live.plant import Plant
from swingid.live.rows import Rows
from swingid.live.running import Reason
from swingid.live.session import Session
from swingid.recording.recording import Recording

can = pytest.importorskip("can", reason="python-can is not installed: pip install 'swingid[live]'")
moteus = pytest.importorskip("moteus", reason="moteus is not installed: pip install 'swingid[moteus]'")

RIGHT = RIG.changed({"sensors.counts_per_turn": COUNTS})
GAIN, RATE = 0.02, 500.0


class FakeDrive:
    """A moteus with the twin as its motor and wheel: it answers the maker's frames on its own end of the bus."""

    def __init__(self, channel: str, plant: Plant) -> None:
        self.bus = can.Bus(channel=channel, interface="virtual", fd=True)
        self.plant, self.volts, self.mode, self.silent = plant, 0.0, 0, False
        self.commands: list[dict[int, float]] = []

    def poll(self) -> None:
        """Take what has come; a query is a sample of the plant."""
        while (message := self.bus.recv(0)) is not None:
            assert message.is_fd
            assert message.arbitration_id & 0x7F == 3
            found = moteus.parse_registers(bytes(message.data))
            if found.command:
                self._take(found.command)
            if message.arbitration_id & 0x8000 and not self.silent:
                self._answer(found.query)

    def _take(self, command: dict[int, float]) -> None:
        self.commands.append(command)
        if self.mode != 1:
            self.mode = round(command[moteus.Register.MODE])
        driven = self.mode == moteus.Mode.POSITION
        if driven:
            assert np.isnan(command[moteus.Register.COMMAND_POSITION])
            assert command[moteus.Register.COMMAND_KP_SCALE] == command[moteus.Register.COMMAND_KD_SCALE] == 0.0
            assert command[moteus.Register.COMMAND_TIMEOUT] == pytest.approx(0.1)
        self.volts = command[moteus.Register.COMMAND_FEEDFORWARD_TORQUE] / GAIN if driven else 0.0

    def _answer(self, query: list[Any]) -> None:
        self.plant.hold(self.volts)
        readings = self.plant.read()
        raw = {
            moteus.Register.MODE: (0x21, struct.pack("<b", self.mode)),
            moteus.Register.POSITION: (0x29, struct.pack("<i", readings.wheel)),
            moteus.Register.ENCODER_1_POSITION: (0x29, struct.pack("<i", readings.axis % COUNTS)),
            moteus.Register.Q_CURRENT: (0x2D, struct.pack("<f", 0.25)),
            moteus.Register.FAULT: (0x21, struct.pack("<b", 33 if self.mode == 1 else 0)),
        }
        asked = [one[0] if isinstance(one, tuple) else one for one in query]
        data = b"".join(bytes([raw[one][0], int(one)]) + raw[one][1] for one in raw if int(one) in map(int, asked))
        data += b"\x50" * (next(size for size in (12, 16, 20, 24, 32) if size >= len(data)) - len(data))
        self.bus.send(can.Message(arbitration_id=3 << 8, data=data, is_extended_id=False, is_fd=True))


class Bench:
    """Time of the test, and the host's end of the bus, where each message reaches the drive at once."""

    def __init__(self, channel: str, drive: FakeDrive) -> None:
        self._bus, self._drive, self._time = can.Bus(channel=channel, interface="virtual", fd=True), drive, 0.0

    def now(self) -> float:
        return self._time

    def wait(self, seconds: float) -> None:
        self._time += max(seconds, 0.0)

    def send(self, message: Any) -> None:
        self._bus.send(message)
        self._drive.poll()

    def recv(self, timeout: float) -> Any:
        return self._bus.recv(0)

    def shutdown(self) -> None:
        self._bus.shutdown()


class Bound(MoteusDevice):
    """The device with the time of a bench, so that a host waits by it."""

    virtual = True

    def __init__(self, bench: Bench) -> None:
        board = Board(RATE, COUNTS, COUNTS, 10.0, 5)
        super().__init__(bench, "moteus://3", board, drive=3, nm_per_volt=GAIN, steady=bench)
        self.clock = bench.now


@pytest.fixture
def drive(request: pytest.FixtureRequest) -> Iterator[tuple[FakeDrive, Bound]]:
    channel = f"swingid-{request.node.name}"
    fake = FakeDrive(channel, Plant(RIGHT, rate=RATE))
    device = Bound(Bench(channel, fake))
    yield fake, device
    device.close()
    fake.bus.shutdown()


def test_a_run_with_the_loop_in_the_host_gives_the_inertia(drive: tuple[FakeDrive, Bound]) -> None:
    fake, device = drive
    with Session(device) as session:
        board = session.connect()
        assert (board.rate, board.axis_counts) == (RATE, COUNTS)
        parameters = parameters_of(Compensator.paper(RIGHT), board, Limits.of(RIGHT))
        session.load(parameters)
        reference = parse_reference("sine 0.8 rad 8.5 rad/s")(np.arange(round(12 * RATE)) / RATE)
        run = session.run(reference)
    assert run.end.reason is Reason.FINISHED, run.end.sentence
    rows = Rows(parameters.tolist(), start=run.start)
    time, angle, wheel, voltage = (np.array(column) for column in list(zip(*rows.feed(run.samples), strict=True))[:4])
    log = Recording(time, angle, wheel_angle=wheel, voltage=voltage)
    result = identify(log, RIGHT)
    assert RIGHT.axis.inertia is not None
    low, high = result.parameters["inertia"].interval95
    assert low <= RIGHT.axis.inertia.value <= high
    assert result.parameters["inertia"].value == pytest.approx(RIGHT.axis.inertia.value, rel=5e-4)
    assert {sample.current for sample in run.samples} == {0.25}
    assert (fake.mode, fake.volts) == (moteus.Mode.STOPPED, 0.0)


def test_it_is_commissioned_as_any_device(drive: tuple[FakeDrive, Bound]) -> None:
    with Session(drive[1]) as session:
        found = commission(session, RIGHT)
    assert (found.axis_sign, found.wheel_sign, found.voltage_sign) == (1, 1, 1)
    assert found.ratio is not None
    assert abs(found.ratio[0] - 1.0) < 3 * found.ratio[1] < 0.05


def driven(session: Session) -> None:
    board = session.connect()
    session.load(parameters_of(Compensator.paper(RIGHT), board, Limits.of(RIGHT)))


def test_a_drive_that_stops_answering_ends_the_run_at_no_torque(drive: tuple[FakeDrive, Bound]) -> None:
    fake, device = drive
    with Session(device) as session:
        driven(session)

        def silence(_: object) -> None:
            fake.silent = device.machine.state is State.RUNNING

        run = session.run(0.3 * np.sin(np.arange(2000) * 0.017), on_batch=silence)
        assert run.end.fault is FaultCode.ENCODER
    assert (fake.mode, fake.volts) == (moteus.Mode.STOPPED, 0.0)
    assert device.machine.fault is FaultCode.ENCODER


def test_a_bus_that_others_flood_ends_the_run_at_no_torque(drive: tuple[FakeDrive, Bound]) -> None:
    fake, device = drive
    strange = can.Message(arbitration_id=0x123, data=b"", is_extended_id=False, is_fd=True)
    with Session(device) as session:
        driven(session)

        def flood(_: object) -> None:
            if device.machine.state is State.RUNNING:
                device._bus.recv = lambda timeout: strange

        run = session.run(0.3 * np.sin(np.arange(2000) * 0.017), on_batch=flood)
        assert run.end.fault is FaultCode.ENCODER
    assert (fake.mode, fake.volts) == (moteus.Mode.STOPPED, 0.0)


def test_a_drive_with_a_fault_or_gone_is_one_sentence(drive: tuple[FakeDrive, Bound]) -> None:
    fake, device = drive
    fake.mode = 1
    with pytest.raises(DeviceError, check=coded("drive-fault", "33")):
        device.read(0.1)
    fake.mode, fake.silent = 0, True
    with pytest.raises(DeviceError, check=coded("gone")):
        device.read(3.0)
    device.close()
    with pytest.raises(UsageError, match="closed"):
        device.read()


@pytest.mark.parametrize(
    "address",
    ["moteus://1", "moteus://x?nm_per_volt=1", "moteus://1?nm_per_volt=0", "moteus://1?nm_per_volt=1&rate=1000"],
)
def test_addresses_that_are_none(address: str) -> None:
    with pytest.raises(UsageError, check=coded("bad-address")):
        open_device(address)


def test_an_address_joins_a_bus() -> None:
    device = open_device("moteus://3?nm_per_volt=0.05&channel=swingid-open&interface=virtual&rate=100")
    assert isinstance(device, MoteusDevice)
    assert (device.board.rate, device.virtual) == (100.0, False)
    assert device.read(0.02) == b""  # no host has asked for anything, and no drive is there
    device.close()
