"""Rows of a stream as plain numbers: from tuples or Recordings; what cannot be used is left out and counted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite

from swingid.errors import InputError
from swingid.recording.recording import Recording

Row = tuple[float, float, float, float]
"""Time (s), angle, wheel angle, voltage or torque; 0 for a channel that the method does not use."""

TOO_MANY_BAD = 1000
"""Rows in succession without one that can be used, after which the stream is refused."""

NAMES = ("time", "angle", "wheel_angle", "voltage or torque")


@dataclass
class Reader:
    """Reads the rows of a stream and counts those left out.

    needed: which of time, angle, wheel angle, drive must be there; the others are not looked at. Rows with NaN or
    infinity in one of them, and rows whose time does not increase, are left out; anything that is no row, also one with
    more numbers, raises InputError.
    """

    needed: tuple[bool, bool, bool, bool]
    skipped: int = 0
    held: bool = True

    def rows(self, samples: Iterable[object] | Recording) -> Iterator[Row]:
        """The usable rows of `samples`: tuples (t, angle, wheel_angle, voltage or torque), or Recordings, or one."""
        last, bad, number = -float("inf"), 0, 0
        for plain in self._plain(samples):
            number += 1
            row = self._row(plain, number)
            if row is not None and row[0] > last:
                last, bad = row[0], 0
                yield row
                continue
            self.skipped += 1
            bad += 1
            if bad > TOO_MANY_BAD:
                why = "NaN or infinity" if row is None else f"a time that does not rise above {last:g} s"
                raise InputError(
                    f"row {number} of the stream: the {bad}th in succession with {why}; mend the source.",
                    code="bad-stream",
                )

    def _plain(self, samples: Iterable[object] | Recording) -> Iterator[object]:
        try:
            stream = iter((samples,) if isinstance(samples, Recording) else samples)
        except TypeError:
            text = f"samples are rows (time, angle, wheel_angle, voltage or torque) or Recordings, not {samples!r:.60}."
            raise InputError(text, code="bad-stream") from None
        for sample in stream:
            if not isinstance(sample, Recording):
                yield sample
                continue
            self.held = sample.drive_held
            drive = sample.torque if sample.voltage is None else sample.voltage
            channels = [sample.time, sample.angle, sample.wheel_angle, drive]
            yield from zip(*([None] * len(sample) if c is None else c.tolist() for c in channels), strict=True)

    def _row(self, sample: object, number: int) -> Row | None:
        """The row as four numbers, None where a needed one is not finite."""
        try:
            given: tuple[float, ...] = tuple(sample)  # type: ignore[arg-type]
            if len(given) > len(NAMES):
                raise ValueError
            values = [float(given[k]) if needed else 0.0 for k, needed in enumerate(self.needed)]
        except (TypeError, ValueError, IndexError):
            wanted = [name for name, needed in zip(NAMES, self.needed, strict=True) if needed]
            raise InputError(
                f"row {number} of the stream is {sample!r:.60}; write (time, angle, wheel_angle, voltage or torque), "
                f"numbers for {', '.join(wanted)}, and None for a channel that the rig does not have.",
                code="bad-row",
            ) from None
        return (values[0], values[1], values[2], values[3]) if all(map(isfinite, values)) else None
