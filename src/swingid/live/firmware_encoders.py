"""Both encoders of a new rig, turned by hand with the motor off: the first step of bringing a board up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import DeviceError
from swingid.live.codes import Flag
from swingid.live.firmware import named
from swingid.live.rest import counts_of

if TYPE_CHECKING:
    from swingid.live.frames import Frame
    from swingid.live.guard import Board
    from swingid.live.session import Session

TURNED = 30.0
"""Degrees that count as turned by hand: far above a touch, and less than the body swings in any run."""

JUMP = 0.25
"""Turns between two samples from which a reading is no motion: 90 000 degrees per second at 1 kHz, no hand's."""


@dataclass(frozen=True)
class Turned:
    """What an encoder saw: range of its angle (degrees), the last angle, its largest step from sample to sample."""

    name: str
    range: float
    last: float
    step: float


def by_hand(
    session: Session, *, seconds: float = 20.0, progress: Callable[[str], None] = lambda _: None
) -> list[Turned]:
    """Listen to both encoders for `seconds` without ever arming the device, with a line a second.

    Raises DeviceError (code "no-readings") where samples have no reading, (code "not-turned") where an encoder has not
    seen 30 degrees, (code "jumps") where its angle jumps.
    """
    board = session.connect()
    session.require_ready()
    progress(f"firmware {named(board.firmware)}; turn body and wheel by hand, each forth and back")
    frames: list[Frame] = []
    for second in range(1, round(seconds) + 1):
        part = session.listen(1.0)
        frames += part
        said = ", ".join(f"{encoder.name} {encoder.last:+.1f} deg" for encoder in _turned(frames, board))
        progress(f"{second:2d} s: {said}, {_missing(part)} of {len(part)} samples without a reading")
    turned = _turned(frames, board)
    _require(frames, turned)
    return turned


def _missing(frames: list[Frame]) -> int:
    return sum(bool(frame.flags & Flag.INVALID) for frame in frames)


def _turned(frames: list[Frame], board: Board) -> list[Turned]:
    """What each encoder saw in samples that have a reading."""
    used = [frame for frame in frames if not frame.flags & Flag.INVALID]
    if len(used) < 2:
        return []
    _, axis, wheel, _ = counts_of(used)
    parts = [("axis", axis, board.axis_counts)] + [("wheel", wheel, board.wheel_counts)] * bool(board.wheel_counts)
    return [
        Turned(
            name,
            float(np.ptp(counts)) * 360 / turn,
            float(counts[-1] - counts[0]) * 360 / turn,
            float(np.abs(np.diff(counts)).max()) / turn,
        )
        for name, counts, turn in parts
    ]


def _require(frames: list[Frame], turned: list[Turned]) -> None:
    """Raise DeviceError for encoders that a run could not trust."""
    missing = _missing(frames)
    if missing:
        text = f"{missing} of {len(frames)} samples have no reading: an encoder is not plugged in, a wire is loose or "
        raise DeviceError(text + "long, or its magnet is missing, too far or too near", code="no-readings")
    for encoder in turned:
        if encoder.step > JUMP:
            text = f"the angle of the {encoder.name} jumps by {encoder.step:.2g} turns between two samples; "
            text += "look after its wires"
            raise DeviceError(text, code="jumps")
        if encoder.range < TURNED:
            text = f"the {encoder.name} has turned by {encoder.range:.2g} deg; turn it by {TURNED:g} at least: "
            text += "else its magnet does not turn with it, or both encoders' selects are wired alike"
            raise DeviceError(text, code="not-turned")
