"""What every device is to a host: a stream of bytes with an address."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol
from urllib.parse import parse_qsl, unquote

from swingid.errors import DeviceError, UsageError


class Stream(Protocol):
    """A connection to a device.

    virtual: time passes only while the host reads, so a host must not wait by its own clock. address: as it was given.
    """

    virtual: bool
    address: str

    def write(self, data: bytes) -> None:
        """Send bytes; DeviceError where the device takes none."""

    def read(self, timeout: float = 0.0) -> bytes:
        """What has come, after at most `timeout` (s); DeviceError where the device has gone."""

    def close(self) -> None:
        """End the connection; a second call does nothing."""


class Connection:
    """A port, a socket or a bus, until it is closed. handle: of its package; failures: errors by which it has gone."""

    virtual = False

    def __init__(self, handle: Any, address: str, failures: tuple[type[Exception], ...] = (OSError,)) -> None:
        self.address = address
        self._handle, self._failures = handle, failures

    @contextmanager
    def used(self, *, to_send: bool = False) -> Iterator[Any]:
        """The handle. What fails in it is a DeviceError: the device has gone, or takes nothing that is sent to it."""
        self.require_open()
        try:
            yield self._handle
        except self._failures as error:
            raise stuck(self.address) if to_send and self.is_full(error) else gone(self.address, error) from None

    def require_open(self) -> None:
        """Raise UsageError where it is closed."""
        if self._handle is None:
            raise closed_error(self.address)

    def is_full(self, error: Exception) -> bool:
        """Return whether it has taken nothing for too long, by the error of sending."""
        return isinstance(error, TimeoutError)

    def close(self) -> None:
        """End it; a second call does nothing."""
        if self._handle is not None:
            handle, self._handle = self._handle, None
            self.end(handle)

    def end(self, handle: Any) -> None:
        """Give the handle back."""
        handle.close()


@dataclass(frozen=True)
class Address:
    """An address ``SCHEME://TARGET?NAME=VALUE&...`` in its parts."""

    text: str
    scheme: str
    target: str
    options: Mapping[str, str]

    def number(self, name: str, default: float) -> float:
        """The value of an option that is a number; UsageError for other words."""
        try:
            return float(self.options.get(name, default))
        except ValueError:
            text = f"{self.text!r}: {name} must be a number, not {self.options[name]!r}"
            raise UsageError(text, code="bad-address") from None

    def whole(self, name: str, default: int) -> int:
        """The value of an option that is a whole number; UsageError for another."""
        value = self.number(name, default)
        if value != int(value) if abs(value) < 2.0**53 else True:
            raise UsageError(f"{self.text!r}: {name} must be a whole number", code="bad-address")
        return int(value)

    def require(self, *offered: str) -> None:
        """UsageError for an option that is not among those offered."""
        for name in self.options:
            if name not in offered:
                these = ", ".join(offered) or "none"
                raise UsageError(f"{self.text!r}: {name} is not offered; options are {these}", code="bad-address")


def split_address(address: str) -> Address:
    """The parts of an address; UsageError for one without a scheme."""
    scheme, separator, rest = address.partition("://")
    if not separator or not scheme:
        text = f"{address!r} is no address of a device, which is SCHEME://..., such as twin://paper"
        raise UsageError(text, code="bad-address")
    target, _, query = rest.partition("?")
    return Address(address, scheme.lower(), unquote(target), dict(parse_qsl(query, keep_blank_values=True)))


def closed_error(address: str) -> UsageError:
    """The error of a device that this program has closed."""
    return UsageError(f"{address}: this device is closed; connect again", code="closed")


def gone(address: str, error: object = "") -> DeviceError:
    """The error of a device that is no longer there."""
    why = (isinstance(error, OSError) and error.strerror) or error
    because = f" ({why})" if str(why) else ""
    return DeviceError(f"{address}: the device has gone{because}; check cable and supply, connect again", code="gone")


def stuck(address: str) -> DeviceError:
    """The error of a device that takes no bytes any more."""
    text = f"{address}: the device takes nothing that is sent to it; check its supply, connect again"
    return DeviceError(text, code="no-answer")
