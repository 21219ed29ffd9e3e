"""One log of a motor calibration: its kind, the wheel's motion, the parts without reversal of the wheel."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from swingid.errors import InputError, UnanswerableError
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import GaussNodes, held_between
from swingid.preparation.encoders import Encoders, moved
from swingid.preparation.motion import FEWEST_ROWS
from swingid.preparation.noise import Noise, channel_noise
from swingid.preparation.speed import NARROWEST, Speed, smooth_speed, speed_on_grid
from swingid.recording.recording import Recording

Kind = Literal["clamped", "driven", "free swing"]

STILL = 12.0
"""A channel that moves by less than so many standard deviations of its noise is at rest."""

IDLE = 1e-3
"""A voltage (V) below this throughout counts as none."""

SLOWEST = 0.02
"""Share of the wheel's largest speed below which it may be about to stop or to reverse."""

CALM = 0.1
"""Noise of the axis' speed as a share of the slowest speed of the wheel that is used."""

GAP = 4.5
"""A distance of rows beyond so many sample steps ends a part."""


def kind_of(log: Recording, rig: Rig) -> Kind:
    """Kind of a log, from the data: the rod clamped, driven, or a free swing without drive.

    Raises UnanswerableError where nothing moves.
    """
    noise = channel_noise(log, rig)
    name = log.source.path or "the log"
    swings = float(np.ptp(log.angle)) > max(STILL * noise.angle, 1e-6)
    turns = log.wheel_angle is not None and float(np.ptp(log.wheel_angle)) > max(STILL * noise.wheel, 1e-6)
    idle = log.voltage is None or float(np.abs(log.voltage).max()) < IDLE
    if swings and idle:
        slip = 0.0 if log.wheel_angle is None else float(np.ptp(log.wheel_angle) / np.ptp(log.angle))
        if slip < 0.02 or not turns:
            return "free swing"
    if turns:
        return "driven" if swings else "clamped"
    if swings:
        raise UnanswerableError(
            f"{name}: the axis swings under a voltage, but the wheel does not turn; check its encoder, or log a free "
            "swing without voltage.",
            code="wheel-still",
        )
    raise UnanswerableError(
        f"{name}: neither the wheel nor the axis moves by more than noise; log a voltage test that turns the wheel.",
        code="no-motion",
    )


@dataclass(frozen=True)
class WheelLog:
    """The channels of one log of a turning wheel, at samples and at Gauss nodes; the declared errors of its encoders.

    wheel, angle (n,): rad, moved to their stamps. voltage (n,) in V; held from row to row where `held`. speed: the
    wheel's smoothed speed. runs (k, 2): begin and end (s) of the parts in which the wheel turns one way without rest
    and no row is missing. smooth (n,): the axis' angle without most of its noise; both are 0 where the axis is held.
    """

    name: str
    kind: Kind
    nodes: GaussNodes
    wheel: Array
    angle: Array
    voltage: Array
    held: bool
    speed: Speed
    noise: Noise
    runs: Array
    smooth: Array
    encoders: Encoders

    @classmethod
    def of(cls, log: Recording, rig: Rig, kind: Kind, encoders: Encoders) -> WheelLog:
        """The channels of a log; InputError without voltage, UnanswerableError where the wheel hardly turns."""
        name = log.source.path or "the log"
        if log.voltage is None:
            raise InputError(
                f"{name} has no voltage, which a motor calibration requires; name its column as voltage under [log].",
                code="missing-voltage",
            )
        assert log.wheel_angle is not None
        if len(log) < FEWEST_ROWS:
            raise UnanswerableError(
                f"{name} has {len(log)} rows, too few for the speed of the wheel; log a longer test.", code="too-short"
            )
        noise = channel_noise(log, rig)
        wheel = moved(log.time, log.wheel_angle, encoders.wheel.latency.value)
        speed = smooth_speed(log.time, wheel, noise.wheel)
        angle = smooth = np.zeros(len(log))
        if kind == "driven":
            angle = moved(log.time, log.angle, encoders.angle.latency.value)
            smooth = _smoothed(log.time, angle, noise, _slowest(speed))
        runs = _runs(speed, log.time, GAP * noise.step)
        if len(runs) == 0:
            raise UnanswerableError(
                f"{name}: the wheel never turns one way for long enough to determine its speed; raise the "
                "voltage, or lower its frequencies.",
                code="wheel-too-slow",
            )
        return cls(
            name=name,
            kind=kind,
            nodes=GaussNodes(log.time, 2),
            wheel=wheel,
            angle=angle,
            voltage=log.voltage,
            held=log.drive_held,
            speed=speed,
            noise=noise,
            runs=runs,
            smooth=smooth,
            encoders=encoders,
        )

    def voltage_between(self) -> Array:
        """Mean voltage (n−1,) from row to row: that of the row where it is held, half-way to the next where measured.

        Missing rows are interpolated linearly.
        """
        if self.held:
            return held_between(self.nodes.time, self.voltage)
        means: Array = self.voltage[:-1] + np.diff(self.voltage) / 2
        return means

    def voltage_at_nodes(self) -> Array:
        """Voltage at the Gauss nodes: held from row to row, or a spline through measured values."""
        if not self.held:
            return self.nodes.spline(self.voltage)
        return np.repeat(self.voltage_between()[:, None], self.nodes.points, axis=1)


def _slowest(speed: Speed) -> float:
    """Speed (rad/s) below which the wheel may be about to stop or to reverse."""
    return max(6 * speed.noise, SLOWEST * float(np.abs(speed.speed).max()))


def _smoothed(time: Array, angle: Array, noise: Noise, slowest: float) -> Array:
    """q1 (rad) at the stamps, smoothed only until the noise of its speed is too small to reverse the wheel."""
    white = noise.angle / (CALM * slowest)
    width = max(NARROWEST * noise.step, float(np.cbrt(9.375 * noise.step * white**2)))
    return speed_on_grid(time, angle, noise.angle, width, 3.0).angle_at(time)


def _runs(speed: Speed, time: Array, gap: float) -> Array:
    """Parts (k, 2) in s in which |q2'| stays above its threshold with one sign and between gaps of the log."""
    least = _slowest(speed)
    sign = np.where(np.abs(speed.speed) > least, np.sign(speed.speed), 0.0)
    gaps = np.flatnonzero(np.diff(time) > gap)
    broken = np.searchsorted(time[gaps], speed.grid)
    change = np.flatnonzero((np.diff(sign) != 0) | (np.diff(broken) != 0)) + 1
    edges = np.concatenate([[0], change, [len(sign)]])
    runs = []
    for first, last in pairwise(edges):
        if sign[first] == 0 or last - first < 3:
            continue
        inside = time[(time >= speed.grid[first]) & (time <= speed.grid[last - 1])]
        if len(inside) > FEWEST_ROWS:
            begin = max(inside[0], time[gaps[broken[first] - 1] + 1]) if broken[first] else inside[0]
            runs.append((begin, inside[-1]))
    return np.array(runs).reshape(-1, 2)
