"""From an address to a device: the schemes of this package, and those of others by the entry points `swingid.devices`.

An entry point is a function ``(address) -> Stream`` under the name of its scheme.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from typing import cast

from swingid.errors import UsageError
from swingid.live.devices.stream import Stream, split_address

GROUP = "swingid.devices"


SCHEMES = {
    "twin": "twin:open_twin",
    "serial": "serial_port:open_serial",
    "tcp": "tcp:open_tcp",
    "moteus": "moteus_drive:open_moteus",
    "odrive": "line_drives:open_odrive",
    "simplefoc": "line_drives:open_simplefoc",
    "hil": "line_drives:open_hil",
    "csv": "columns:open_columns",
    "can": "can_bus:open_can",
}
"""Schemes of this package: module of this folder and function, imported when such an address is opened."""

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
        module, _, name = SCHEMES[scheme].partition(":")
        return cast(Callable[[str], Stream], getattr(import_module(f"swingid.live.devices.{module}"), name))
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
