"""``moteus://ID?nm_per_volt=0.05``: a moteus drive on a CAN-FD bus as the motor of the wheel, the loop in the host.

The machine of a device runs here, at most 500 times a second, while the host reads. A sample asks the drive for the
position of the motor (the wheel) and of its second encoder (the axis), and answers with a torque: `nm_per_volt` times
the controller's voltage. The drive's own watchdog ends the torque 100 ms after the last command, whatever the host
does. Needs the package moteus, whose frames these are, and python-can for the bus.

Options: channel, interface (of python-can; default can0, socketcan), rate (default 250), nm_per_volt (required, in
N m/V at the wheel), limit (V, default 10), encoder (1 or 2, that of the axis; default 1).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from swingid.errors import DeviceError, UsageError
from swingid.live.devices.can_bus import CanBus, join_bus
from swingid.live.devices.host_loop import ANSWER_TIME, WATCHDOG, HostLoop, board_at, gain_at, wrapped
from swingid.live.devices.stream import split_address
from swingid.live.guard import Board, Readings
from swingid.live.schema import missing_extra

FAULT_MODE = 1


class MoteusDevice(HostLoop):
    """A drive as a device. bus: of python-can; drive: number of the moteus; steady: another clock, for tests."""

    def __init__(
        self,
        bus: Any,
        address: str,
        board: Board,
        *,
        drive: int,
        nm_per_volt: float,
        encoder: int = 1,
        steady: Any = None,
    ) -> None:
        import moteus

        super().__init__(address, board, steady=steady)
        self._bus = CanBus(bus, address)
        self._drive, self._gain = drive, nm_per_volt
        self._registers = moteus.Register
        self._axis_register = {1: moteus.Register.ENCODER_1_POSITION, 2: moteus.Register.ENCODER_2_POSITION}[encoder]
        self._moteus = moteus.Controller(id=drive, query_resolution=_asked(moteus, self._axis_register))
        self._parse: Callable[[bytes], Any] = moteus.parse_registers
        self._turn: float | None = None

    def _drive_by(self, voltage: float | None) -> None:
        """The torque of this sample; None: stop."""
        if voltage is None:
            self._send(self._moteus.make_stop())
            return
        self._send(
            self._moteus.make_position(
                position=math.nan,
                kp_scale=0.0,
                kd_scale=0.0,
                ilimit_scale=0.0,
                feedforward_torque=self._gain * voltage,
                watchdog_timeout=WATCHDOG,
            )
        )

    def _leave(self) -> None:
        self._bus.close()

    def _read(self) -> Readings:
        """The drive's answer as counts; without one in time, whatever else is on the bus, the last ones, not valid.

        DeviceError where it has a fault.
        """
        none = self._last._replace(valid=False)
        until = time.monotonic() + ANSWER_TIME
        while self._bus.recv(0.0) is not None:  # an answer that came too late is none of this sample
            if time.monotonic() >= until:
                return none
        self._send(self._moteus.make_query())
        until = remaining = time.monotonic() + ANSWER_TIME
        while remaining > 0.0:
            remaining = until - time.monotonic()
            message = self._bus.recv(max(remaining, 0.0))
            if message is None:
                break
            if message.arbitration_id >> 8 & 0x7F == self._drive and message.arbitration_id & 0x7F == 0:
                return self._counts(self._parse(bytes(message.data)).response)
        return none

    def _counts(self, values: dict[int, float]) -> Readings:
        """Readings of an answer; the axis' encoder may count within a turn or on."""
        registers = self._registers
        if values.get(registers.MODE) == FAULT_MODE:
            code = round(values.get(registers.FAULT, 0))
            text = f"{self.address}: the drive has fault {code} (table of faults in moteus' reference); remove the "
            raise DeviceError(f"{text}cause, then start again", code="drive-fault")
        position, axis = values.get(registers.POSITION, math.nan), values.get(self._axis_register, math.nan)
        if not (math.isfinite(position) and math.isfinite(axis)):
            return self._last._replace(valid=False)
        now, before = axis, self._turn
        turns = now if before is None else before + math.remainder(now - before, 1.0)
        self._turn = turns
        current = values.get(registers.Q_CURRENT, math.nan)
        self._last = Readings(wrapped(turns), wrapped(position), current)
        return self._last

    def _send(self, command: Any) -> None:
        data = bytes(command.data)
        size = next(size for size in (*range(9), 12, 16, 20, 24, 32, 48, 64) if size >= len(data))
        data += b"\x50" * (size - len(data))  # moteus' own byte for nothing
        self._bus.send((0x8000 if command.reply_required else 0) | self._drive, data)


def _asked(moteus: Any, axis: int) -> Any:
    """What a sample asks for."""
    asked = moteus.QueryResolution()
    asked.mode = asked.fault = moteus.INT8
    asked.position = moteus.INT32
    asked.q_current = moteus.F32
    asked.velocity = asked.torque = asked.voltage = asked.temperature = moteus.IGNORE
    asked._extra = {axis: moteus.INT32}
    return asked


def open_moteus(address: str) -> MoteusDevice:
    """Join the bus of ``moteus://ID?...``; UsageError for a bad address, DeviceError without bus or drive."""
    parts = split_address(address)
    parts.require("channel", "interface", "rate", "nm_per_volt", "limit", "encoder")
    try:
        import moteus
    except ImportError:
        raise missing_extra("moteus", "moteus") from None
    del moteus
    number, encoder = parts.target.strip("/") or "1", parts.whole("encoder", 1)
    if not number.isdecimal() or not 1 <= int(number) < 127 or encoder not in (1, 2):
        text = f"{address!r} must be moteus://ID?nm_per_volt=X with ID 1 to 126, and encoder 1 or 2"
        raise UsageError(text, code="bad-address")
    gain, board = gain_at(parts), board_at(parts, 250.0)
    interface = parts.options.get("interface", "socketcan")
    bus = join_bus(address, parts.options.get("channel", "can0"), interface)
    return MoteusDevice(bus, address, board, drive=int(number), nm_per_volt=gain, encoder=encoder)
