"""What is stated as uncertain of a rig, its sensors and its log: one list of perturbations, the same for every method.

A perturbation is an error of a constant, of which the coefficients of the equation are made, or an error s(t) of a
channel, measured = true + s. To first order it changes the known side of every row by

    ρ = −Σ ∂c/∂constant ∫φ f        or        ρ = −Σ c ∫φ ∂f/∂channel s

and a linear estimate θ = K y by K ρ. That gives the sensitivity coefficient of every parameter to every perturbation
without a second fit (type B, JCGM 100 5.1.3). What a method does with φ is its own; the list and the shapes s are not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from swingid.model.equation import CLOCK, Equation, deviations, relative
from swingid.model.rig import Rig
from swingid.model.terms import RigTerm
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Channel, Encoders
from swingid.uncertainty.budget import Declared, stated

Shape = Literal["", "cosine", "sine", "cosine 2", "sine 2", "latency", "scale", "offset", "level"]

SHAPES: dict[str, Callable[[Array], Array]] = {
    "cosine": np.cos,
    "sine": np.sin,
    "cosine 2": lambda q: np.cos(2 * q),
    "sine 2": lambda q: np.sin(2 * q),
    "scale": lambda q: q,
    "offset": np.ones_like,
}
"""Errors of a channel per unit, as functions of its values: nonlinearity once and twice per turn, scale, zero."""

BENDS: tuple[Shape, ...] = "cosine", "sine"
"""Parts of a nonlinearity once per turn."""

SECOND: tuple[Shape, ...] = "cosine 2", "sine 2"
"""Parts of one twice per turn."""

ANGLE_SCALE, ANGLE_OFFSET, WHEEL_SCALE = "log.angle_scale", "log.angle_offset", "log.wheel_scale"
"""Scales (errors are relative) and the zero (rad, m) of the logged angles."""

RATE_SCALE = "log.angle_speed_scale"
"""Scale of a logged rate, and so of its integral."""

OF_THE_ANGLE = (ANGLE_SCALE, RATE_SCALE)
"""Scales of the angle, which are scales of the speed as well."""


@dataclass(frozen=True)
class Perturbation:
    """An error of a constant or of a channel: its source, standard deviation, and the physical quantity `shared_id`.

    channel, shape: of an error of a channel, see `SHAPES`; "latency" is its rate, "level" what is unknown of an
    integrated rate. fitted: whether the method momentum has it as an unknown under its prior, of the mean `mean` in
    standard deviations; others are propagated. constant, of_time: see `Declared`. of_noise: whether it is a part of
    the sensor's noise, which is of type A.
    """

    source: str
    std: float
    shared_id: str | None
    channel: Channel | None = None
    shape: Shape = ""
    fitted: bool = False
    constant: bool = False
    of_time: bool = False
    of_noise: bool = False
    mean: float = 0.0

    @property
    def scales_speed(self) -> bool:
        """Return whether it is a relative error of the speed, too, which friction depends on."""
        return self.source in OF_THE_ANGLE

    def on(self, slopes: Array) -> Declared:
        """Make the entry of the budget; slopes (n,): change per unit of the parameters."""
        return Declared(stated(self.source, self.shared_id), self.std, slopes, self.constant, self.of_time)


@dataclass(frozen=True)
class RowError:
    """A perturbation as it acts: its effect ρ on the known side of the rows of a fit, and on J1 directly, per unit."""

    of: Perturbation
    rows: Array
    direct: float = 0.0

    @property
    def source(self) -> str:
        """The source of the perturbation."""
        return self.of.source

    @property
    def std(self) -> float:
        """The standard deviation of the perturbation."""
        return self.of.std

    def on(self, slopes: Array) -> Declared:
        """Make the entry of the budget; slopes (n,): change per unit of the parameters, the inertia of the whole axis
        first.
        """
        return self.of.on(np.append(slopes[:1] + self.direct, slopes[1:]))


def channel_of(perturbation: Perturbation, drive: str | None) -> str:
    """The channel that an error of a channel acts on: an angle that is late is a drive that is early.

    drive: its channel, as of `Drive.channel`.
    """
    if perturbation.shape == "latency" and perturbation.channel == "angle":
        return (drive or "").removesuffix("_angle")
    return perturbation.channel or ""


Slope = Callable[[Array], Array | float]
"""∂f/∂channel of a term as a function of the angle."""


def slopes_by(channel: str, terms: Mapping[str, RigTerm]) -> list[tuple[str, int, Slope]]:
    """Terms that depend on a channel: name, order of the time derivative that the error meets, ∂f/∂channel.

    terms: of the equation, by name.
    That of friction is left out: of a scale of the angle it is a multiple of its own columns, else negligible.
    """
    if channel == "wheel":
        return [("wheel", 2, _one)]
    if channel == "torque":
        return [("torque", 0, _one)]
    if channel == "voltage":
        return [("torque_per_volt", 0, lambda _: -1.0)]
    held = [(name, 0, term.stiffness) for name, term in terms.items() if term.term.is_conservative]
    return [("inertia", 2, _one), *held]


def _one(_: Array) -> float:
    return 1.0


def propagated(errors: Iterable[RowError], influence: Array, weights: Array | None = None) -> list[Declared]:
    """Effects of perturbations on parameters, of which the inertia is the first (JCGM 100 5.1.3).

    influence (n, rows): of the fit; weights (m, n): of the parameters on its unknowns, where these are not the same.
    """
    slopes = ((error, influence @ error.rows) for error in errors)
    return [error.on(slopes_of if weights is None else weights @ slopes_of) for error, slopes_of in slopes]


def of_constants(equation: Equation) -> Iterator[Perturbation]:
    """The constants that the coefficients of an equation are made of, exact ones (std 0) too."""
    for constant in equation.constants:
        yield Perturbation(
            constant.key,
            constant.std,
            constant.key if constant.shared else None,
            constant=not constant.deviation,
            of_time=constant.key == CLOCK,
        )


def of_channels(rig: Rig, encoders: Encoders) -> list[Perturbation]:
    """What is stated as uncertain of the encoders and of the log's columns, always in the same order."""
    perturbations = [*_nonlinearities(rig, encoders), *_latencies(rig, encoders), *_scales(rig), *_level(encoders)]
    return [perturbation for perturbation in perturbations if perturbation.std > 0]


