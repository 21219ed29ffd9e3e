"""``can://CHANNEL?interface=socketcan``: a device on a CAN-FD bus, by python-can.

A message has the identifier and payload of the schema, unchanged. Towards the host it is a stream of frames as on a
serial line, so that a host has one decoder. Options: interface (of python-can, default socketcan), bitrate,
data_bitrate (bit/s, where the interface sets them itself).
"""

from __future__ import annotations

import time
from typing import Any

from swingid.errors import DeviceError, SwingidError, UsageError
from swingid.live.devices.stream import Connection, split_address
from swingid.live.frames import unwrap, wrap
from swingid.live.schema import missing_extra, schema

WRITE_TIME = 1.0
MOST = 256
"""Messages that one call of `read` returns at most."""


class CanBus(Connection):
    """A bus of python-can, with CAN-FD."""

    def __init__(self, bus: Any, address: str) -> None:
        import can

        super().__init__(bus, address, (can.CanError, OSError))

    def send(self, identifier: int, data: bytes, **timeout: float) -> None:
        """A message; timeout: seconds after which a bus that takes none is said to be stuck, without it to be gone."""
        import can

        message = can.Message(
            arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF, is_fd=True, bitrate_switch=True
        )
        with self.used(to_send=bool(timeout)) as bus:
            bus.send(message, **timeout)

    def recv(self, timeout: float) -> Any:
        """The next message, after at most `timeout` (s); None without one."""
        with self.used() as bus:
            return bus.recv(timeout)

    def is_full(self, error: Exception) -> bool:
        """Return whether a message was not taken, by the error of sending."""
        return super().is_full(error) or "buffer" in str(error).lower()

    def end(self, handle: Any) -> None:
        """Leave the bus."""
        handle.shutdown()


class CanDevice(CanBus):
    """A bus of python-can as a device. from_host: this side is the host; False for tests, emulators."""

    def __init__(self, bus: Any, address: str, *, from_host: bool = True) -> None:
        super().__init__(bus, address)
        self._rest = b""
        self._expected = {i for i, message in schema().by_id.items() if message.from_host != from_host}

    def write(self, data: bytes) -> None:
        """Send the frames that end in these bytes, each as a message; bytes that are no frame are left out."""
        *ended, self._rest = (self._rest + data).split(b"\0")
        for encoded in ended:
            frame = unwrap(encoded) if encoded else None
            if frame is not None:
                self.send(*frame, timeout=WRITE_TIME)

    def read(self, timeout: float = 0.0) -> bytes:
        """What has come, after at most `timeout` (s), as frames of a serial line; other messages are left out."""
        data = b""
        until = time.monotonic() + max(timeout, 0.0)
        for _ in range(MOST):
            message = self.recv(0.0 if data else max(until - time.monotonic(), 0.0))
            if message is None:
                break
            plain = not (message.is_extended_id or message.is_error_frame or message.is_remote_frame)
            if plain and message.arbitration_id in self._expected:
                data += wrap(message.arbitration_id, bytes(message.data))
        return data


def open_can(address: str) -> CanDevice:
    """Join the bus of ``can://CHANNEL?interface=...``; UsageError for a bad address, DeviceError without such a bus."""
    parts = split_address(address)
    parts.require("interface", "bitrate", "data_bitrate")
    if not parts.target:
        text = f"{address!r} must be can://CHANNEL?interface=NAME, such as can://can0?interface=socketcan"
        raise UsageError(text, code="bad-address")
    rates = {name: parts.whole(name, 0) for name in ("bitrate", "data_bitrate") if name in parts.options}
    return CanDevice(join_bus(address, parts.target, parts.options.get("interface", "socketcan"), **rates), address)


def join_bus(address: str, channel: str, interface: str, **rates: int) -> Any:
    """A CAN-FD bus of python-can; rates: bitrate and data_bitrate. Errors as `open_can`."""
    try:
        import can
    except ImportError:
        raise missing_extra("python-can") from None
    if interface not in can.VALID_INTERFACES:
        text = f"{address!r}: python-can has no interface {interface}; it has {', '.join(sorted(can.VALID_INTERFACES))}"
        raise UsageError(text, code="bad-address")
    try:
        return can.Bus(channel=channel, interface=interface, fd=True, **rates)
    except Exception as error:
        raise _refused(address, interface, error) from None


def _refused(address: str, interface: str, error: Exception) -> SwingidError:
    """Why a bus can't be joined, with the remedy."""
    if interface == "socketcan":
        remedy = "bring it up: ip link set can0 up type can bitrate 1000000 dbitrate 5000000 fd on"
    else:
        remedy = "check adapter, driver and channel; the interface must do CAN-FD"
    return DeviceError(f"{address}: no CAN bus there ({error}); {remedy}", code="no-device")
