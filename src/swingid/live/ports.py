"""Where a host connects to an emulated device: a TCP port of this machine, or a pseudo terminal."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Protocol

from swingid.errors import DeviceError, UsageError

WAITING = 16384
"""Bytes of a host that a TCP port holds, as far as the system counts so; one that sends more has to wait."""


class Port(Protocol):
    """A place for one host at a time. address: what the host opens."""

    address: str

    def receive(self, most: int) -> bytes:
        """What the host has sent, `most` (1 or more) bytes of it, without waiting."""

    def send(self, data: bytes) -> None:
        """Bytes for the host; lost where they are not taken, as on a serial line."""

    def close(self) -> None:
        """Give the place up."""


class TcpPort:
    """A TCP port for hosts on this machine; a second host is turned away. number 0: any free port."""

    def __init__(self, number: int) -> None:
        try:
            self._listener = socket.create_server(("127.0.0.1", number), backlog=4)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or str(error)
            text = f"TCP port {number} can't be used ({why}); give another one by --tcp, 0 for any free one"
            raise DeviceError(text, code="busy") from None
        self._listener.setblocking(False)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WAITING)  # each connection has it from here
        self._host: socket.socket | None = None
        self.number = int(self._listener.getsockname()[1])
        self.address = f"tcp://localhost:{self.number}"

    def receive(self, most: int) -> bytes:
        """What the host has sent, `most` bytes of it, without waiting; connects and disconnects hosts."""
        self._connect()
        if self._host is None:
            return b""
        try:
            data = self._host.recv(most)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._leave()
        return data

    def _connect(self) -> None:
        with suppress(OSError):
            connection, _ = self._listener.accept()
            if self._host is not None:
                connection.close()
                return
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._host = connection

    def send(self, data: bytes) -> None:
        """Bytes for the host; lost where there is none or it does not read."""
        if self._host is None:
            return
        try:
            self._host.send(data)
        except BlockingIOError:
            return
        except OSError:
            self._leave()

    def _leave(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host = None

    def close(self) -> None:
        """Give the port up."""
        self._leave()
        self._listener.close()


class PtyPort:
    """A pseudo terminal, which a host opens as a serial port; UsageError on Windows, which has none."""

    def __init__(self) -> None:
        try:
            import pty
            import tty
        except ImportError:
            text = "this system has no pseudo terminals; use --tcp, or --tcp with a virtual COM port program"
            raise UsageError(text, code="no-pty") from None
        self._master, self._slave = pty.openpty()  # the slave stays open, so that a host may leave and come back
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.address = f"serial://{os.ttyname(self._slave)}"

    def receive(self, most: int) -> bytes:
        """What the host has sent, `most` bytes of it, without waiting."""
        try:
            return os.read(self._master, most)
        except OSError:
            return b""

    def send(self, data: bytes) -> None:
        """Bytes for the host; lost where they are not read."""
        with suppress(OSError):
            os.write(self._master, data)

    def close(self) -> None:
        """Give the terminal up: the host finds it unplugged."""
        os.close(self._master)
        os.close(self._slave)
