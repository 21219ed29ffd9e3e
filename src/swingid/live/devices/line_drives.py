"""``odrive:///dev/ttyACM0?nm_per_volt=X``, ``simplefoc:///dev/ttyUSB0``, ``hil://HOST:PORT``: lines of ASCII.

The loop runs in the host (`host_loop.py`). A sample is a question for the positions, and a line with the torque.

ODrive (firmware 0.5, ASCII protocol of its documentation): ``f N`` answers position (turns) and speed of axis N, ``c N
X`` is a torque of X N m and feeds the watchdog, ``r`` and ``w`` read and write properties. The wheel is on the motor
of `motor`, the axis on the encoder of `axis`.

SimpleFOC (Commander of its documentation): ``M`` is the motor, in torque control by voltage, ``M1.5`` means 1.5 V. The
Commander knows one sensor and no watchdog, so the sketch adds two commands: ``A`` prints the angles (rad) of axis
and wheel in one line, parted by a comma, and ``W`` the time (ms, 100 at most) after which the sketch disables the motor
when no line has come.

HIL: a program beside a closed data acquisition board (Quanser's, say) that serves lines of CSV on TCP, such as
``examples/quanser_hil.py``. ``C`` answers counts per turn of axis and wheel (0: none), the largest voltage and the ms
of its watchdog, 100 at most; ``R`` both counts and the current (nan: none); ``U,1.5`` is a voltage, ``E,1`` and ``E,0``
enable the amplifier and let go of it. No line within the watchdog's time is 0 V and ``E,0``.
"""

from __future__ import annotations

import math
import time
import zlib
from abc import abstractmethod
from typing import Any

from swingid.errors import DeviceError, UsageError
from swingid.live.devices.host_loop import ANSWER_TIME, COUNTS, WATCHDOG, HostLoop, board_at, gain_at, wrapped
from swingid.live.devices.stream import Address, Stream, split_address
from swingid.live.guard import Board, Readings
from swingid.live.machine import VERSION, Machine

PATIENCE = 0.5
"""Seconds for an answer outside of a sample."""

CHECKED = 25
"""Samples between two looks for an error of the drive: ten a second at 250 Hz, each as long as a sample's question."""

WHOLE = 2.0**53 / COUNTS
"""Numbers of an answer are smaller: counts of turns are whole in a double; larger ones are noise on the line."""

IDLE, CLOSED_LOOP, TORQUE, PASSTHROUGH = 1, 8, 1, 1
"""ODrive's numbers of its states, control mode and input mode."""

EXPIRED = 0x800
"""ODrive's error of its watchdog."""


class LineDrive(HostLoop):
    """A drive behind a line of ASCII. port: a stream of bytes; the drive is set up, not enabled, by `_begin_with`."""

    def __init__(self, port: Stream, address: str, board: Board, *, steady: Any = None) -> None:
        super().__init__(address, board, steady=steady)
        self._port, self._rest, self._enabled = port, b"", False

    def _tell(self, *lines: str) -> None:
        self._port.write("".join(f"{line}\n" for line in lines).encode("ascii"))

    def _ask(self, line: str, patience: float = ANSWER_TIME) -> str | None:
        """The line that answers; None without one in time. What came before is none of it."""
        while self._port.read(0.0):
            pass
        self._rest = b""
        self._tell(line)
        until = time.monotonic() + patience
        while (remaining := until - time.monotonic()) > 0.0:
            self._rest += self._port.read(remaining)
            answer, ended, _ = self._rest.partition(b"\n")
            if ended:
                return answer.decode("ascii", "replace").strip()
        return None

    def _numbers(self, line: str, count: int, patience: float = ANSWER_TIME) -> list[float] | None:
        """The numbers of an answer, parted by spaces, tabs or commas; None where they are not so many.

        The third may be nan: a current that nobody measures.
        """
        try:
            numbers = [float(word) for word in (self._ask(line, patience) or "").replace(",", " ").split()]
        except ValueError:
            return None
        sound = all(abs(number) < WHOLE for number in numbers[:2] + numbers[3:])  # nan and infinite ones are not
        return numbers if len(numbers) == count and sound else None

    def _now_at(self, axis: float | None, wheel: float | None, current: float = math.nan) -> Readings:
        """Readings of two positions in turns."""
        if axis is None or wheel is None:
            return self._last._replace(valid=False)
        self._last = Readings(wrapped(axis), wrapped(wheel), current)
        return self._last

    def _drive_by(self, voltage: float | None) -> None:
        enable = voltage is not None
        if enable != self._enabled:
            self._tell(*self._switch(enable))
            self._enabled = enable
        if voltage is not None:
            self._tell(self._torque(voltage))

    def _leave(self) -> None:
        self._tell(*self._switch(False))
        self._port.close()

    @abstractmethod
    def _switch(self, on: bool) -> tuple[str, ...]:
        """Lines that enable the motor, or let go of it."""

    @abstractmethod
    def _torque(self, voltage: float) -> str:
        """The line of a voltage."""


