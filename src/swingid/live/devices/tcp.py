"""``tcp://HOST:PORT``: a device behind a TCP port, such as `swingid emulate --tcp` or a serial port on a network."""

from __future__ import annotations

import select
import socket

from swingid.errors import DeviceError, UsageError
from swingid.live.devices.stream import Connection, gone, split_address

CONNECT_TIME, WRITE_TIME = 3.0, 1.0
"""Seconds to wait for a connection, and until what is sent has been taken."""
PIECE = 65536


class TcpDevice(Connection):
    """A connected socket as a device."""

    def __init__(self, connection: socket.socket, address: str) -> None:
        super().__init__(connection, address)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.settimeout(WRITE_TIME)

    def write(self, data: bytes) -> None:
        """Send bytes; DeviceError where the other side has gone or takes none."""
        with self.used(to_send=True) as connection:
            connection.sendall(data)

    def read(self, timeout: float = 0.0) -> bytes:
        """What has come, after at most `timeout` (s)."""
        with self.used() as connection:
            if not select.select([connection], [], [], max(timeout, 0.0))[0]:
                return b""
            data: bytes = connection.recv(PIECE)
        if not data:
            raise gone(self.address, "it closed the connection: perhaps another host uses it")
        return data


def open_tcp(address: str) -> TcpDevice:
    """Connect to ``tcp://HOST:PORT``; UsageError for another address, DeviceError where nothing answers."""
    parts = split_address(address)
    parts.require()
    host, _, port = parts.target.rstrip("/").rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise UsageError(f"{address!r} must be tcp://HOST:PORT, such as tcp://localhost:8765", code="bad-address")
    try:
        connection = socket.create_connection((host.strip("[]"), int(port)), CONNECT_TIME)
    except OSError as error:
        why = error.strerror or str(error)
        text = f"{address}: nobody answers there ({why}); is the device or swingid emulate running on that port?"
        raise DeviceError(text, code="no-device") from None
    return TcpDevice(connection, address)
