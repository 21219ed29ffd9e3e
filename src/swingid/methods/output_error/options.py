"""The options of the method, checked, and what drives the simulation where they leave that open."""

from __future__ import annotations

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.methods.output_error.problem import FEWEST_ROWS, Input
from swingid.methods.output_error.solver import LOSSES
from swingid.methods.output_error.unknowns import friction_unknowns
from swingid.model.rig import Rig
from swingid.preparation.scale import Scale
from swingid.recording.recording import Recording

MOST_LOST = 1e-3
"""Share of lost rows beyond which the measured wheel is the better input, as a lost voltage is not known."""


def names_of(free: object) -> tuple[str, ...]:
    """Names from text with commas or a sequence of texts; UsageError for anything else."""
    names = free.split(",") if isinstance(free, str) else free
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise UsageError(f"option free must be names with commas between, and is {free!r}.", code="bad-option")
    return tuple(name.strip() for name in names if name.strip())


def check_options(law: str, loss: str, starts: int, segment: float | None) -> None:
    """Raise UsageError for an option that is not offered."""
    if law != "auto":
        friction_unknowns(law)
    if loss not in LOSSES:
        raise UsageError(f"unknown loss {loss!r}; choose one of {', '.join(LOSSES)}.", code="unknown-loss")
    if isinstance(starts, bool) or not (isinstance(starts, int) and 1 <= starts <= 20):
        raise UsageError(f"starts is {starts!r}; give a whole number from 1 to 20.", code="bad-starts")
    if segment is None:
        return
    if isinstance(segment, bool) or not (isinstance(segment, int | float) and segment > 0):
        raise UsageError(f"segment is {segment!r}; give a length in seconds.", code="bad-segment")


def require_rows(segment: float | None, log: Recording) -> None:
    """Raise UsageError for segments that hold too few rows for their own initial values."""
    if segment is not None and segment * log.rate < FEWEST_ROWS:
        raise UsageError(
            f"segment is {segment:g} s, in which the log has fewer than {FEWEST_ROWS} rows; give at least "
            f"{FEWEST_ROWS / log.rate:.2g} s.",
            code="bad-segment",
        )


def _rows_lost(log: Recording) -> bool:
    """Whether so many rows are missing that the voltage held in them is missed."""
    steps = np.diff(log.time)
    lost = float(np.sum(np.maximum(np.rint(steps / np.median(steps)) - 1, 0)))
    return lost > MOST_LOST * len(log)


def input_of(wanted: str | None, log: Recording, rig: Rig, scale: Scale) -> Input:
    """What drives the simulation. Raises where the log or the rig lacks it."""
    if scale.drive != "reaction-wheel":
        if wanted is not None:
            raise UsageError(f"input belongs to a reaction wheel, not to drive {scale.drive!r}.", code="no-input")
        return "torque" if scale.drive == "direct" else "none"
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
