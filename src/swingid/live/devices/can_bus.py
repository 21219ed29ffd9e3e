"""``can://CHANNEL?interface=socketcan``: a device on a CAN-FD bus, by python-can.

A message has the identifier and payload of the schema, unchanged. Towards the host it is a stream of frames as on a
serial line, so that a host has one decoder. Options: interface (of python-can, default socketcan), bitrate,
data_bitrate (bit/s, where the interface sets them itself).
"""

from __future__ import annotations

import time
from typing import Any

from swingid.errors import DeviceError, SwingidError, UsageError
from swingid.live.devices.stream import closed_error, gone, split_address, stuck
from swingid.live.frames import unwrap, wrap
from swingid.live.schema import missing_extra, schema

WRITE_TIME = 1.0
MOST = 256
"""Messages that one call of `read` returns at most."""


class CanDevice:
    """A bus of python-can as a device. from_host: this side is the host; False for tests, emulators."""

    virtual = False

    def __init__(self, bus: Any, address: str, *, from_host: bool = True) -> None:
        self.address = address
        self._bus: Any = bus
        self._rest = b""
        self._expected = {i for i, message in schema().by_id.items() if message.from_host != from_host}

    def write(self, data: bytes) -> None:
        """Send the frames that end in these bytes, each as a message; bytes that are no frame are left out."""
        import can

        bus = self._open()
        *ended, self._rest = (self._rest + data).split(b"\0")
        for encoded in ended:
            frame = unwrap(encoded) if encoded else None
            if frame is None:
                continue
            message = can.Message(
                arbitration_id=frame[0], data=frame[1], is_extended_id=False, is_fd=True, bitrate_switch=True
            )
            try:
                bus.send(message, timeout=WRITE_TIME)
            except (can.CanError, OSError) as error:
                full = "buffer" in str(error).lower() or isinstance(error, can.CanTimeoutError)
                raise stuck(self.address) if full else gone(self.address, error) from None

    def read(self, timeout: float = 0.0) -> bytes:
        """What has come, after at most `timeout` (s), as frames of a serial line; other messages are left out."""
        import can

        bus = self._open()
        data = b""
        until = time.monotonic() + max(timeout, 0.0)
        for _ in range(MOST):
            remaining = 0.0 if data else max(until - time.monotonic(), 0.0)
            try:
                message = bus.recv(remaining)
            except (can.CanError, OSError) as error:
                raise gone(self.address, error) from None
            if message is None:
                break
            plain = not (message.is_extended_id or message.is_error_frame or message.is_remote_frame)
            if plain and message.arbitration_id in self._expected:
                data += wrap(message.arbitration_id, bytes(message.data))
        return data

    def close(self) -> None:
        """Leave the bus."""
        if self._bus is not None:
            bus, self._bus = self._bus, None
            bus.shutdown()

    def _open(self) -> Any:
        if self._bus is None:
            raise closed_error(self.address)
        return self._bus


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
