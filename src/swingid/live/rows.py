"""From frames of a run to rows of a log: device time and counts without their wraps, in SI and the model's signs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from swingid.control import law
from swingid.live import guard as at
from swingid.live.codes import Flag, State, Status, apart
from swingid.live.frames import Frame
from swingid.live.schema import schema


class Row(NamedTuple):
    """One sample of a run: time since reference 0 (s), angle and wheel angle (rad, model's signs; None without a
    wheel), voltage held from it on (V), gain of the controller, reference (rad, None where it is not known).

    flags: why its readings are not to be used, then both angles are None; None where they are.
    """

    t: float
    q1: float | None
    q2: float | None
    u: float
    k: float
    ym: float | None
    flags: int | None = None


UNUSED = Flag.INVALID | Flag.LATE
"""Flags of a sample whose readings are not those of its instant: an encoder gave none, or the sample came late."""


class Unwrapped:
    """A counter of 32 bits as a whole number that goes on."""

    def __init__(self) -> None:
        self.value: int | None = None

    def __call__(self, raw: int) -> int:
        """The number behind the next reading."""
        if self.value is None:
            self.value = raw
        else:
            self.value += apart(raw, self.value)
        return self.value


@dataclass
class Rows:
    """Rows of the running state, in the order of their sequence; others, and samples that come twice, are left out.

    parameters: those of the device (`guard.parameters_of`), for steps, signs and zero. reference: what was sent (rad).
    lost: samples of the run that did not come.
    """

    parameters: list[float]
    reference: list[float] = field(default_factory=list)
    start: int | None = None
    lost: int = 0
    _time: Unwrapped = field(default_factory=Unwrapped)
    _axis: Unwrapped = field(default_factory=Unwrapped)
    _wheel: Unwrapped = field(default_factory=Unwrapped)
    _sequence: Unwrapped = field(default_factory=Unwrapped)
    _first: int | None = None
    _waiting: list[Frame] = field(default_factory=list)

    def feed(self, frames: Iterable[Frame]) -> list[Row]:
        """The rows of these frames; those that come before Run's answer wait for it."""
        rows = []
        for frame in frames:
            if frame.name == "Ack" and frame.message == schema().by_name["Run"].id and frame.status == Status.DONE:
                self.start = frame.value if self.start is None else self.start
            elif frame.name == "Sample":
                self._waiting.append(frame)
        if self.start is not None or len(self._waiting) > 5000:
            for frame in self._waiting:
                if (row := self._row(frame)) is not None:
                    rows.append(row)
            self._waiting.clear()
        return rows

    def _row(self, frame: Frame) -> Row | None:
        before = self._sequence.value
        if before is not None and apart(frame.sequence, before) <= 0:
            return None
        sequence, time = self._sequence(frame.sequence), self._time(frame.time)
        axis, wheel = self._axis(frame.axis), self._wheel(frame.wheel)
        if frame.state != State.RUNNING or self.start is None:
            return None
        number = apart(frame.sequence, self.start)
        if number < 0:
            return None
        if self._first is None:
            self._first = time - round(number * 1e6 / (1.0 / self.parameters[at.CONTROLLER + law.SAMPLE_TIME]))
            self.lost += number
        elif before is not None:
            self.lost += sequence - before - 1
        p, unused = self.parameters, int(frame.flags & UNUSED)
        return Row(
            t=(time - self._first) * 1e-6,
            q1=None if unused else (axis - int(p[at.AXIS_ZERO])) * p[at.AXIS_STEP],
            q2=wheel * p[at.WHEEL_STEP] if p[at.WHEEL_STEP] and not unused else None,
            u=frame.voltage * p[at.VOLTAGE_SIGN],
            k=frame.gain,
            ym=self.reference[number] if number < len(self.reference) else None,
            flags=unused or None,
        )
