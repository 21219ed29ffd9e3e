"""One log of a calibration: its windows, chosen once, and its regression with the encoders as estimated so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.choice import choose
from swingid.balance.errors import channel_errors, constant_error
from swingid.balance.fits import WindowFit, columns_of, known_side, sensor_variance
from swingid.balance.perturbations import BENDS, Perturbation, Shape, of_constants
from swingid.balance.rows import Rows, Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.calibration.encoders.parts import ANGLE, WHEEL, bounded, latency_key
from swingid.checks.answer import check_sign
from swingid.model.equation import CLOCK
from swingid.model.parameters import AXIS_TILT
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import project
from swingid.preparation.encoders import Channel, Encoders, straightened
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Prepared
from swingid.preparation.scale import equation_of, refuse_rates, require_channels
from swingid.recording.recording import Recording

OF_GRAVITY = (AXIS_TILT, CLOCK)
"""Deviations that act as an error of the gravity torque does, and that its stated uncertainty is taken to contain."""


@dataclass(frozen=True)
class LogRows:
    """The regression of one log, linear about the encoders as corrected so far.

    own: names of the unknowns of this log alone (friction); common: inertia and, where unknown, the gravity torque.
    columns (rows, common + own); parts: regressors of the encoders' parts by key; constants: those of uncertain
    constants of the rig, per standard deviation. grid (8, rows): errors of the rows for eight phases of the encoder's
    grid, the same in every log, because the grid is fixed to the encoder. balance, values (of the coefficients), noise:
    those from which the rows were computed.
    """

    common: tuple[str, ...]
    own: tuple[str, ...]
    columns: Array
    target: Array
    parts: dict[str, Array]
    constants: dict[str, Array]
    grid: Array
    balance: Rows
    values: dict[str, float]
    noise: Noise

    def sensor_noise(self, influence: Array, *, grid: bool = False) -> tuple[float, float]:
        """Variance of an unknown by white noise of the sensors, and what Newey and West's sum makes of that noise.

        grid: of the rounding errors of the angle's encoder instead, if they were white.
        """
        noise = replace(self.noise, angle=self.noise.resolution / np.sqrt(12), wheel=0.0) if grid else self.noise
        return sensor_variance(self.balance, influence, self.values, noise)


@dataclass(frozen=True)
class CalibrationLog:
    """A log as read, the part used, and the windows and friction terms that were chosen for it."""

    log: Recording
    noise: Noise
    first: WindowFit
    late: Array

    @property
    def name(self) -> str:
        """The log's path, or words."""
        return self.log.source.path or "the log"

    @classmethod
    def of(cls, log: Recording, rig: Rig) -> CalibrationLog:
        """Find the useful part and the windows; raises as the method momentum."""
        # the readings are not corrected yet, because the nonlinearities are to be estimated
        refuse_rates(rig, "a calibration of encoders")
        prepared = Prepared(log, rig, equation_of(rig), Encoders.of(bounded(rig)), ())
        require_channels(log, rig)
        part = prepared.part(reread=True)
        # windows of least variance beside encoder nonlinearities, whatever is stated of a latency
        choice = choose(Signals.of(part.log, rig, part.motion, part.encoders), rig, prepared.equation, part.noise)
        check_sign(choice.law, log.source.path or "the log", live=log.is_live)
        late = part.motion.turning_times - choice.signals.motion.turning_times
        # the findings would keep `straightened` from correcting the readings again in each step
        return cls(replace(part.log, findings=()), part.noise, choice.law, late)

    def signals(self, rig: Rig) -> Signals:
        """The signals with the encoders as `rig` states them."""
        encoders = Encoders.of(rig)
        log = straightened(self.log, encoders, rotary=rig.axis.kind == "rotary")
        motion = find_motion(log.time, log.angle, self.noise.angle)
        motion = motion.reread(log.time, log.angle, motion.speed.half_width)
        signals = Signals.of(log, rig, motion, encoders)
        same = len(self.late) == len(motion.turning_times)
        return signals.earlier(self.late) if same else signals

    def rows(self, signals: Signals, rig: Rig, a11: float, b: float, stretch: float = 1.0) -> LogRows:
        """The regression on windows of `stretch` times the chosen length; a11, b as estimated so far."""
        equation, signals = equation_of(rig), signals.suited(stretch * self.first.half)
        rows = rows_of(signals, law_windows(signals, stretch * self.first.half))
        friction = self.first.friction
        names, columns = columns_of(rows, equation, friction)
        common = names[: len(names) - len(friction)]
        values = equation.stated | {"inertia": a11, "gravity_torque": b}
        constants = [one for one in of_constants(equation) if one.std > 0 and one.source not in OF_GRAVITY]
        return LogRows(
            common=common,
            own=friction,
            columns=columns,
            target=known_side(rows, equation),
            parts=_parts(rows, signals, rig, values),
            constants={one.source: constant_error(rows, equation, one).rows * one.std for one in constants},
            grid=self._grid(signals, rows, a11, b),
            balance=rows,
            values=values,
            noise=self.noise,
        )

    def _grid(self, signals: Signals, rows: Rows, a11: float, b: float) -> Array:
        """Errors of the rows by the encoder's grid, for eight phases of it; none without a grid."""
        if self.noise.resolution == 0.0:
            return np.zeros((0, len(rows.windows)))
        nodes, windows = signals.nodes, rows.windows
        shape = signals.angle.shape
        errors = signals.grid_errors(self.noise.resolution) / nodes.flat[1]
        cosine = signals.cosine
        at_nodes = [error.reshape(shape) for error in errors]
        first = project(nodes, [(error, 2) for error in at_nodes], windows.centres, windows.half)
        second = project(nodes, [(error * cosine, 0) for error in at_nodes], windows.centres, windows.half)
        result: Array = -(a11 * first + b * second).T
        return result


def _parts(rows: Rows, signals: Signals, rig: Rig, values: Mapping[str, float]) -> dict[str, Array]:
    """Regressor of every part, by its key (and "zero"), about the channels as read (THEORY 4, self-calibration).

    δ of the wheel against the angle     −a12 ∫φ'' q2'          (direct drive: of the angle against the torque, ∫φ' τ)
    α of the wheel's encoder             −a12 ∫φ'' cos q2
    α of the axis' encoder               −a11 ∫φ'' cos q1 − b ∫φ cos² q1
    δ of the angle's zero                −b ∫φ cos q1
    """
    shapes: list[tuple[str, Channel, Shape]] = []
    if not signals.linear:
        shapes += [(f"{ANGLE}.nonlinearity_{shape}", "angle", shape) for shape in BENDS]
    if signals.wheel is not None:
        shapes += [(f"{WHEEL}.nonlinearity_{shape}", "wheel", shape) for shape in BENDS]
    if not signals.linear:
        shapes.append(("zero", "angle", "offset"))
    if signals.wheel is not None or signals.torque is not None:
        shapes.append((latency_key(rig), "angle" if signals.wheel is None else "wheel", "latency"))
    found = [Perturbation(key, 0.0, None, channel, shape) for key, channel, shape in shapes]
    return {error.source: error.rows for error in channel_errors(rows, signals, found, values)}
