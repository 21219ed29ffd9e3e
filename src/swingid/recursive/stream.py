"""Entry points: `online` for a stream, `swing_estimates` for a log; both give the same estimates of the same swings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain, islice

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
from swingid.recursive.solution import Recursion, Reporter, SwingEstimate, first_solution, solve_all

Maker = Callable[[Recording, Rig, Equation, Noise, Motion, Encoders, int], Block | None]

MAKERS: dict[str, Maker] = {"momentum": momentum_block, "energy": energy_block}
"""Of each method that is `online`: from the rows of a swing to its block of equations."""

FIRST = 4
"""Swings before the first estimate."""

WARM = 200
"""Rows at the start of a stream from which its noise is estimated."""

NOISES = 10.0
"""Standard deviations of noise, and steps of the encoder, that a swing must exceed."""


def online(rig: Rig, samples: Iterable[object] | Recording, method: str = "momentum") -> Iterator[SwingEstimate]:
    """One estimate per swing of a stream, each as soon as the swing after it has turned around.

    samples: rows (t, angle, wheel_angle, voltage or torque) in the units and conventions of a Recording (s, rad or m,
    V, N m or N; wheel relative to the pendulum; a held voltage or torque acts from its row to the next); or a
    Recording, or several, one after the other. A channel that the rig does not have is None, or absent at the end of a
    row; a value in its place is ignored. Rows with NaN and rows out of order are excluded and counted. method:
    "momentum" or "energy". Stores two swings of rows and sums of fixed size at any length.

    Unlike `identify` it uses every swing, also those of the transient, and its uncertainty contains only the scatter of
    the swings and what rig.toml declares: for the record, identify the log.

    Raises UsageError for another method, InputError for samples that are no rows or a wheel of the wrong sign,
    UnanswerableError where the stream ends without enough swings.
    """
    estimator = Estimator(rig, method)
    for block in estimator.swings.blocks(samples):
        estimate = estimator.add(block)
        if estimate is not None:
            yield estimate
    if estimator.recursion is None:
        raise _too_few(len(estimator.waiting))


class Estimator:
    """`online` for rows that are handed over as they come: `push` them, in any portions.

    Raises as `online` does; too few swings are no error here.
    """

    def __init__(self, rig: Rig, method: str = "momentum") -> None:
        self.swings = _Swings(rig, method)
        self.recursion: Recursion | None = None
        self.waiting: list[Block] = []
        self._reporter = Reporter(self.swings.equation, rig.axis.model_uncertainty)
        self._early: list[Row] = []

    def push(self, samples: Iterable[object]) -> list[SwingEstimate]:
        """The estimates that further rows give: (t, angle, wheel_angle, voltage or torque), as of `online`."""
        rows = list(self.swings.reader.rows(samples))
        if self.swings.buffer is None:
            self._early += rows
            if len(self._early) < WARM:
                return []
            rows, self._early = self._early, []
            self.swings.begin(rows[:WARM])
        found = [self.add(block) for block in self.swings.blocks_of(rows)]
        return [estimate for estimate in found if estimate is not None]

    def add(self, block: Block) -> SwingEstimate | None:
        """The estimate after one more swing; None before there are enough."""
        swings, reporter = self.swings, self._reporter
        if self.recursion is None:
            self.waiting.append(block)
            if len(self.waiting) < FIRST:
                return None
            self.recursion = Recursion(block.unknowns, first_solution(self.waiting), swings.equation, swings.noise)
            for early in self.waiting[:-1]:
                self.recursion.add(early)
                reporter.skip()
            self.waiting.clear()
        self.recursion.add(block)
        estimate = reporter.estimate(block, self.recursion.solution(), swings.reader.skipped, swings.lost)
        _check_sign(estimate)
        return estimate


def swing_estimates(log: Recording, rig: Rig, method: str = "momentum") -> list[SwingEstimate]:
    """The estimates of `online` for a whole log, each by least squares over all rows of its swings at once.

    The batch form, for comparison: it stores every swing, and its cost grows with their square. Raises as `online`.
    """
    swings = _Swings(rig, method)
    reporter = Reporter(swings.equation, rig.axis.model_uncertainty)
    kept: list[Block] = []
    estimates = []
    for block in swings.blocks([log]):
        kept.append(block)
        if len(kept) < FIRST:
            reporter.skip()
            continue
        solution = solve_all(kept, first_solution(kept[:FIRST]), swings.equation, swings.noise)
        estimates.append(reporter.estimate(block, solution, swings.reader.skipped, swings.lost))
        _check_sign(estimates[-1])
    if not estimates:
        raise _too_few(len(kept))
    return estimates


@dataclass
class _Swings:
    """From rows to blocks: reading, cutting into pieces, the balance of each."""

    rig: Rig
    method: str
    equation: Equation = field(init=False)
    reader: Reader = field(init=False)
    without: int = 0
    buffer: SwingBuffer | None = None
    _noise: Noise | None = None
    _shrinking: bool = False

    def __post_init__(self) -> None:
        if self.method not in MAKERS:
            raise UsageError(
                f"online knows no method {self.method!r}; choose one of {', '.join(MAKERS)}.", code="unknown-method"
            )
        refuse_motor(self.rig, "online")
        refuse_rates(self.rig, "a stream")
        self.equation = equation_of(self.rig)
        drive = self.rig.drive.kind
        voltage = drive == "reaction-wheel" and self.method == "energy"
        self.reader = Reader((True, True, drive == "reaction-wheel", drive == "direct" or voltage))

    def blocks(self, samples: Iterable[object] | Recording) -> Iterator[Block]:
        """The blocks of a stream, one per turning point that has a whole swing on both sides."""
        rows = self.reader.rows(samples)
        early = list(islice(rows, WARM))
        if not early:
            return
        self.begin(early)
        yield from self.blocks_of(chain(early, rows))

    def begin(self, early: list[Row]) -> None:
        """Find the noise in the first rows, which `blocks_of` then takes with the others."""
        self.buffer = SwingBuffer(self._least(np.array(early)))

    def blocks_of(self, rows: Iterable[Row]) -> Iterator[Block]:
        """The blocks that further rows complete."""
        assert self.buffer is not None
        for row in rows:
            piece = self.buffer.push(row)
            block = None if piece is None else self._block(*piece)
            if block is not None:
                yield block

    @property
    def noise(self) -> Noise:
        """Noise of the channels, from the first piece."""
        assert self._noise is not None
        return self._noise

    @property
    def lost(self) -> int:
        """Turning points without a block so far."""
        return self.without + (self.buffer.lost if self.buffer is not None else 0)

    def _least(self, rows: Array) -> float:
        """The least swing (rad or m): well above noise and steps of the angle, as declared or as estimated."""
        sensor = Encoders.of(self.rig).angle
        angle = rows[:, 1]
        return NOISES * max(sensor.noise, sample_noise(angle), sensor.resolution / 4, grid_step(angle) / 4, 1e-9)

    def _block(self, piece: Array, middle: float) -> Block | None:
        """The block around the turning point near `middle` (s), None (and counted) where there is none."""
        log, encoders, _ = corrected(self._recording(piece), self.rig)
        if self._noise is None:
            if self.method == "energy":
                require_motor(log, self.rig, self.equation, self.method)
            self._noise = channel_noise(log, self.rig)
        block = self._balance(log, encoders, middle)
        self.without += block is None
        return block

    def _balance(self, log: Recording, encoders: Encoders, middle: float) -> Block | None:
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
        """Whether no torque but friction acts: in a free decay each swing is smaller than the one before."""
        if self.equation.drive != "none":
            return True
        before, after = motion.swing_sizes[at - 1 : at + 1]
        was, self._shrinking = self._shrinking, bool(after < 1.002 * before)
        return was and self._shrinking

    def _recording(self, piece: Array) -> Recording:
        drive = piece[:, 3] if self.reader.needed[3] else None
        wheel = self.equation.drive == "reaction-wheel"
        return Recording(
            time=piece[:, 0],
            angle=piece[:, 1],
            wheel_angle=piece[:, 2] if wheel else None,
            voltage=drive if wheel else None,
            torque=None if wheel else drive,
            drive_held=self.reader.held,
            findings=self.reader.findings,
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


def _too_few(swings: int) -> UnanswerableError:
    return UnanswerableError(
        f"the stream ended after {swings} whole swings, at least {FIRST} are needed; record a longer run.",
        code="too-short",
    )
