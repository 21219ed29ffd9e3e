"""Passes and their mirror images: nodes at equal angles before and after each measured turning point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.numerics.arrays import Array, Bools
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


def _crossings(time: Array, angles: Array, turning: Array, tops: Array, sides: Array, depths: Array) -> Array:
    """Instants at which the angle is `depths` away from each inner turning point, before it and after it.

    NaN where it is not before the turning points around.
    """
    blocks, levels = depths.shape
    result = np.full((blocks, 2 * levels + 1), np.nan)
    if blocks == 0:
        return result
    result[:, levels] = turning[1:-1]
    at = np.searchsorted(time, turning)
    for direction, start, last in ((1, at[1:-1], at[2:] + 1), (-1, at[1:-1] - 1, at[:-2] - 2)):
        count = direction * (np.clip(last, 0, len(time) - 1) - start) + 1
        behind = np.arange(max(int(count.max(initial=0)), 1))
        rows = np.clip(start[:, None] + direction * behind, 0, len(time) - 1)
        drop = sides[1:-1, None] * (tops[1:-1, None] - angles[rows])
        reached = np.maximum.accumulate(drop, axis=1)
        k = np.array([np.searchsorted(drops, depth) for drops, depth in zip(reached, depths, strict=True)])
        beyond = start[:, None] + direction * k
        before = beyond - direction
        sound = (k < count[:, None]) & (before >= 0) & (before < len(time))
        block, level = np.nonzero(sound)
        after, before = beyond[sound], before[sound]
        side, top = sides[block + 1], tops[block + 1]
        near, far = side * (top - angles[before]), side * (top - angles[after])
        share = np.where(far == near, 1.0, (depths[sound] - near) / np.where(far == near, 1.0, far - near))
        result[block, levels + direction * (level + 1)] = time[before] + share * (time[after] - time[before])
    outside = (result[:, 0] < turning[:-2]) | (result[:, -1] > turning[2:])
    result[outside, 0] = np.nan
    return result
