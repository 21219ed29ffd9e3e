"""Passes and their mirror images: nodes at equal angles before and after each measured turning point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.numerics.arrays import Array, Bools
from swingid.numerics.compiled import njit
from swingid.numerics.spline import rows_before
from swingid.preparation.motion import Motion


@dataclass(frozen=True)
class Passes:
    """Nodes around turning points: a block per turning point, each way in and back out at the same angles.

    instants (blocks, 2 levels + 1): the levels on the way in, the turning point, the levels on the way out. sides:
    +1 upper, −1 lower.
    """

    turning: Array
    sides: Array
    instants: Array


def mirrored_passes(motion: Motion, depths: Array, time: Array, longest_gap: float) -> Passes:
    """Nodes at the given depths: rising shares of the smaller of the two swings, measured from the turning point.

    Blocks across a gap of the log longer than `longest_gap` (s) are excluded, as the drive's work there is unknown.
    """
    speed, turning = motion.speed, motion.turning_times
    fine = np.linspace(speed.grid[0], speed.grid[-1], 8 * len(speed.grid))
    sizes, angles = motion.swing_sizes, speed.angle_at(fine)
    reach = np.minimum(sizes[:-1], sizes[1:])
    instants = _crossings(fine, angles, turning, motion.turning_angles, motion.sides, reach[:, None] * depths)
    sound: Bools = np.all(np.isfinite(instants), axis=1)
    sound &= (np.diff(instants, axis=1) > 0).all(axis=1)
    sound[sound] &= (instants[sound, 0] >= time[0]) & (instants[sound, -1] <= time[-1])
    for k in np.nonzero(np.diff(time) > longest_gap)[0]:
        sound[sound] &= (instants[sound, 0] >= time[k + 1]) | (instants[sound, -1] <= time[k])
    return Passes(turning[1:-1][sound], motion.sides[1:-1][sound], instants[sound])


@njit
def _crossings(time: Array, angles: Array, turning: Array, tops: Array, sides: Array, depths: Array) -> Array:
    """Instants at which the angle is `depths` away from each inner turning point, before it and after it."""
    blocks, levels = depths.shape
    result = np.full((blocks, 2 * levels + 1), np.nan)
    for i in range(blocks):
        top, side = tops[i + 1], sides[i + 1]
        result[i, levels] = turning[i + 1]
        centre = rows_before(time, turning[i + 1], False)
        for direction in (-1, 1):
            k = centre if direction > 0 else centre - 1
            for j in range(levels):
                while 0 <= k < len(time) and side * (top - angles[k]) < depths[i, j]:
                    k += direction
                if not 0 <= k < len(time) or not 0 <= k - direction < len(time):
                    break
                near, far = side * (top - angles[k - direction]), side * (top - angles[k])
                share = 1.0 if far == near else (depths[i, j] - near) / (far - near)
                t = time[k - direction] + share * (time[k] - time[k - direction])
                result[i, levels + direction * (j + 1)] = t
        if result[i, 0] < turning[i] or result[i, 2 * levels] > turning[i + 2]:
            result[i, 0] = np.nan
    return result
