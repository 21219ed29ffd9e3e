"""``csv://PATH_OR_PORT``: a program or board that prints columns of numbers; nothing can be sent to it.

``csv:///dev/ttyACM0?baud=115200`` and ``csv://COM3`` are serial ports, any other path a file that grows. `record` of
`live/record.py` makes a log of it.
"""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import IO

from swingid.errors import DeviceError, UsageError
from swingid.live.devices.serial_port import SerialDevice, open_serial
from swingid.live.devices.stream import Connection, split_address

BAUD = 115200
"""What sketches use; ports over USB take any."""

LOOK = 0.02
"""Seconds between two looks at a file."""

PIECE = 1 << 16
_PORT = re.compile(r"/dev/(tty|cu|serial|pts)\S*|COM\d+", re.IGNORECASE)


class PassiveDevice(Connection):
    """What prints columns, as a stream of its bytes; `write` is refused. path: of the file, empty for a port."""

    passive = True

    def __init__(self, source: SerialDevice | IO[bytes], address: str, path: str = "") -> None:
        super().__init__(source, address)
        self.path = path

    def write(self, data: bytes) -> None:
        """Nothing can be sent: UsageError."""
        del data
        text = f"{self.address} only prints: nothing can be sent to it; record it with swingid record"
        raise UsageError(text, code="passive")

    def read(self, timeout: float = 0.0) -> bytes:
        """What has come, after at most `timeout` (s); DeviceError where the port or file has gone."""
        until = time.monotonic() + timeout
        with self.used() as source:
            if isinstance(source, SerialDevice):
                return source.read(timeout)
            while True:
                data: bytes = source.read(PIECE) or b""
                remaining = until - time.monotonic()
                if data or remaining <= 0.0:
                    return data
                time.sleep(min(LOOK, remaining))


def open_columns(address: str) -> PassiveDevice:
    """Open ``csv://PATH_OR_PORT``; UsageError for a bad address, DeviceError where there is no such port or file."""
    parts = split_address(address)
    parts.require("baud")
    if not parts.target:
        text = f"{address!r} must be csv://PATH or csv://PORT, such as csv:///dev/ttyACM0?baud=115200"
        raise UsageError(text, code="bad-address")
    if _PORT.fullmatch(parts.target):
        port = open_serial(f"serial://{parts.target}?baud={parts.whole('baud', BAUD)}")
        port.address = address
        return PassiveDevice(port, address)
    if "baud" in parts.options:
        raise UsageError(f"{address!r}: a file has no baud; leave it out", code="bad-address")
    try:
        return PassiveDevice(Path(parts.target).open("rb"), address, parts.target)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        text = f"{address}: there is no such file or port ({why}); start the program that prints, then record"
        raise DeviceError(text, code="no-device") from None
