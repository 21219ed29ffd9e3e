"""From an address to a device: the schemes of this package, and those of others by the entry points `swingid.devices`.

An entry point is a function ``(address) -> Stream`` under the name of its scheme.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import cast

from swingid.errors import UsageError
from swingid.live.devices.stream import Stream, split_address

GROUP = "swingid.devices"


def _twin(address: str) -> Stream:
    from swingid.live.devices.twin import open_twin

    return open_twin(address)


def _serial(address: str) -> Stream:
    from swingid.live.devices.serial_port import open_serial

    return open_serial(address)


def _tcp(address: str) -> Stream:
    from swingid.live.devices.tcp import open_tcp

    return open_tcp(address)


def _moteus(address: str) -> Stream:
    from swingid.live.devices.moteus_drive import open_moteus

    return open_moteus(address)


def _odrive(address: str) -> Stream:
    from swingid.live.devices.line_drives import open_odrive

    return open_odrive(address)


def _simplefoc(address: str) -> Stream:
    from swingid.live.devices.line_drives import open_simplefoc

    return open_simplefoc(address)


def _hil(address: str) -> Stream:
    from swingid.live.devices.line_drives import open_hil

    return open_hil(address)


def _csv(address: str) -> Stream:
    from swingid.live.devices.columns import open_columns

    return open_columns(address)


def _can(address: str) -> Stream:
    from swingid.live.devices.can_bus import open_can

    return open_can(address)


SCHEMES: dict[str, Callable[[str], Stream]] = {
    "twin": _twin,
    "serial": _serial,
    "tcp": _tcp,
    "moteus": _moteus,
    "odrive": _odrive,
    "simplefoc": _simplefoc,
    "hil": _hil,
    "csv": _csv,
    "can": _can,
}
"""Schemes of this package; each imports what it needs when it is opened."""

_PORT = re.compile(r"/dev/\S+|COM\d+", re.IGNORECASE)


def open_device(address: str) -> Stream:
    """Connect to a device such as ``twin://paper``, ``serial:///dev/ttyACM0``, ``tcp://localhost:8765``.

    A bare port (``/dev/ttyACM0``, ``COM3``) is a serial one. Raises UsageError for an unknown scheme or option,
    DeviceError where nothing answers there.
    """
    if _PORT.fullmatch(address):
        address = f"serial://{address}"
    parts = split_address(address)
    return _opener(parts.scheme)(address)


def schemes() -> list[str]:
    """All schemes that are known, those of other packages too."""
    return sorted({*SCHEMES, *(point.name for point in entry_points(group=GROUP))})


def _opener(scheme: str) -> Callable[[str], Stream]:
    """The function that opens an address of this scheme."""
    if scheme in SCHEMES:
        return SCHEMES[scheme]
    for point in entry_points(group=GROUP, name=scheme):
        try:
            return cast(Callable[[str], Stream], point.load())
        except Exception as error:
            text = f"the package that offers {scheme}:// can't be loaded: {point.value}: {error}; update or remove it"
            raise UsageError(text, code="bad-plugin") from error
    known = schemes()
    near = difflib.get_close_matches(scheme, known, n=1)
    hint = f"did you mean {near[0]}://?" if near else "schemes are " + ", ".join(f"{name}://" for name in known)
    raise UsageError(f"no device has addresses of the scheme {scheme}://; {hint}", code="bad-address")
