"""The table [sensors] of rig.toml: what the encoders do to an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from swingid.model.rig.fields import Table, plain_number, quantity, refuse, stated
from swingid.units import Quantity


@dataclass(frozen=True, slots=True)
class Sensor:
    """One encoder, resolved to SI: lengths in rad (a linear axis: m), times in s.

    `resolution` 0 is continuous. `nonlinearity` is the standard deviation of each of α and β in
    q + α cos q + β sin q, `noise` that of white noise, `jitter` that of the reading instant (one draw per row
    for all channels). `latency` positive: the value in row k is the angle at t_k + latency. `dropouts` is the
    fraction of rows lost.
    """

    resolution: float = 0.0
    nonlinearity: float = 0.0
    noise: float = 0.0
    latency: Quantity = field(default=Quantity(0.0))
    jitter: float = 0.0
    dropouts: float = 0.0


class Encoder(Table):
    """Keys of one encoder; all optional, a perfect sensor without them. Units and meaning as in `Sensor`."""

    counts_per_turn: Annotated[int, Field(strict=True, gt=0)] | None = None
    resolution: Annotated[float, plain_number("rad", "m", least=0)] | None = None
    nonlinearity: Annotated[float, plain_number("rad", least=0)] = 0.0
    noise: Annotated[float, plain_number("rad", "m", least=0)] = 0.0
    latency: Annotated[Quantity, quantity("s")] = Quantity(0.0)
    jitter: Annotated[float, plain_number("s", least=0)] = 0.0
    dropouts: Annotated[float, plain_number("", least=0, below=1)] = 0.0

    @model_validator(mode="after")
    def _one_resolution(self) -> Self:
        if self.counts_per_turn is not None and self.resolution is not None:
            refuse("contradiction", "is given beside counts_per_turn; keep one of the two", "resolution")
        return self

    def resolved(self) -> Sensor:
        """The encoder as plain SI numbers."""
        counts = self.counts_per_turn
        resolution = self.resolution or 0.0 if counts is None else math.tau / counts
        return Sensor(resolution, self.nonlinearity, self.noise, self.latency, self.jitter, self.dropouts)


class Sensors(Encoder):
    """The axis' encoder, and under `wheel` what differs at the wheel's (absent keys are inherited)."""

    wheel: Encoder | None = None

    def of(self, channel: Literal["angle", "wheel"]) -> Sensor:
        """The encoder of the `channel` "angle" or "wheel", resolved to SI; "wheel" inherits what it does not state."""
        if channel == "angle" or self.wheel is None:
            return self.resolved()
        own = {key: getattr(self.wheel, key) for key in self.wheel.model_fields_set}
        shared = {key: getattr(self, key) for key in Encoder.model_fields}
        if stated(self.wheel, "counts_per_turn") or stated(self.wheel, "resolution"):
            shared |= {"counts_per_turn": None, "resolution": None}
        return Encoder.model_construct(**shared | own).resolved()
