"""The live rig: schema and frames of the link, the device's state machine and guard, the host's session and journal.

    with swingid.live.connect("twin://paper") as rig:
        log = rig.run("sine 0.8 rad 8.5 rad/s", duration=25)

`firmware/core` is the device in C99. Needs the packages of ``pip install 'swingid[live]'``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swingid.live.api import LiveRig as LiveRig
    from swingid.live.api import connect as connect

__all__ = ["LiveRig", "connect"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'swingid.live' has no attribute {name!r}")
    from swingid.live import api

    return getattr(api, name)
