"""The consecutive compensator (15)-(20): adaptive output feedback from measured angles alone.

One function, `compensator_step`, is the controller of the twin's compiled loop and of `Compensator.step`.
Between two samples the error is held, so the chain (16), the error filter of (18) and the gain (17) are
integrated exactly: the controller is stable at every rate, and a coarse one is only late, never divergent
by itself.

Not for plants whose zeros are unstable, nor where a velocity is measured (use it then).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.control import law
from swingid.control.controller import SampledController, motor_voltages, refused
from swingid.control.law import compensator_step
from swingid.numerics.arrays import Array

if TYPE_CHECKING:
    from swingid.model.rig import Rig


def _hurwitz(polynomial: Sequence[float]) -> bool:
    """Return whether all roots of a polynomial (highest power first) lie in the open left half plane."""
    return bool(np.all(np.roots(np.asarray(polynomial, dtype=float)).real < 0.0))


@dataclass(frozen=True)
class Compensator(SampledController):
    """The consecutive compensator with its gains and its model of the motor.

    Parameters
    ----------
    delta0, sigma0, lambda0 : float, rad, 1/s, 1/s
        Of (18), (19).
    k_tilde0, k_tilde_max : float
        Start and optional upper bound of the gain (17).
    filter_time : float, s
        T of W_f = 1/(T p + 1) in (18), 0 for none.
    alpha : (rho,) float
        Polynomial of order rho − 1, highest power first; rho is the relative degree.
    k : (rho − 1,) float
        k_1, ..., k_(rho−1) of (16).
    voltage_limit : float, V
        Saturation, None for none.
    coulomb_voltage, dead_zone_voltage : float; (2,) float, V
        f3/(c1 eta) of u1; (d2, d1)/(c1 eta) of u3 in (12).
    back_emf_ratio : float, V s/rad
        c2/c1.
    dead_zone_switch : "exact" or "printed"
        Whether u3 switches on the sign of c1 (u1 + u2) − c2 q2', or of u1 + u2.
    plant_sign : −1 or +1
        −1 where a positive voltage drives the angle down: a reaction wheel, as printed in (15).
    differentiate_gain : bool
        True applies alpha(p) to the product k tilde xi_1, as (20) does; False is (15) to the letter, k tilde
        alpha(p) xi_1. They differ only while k tilde grows.
    wheel_filter_time : float, s
        Smooths the wheel's sampled differences, 0 for none.
    sample_time : float, s
        Used by `step` alone.

    Raises
    ------
    UsageError
        Gains out of range, a chain or an alpha that is not stable.
    """

    delta0: float
    sigma0: float
    lambda0: float
    k_tilde0: float = 0.0
    k_tilde_max: float | None = None
    filter_time: float = 0.0125
    alpha: tuple[float, ...] = (1.0, 1.0)
    k: tuple[float, ...] = (1.0,)
    dead_zone_switch: Literal["exact", "printed"] = "exact"
    plant_sign: int = -1
    differentiate_gain: bool = True
    wheel_filter_time: float = 0.0

    _kernel = staticmethod(compensator_step)

    def __post_init__(self) -> None:
        """Refuse gains that cannot work, in one sentence that names the gain."""
        object.__setattr__(self, "alpha", tuple(float(value) for value in self.alpha))
        object.__setattr__(self, "k", tuple(float(value) for value in self.k))
        for name in ("delta0", "sigma0", "lambda0", "k_tilde0", "filter_time", "wheel_filter_time"):
            value = getattr(self, name)
            self._require(0.0 <= value < math.inf, f"{name} must be zero or positive, and is {value}")
        most, sign, switch = self.k_tilde_max, self.plant_sign, self.dead_zone_switch
        self._require_motor()
        self._require(
            most is None or most >= self.k_tilde0, f"k_tilde_max = {most} must not lie below k_tilde0 = {self.k_tilde0}"
        )
        self._require(sign in (-1, 1), f"plant_sign must be -1 (reaction wheel) or 1, and is {sign}")
        self._require(switch in ("exact", "printed"), f"dead_zone_switch must be 'exact' or 'printed', not {switch!r}")
        self._require(
            len(self.alpha) == len(self.k) + 1,
            f"alpha has {len(self.alpha)} coefficients and k {len(self.k)}; alpha needs one more than k",
        )
        self._require(
            self.alpha[0] > 0.0 and _hurwitz(self.alpha),
            f"alpha = {self.alpha} must start positive and have its roots in the left half plane",
        )
        self._require(_hurwitz((1.0, *reversed(self.k))), f"k = {self.k} makes the chain (16) unstable")

    @classmethod
    def paper(cls, rig: Rig, *, sample_time: float = 1e-3) -> Compensator:
        """The gains of the paper's experiment (section 5) with the rig's motor compensated.

        sample_time (s) is used by `step` alone; the twin's loop passes its own. On a direct drive the output is the
        torque (N m), for which these gains are not made. Raises UsageError for a rig without a drive.
        """
        return cls._for_rig(rig, 0.08, 0.1, 2.0, sample_time)

    @classmethod
    def paper_simulation(cls, rig: Rig, *, sample_time: float = 1e-4) -> Compensator:
        """The gains of the paper's simulation (Fig. 7), for a loop of 10 kHz that reads ideal angles.

        At 1 kHz, or with 14-bit encoders at 10 kHz too, k tilde never settles and the voltage chatters between its
        limits: a step of the error is answered with k tilde sigma, 4e6 V/rad, at once. Raises UsageError for a rig
        without a drive.
        """
        return cls._for_rig(rig, 0.005, 0.01, 150.0, sample_time)

    @classmethod
    def _for_rig(cls, rig: Rig, delta0: float, sigma0: float, lambda0: float, sample_time: float) -> Compensator:
        if rig.drive.channel is None:
            raise refused(cls, f"rig {rig.name!r} has no drive to control")
        return cls(
            delta0=delta0,
            sigma0=sigma0,
            lambda0=lambda0,
            plant_sign=-1 if rig.drive.wheel is not None else 1,
            sample_time=sample_time,
            **motor_voltages(rig),
        )

    def initial_state(self, angle: float = 0.0, wheel_angle: float | None = None) -> Array:
        """State before the first sample (rho + 3,): k tilde, filtered error, wheel memory, its flag, xi.

        `angle` is taken for interface's sake: the chain and the filter start at zero error, as in the
        paper. With `wheel_angle` None the first sample sets the wheel's memory.
        """
        del angle
        state = np.zeros(law.XI + len(self.k))
        state[law.K_TILDE] = self.k_tilde0
        if wheel_angle is not None:
            state[law.WHEEL_MEMORY], state[law.WHEEL_SEEN] = wheel_angle, 1.0
        return state

    def parameters(self, sample_time: float | None = None) -> Array:
        """Parameter array of `compensator_step` for a sample time (s), `self.sample_time` if None.

        Raises UsageError for a sample time that is not positive.
        """
        head = self._common_parameters(sample_time)
        h = head[law.SAMPLE_TIME]
        head[law.ORDER] = len(self.k)
        head[law.DELTA0], head[law.LAMBDA0], head[law.SIGMA0] = self.delta0, self.lambda0, self.sigma0
        head[law.K_TILDE_MAX] = math.inf if self.k_tilde_max is None else self.k_tilde_max
        head[law.ERROR_DECAY] = math.exp(-h / self.filter_time) if self.filter_time > 0.0 else 0.0
        head[law.WHEEL_DECAY] = math.exp(-h / self.wheel_filter_time) if self.wheel_filter_time > 0.0 else 0.0
        head[law.PLANT_SIGN], head[law.DIFFERENTIATE_GAIN] = self.plant_sign, float(self.differentiate_gain)
        if self.dead_zone_switch == "printed":
            head[law.BACK_EMF] = 0.0
        return np.concatenate([head, self.alpha, self.k])
