"""What all controllers share: a step from sample to sample, their refusals, and the constants of the rig's motor."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from swingid.control import law
from swingid.errors import InputError, UsageError

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array


def motor_voltages(rig: Rig) -> dict[str, Any]:
    """The fields of `SampledController` for a rig's motor; without a wheel nothing is compensated, only the limit set.

    Raises InputError for a wheel whose motor gives no torque per volt.
    """
    motor = rig.drive.motor
    limit = None if motor is None else motor.voltage_limit
    if motor is None or rig.drive.wheel is None:
        return {"voltage_limit": limit}
    require_torque(rig)
    c1, eta = motor.torque_per_volt.value, motor.efficiency.value
    d2, d1 = motor.dead_zone
    return {
        "coulomb_voltage": motor.coulomb.value / (c1 * eta),
        "dead_zone_voltage": (d2 / (c1 * eta), d1 / (c1 * eta)),
        "back_emf_ratio": motor.back_emf.value / c1,
        "voltage_limit": limit,
    }


def require_torque(rig: Rig) -> None:
    """Raise InputError for a rig whose voltage moves nothing: a reaction wheel without torque per volt."""
    motor = rig.drive.motor
    if rig.drive.wheel is not None and (motor is None or motor.torque_per_volt.value == 0.0):
        message = f"rig {rig.name!r} gives no drive.motor.torque_per_volt, without which no voltage moves it; add it"
        raise InputError(message, code="no-torque")


@dataclass(frozen=True, kw_only=True)
class SampledController(ABC):
    """A controller with a compiled step: f3/(c1 eta) (V) of u1, (d2, d1)/(c1 eta) (V) of u3 (12), c2/c1 (V s/rad).

    voltage_limit: of u0 (V), None for none. sample_time (s): used by `step` alone.
    """

    voltage_limit: float | None = None
    coulomb_voltage: float = 0.0
    dead_zone_voltage: tuple[float, float] = (0.0, 0.0)
    back_emf_ratio: float = 0.0
    sample_time: float = 1e-3
    _kernel: ClassVar[Callable[..., float]]

    @abstractmethod
    def initial_state(self, angle: float = 0.0, wheel_angle: float | None = None) -> Array:
        """State before the first sample."""

    @abstractmethod
    def parameters(self, sample_time: float | None = None) -> Array:
        """Parameter array of the compiled step."""

    def step(self, t: float, angles: Sequence[float], state: Array) -> tuple[float, Array]:
        """One sample: (voltage (V) held to the next, new state).

        `angles` = (reference, angle, wheel_angle) in rad (m), wheel_angle 0 without a wheel. The law does
        not depend on `t` (s), which every controller is given. `state` is left as it is.
        """
        del t
        reference, angle, wheel_angle = angles
        moved = state.copy()
        return float(self._kernel(reference, angle, wheel_angle, moved, _parameters(self))), moved

    def _require(self, holds: bool, sentence: str) -> None:
        """Raise UsageError with the controller's name unless a gain is in range."""
        if not holds:
            raise refused(type(self), sentence)

    def _require_motor(self) -> None:
        """Raise UsageError for a limit of the voltage or a sample time that is not positive."""
        self._require(0.0 < self.sample_time < math.inf, f"sample_time must be positive, and is {self.sample_time}")
        limit = self.voltage_limit
        self._require(limit is None or limit > 0.0, f"voltage_limit must be positive, and is {limit}")

    def _common_parameters(self, sample_time: float | None) -> Array:
        """Array (law.ALPHA,) with what every compiled step reads: sample time, limit, Coulomb friction, dead zone."""
        h = self.sample_time if sample_time is None else float(sample_time)
        self._require(0.0 < h < math.inf, f"the sample time must be positive, and is {h}")
        head = np.zeros(law.ALPHA)
        head[law.SAMPLE_TIME] = h
        head[law.LIMIT] = math.inf if self.voltage_limit is None else self.voltage_limit
        head[law.COULOMB], head[law.BACK_EMF] = self.coulomb_voltage, self.back_emf_ratio
        head[law.DEAD_NEGATIVE], head[law.DEAD_POSITIVE] = self.dead_zone_voltage
        return head


@cache
def _parameters(controller: SampledController) -> Array:
    """The parameter array of `step`, made once per controller."""
    return controller.parameters()


def refused(kind: type[SampledController], sentence: str) -> UsageError:
    """The error that names the controller."""
    return UsageError(f"{kind.__name__}: {sentence}.", code="bad-controller")
