"""``serial:///dev/ttyACM0``, ``serial://COM3``: a device on a serial port or a pseudo terminal, by serialx.

Option: ``?baud=1000000``; USB-CDC ports take any. The port is locked, and set to low latency where its driver can.
"""

from __future__ import annotations

import errno
import os
import sys
from typing import Any

from swingid.errors import DeviceError, SwingidError, UsageError
from swingid.live.devices.stream import Connection, split_address
from swingid.live.schema import missing_extra

BAUD = 1_000_000
WRITE_TIME = 1.0
PIECE = 65536


class SerialDevice(Connection):
    """An open serial port as a device. port: of serialx."""

    def __init__(self, port: Any, address: str) -> None:
        super().__init__(port, address, (Exception,))
        self._piece = bytearray(PIECE)

    def write(self, data: bytes) -> None:
        """Send bytes; DeviceError where the port has gone or takes none."""
        with self.used(to_send=True) as port:
            port.write(data, timeout=WRITE_TIME)

    def read(self, timeout: float = 0.0) -> bytes:
        """What has come, after at most `timeout` (s)."""
        with self.used() as port:
            count = port.readinto(self._piece, timeout=max(timeout, 0.0))
        return bytes(self._piece[: count or 0])


def open_serial(address: str) -> SerialDevice:
    """Open ``serial://PORT``; UsageError for a bad address, DeviceError where the port can't be used."""
    try:
        import serialx
    except ImportError:
        raise missing_extra("serialx") from None
    parts = split_address(address)
    parts.require("baud")
    baud = parts.whole("baud", BAUD)
    if not parts.target or baud <= 0:
        text = f"{address!r} must be serial://PORT, such as serial:///dev/ttyACM0 or serial://COM3?baud=115200"
        raise UsageError(text, code="bad-address")
    try:
        port = serialx.Serial(parts.target, baud)
        port.open()
    except Exception as error:
        raise _refused(address, parts.target, error) from None
    return SerialDevice(port, address)


def _refused(address: str, target: str, error: Exception) -> SwingidError:
    """Why a port can't be opened, with the remedy."""
    number = getattr(error, "errno", None)
    if isinstance(error, FileNotFoundError) or number in (errno.ENXIO, errno.ENODEV):
        listed = ", ".join(ports()) or "none"
        return DeviceError(f"{address}: there is no port {target}; ports here: {listed}", code="no-device")
    if isinstance(error, PermissionError) and sys.platform != "win32":
        command = f"sudo usermod -aG {group_of(target)} $USER"
        text = f"{address}: no permission for {target}; add yourself to its group: {command}"
        return DeviceError(f"{text}, then log in again", code="no-permission")
    if isinstance(error, PermissionError) or number in (errno.EBUSY, errno.EAGAIN):
        text = f"{address}: another program uses {target}; close it (a terminal, an IDE's serial monitor, another run)"
        return DeviceError(text, code="busy")
    if type(error).__name__ == "UnsupportedSetting":
        return UsageError(f"{address}: {str(error)[:1].lower()}{str(error)[1:]}; give another baud", code="bad-address")
    return DeviceError(f"{address}: {target} is no serial port that can be used: {error}", code="no-device")


def ports() -> list[str]:
    """Serial ports of this machine."""
    try:
        import serialx

        return sorted({str(port.device) for port in serialx.list_serial_ports()})
    except Exception:
        return []


def group_of(target: str) -> str:
    """Name of the group that may use a port."""
    try:
        import grp

        return str(grp.getgrgid(os.stat(target).st_gid).gr_name)
    except (ImportError, AttributeError, KeyError, OSError):
        return "dialout"
