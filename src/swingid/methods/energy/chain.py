"""The drive between the rows of a log; and the paper's post-processing: speeds by observers, the drive through W_f.

Section 5: "the measured angles in the proposed method passed through a observer in the direct and reverse time for the
delay compensation; the control signal passed through a filter" W_f(p) = 1/(0.0125 p + 1). Here both run forward and
backward in time and are averaged. W_f then has no delay, but it keeps 1/(1 + (w T)^2) of a sine of frequency w only and
rounds off the steps by which the controller compensates the motor at every reversal of the wheel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.errors import UsageError
from swingid.numerics.arrays import Array, median
from swingid.numerics.quadrature import GaussNodes, held_between
from swingid.preparation.speed import Speed
from swingid.recording.recording import Recording


@dataclass(frozen=True)
class Chain:
    """Sources of speeds and drive for the balance.

    observers: speeds by the observers (23), also for the turn of the wheel, else by local cubics. filter_time: T of W_f
    for the drive, s; 0: the drive as it was held.
    """

    observers: bool = False
    filter_time: float = 0.0

    @classmethod
    def of(cls, velocities: str, filter_time: float | None) -> Chain:
        """Read the options of the method. Raises UsageError for other values."""
        if velocities not in ("smoothed", "observers"):
            text = f'unknown velocities {velocities!r} of "energy"; choose "smoothed" or "observers".'
            raise UsageError(text, code="no-velocities")
        if velocities == "smoothed":
            if filter_time is not None:
                raise UsageError('filter_time belongs to velocities="observers"; leave it out.', code="observers-only")
            return cls()
        chosen = 0.0125 if filter_time is None else filter_time
        if isinstance(chosen, bool) or not isinstance(chosen, int | float) or not 0 <= chosen < np.inf:
            raise UsageError(f"filter_time must be zero or positive, not {filter_time!r}.", code="bad-filter-time")
        return cls(True, float(chosen))


def observed_speed(time: Array, angle: Array, noise: float) -> Speed:
    """The observers (23) with the gains of section 5, both ways, at the stamps; noise: of one sample of the angle."""
    from swingid.control.observer import VelocityObserver  # here, for it is compiled

    observer, step = VelocityObserver(), median(np.diff(time))
    speed = observer.both_ways(time, angle)
    return Speed(time, angle, speed, max(step, 1 / observer.sigma), noise * observer.noise_gain(step))


def drive_at(nodes: GaussNodes, log: Recording, values: Array, chain: Chain) -> Array:
    """The logged voltage or torque of a log at the nodes (n−1, points), through the filter of a chain."""
    if chain.filter_time > 0:
        return filtered_drive(nodes, values, chain.filter_time, held=log.drive_held)
    return between_rows(nodes, values, held=log.drive_held)


def filtered_drive(nodes: GaussNodes, values: Array, filter_time: float, *, held: bool) -> Array:
    """A logged voltage or torque through W_f of `filter_time` (s) both ways, at the nodes (n−1, points)."""
    from swingid.control.observer import filtered_both_ways  # here, for it is compiled

    constant = held_between(nodes.time, values) if held else (values[1:] + values[:-1]) / 2
    return nodes.spline(filtered_both_ways(nodes.time, np.append(constant, constant[-1]), filter_time))


def between_rows(nodes: GaussNodes, values: Array, *, held: bool) -> Array:
    """A logged voltage or torque at the nodes: constant from row to row if held, else a spline through the rows.

    Where rows are missing the values lost are taken to lie on a straight line, each of them held.
    """
    if not held:
        return nodes.spline(values)
    return np.repeat(held_between(nodes.time, values)[:, None], nodes.points, axis=1)