def encoder_error(encoders: Encoders, channel: Channel, shape: Shape, *, fitted: bool = False) -> Perturbation:
    """A nonlinearity ("cosine", "sine": q + α cos q + β sin q is read; of 2q) or latency (q + q' δ) of an encoder."""
    sensor, prefix = encoders.of_channel(channel), "sensors" if channel == "angle" else "sensors.wheel"
    if shape == "latency":
        return Perturbation(f"{channel} latency", sensor.lateness, f"{prefix}.latency", channel, shape, fitted)
    if shape in SECOND:
        source, part = f"{channel} encoder second harmonic ({shape})", shape.removesuffix(" 2")
        return Perturbation(source, sensor.twice, f"{prefix}.second_harmonic.{part}", channel, shape, fitted)
    std, source = sensor.parts[shape].std, f"{channel} encoder nonlinearity ({shape})"
    shared_id = f"{prefix}.nonlinearity.{shape}"
    return Perturbation(source, std or 0.0, shared_id, channel, shape, fitted)


def _nonlinearities(rig: Rig, encoders: Encoders) -> Iterator[Perturbation]:
    """Once and twice per turn, of each encoder.

    Values stated in the rig file were estimated from data, maybe from these, so their uncertainty is propagated and
    they are not fitted again: the data would count twice. So a11 has the variance of the joint fit.
    """
    for channel in encoders.channels:
        if channel == "angle" and rig.axis.kind == "linear":
            continue
        sensor = encoders.of_channel(channel)
        for shape in BENDS if sensor.nonlinearity else ():
            yield encoder_error(encoders, channel, shape, fitted=shape not in sensor.calibrated)
        for shape in SECOND:
            yield encoder_error(encoders, channel, shape, fitted=True)


def _latencies(rig: Rig, encoders: Encoders) -> Iterator[Perturbation]:
    """A channel that is read late. A free decay does not depend on it."""
    for channel in encoders.channels if rig.drive.channel is not None else ():
        yield encoder_error(encoders, channel, "latency", fitted=True)


def _scales(rig: Rig) -> Iterator[Perturbation]:
    """Angles of which the log shows (1 + ε) q + δ."""
    log = rig.log
    yield Perturbation(ANGLE_SCALE, relative(log.angle_scale), ANGLE_SCALE, "angle", "scale")
    yield Perturbation(ANGLE_OFFSET, log.angle_offset.std or 0.0, ANGLE_OFFSET, "angle", "offset")
    if log.angle_speed is not None:
        yield Perturbation(RATE_SCALE, relative(log.angle_speed_scale), RATE_SCALE, "angle", "scale")
    if rig.drive.wheel is not None:
        yield Perturbation(WHEEL_SCALE, relative(log.wheel_scale), WHEEL_SCALE, "wheel", "scale")


def _level(encoders: Encoders) -> Iterator[Perturbation]:
    """What is left of start, bias and random walk of the integral of a rate: errors of the angle that are slow."""
    level = encoders.level
    if level is None:
        return
    for name, unknown in level.unknowns(np.zeros(1)).items():
        mean = unknown.taken / unknown.std
        yield Perturbation(name, unknown.std, None, "angle", "level", fitted=True, of_noise=True, mean=mean)


def declared_with_deviations(rig: Rig, constants: Iterable[Declared]) -> Iterator[Declared]:
    """Effects of the constants on the parameters, and what follows from them: those of tilts, clock and voltage scale.

    For methods whose rows are not those of equation (I).
    """
    by_source = {constant.source.name: constant for constant in constants}
    yield from by_source.values()
    for key, std, weights in deviations(rig, set(by_source)):
        slopes = [weight * by_source[source].slopes for source, weight in weights.items()]
        none = np.zeros(len(next(iter(by_source.values())).slopes))
        yield Declared(stated(key, key), std, sum(slopes, none), of_time=key == CLOCK)
