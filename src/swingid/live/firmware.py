"""Images of the firmware that the package ships, and which of them a device states in Hello.

An image states the CRC-32 of its own bytes, which the journal of a run records.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cache

from swingid.errors import UsageError
from swingid.live.native import sources


@dataclass(frozen=True)
class Timing:
    """When a board samples and acts (s), against the begin of a sample.

    axis, wheel: end of the frame that reads this encoder. voltage: where the voltage begins. age: of the angle that an
    encoder gives at the end of its frame. unsure: standard uncertainty of a reading's instant; jitter: its standard
    deviation from sample to sample.
    """

    axis: float
    wheel: float
    voltage: float
    age: float
    unsure: float
    jitter: float

    def latency(self, channel: str) -> str:
        """Instant of a reading of "axis" or "wheel" less that of the voltage, as `sensors.latency` states it."""
        read = self.axis if channel == "axis" else self.wheel
        return f"{1e3 * (read - self.age - self.voltage):.3f} ± {1e3 * self.unsure:g} ms"


IMAGES = {"nucleo": Timing(axis=6e-6, wheel=13e-6, voltage=115e-6, age=145e-6, unsure=3e-5, jitter=2.6e-5)}
"""Boards with an image, see `firmware/README.md`; their instants are those that `tests/firmware/test_nucleo.py` counts.

An AS5048A needs 0.1 ms for an angle and makes one every 0.09 ms by its own clock (data sheet: propagation delay,
sampling rate), so the one that is read is 0.1 to 0.19 ms old, each alike. Its delay differs by 10 % from part to part.
"""


def image(board: str) -> bytes:
    """The image of a board, as it is written to its flash; UsageError where there is none."""
    if board not in IMAGES:
        raise UsageError(f"there is no image for {board!r}; boards: {', '.join(IMAGES)}", code="no-image")
    folder = sources()
    if folder is None:
        raise UsageError("the firmware's files are not installed; install swingid again", code="no-image")
    return (folder / "images" / f"{board}.bin").read_bytes()


@cache
def _known() -> dict[int, str]:
    return {zlib.crc32(image(board)): board for board in IMAGES} if sources() is not None else {}


def timing(firmware: int) -> Timing | None:
    """The timing of a firmware that is an image of this version, for controllers of order 0 and 1; else None."""
    board = _known().get(firmware)
    return None if board is None else IMAGES[board]


def named(firmware: int) -> str:
    """The hash of a firmware in words: with its board where it is an image of this version."""
    board = _known().get(firmware)
    return f"{firmware:08x}" + (f" (the image {board} of this version)" if board else "")
