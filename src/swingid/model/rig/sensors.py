"""The table [sensors] of rig.toml: what the encoders do to an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from swingid.model.rig.encoder_kinds import NAMES, Kind, kind_of
from swingid.model.rig.fields import Table, given, plain_number, quantity, refuse, stated
from swingid.quantity_text import shown
from swingid.units import Quantity


@dataclass(frozen=True, slots=True)
class Sensor:
    """One encoder, resolved to SI: lengths in rad (a linear axis: m), times in s.

    `resolution` 0 is continuous. `cosine` and `sine` are α and β in q + α cos q + β sin q, the nonlinearity: as
    stated (`calibrated` names those), else 0 with the standard deviation that the file declares for each, or, where
    it declares none (`assumed`), that of its kind. `twice` is that of each part of cos 2q and sin 2q. `noise` is the
    standard deviation of white noise, `jitter` that of the reading instant (one draw per row for all channels).
    `latency` positive: the value in row k is the angle at t_k + latency; `delay` is the standard deviation that a
    latency has which is not stated. `dropouts` is the fraction of rows lost.
    """

    resolution: float = 0.0
    cosine: Quantity = field(default=Quantity(0.0))
    sine: Quantity = field(default=Quantity(0.0))
    calibrated: tuple[str, ...] = ()
    noise: float = 0.0
    latency: Quantity = field(default=Quantity(0.0))
    jitter: float = 0.0
    dropouts: float = 0.0
    twice: float = 0.0
    assumed: bool = False
    delay: float = 0.0

    @property
    def parts(self) -> dict[str, Quantity]:
        """α and β by the names of their functions, "cosine" and "sine"."""
        return {"cosine": self.cosine, "sine": self.sine}

    @property
    def nonlinearity(self) -> float:
        """The larger standard deviation of α and β, 0 where both are known exactly or not declared."""
        return max(self.cosine.std or 0.0, self.sine.std or 0.0)

    @property
    def lateness(self) -> float:
        """Standard deviation (s) of the latency, stated or not."""
        return math.hypot(self.latency.std or 0.0, self.delay)

    @property
    def drawn(self) -> tuple[Quantity, Quantity]:
        """α and β of a twin: as stated; what is only assumed of a rig is not simulated."""
        exact = (Quantity(part.value) for part in (self.cosine, self.sine))
        cosine, sine = exact if self.assumed else (self.cosine, self.sine)
        return cosine, sine

    @property
    def bent(self) -> bool:
        """Return whether the nonlinearity is known to be there, or may be."""
        return self.nonlinearity > 0 or any(part.value != 0 for part in self.parts.values())


LARGEST = 0.5
"""A nonlinearity (rad) beyond which a reading would no longer determine the angle; a larger one is a wrong unit."""


def _known_kind(name: str | None) -> str | None:
    if name is not None and name.lower() not in [known.lower() for known in NAMES]:
        refuse("wrong-value", f"is {shown(name)}, but must be one of {', '.join(NAMES)}")
    return name


class Encoder(Table):
    """Keys of one encoder; all optional. Units and meaning as in `Sensor`.

    sensor: name of its kind, from which follows what is not stated of its nonlinearity; the kind is unknown where it is
    not named. second_harmonic: standard deviation of each of the parts cos 2q and sin 2q; 0 where no kind is named, but
    something of the nonlinearity is stated.
    """

    sensor: Annotated[str | None, AfterValidator(_known_kind)] = None
    counts_per_turn: Annotated[int, Field(strict=True, gt=0)] | None = None
    resolution: Annotated[float, plain_number("rad", "m", least=0)] | None = None
    nonlinearity: Annotated[float, plain_number("rad", least=0)] | None = None
    nonlinearity_cosine: Annotated[Quantity, quantity("rad", least=-LARGEST, most=LARGEST)] | None = None
    nonlinearity_sine: Annotated[Quantity, quantity("rad", least=-LARGEST, most=LARGEST)] | None = None
    second_harmonic: Annotated[float, plain_number("rad", least=0)] | None = None
    noise: Annotated[float, plain_number("rad", "m", least=0)] = 0.0
    latency: Annotated[Quantity, quantity("s")] = Quantity(0.0)
    jitter: Annotated[float, plain_number("s", least=0)] = 0.0
    dropouts: Annotated[float, plain_number("", least=0, below=1)] = 0.0

    @model_validator(mode="after")
    def _one_resolution(self) -> Self:
        if self.counts_per_turn is not None and self.resolution is not None:
            refuse("contradiction", "is given beside counts_per_turn; keep one of the two", "resolution")
        return self

    @property
    def kind(self) -> Kind:
        """The kind of the sensor: as named, else unknown."""
        return kind_of(self.sensor)

    @property
    def says_nonlinearity(self) -> bool:
        """Return whether anything of its nonlinearity is stated."""
        return given(self.nonlinearity, self.nonlinearity_cosine, self.nonlinearity_sine)

    def resolved(self) -> Sensor:
        """The encoder as plain SI numbers."""
        counts = self.counts_per_turn
        resolution = self.resolution or 0.0 if counts is None else math.tau / counts
        once, twice = self.nonlinearity, self.second_harmonic
        if once is None:
            once = math.radians(self.kind.once)
        if twice is None:
            twice = 0.0 if self.sensor is None and self.says_nonlinearity else math.radians(self.kind.twice)
        unknown = Quantity(0.0, once or None)
        parts = {"cosine": self.nonlinearity_cosine, "sine": self.nonlinearity_sine}
        return Sensor(
            resolution=resolution,
            cosine=parts["cosine"] or unknown,
            sine=parts["sine"] or unknown,
            calibrated=tuple(name for name, part in parts.items() if part is not None),
            noise=self.noise,
            latency=self.latency,
            jitter=self.jitter,
            dropouts=self.dropouts,
            twice=twice,
            assumed=self.nonlinearity is None,
        )


class RateSensor(Table):
    """Keys of a gyroscope or tachometer: white noise, steps, limit (rad/s; linear axis m/s), and bias with its
    uncertainty.
    """

    noise: Annotated[float, plain_number("rad/s", "m/s", least=0)] = 0.0
    resolution: Annotated[float, plain_number("rad/s", "m/s", least=0)] = 0.0
    range: Annotated[float, plain_number("rad/s", "m/s", above=0)] = math.inf
    bias: Annotated[Quantity, quantity("rad/s", "m/s")] = Quantity(0.0)


ONE_ENCODER = ("nonlinearity_cosine", "nonlinearity_sine")
"""Keys that hold for one piece of hardware: the wheel's encoder does not inherit the axis' calibration."""


NONLINEARITY = ("nonlinearity", *ONE_ENCODER, "second_harmonic")
"""Keys of what repeats with every turn."""


class Sensors(Encoder):
    """The axis' encoder, and under `wheel` what differs at the wheel's (absent keys are inherited).

    angle_speed, wheel_speed: the sensors of their rates, where those are logged.
    """

    wheel: Encoder | None = None
    angle_speed: RateSensor | None = None
    wheel_speed: RateSensor | None = None

    def of_rate(self, channel: Literal["angle", "wheel"]) -> RateSensor:
        """The sensor of the rate of the `channel`; a perfect one where none is stated."""
        return (self.angle_speed if channel == "angle" else self.wheel_speed) or RateSensor()

    def of(self, channel: Literal["angle", "wheel"]) -> Sensor:
        """The encoder of the `channel` "angle" or "wheel", resolved to SI; "wheel" inherits what it does not state."""
        return self._of_angle if channel == "angle" else self._of_wheel

    def rounded(self, channel: Literal["angle", "wheel"]) -> bool:
        """Return whether the steps of the `channel` are stated as a resolution, which is often rounded, not as
        counts.
        """
        wheel = None if channel == "angle" else self.wheel
        stated = wheel if wheel is not None and wheel.model_fields_set & {"counts_per_turn", "resolution"} else self
        return stated.counts_per_turn is None

    @cached_property
    def _of_angle(self) -> Sensor:
        return self.resolved()

    @cached_property
    def _of_wheel(self) -> Sensor:
        return self.of_wheel.resolved()

    @cached_property
    def of_wheel(self) -> Encoder:
        """The keys of the wheel's encoder, its own and inherited ones."""
        stated = {} if self.wheel is None else {key: getattr(self.wheel, key) for key in self.wheel.model_fields_set}
        shared = {key: getattr(self, key) for key in Encoder.model_fields if key not in ONE_ENCODER}
        if "counts_per_turn" in stated or "resolution" in stated:
            shared |= {"counts_per_turn": None, "resolution": None}
        if "sensor" in stated:
            shared |= {"nonlinearity": None, "second_harmonic": None}
        return Encoder.model_construct(**shared | stated)

    def of_camera(self, *, has_wheel: bool) -> Sensors:
        """Return the sensor as a camera's, of the kind for marks in a video, where nothing is stated of it."""
        if self.sensor is not None or self.says_nonlinearity:
            return self
        stated: dict[str, Any] = {key: getattr(self, key) for key in self.model_fields_set} | {"sensor": "camera"}
        if has_wheel and (self.wheel is None or self.wheel.sensor is None):
            known = {} if self.wheel is None else self.wheel.model_dump(exclude_unset=True)
            stated["wheel"] = Encoder.model_validate({**known, "sensor": "unknown"})
        return Sensors.model_construct(**stated)

    def with_pivot(self, cosine: float, sine: float) -> Sensors:
        """Return the sensor with standard deviations (rad) of both parts once per turn, where none are stated.

        They come from a pivot that was fitted to the marks of a video. A plane that is seen from aside makes an ellipse
        of the circle, whose centre is as far off along the lever as the part of twice per turn.
        """
        if self.says_nonlinearity:
            return self
        aside = 2 * self.resolved().twice
        parts = {
            "nonlinearity_cosine": Quantity(0.0, cosine),
            "nonlinearity_sine": Quantity(0.0, math.hypot(sine, aside)),
        }
        stated = {key: getattr(self, key) for key in self.model_fields_set}
        twice = stated.get("second_harmonic", math.radians(self.kind.twice))
        return Sensors.model_construct(**stated | parts | {"second_harmonic": twice})

    @property
    def says_latency(self) -> bool:
        """Return whether the file states when a channel is read."""
        return stated(self, "latency") or (self.wheel is not None and stated(self.wheel, "latency"))
