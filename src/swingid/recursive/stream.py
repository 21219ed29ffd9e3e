"""Entry points: `online` for a stream, `swing_estimates` for a log, `Estimator` for rows as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders, corrected
from swingid.preparation.motion import Motion, find_motion, grid_step, sample_noise
from swingid.preparation.noise import Noise, channel_noise
from swingid.preparation.scale import equation_of, refuse_motor, refuse_rates, require_motor
from swingid.recording.recording import Recording
from swingid.recursive.blocks import Block, energy_block, momentum_block
from swingid.recursive.rows import Reader, Row, SwingBuffer
from swingid.recursive.solution import Recursion, SwingEstimate

Maker = Callable[[Recording, Rig, Equation, Noise, Motion, Encoders, int], Block | None]

MAKERS: dict[str, Maker] = {"momentum": momentum_block, "energy": energy_block}
"""Of each method that is `online`: from the rows of a swing to its block of equations."""

FIRST = 4
"""Swings before the first estimate."""

WARM = 200
"""Rows at the start of a stream from which its noise is estimated."""

NOISES = 10.0
"""Standard deviations of noise, and steps of the encoder, that a swing must exceed."""


def online(samples: Iterable[object] | Recording, rig: Rig, method: str = "momentum") -> Iterator[SwingEstimate]:
    """One estimate per swing of a stream, each as soon as the swing after it has turned around.

    Unlike `identify` it uses every swing, also those of the transient, and its uncertainty contains only the scatter of
    the swings, the timing of the turning points and what rig.toml declares: for the record, identify the log. It stores
    two swings of rows and sums of fixed size at any length.

    Parameters
    ----------
    samples : rows (t, angle, wheel_angle, voltage or torque), or Recordings
        In the units and conventions of a Recording (s, rad or m, V, N m or N; wheel relative to the pendulum; a held
        voltage or torque acts from its row to the next). A channel that the rig does not have is None, or absent at
        the end of a row; a value in its place is ignored. Rows with NaN and rows out of order are excluded and counted.
    rig : Rig
        As of `identify`.
    method : "momentum" or "energy"
        As of `identify`.

    Raises
    ------
    UsageError
        Another method.
    InputError
        Samples that are no rows, a wheel of the wrong sign.
    UnanswerableError
        The stream ends without enough swings.

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper")
    >>> log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=15, seed=1)
    >>> *_, last = sw.online(log, rig)
    >>> f"{last.inertia.value:.3g}"
    '0.00302'
    """
    if isinstance(samples, Rig):  # the order of arguments before version 1
        samples, rig = rig, samples
    estimator = Estimator(rig, method)
    for block in estimator.swings.blocks(samples):
        yield from estimator.add(block)
    if estimator.recursion is None:
        raise UnanswerableError(
            f"the stream ended after {len(estimator.waiting)} whole swings, at least {FIRST} are needed; record a "
            "longer run.",
            code="too-short",
        )


def swing_estimates(log: Recording, rig: Rig, method: str = "momentum") -> list[SwingEstimate]:
    """The estimates of `online` for a whole log."""
    return list(online(log, rig, method))


class Estimator:
    """`online` for rows that are handed over as they come: `push` them, in any portions.

    Raises as `online` does; too few swings are no error here.
    """

    def __init__(self, rig: Rig, method: str = "momentum") -> None:
        self.swings = Swings(rig, method)
        self.recursion: Recursion | None = None
        self.waiting: list[Block] = []

    def push(self, samples: Iterable[object]) -> list[SwingEstimate]:
        """The estimates that further rows give: (t, angle, wheel_angle, voltage or torque), as of `online`."""
        rows = list(self.swings.reader.rows(samples))
        return [estimate for block in self.swings.blocks_of(rows) for estimate in self.add(block)]

    def add(self, block: Block) -> Iterator[SwingEstimate]:
        """The estimate after one more swing; none before there are enough."""
        swings = self.swings
        if self.recursion is None:
            self.waiting.append(block)
            if len(self.waiting) < FIRST:
                return
            self.recursion = Recursion.of(self.waiting, swings.equation, swings.noise)
            for early in self.waiting[:-1]:
                self.recursion.add(early)
            self.waiting.clear()
        self.recursion.add(block)
        relative = swings.rig.axis.model_uncertainty
        estimate = self.recursion.estimate(block, relative, swings.reader.skipped, swings.lost)
        _check_sign(estimate)
        yield estimate


class Swings:
    """Makes blocks of rows: reading, cutting into pieces, the balance of each.

    without: turning points whose piece gave no block. noise: of the channels, from the first piece.
    """

    noise: Noise

    def __init__(self, rig: Rig, method: str) -> None:
        if method not in MAKERS:
            raise UsageError(
                f"online knows no method {method!r}; choose one of {', '.join(MAKERS)}.", code="unknown-method"
            )
        refuse_motor(rig, "online")
        refuse_rates(rig, "a stream")
        self.rig, self.method, self.equation = rig, method, equation_of(rig)
        wheel = rig.drive.wheel is not None
        self.reader = Reader((True, True, wheel, rig.drive.channel == "torque" or (wheel and method == "energy")))
        self.without = 0
        self._buffer: SwingBuffer | None = None
        self._early: list[Row] = []
        self._shrinking = False

    def blocks(self, samples: Iterable[object] | Recording) -> Iterator[Block]:
        """The blocks of a stream, one per turning point that has a whole swing on both sides."""
        yield from self.blocks_of(self.reader.rows(samples))
        if self._buffer is None and self._early:  # fewer rows than the noise is estimated from
            yield from self._begun()

    def blocks_of(self, rows: Iterable[Row]) -> Iterator[Block]:
        """The blocks that further rows complete; the first rows wait until there are enough for their noise."""
        for row in rows:
            if self._buffer is not None:
                yield from self._pushed(self._buffer, row)
                continue
            self._early.append(row)
            if len(self._early) == WARM:
                yield from self._begun()

    def _begun(self) -> Iterator[Block]:
        """The blocks of the first rows, from which the least swing follows that is no noise."""
        sensor, angle = Encoders.of(self.rig).angle, np.array(self._early)[:, 1]
        # well above noise and steps of the angle, as declared or as estimated
        noise = max(sensor.noise, sample_noise(angle), sensor.resolution / 4, grid_step(angle) / 4, 1e-9)
        self._buffer = SwingBuffer(NOISES * noise)
        for row in self._early:
            yield from self._pushed(self._buffer, row)
        self._early = []

    def _pushed(self, buffer: SwingBuffer, row: Row) -> Iterator[Block]:
        """The block that a row completes, if any; a piece without one is counted."""
        piece = buffer.push(row)
        if piece is None:
            return
        block = self._block(*piece)
        self.without += block is None
        if block is not None:
            yield block

    @property
    def lost(self) -> int:
        """Turning points without a block so far."""
        return self.without + (self._buffer.lost if self._buffer is not None else 0)

    def _block(self, piece: Array, middle: float) -> Block | None:
        """The block around the turning point near `middle` (s), None where there is none."""
        log, encoders, _ = corrected(self._recording(piece), self.rig)
        if not hasattr(self, "noise"):
            if self.method == "energy":
                require_motor(log, self.rig, self.equation, self.method)
            self.noise = channel_noise(log, self.rig)
        steps = np.diff(log.time)
        try:
            motion = find_motion(log.time, log.angle, self.noise.angle)
        except UnanswerableError:
            return None
        turning = motion.turning_times
        at = int(np.argmin(np.abs(turning - middle))) if len(turning) else 0
        if not 1 <= at <= len(turning) - 2:
            return None
        longest = max(4.5 * float(np.median(steps)), 0.05 * motion.half_period)
        if steps.max() > longest or not self._left_alone(motion, at):
            return None
        return MAKERS[self.method](log, self.rig, self.equation, self.noise, motion, encoders, at)

    def _left_alone(self, motion: Motion, at: int) -> bool:
        """Return whether no torque but friction acts: in a free decay each swing is smaller than the one before."""
        if self.equation.driven:
            return True
        before, after = motion.swing_sizes[at - 1 : at + 1]
        was, self._shrinking = self._shrinking, bool(after < 1.002 * before)
        return was and self._shrinking

    def _recording(self, piece: Array) -> Recording:
        drive = piece[:, 3] if self.reader.needed[3] else None
        wheel = "wheel" in self.equation.coefficients
        return Recording(
            time=piece[:, 0],
            angle=piece[:, 1],
            wheel_angle=piece[:, 2] if wheel else None,
            voltage=drive if wheel else None,
            torque=None if wheel else drive,
            drive_held=self.reader.held,
            findings=self.reader.findings,
            repairs_off=self.reader.repairs_off,
        )


def _check_sign(estimate: SwingEstimate) -> None:
    """Raise InputError where the inertia is negative beyond its uncertainty."""
    inertia = estimate.inertia
    if inertia.standard_uncertainty is not None and inertia.value < -3 * inertia.standard_uncertainty:
        raise InputError(
            f"the stream gives a negative inertia ({inertia.value:.3g} {inertia.unit}) after {estimate.swing} swings: "
            "wheel angle or torque has the wrong sign against the angle, or the angle's zero is the top; correct it.",
            code="wrong-sign",
        )
