"""``twin://RIG``: a rig that is not there, exact and in virtual time.

The machine of a device and the twin's motion behind the stream of bytes of a serial port. Time passes while the host
reads, and only then: a run of 25 s takes as long as its computation. The same seed and the same bytes written give the
same bytes read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from swingid.errors import UsageError
from swingid.live.devices.stream import Connection, split_address
from swingid.live.guard import Board, Readings
from swingid.live.machine import EMULATED, Machine, most_taken
from swingid.live.plant import Plant, board_of

if TYPE_CHECKING:
    from swingid.model.rig import Rig

BLOCK = 16
"""Samples that one call of `read` returns at most, as a USB adapter does every 16 ms."""


class Device(Protocol):
    """What is between the bytes of a host and the samples of a rig: `Machine`, or the firmware's core."""

    busy: bool
    """Whether the host has sent as much as a sample takes, so that more may wait."""

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""

    def tick(self, time: int, readings: Readings) -> float:
        """One sample at a device time (us): the voltage (V) up to the next one."""

    def output(self) -> bytes:
        """Bytes for the host."""


class TwinDevice(Connection):
    """A device on the twin of a rig.

    machine: another device than `Machine`, for tests of firmware. clock: the device's time at its first sample (us).
    """

    virtual = True

    def __init__(self, plant: Plant, board: Board, *, machine: Device | None = None, clock: int = 0) -> None:
        super().__init__(plant, f"twin://{plant.rig.name}")
        self.plant = plant
        self.board = board
        self.machine: Device = machine or Machine(board)
        self._clock = clock
        self._left = 0.0
        self._waiting = self._pending = b""
        self._taken, self._most_taken = 0, most_taken(board)

    def write(self, data: bytes) -> None:
        """Bytes from the host; they arrive at once, what is more than a sample takes with the samples after it."""
        self.require_open()
        self._waiting += data
        self._take()

    @property
    def room(self) -> int:
        """How many bytes the device takes before its next sample."""
        return max(self._most_taken - self._taken - len(self._waiting), 0)

    def _take(self) -> None:
        """Pass on of what waits as much as a sample takes."""
        room = self._most_taken - self._taken
        part, self._waiting = self._waiting[:room], self._waiting[room:]
        if part:
            self._taken += len(part)
            self.machine.receive(part)
            self._pending += self.machine.output()

    def read(self, timeout: float = 0.0) -> bytes:
        """Bytes of the device after at most `timeout` (s) of its time; that time, `BLOCK` samples at most, passes.

        What a timeout is longer or shorter than whole samples is kept for the next call.
        """
        self.require_open()
        self._left += max(timeout, 0.0) * self.board.rate
        for _ in range(min(int(self._left + 1e-9), BLOCK)):
            self.step()
        self._left = self._left + 1e-9 - int(self._left + 1e-9)
        data, self._pending = self._pending, b""
        return data

    def step(self) -> None:
        """One sample of device and rig."""
        self._take()
        self.machine.busy, self._taken = self._taken == self._most_taken, 0
        time = (self._clock + round(self.plant.row * 1e6 / self.board.rate)) % 2**32
        voltage = self.machine.tick(time, self.plant.read())
        self._pending += self.machine.output()
        self.plant.hold(voltage)

    def clock(self) -> float:
        """Time that has passed (s): a host takes it in the place of its own clock."""
        return self.plant.time

    def end(self, handle: Plant) -> None:
        """End of the connection; the rig hangs as it does."""


def twin_of(rig: Rig, *, rate: float = 1000.0, seed: int = 0, draw: bool = False, clock: int = 0) -> TwinDevice:
    """A device on the twin of a rig; errors as `board_of` and, without inertia or gravity torque, as `simulate`."""
    board = board_of(rig, rate=rate, firmware=EMULATED["twin"])
    return TwinDevice(Plant(rig, rate=rate, seed=seed, draw=draw), board, clock=clock)


def open_twin(address: str) -> TwinDevice:
    """Device of an address such as ``twin://paper`` or ``twin://lab/rig.toml?rate=500&seed=3&draw=1``.

    Raises UsageError for another scheme and for options that are not known.
    """
    from swingid.model.rig import Rig

    parts = split_address(address)
    if parts.scheme != "twin":
        raise UsageError(f"{address!r} is no address of a twin, which starts with twin://", code="bad-address")
    parts.require("rate", "seed", "draw")
    rate, seed, draw = parts.number("rate", 1000.0), parts.whole("seed", 0), bool(parts.whole("draw", 0))
    if not 20.0 <= rate <= 100_000.0 or seed < 0:
        wrong = "rate" if seed >= 0 else "seed"
        text = f"{address!r}: {wrong} is not offered; options are rate (20 to 100000), seed (0 or more), draw (0 or 1)"
        raise UsageError(text, code="bad-address")
    device = twin_of(Rig.load(parts.target), rate=rate, seed=seed, draw=draw)
    device.address = address
    return device
