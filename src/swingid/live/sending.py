"""The reference on its way to the device: blocks as there is room, again where an answer shows that one was lost."""

from __future__ import annotations

from swingid.live.codes import Status
from swingid.live.ends import refusal_words
from swingid.live.frames import Frame, encode

BLOCK, WINDOW, PER_TURN = 14, 36, 12
"""Reference samples in a message; messages without an answer at most, a device holds the answers to forty; messages in
one turn.
"""

RETRY = 0.06
"""Seconds until reference, Run or Stop are sent again."""

AGAIN = 2
"""How often a message goes out at once that must not keep step with a link that loses every n-th frame."""


class Sending:
    """The state of sending the reference. accepted: samples that the device has acknowledged; advanced: when it last
    did (s).

    room: samples of the reference that the device holds.
    """

    def __init__(self, number: int, reference: list[float], room: int, now: float) -> None:
        self._number, self._reference, self._room = number, reference, room
        self.accepted = self._sent = self._most = 0
        self.advanced = self._moved = now
        self._back = -1
        self._answer: Frame | None = None
        self.messages = 0

    def __len__(self) -> int:
        return len(self._reference)

    @property
    def primed(self) -> bool:
        """Return whether the device holds all that it can, or the whole reference."""
        return self.accepted >= min(len(self._reference), self._room - 2 * BLOCK)

    def blocks(self, now: float, used: int) -> bytes:
        """The next messages, from where the device wants them; used: samples that it has followed already."""
        times = 1
        if self._sent > self.accepted and now - self._moved >= RETRY:
            self._sent, self._moved, times = self.accepted, now, AGAIN
        out = b""
        for _ in range(PER_TURN):
            part = self._reference[self._sent : self._sent + BLOCK]
            room = self._room - (self._sent - min(used, self.accepted))
            if not part or len(part) > room or self._sent - self.accepted >= WINDOW * BLOCK:
                break
            ends = self._sent + len(part) >= len(self._reference)
            values = {"start": self._sent, "count": len(part), "last": int(ends), "session": self._number}
            out += encode("Reference", value=tuple(part), **values) * times
            self.messages += times
            times = 1
            if self._sent == self.accepted:
                self._moved = now
            self._sent += len(part)
            self._most = max(self._most, self._sent)
        return out

    def acknowledge(self, ack: Frame, now: float) -> str:
        """Take an answer to Reference; what contradicts the protocol in words, "" for nothing."""
        if ack.status != Status.WRONG_STATE or self._answer is None:  # one of after the run says nothing
            self._answer = ack
        if ack.status not in (Status.DONE, Status.GAP, Status.FULL):
            return ""
        if ack.next > self._most:
            return f"acknowledges {ack.next} samples of the reference where {self._most} were sent"
        if ack.next > self.accepted:
            self.accepted, self.advanced, self._moved = ack.next, now, now
            self._sent = max(self._sent, self.accepted)
        if ack.status == Status.GAP and self._back != self.accepted and ack.next == self.accepted:
            self._sent = self._back = self.accepted
        return ""

    def obstacle(self) -> str:
        """Why the device takes no more of the reference, in words, from its last answer."""
        ack = self._answer
        if ack is None:
            return "does not take the reference: no answer to Reference"
        if ack.status == Status.FULL or (ack.status == Status.DONE and not ack.value):
            return f"says it has no room for the reference ({ack.value} of {self._room} samples, {self.accepted} taken)"
        if ack.status in (Status.DONE, Status.GAP):
            return f"does not take the reference: it wants sample {ack.next} where {self.accepted} were acknowledged"
        return f"does not take the reference: {refusal_words(ack.status)}"