class ODrive(LineDrive):
    """An ODrive; motor and axis: numbers of its two sides."""

    def __init__(
        self, port: Stream, address: str, board: Board, *, nm_per_volt: float, motor: int, axis: int, steady: Any = None
    ) -> None:
        super().__init__(port, address, board, steady=steady)
        self._gain, self._motor, self._axis, self._looked = nm_per_volt, motor, axis, 0
        side = f"axis{motor}"
        self._tell(
            f"w {side}.requested_state {IDLE}",
            f"w {side}.controller.config.control_mode {TORQUE}",
            f"w {side}.controller.config.input_mode {PASSTHROUGH}",
            f"w {side}.config.watchdog_timeout {WATCHDOG:g}",
            f"w {side}.config.enable_watchdog 1",
        )
        said = self._ask(f"r {side}.config.watchdog_timeout", PATIENCE)
        try:
            set_to = float(said or "nan")
        except ValueError:
            set_to = math.nan
        if not 0.0 < set_to <= WATCHDOG * 1.001:
            text = f"{address}: the drive answers {said!r} to its watchdog, without which a dead host leaves the "
            raise DeviceError(f"{text}torque on; look after port and firmware (0.5)", code="no-watchdog")

    def _read(self) -> Readings:
        self._looked += 1
        if self._enabled and self._looked % CHECKED == 0:
            self._require_sound()
        axis, wheel = (self._numbers(f"f {side}", 2) for side in (self._axis, self._motor))
        return self._now_at(axis[0] if axis else None, wheel[0] if wheel else None)

    def _require_sound(self, but: int = 0) -> None:
        """DeviceError where the drive has an error other than `but`."""
        errors = self._numbers(f"r axis{self._motor}.error", 1)
        error = int(errors[0]) if errors is not None else 0
        if error not in (0, but):
            text = f"{self.address}: the drive has error {error:#x} (dump_errors in odrivetool says which); remove the "
            raise DeviceError(text + "cause, then start again", code="drive-fault")

    def _switch(self, on: bool) -> tuple[str, ...]:
        if on:
            self._require_sound(but=EXPIRED)  # that of a drive which waited for its host
        feed = (f"u {self._motor}", f"w axis{self._motor}.error 0") if on else (self._torque(0.0),)
        return *feed, f"w axis{self._motor}.requested_state {CLOSED_LOOP if on else IDLE}"

    def _torque(self, voltage: float) -> str:
        return f"c {self._motor} {self._gain * voltage:.6f}"


