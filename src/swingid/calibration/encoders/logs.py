"""One log of a calibration: its windows, chosen once, and its regression with the encoders as estimated so far."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.choice import choose
from swingid.balance.covariance import sensor_variance
from swingid.balance.errors import errors_of, shaped_errors
from swingid.balance.fits import WindowFit, fit_rows
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.calibration.encoders.parts import ZERO, bounded, part_key
from swingid.checks.answer import check_sign
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders, straightened
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Prepared
from swingid.preparation.scale import equation_of, refuse_rates, require_channels
from swingid.recording.recording import Recording


@dataclass(frozen=True)
class LogRows:
    """The regression of one log, linear about the encoders as corrected so far.

    fit: the rows, and what the log's own fit leaves of them; its inertia, and gravity where unknown, are those of all
    logs. declared: effects on the rows of the encoders' parts and of all else that the rig declares, by key, each of
    one (prior) standard deviation. grid (8, rows): errors of the rows for eight phases of the encoder's grid, the same
    in every log, because the grid is fixed to the encoder.
    """

    fit: WindowFit
    declared: dict[str, Array]
    grid: Array

    @property
    def own(self) -> int:
        """Number of the unknowns of this log alone, the last ones: its friction."""
        return len(self.fit.friction)

    def grid_noise(self, influence: Array) -> Array:
        """Variances of unknowns (p,), influence (p, rows), by the angle's rounding errors if these were white."""
        fit, noise = self.fit, self.fit.noise
        rounding = replace(noise, angle=noise.resolution / np.sqrt(12), wheel=0.0)
        variances: Array = sensor_variance(fit.rows, influence, fit.coefficients, rounding)[0]
        return variances


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
        # `straightened` corrects the readings again in each step
        log = replace(part.log, done=frozenset(), repairs_off=frozenset())
        return cls(log, part.noise, choice.law, late)

    def signals(self, rig: Rig) -> Signals:
        """The signals with the encoders as `rig` states them."""
        encoders = Encoders.of(rig)
        log = straightened(self.log, encoders, rotary=rig.axis.kind == "rotary")
        motion = find_motion(log.time, log.angle, self.noise.angle)
        motion = motion.reread(log.time, log.angle, motion.speed.half_width)
        signals = Signals.of(log, rig, motion, encoders)
        same = len(self.late) == len(motion.turning_times)
        return signals.earlier(self.late) if same else signals

    def rows(self, signals: Signals, rig: Rig, a11: float, b: float, stretch: float = 1.0) -> LogRows | None:
        """The regression on windows of `stretch` times the chosen length; a11, b as estimated so far.

        None where there are too few of them.
        """
        signals = signals.suited(stretch * self.first.half)
        rows = rows_of(signals, law_windows(signals, stretch * self.first.half))
        friction = tuple(name for name in self.first.friction if name in rows.columns)
        fit = fit_rows(rows, equation_of(rig), self.noise, friction)
        if fit is None:
            return None
        common = fit.values | {"inertia": a11, "gravity_torque": b}
        fit = replace(fit, fit=replace(fit.fit, values=np.array([common[name] for name in fit.unknowns])))
        errors = errors_of(rows, signals, rig, fit.equation, fit.coefficients)
        declared = {part_key(error): error.rows * error.std for error in errors}
        if not signals.linear:
            (zero,) = shaped_errors(rows, signals, "angle", [np.ones_like(signals.angle)], fit.coefficients).T
            declared["zero"] = zero * ZERO
        grid = np.zeros((0, len(rows)))
        if self.noise.resolution:
            shapes = signals.grid_errors(self.noise.resolution) / signals.nodes.flat[1]
            grid = shaped_errors(rows, signals, "angle", shapes.reshape(-1, *signals.angle.shape), fit.coefficients).T
        return LogRows(fit, declared, grid)
