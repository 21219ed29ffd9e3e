"""What drives have in common whose loop runs in the host: the machine of a device, its samples and its time.

Samples are made while the host reads, `MOST_RATE` a second at most; one that comes later than 1.5 periods is a fault
(overrun). What cuts the torque when the host dies must be in the drive: a watchdog of 100 ms.
"""

from __future__ import annotations

import math
import time
import zlib
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Any

from swingid.errors import DeviceError, UsageError
from swingid.live.codes import State, apart
from swingid.live.devices.stream import Address, Connection, gone
from swingid.live.guard import Board, Readings
from swingid.live.machine import VERSION, Machine

COUNTS = 100_000
"""Counts per turn into which the positions of such drives, which are turns or angles, are made."""

WATCHDOG = 0.1
"""Seconds of a drive's watchdog: as long as the heartbeat of a host may be missing."""

MOST_RATE, ANSWER_TIME, SILENT = 500.0, 0.003, 1.0
"""Samples per second at most; seconds: for an answer, until a silent drive is gone."""


class Steady:
    """The host's own time (s)."""

    def now(self) -> float:
        """Seconds since some moment."""
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        """Let so much time pass."""
        if seconds > 0.0:
            time.sleep(seconds)


class HostLoop(Connection, ABC):
    """A drive as a device: `_read`, `_drive_by` and `_leave` are its own. steady: another clock, for tests."""

    def __init__(self, address: str, board: Board, *, steady: Any = None) -> None:
        super().__init__(board, address)
        self.board, self.machine = board, Machine(board)
        self._steady = steady or Steady()
        self._pending = b""
        self._last = Readings(0, 0)
        self._begin = self._due = self._heard = self._steady.now()

    @abstractmethod
    def _read(self) -> Readings:
        """Readings of this sample; without an answer in time the last ones, not valid. DeviceError for a fault."""

    @abstractmethod
    def _drive_by(self, voltage: float | None) -> None:
        """What the controller's voltage makes the drive do up to the next sample; None: no torque, not enabled."""

    @abstractmethod
    def _leave(self) -> None:
        """Give bus or port up."""

    def write(self, data: bytes) -> None:
        """Bytes from the host."""
        self.require_open()
        self.machine.receive(data)
        self._pending += self.machine.output()

    def read(self, timeout: float = 0.0) -> bytes:
        """Make the samples that are due, the first of them within `timeout` (s); DeviceError where the drive goes."""
        self.require_open()
        until = self._steady.now() + max(timeout, 0.0)
        while True:
            now = self._steady.now()
            if self._due <= now:
                self._sample()
                self._due += 1.0 / self.board.rate
                behind = self._steady.now() - self._due
                if behind > 0.0:  # late samples are not made up for: the guard sees the gap
                    self._due += math.ceil(behind * self.board.rate) / self.board.rate
            elif self._pending or now >= until:
                break
            else:
                self._steady.wait(min(self._due, until) - now)
        data, self._pending = self._pending, b""
        return data

    def end(self, handle: Board) -> None:
        """Stop the motor and leave."""
        try:
            with suppress(DeviceError):
                self._drive_by(None)
        finally:
            self._leave()

    def _sample(self) -> None:
        """One sample: readings, the machine, the torque."""
        readings = self._read()
        now = self._steady.now()
        if readings.valid:
            self._heard = now
        elif now - self._heard > SILENT:
            raise gone(self.address, "the drive does not answer")
        voltage = self.machine.tick(round((now - self._begin) * 1e6) % 2**32, readings)
        self._pending += self.machine.output()
        self._drive_by(voltage if self.machine.state in (State.RUNNING, State.STOPPING) else None)


def wrapped(turns: float) -> int:
    """Counts of a position in turns, in 32 bits."""
    return apart(round(turns * COUNTS), 0)


def board_at(parts: Address, rate: float = 200.0) -> Board:
    """The device of an address with options rate (default `rate`) and limit; UsageError for one that none has."""
    rate, limit = parts.number("rate", rate), parts.number("limit", 10.0)
    if not 20.0 <= rate <= MOST_RATE or not 0.0 < limit < 1000.0:
        text = f"{parts.text!r}: rate must be 20 to {MOST_RATE:g} per second, limit above 0 V and below 1000 V"
        raise UsageError(text, code="bad-address")
    return Board(rate, COUNTS, COUNTS, limit, zlib.crc32(f"swingid {parts.scheme} {VERSION}".encode()))


def gain_at(parts: Address) -> float:
    """Torque at the wheel per volt (N m/V), the option nm_per_volt of an address; UsageError without one."""
    gain = parts.number("nm_per_volt", math.nan)
    if not math.isfinite(gain) or gain == 0.0:
        text = f"{parts.text!r} must state nm_per_volt=X, the torque at the wheel (N m) per volt of the controller"
        raise UsageError(text, code="bad-address")
    return gain