class SimpleFoc(LineDrive):
    """A board with SimpleFOC's Commander and the two commands of the module's text."""

    def __init__(self, port: Stream, address: str, board: Board, *, steady: Any = None) -> None:
        super().__init__(port, address, board, steady=steady)
        self._tell("@0", "ME0", "MC0", "MT0", "M0")
        said = self._ask("W", PATIENCE)
        if said is None or not said.isdecimal() or not 0 < int(said) <= round(1000 * WATCHDOG):
            text = f"{address}: the sketch answers {said!r} to W, which must be the ms of its watchdog, 100 at most"
            raise DeviceError(f"{text}; docs/porting.md has its two commands", code="no-watchdog")

    def _read(self) -> Readings:
        angles = self._numbers("A", 2)
        axis, wheel = (angle / (2 * math.pi) for angle in angles) if angles else (None, None)
        return self._now_at(axis, wheel)

    def _switch(self, on: bool) -> tuple[str, ...]:
        return ("M0", "ME1") if on else ("M0", "ME0")

    def _torque(self, voltage: float) -> str:
        return f"M{voltage:.4f}"


class Hil(LineDrive):
    """A program that serves a data acquisition board by lines of CSV."""

    def __init__(self, port: Stream, address: str, rate: float, *, steady: Any = None) -> None:
        super().__init__(port, address, Board(rate), steady=steady)
        numbers = self._numbers("C", 4, PATIENCE)
        if numbers is None:
            text = f"{address}: the program does not answer C with counts, counts, volts and ms of its watchdog"
            raise DeviceError(f"{text}; docs/porting.md has its lines", code="no-answer")
        axis, wheel, limit, dog = numbers
        if not (0.0 < dog <= 1000 * WATCHDOG and axis >= 1.0 and wheel >= 0.0 and limit > 0.0):
            text = f"{address}: {axis:g} and {wheel:g} counts, {limit:g} V, a watchdog of {dog:g} ms; needed are counts"
            raise DeviceError(f"{text} of the axis, volts, and a watchdog of 1 to 100 ms", code="no-watchdog")
        firmware = zlib.crc32(f"swingid hil {VERSION}".encode())
        self.board = Board(rate, round(axis), round(wheel), limit, firmware)
        self.machine = Machine(self.board)
        self._tell("U,0", "E,0")

    def _read(self) -> Readings:
        numbers = self._numbers("R", 3)
        if numbers is None:
            return self._last._replace(valid=False)
        axis, wheel, current = numbers
        return self._now_at(axis / COUNTS, wheel / COUNTS, current)

    def _switch(self, on: bool) -> tuple[str, ...]:
        return "U,0", f"E,{int(on)}"

    def _torque(self, voltage: float) -> str:
        return f"U,{voltage:.6f}"


def _port(parts: Address, usual: int) -> Stream:
    from swingid.live.devices.serial_port import open_serial

    return open_serial(f"serial://{parts.target}?baud={parts.whole('baud', usual)}")


def open_odrive(address: str) -> ODrive:
    """``odrive://PORT?nm_per_volt=X``; UsageError for a bad address, DeviceError without port or watchdog."""
    parts = split_address(address)
    parts.require("baud", "rate", "limit", "nm_per_volt", "motor", "axis")
    motor, axis = parts.whole("motor", 0), parts.whole("axis", 1)
    if {motor, axis} != {0, 1}:
        text = f"{address!r}: motor and axis must be 0 and 1 or 1 and 0, the drive's sides"
        raise UsageError(text, code="bad-address")
    gain, board = gain_at(parts), board_at(parts)
    return ODrive(_port(parts, 115_200), address, board, nm_per_volt=gain, motor=motor, axis=axis)


def open_simplefoc(address: str) -> SimpleFoc:
    """``simplefoc://PORT``; UsageError for a bad address, DeviceError without port or watchdog."""
    parts = split_address(address)
    parts.require("baud", "rate", "limit")
    board = board_at(parts)
    return SimpleFoc(_port(parts, 1_000_000), address, board)


def open_hil(address: str) -> Hil:
    """``hil://HOST:PORT``; UsageError for a bad address, DeviceError where no such program or watchdog answers."""
    from swingid.live.devices.tcp import open_tcp

    parts = split_address(address)
    parts.require("rate")
    rate = board_at(parts).rate
    port = open_tcp(f"tcp://{parts.target}")
    port.address = address
    return Hil(port, address, rate)
