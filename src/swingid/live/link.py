"""A device's stream of bytes as frames: what goes out, what comes in.

Time is that of the stream: one that is virtual sets it, by its ``clock()`` or by how long it was read; for any other it
is the host's steady clock. Nothing here sleeps; time passes in ``read(timeout)``, or between the
turns of a `Pace`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from swingid.errors import DeviceError
from swingid.live.codes import StopMode
from swingid.live.devices.stream import Stream
from swingid.live.frames import Decoder, Frame, encode
from swingid.live.pace import Pace

TURN = 0.016
"""Longest wait for bytes (s): what a USB adapter needs at worst, and a sixth of the heartbeat's time."""

MOST_LOST = 0.2
"""Share of lost or damaged frames up to which a link is fit for a run, as `tests/live_faults.py` shows."""

HALTS = 3
"""How often a hard stop goes out that nobody waits for."""

Tap = Callable[[bool, float, bytes], None]
"""Called with (from the device, time of the link in s, bytes) for all bytes in both directions."""


class Link:
    """Frames over a stream. name: of the device, for messages. tap: sees every byte.

    pace: waits for the next turn of a loop at a fixed rate, in the place of the stream. each_turn: called at the
    beginning of each `exchange`; a SwingidError that it raises ends what goes on, and who runs the session then halts.
    """

    def __init__(self, stream: Stream, name: str | None = None, tap: Tap | None = None) -> None:
        self.stream, self.name, self.tap = stream, name or stream.address, tap
        self._passed = 0.0
        steady: Callable[[], float] = (lambda: self._passed) if stream.virtual else time.monotonic
        self.clock: Callable[[], float] = getattr(stream, "clock", steady)
        self.bytes_in = self.frames = 0
        self.pace: Pace | None = None
        self.each_turn: Callable[[], None] = lambda: None
        self._decoder = Decoder()

    @property
    def bad(self) -> int:
        """How many pieces of what came in were no frames."""
        return self._decoder.bad

    @property
    def lossy(self) -> bool:
        """Return whether more of what came in is damaged than a run can do with (`MOST_LOST`)."""
        return self.bad > MOST_LOST * (self.bad + self.frames)

    def exchange(self, out: bytes = b"", timeout: float = TURN) -> list[Frame]:
        """Send bytes, then the frames that come within `timeout` (s).

        Raises DeviceError where the connection has gone, and what `each_turn` raises.
        """
        self.each_turn()
        return self.turn(out, timeout)

    def turn(self, out: bytes, timeout: float) -> list[Frame]:
        """Take a turn as `exchange` does, without `each_turn`."""
        try:
            if out:
                self.stream.write(out)
                self._show(False, out)
            if self.pace is not None:
                self.pace.wait()
            data = self.stream.read(timeout if self.pace is None else 0.0)
            self._passed += timeout
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise self.lost(f"the connection has gone ({reason})") from None
        if not data:
            return []
        self.bytes_in += len(data)
        self._show(True, data)
        frames = self._decoder.feed(data)
        self.frames += len(frames)
        return frames

    def _show(self, came: bool, data: bytes) -> None:
        if self.tap is not None:
            self.tap(came, self.clock(), data)

    def send(self, name: str, timeout: float = TURN, **values: Any) -> list[Frame]:
        """One message, then the frames that come; raises as `exchange`."""
        return self.exchange(encode(name, **values), timeout)

    def halt(self, session: int, times: int = HALTS) -> None:
        """Send hard stops without waiting for an answer, and without `each_turn`; never raises."""
        with suppress(Exception):
            for _ in range(times):
                self.turn(encode("Stop", session=session, mode=StopMode.HARD), TURN)

    def lost(self, why: str) -> DeviceError:
        """The error of a link on which nothing comes."""
        text = f"{self.name}: {why}; its firmware gives 0 V without a host: look after cable and supply, connect again"
        return DeviceError(text, code="link-lost")
