"""The digital twin sample by sample: what a device's encoders read, and the rig under the voltage it holds.

The kernels, draws and order of the closed loop of `swingid.simulation`, so that the same controller gives the same log
as `simulate`. One exception: a device can't wait for a reading, so an encoder that is read later than its sample
(`sensors.latency` above 0) is read at the sample.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import UsageError
from swingid.live.codes import apart
from swingid.live.guard import Board, Readings
from swingid.model.integrator import NOW, Q1, Q2, ROWS, STATES, STEP_KERNEL
from swingid.model.motion import COUNTS, FIELDS, LONGEST, advance
from swingid.model.parameters import OFFSET, vector
from swingid.model.sensors import encoder_reading
from swingid.model.sticking import BEGIN_KERNEL
from swingid.simulation import draws
from swingid.simulation.loop import before_start
from swingid.simulation.twin import own_limit

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array, Ints

IDEAL_COUNTS = 2**20
"""Counts per turn in the place of an encoder without resolution: 6e-6 rad, and 2000 turns before 32 bits wrap."""

SEEDS_APART = 1_000_003
"""Seeds of the following blocks of rows lie so far from one another."""


def board_of(rig: Rig, *, rate: float = 1000.0, firmware: int = 0) -> Board:
    """The device that a rig file describes.

    Raises UsageError for a rig without a voltage limit, which nothing could hold, and for a linear axis.
    """
    limit = own_limit(rig)
    if not math.isfinite(limit):
        message = f"rig {rig.name!r} gives no drive.motor.voltage_limit, without which no device drives it; add it"
        raise UsageError(message, code="no-voltage-limit")
    if rig.axis.kind != "rotary":
        raise UsageError(f"rig {rig.name!r} has a linear axis; a live rig turns", code="linear-axis")
    counts = []
    for channel in draws.CHANNELS:
        resolution = rig.sensors.of(channel).resolution
        counts.append(round(2 * math.pi / resolution) if resolution > 0.0 else IDEAL_COUNTS)
    wheel = counts[1] if rig.drive.wheel is not None else 0
    return Board(rate, counts[0], wheel, limit, firmware)


class Plant:
    """A rig that moves on by a sample whenever a voltage is held.

    seed, draw, initial_angle (rad), initial_speed (rad/s), encoder_zero (rad): as of `simulate`. rows: the random draws
    are made for so many rows at once, those of the first block are the draws of a simulation of that length. Public
    for faults: `values`, the vector of constants of `swingid.model.parameters`, and `push` (N m), a torque from
    outside.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        rate: float = 1000.0,
        rows: int = 60_000,
        seed: int = 0,
        draw: bool = False,
        initial_angle: float = 0.0,
        initial_speed: float = 0.0,
        encoder_zero: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.rig, self.rate, self.rows, self.seed = rig, rate, rows, seed
        self.push = 0.0
        self._made = draws.draw(rig, rows, seed, constants_too=draw, encoder_zero=encoder_zero)
        self.values = vector(self._made.values, rig.drive.channel)
        self._limit = own_limit(rig)
        self._encoders = [encoder.array() for encoder in self._made.encoders]
        self._steps = [encoder.resolution or 2 * math.pi / IDEAL_COUNTS for encoder in self._made.encoders]
        self._work = np.zeros((ROWS, STATES))
        self._work[NOW, :2] = initial_angle, initial_speed
        self._tried = LONGEST
        self._row = 0
        self._begin_block(0)

    @property
    def row(self) -> int:
        """How many samples have passed."""
        return self._row

    @property
    def time(self) -> float:
        """Time of the present sample (s)."""
        return self._row / self.rate

    @property
    def state(self) -> Array:
        """True state (5,): angle, speed, wheel angle, wheel speed, bristle; for tests and views, never for a device."""
        return np.array(self._work[NOW])

    def _begin_block(self, first: int) -> None:
        """Draw noise and reading times of the rows from `first` on."""
        made = self._made
        if first > 0:
            made = draws.draw(self.rig, self.rows, self.seed + SEEDS_APART * (first // self.rows))
        jitter = made.delays - np.array(made.latencies)[:, None]
        delays = np.minimum(jitter + np.array(self._made.latencies)[:, None], 0.0)
        self._first, self._noise = first, made.noise
        times = np.arange(first, first + self.rows) / self.rate
        self._late = bool(delays.any())
        self._instants, self._reads = np.zeros(0), np.zeros((2, 0), np.int64)
        if self._late:
            self._instants, places = np.unique(times + delays, return_inverse=True)
            self._reads = places.reshape(2, self.rows)
        self._seen: Array = np.zeros((len(self._instants), STATES))
        self._counts: Ints = np.zeros(COUNTS, np.int64)
        before_start(times[0], self._work, self._instants, self._seen, self._counts)

    def angles(self) -> tuple[float, float]:
        """Readings of both encoders (rad) at this sample, as the twin logs them."""
        k, t = self._row - self._first, self.time
        angles = []
        for i, place in enumerate((Q1, Q2)):
            q = self._work[NOW, place]
            if self._late and self._instants[self._reads[i, k]] < t:
                q = self._seen[self._reads[i, k], place]
            angles.append(encoder_reading(q, self._encoders[i], self._noise[i, k]))
        return angles[0], angles[1]

    def read(self) -> Readings:
        """Raw counts of both encoders at this sample, wrapping at 32 bits; the twin measures no current."""
        axis, wheel = (apart(round(angle / step), 0) for angle, step in zip(self.angles(), self._steps, strict=True))
        return Readings(axis, wheel)

    def hold(self, voltage: float) -> None:
        """Move on by a sample under a held voltage (V), which the rig's amplifier limits."""
        u = min(max(voltage, -self._limit), self._limit)
        offset = self.values[OFFSET]
        self.values[OFFSET] = offset - self.push  # a constant friction torque is an external one of opposite sign
        t, end = self._row / self.rate, (self._row + 1) / self.rate
        noted = self._instants, self._seen, np.zeros((0, FIELDS)), self._counts
        self._tried = advance(STEP_KERNEL, BEGIN_KERNEL, t, end, u, self._work, self._tried, self.values, *noted)
        self.values[OFFSET] = offset
        self._row += 1
        if self._row == self._first + self.rows:
            self._begin_block(self._row)
