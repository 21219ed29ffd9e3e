"""What every fit of one log shares: the checked options, the input of the simulation, the prepared log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swingid.balance.fits import WindowFit
from swingid.checks.consistency import require_signs
from swingid.checks.momentum import MomentumCheck
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.methods.output_error.constants import uncertain_constants
from swingid.methods.output_error.problem import INPUTS, Input, Problem
from swingid.methods.output_error.segments import FEWEST_ROWS, problem_of
from swingid.methods.output_error.unknowns import Unknowns, friction_unknowns, unknowns_of
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.shooting import LOSSES
from swingid.preparation.encoders import Encoders
from swingid.preparation.prepared import Part
from swingid.recording.recording import Recording

MOST_LOST = 1e-3
"""Share of lost rows above which the measured wheel is the better input, as the voltage of a lost row is unknown."""


MOST_PERIODS = 10.0
"""Periods of a torque of the angle from row to row above which a log is not simulated.

Every period takes some ten steps, and the phase after a row is not that of the readings: a search with 108 took 90 s.
Readings do not even resolve half a period, which is no reason to refuse what the rig file states.
"""


@dataclass(frozen=True)
class Setup:
    """What every fit of one log shares.

    check: momentum's answer. moves: whether constants and sensors with a stated uncertainty are estimated, with the
    stated value as prior.
    """

    check: MomentumCheck
    part: Part
    source: Input
    free: tuple[str, ...]
    loss: str
    starts: int
    segment: float | None
    moves: bool = True

    @classmethod
    def of(
        cls,
        check: MomentumCheck,
        wanted: str | None,
        law: str,
        free: str | Sequence[str],
        loss: str,
        starts: int,
        segment: float | None,
    ) -> Setup:
        """Read the options of the method; errors as `output_error`."""
        names = names_of(free)
        if law != "auto":
            friction_unknowns(law)
        prepared = check.prepared
        _check_options(loss, starts, segment, prepared.log)
        source = input_of(wanted, prepared.log, prepared.rig)
        part = prepared.part()
        _require_resolved(part, prepared.equation)
        require_signs(check)
        return cls(check, part, source, names, loss, starts, segment)

    @property
    def rig(self) -> Rig:
        """The rig."""
        return self.part.rig

    @property
    def equation(self) -> Equation:
        """The scale reference."""
        return self.part.equation

    @property
    def alternative(self) -> str:
        """What to try where this model does not fit the log."""
        wheel_input = 'input="wheel", which needs no motor, or ' if self.source == "voltage" else ""
        return f"{wheel_input}the momentum method"

    @property
    def windows(self) -> WindowFit:
        """The linear fit of equation (I). Raises UnanswerableError without one."""
        if self.check.evidence is None:
            raise UnanswerableError(
                "the used part of the log has too few rows or swings for initial estimates; record a longer motion, or "
                "take the momentum method.",
                code="too-short",
            )
        return self.check.evidence.law

    @cached_property
    def fastest(self) -> float:
        """Highest speed of the axis, rad/s."""
        return float(np.max(np.abs(self.part.motion.speed.speed)))

    @property
    def strongest(self) -> float:
        """A torque (N m) that no friction of this motion exceeds: three times that of inertia and gravity."""
        speed = self.part.motion.speed
        quickest = float(np.max(np.abs(speed.acceleration(speed.grid))))
        return 3 * (abs(self.windows.a11) * quickest + abs(self.windows.value("gravity_torque")))

    @cached_property
    def uncertain(self) -> tuple[tuple[str, ...], dict[str, float]]:
        """Constants and sensors that rig.toml states with an uncertainty, see `unknowns_of`."""
        readings = _uncertain_readings(self.part.encoders, self.source, rotary=not self.equation.linear)
        return uncertain_constants(self.rig, self.equation, self.source), readings

    def unknowns(self, law: str) -> Unknowns:
        """The unknowns with a friction law."""
        more = self.uncertain if self.moves else ((), {})
        resolution = self.part.noise.resolution
        return unknowns_of(self.rig, self.equation, law, self.free, self.fastest, self.strongest, resolution, *more)

    def problem(self, length: float) -> Problem:
        """The log in segments of about `length` s."""
        part = self.part
        return problem_of(part.log, part.encoders, part.noise, self.source, length, part.longest_gap)


def names_of(free: object) -> tuple[str, ...]:
    """Names from text with commas or a sequence of texts; UsageError for anything else."""
    names = free.split(",") if isinstance(free, str) else free
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise UsageError(f"option free must be names with commas between, and is {free!r}.", code="bad-option")
    return tuple(name.strip() for name in names if name.strip())


def _check_options(loss: str, starts: int, segment: float | None, log: Recording) -> None:
    """Raise UsageError for a value that is not offered, and for segments shorter than their initial values need."""
    if loss not in LOSSES:
        raise UsageError(f"unknown loss {loss!r}; choose one of {', '.join(LOSSES)}.", code="unknown-loss")
    if isinstance(starts, bool) or not (isinstance(starts, int) and 1 <= starts <= 20):
        raise UsageError(f"starts is {starts!r}; give a whole number from 1 to 20.", code="bad-starts")
    if segment is None:
        return
    if isinstance(segment, bool) or not (isinstance(segment, int | float) and segment > 0):
        raise UsageError(f"segment is {segment!r}; give a length in seconds.", code="bad-segment")
    if segment * log.rate < FEWEST_ROWS:
        raise UsageError(
            f"segment is {segment:g} s, in which the log has fewer than {FEWEST_ROWS} rows; give at least "
            f"{FEWEST_ROWS / log.rate:.2g} s.",
            code="bad-segment",
        )


def _require_resolved(part: Part, equation: Equation) -> None:
    """Raise UnanswerableError for a torque of the angle with more than `MOST_PERIODS` periods from row to row."""
    fastest = float(np.max(np.abs(part.motion.speed.speed)))
    for term in equation.slots:
        periods = fastest * term.order / (2 * np.pi * part.log.rate)
        if periods > MOST_PERIODS:
            raise UnanswerableError(
                f"{term.term.key} with order {term.order:g} has {periods:.0f} periods from one row to the next, which "
                "no simulation of these rows follows; leave it out, for it averages out, or take the momentum method.",
                code="unresolved-torque",
            )


def _rows_lost(log: Recording) -> bool:
    """Return whether more than `MOST_LOST` of the rows are missing, and with them the voltage held there."""
    steps = np.diff(log.time)
    lost = float(np.sum(np.maximum(np.rint(steps / np.median(steps)) - 1, 0)))
    return lost > MOST_LOST * len(log)


def input_of(wanted: object, log: Recording, rig: Rig) -> Input:
    """The input of the simulation. Raises where the log or the rig lacks it."""
    if rig.drive.wheel is None:
        if wanted is not None:
            raise UsageError(f"input belongs to a reaction wheel, not to drive {rig.drive.kind!r}.", code="no-input")
        return INPUTS.get(rig.drive.channel, "none")
    if wanted not in (None, "voltage", "wheel"):
        raise UsageError(f'unknown input {wanted!r}; choose "voltage" or "wheel".', code="unknown-input")
    motor = rig.drive.motor
    constants = motor is not None and motor.torque_per_volt.value > 0
    speed_only = log.wheel_speed is not None
    if wanted == "wheel" or (
        wanted is None and (log.voltage is None or not constants or speed_only or _rows_lost(log))
    ):
        return "wheel"
    if speed_only:
        raise InputError(
            f"{log.source.path or 'the log'} holds the wheel's speed, but a simulation under the voltage is compared "
            'with its angle; take input="wheel", or log the angle.',
            code="needs-wheel-angle",
        )
    if log.voltage is None:
        raise InputError(
            f"{log.source.path or 'the log'} has no voltage; name its column as voltage under [log], or take "
            'input="wheel", which needs none.',
            code="missing-voltage",
        )
    if not constants:
        raise UnanswerableError(
            f"rig {rig.name}: drive.motor.torque_per_volt is not given, but the simulation under the voltage needs the "
            'motor\'s constants; give them, or take input="wheel", which needs none.',
            code="no-motor-constants",
        )
    return "voltage"


def _uncertain_readings(encoders: Encoders, source: Input, *, rotary: bool) -> dict[str, float]:
    """Stated standard uncertainties of the sensors whose angles are compared with the simulation, by their keys.

    Not of the wheel's sensor where its angle is the input; not of a latency in a free decay, which has no other clock.
    """
    stds: dict[str, float | None] = {}
    for channel, prefix in (("angle", "sensors."), ("wheel", "sensors.wheel.")):
        if channel == "wheel" and source != "voltage":
            continue
        sensor = encoders.angle if channel == "angle" else encoders.wheel
        if rotary:
            stds |= {f"{prefix}nonlinearity.{name}": part.std for name, part in sensor.parts.items()}
        if source != "none":
            stds[f"{prefix}latency"] = sensor.lateness
    return {key: std for key, std in stds.items() if std}
