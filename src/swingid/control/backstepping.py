"""Adaptive backstepping (21) with the velocity observers (23), the paper's alternative method (section 4.2).

    u2 = (e1 - a3^ x2^ - a2^ sin x1 + a7^ x4^ + n1 (x2^ - y_m') - y_m'' + n2 e2) / a4^
    e1 = x1 - y_m,   e2 = x2^ + n1 e1 - y_m',   a4^ = c4 a2^,   a7^ = c7 a2^
    a3^' = -gamma1 e2 x2^
    a2^' = -gamma2 e2 sin x1                           "printed"
    a2^' =  gamma2 e2 (-sin x1 + c7 x4^ - c4 u2)       "consistent", what the Lyapunov function requires

e1 is printed as the opposite, (14); its derivatives and (21) are those of x1 - y_m. The proof leaves out the errors of
a4^ and a7^, though both follow a2^: hence the second law. The u2 of the law is the one that was applied, u0 - u1 - u3
after the limit. Both estimates are kept above a least value, as in section 5.

(21) needs y_m' and y_m'': they are taken from the last four references, to second order in the sample time, so that the
controller is given the same as `Compensator` and nothing of the future.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.control import law
from swingid.control.controller import SampledController, motor_voltages, refused
from swingid.control.law import motor_compensation
from swingid.control.observer import OBSERVER_PARAMETERS, OBSERVER_STATES, VelocityObserver, observer_step
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_inlined

if TYPE_CHECKING:
    from swingid.model.rig import Rig


# Places in the state: estimates, references before, how many were seen, the two observers.
ALPHA2, ALPHA3, BEFORE, SEEN, AXIS = 0, 1, 2, 5, 6
WHEEL, STATES = AXIS + OBSERVER_STATES, AXIS + 2 * OBSERVER_STATES
# Places in the parameters; SAMPLE_TIME, LIMIT, COULOMB ... BACK_EMF are those of `law`.
N1, N2, GAMMA1, GAMMA2, C4, C7, CONSISTENT, LEAST = 0, 2, 3, 4, 5, 6, 7, 8
AXIS_OBSERVER = law.ALPHA
WHEEL_OBSERVER = AXIS_OBSERVER + OBSERVER_PARAMETERS
PARAMETERS = WHEEL_OBSERVER + OBSERVER_PARAMETERS


@njit_inlined
def reference_rates(reference: float, state: Array, h: float) -> tuple[float, float]:
    """y_m' and y_m'' at this sample from it and the three before, which `state` keeps.

    Errors h^2 y_m'''/3 and 11/12 h^2 y_m''''; the first sample gives 0, 0, the next two are of lower order.
    """
    y1, y2, y3 = state[BEFORE], state[BEFORE + 1], state[BEFORE + 2]
    seen = state[SEEN]
    rate, bend = 0.0, 0.0
    if seen == 1.0:
        rate = (reference - y1) / h
    elif seen >= 2.0:
        rate = (3.0 * reference - 4.0 * y1 + y2) / (2.0 * h)
        bend = (reference - 2.0 * y1 + y2) / (h * h)
    if seen >= 3.0:
        bend = (2.0 * reference - 5.0 * y1 + 4.0 * y2 - y3) / (h * h)
    state[BEFORE], state[BEFORE + 1], state[BEFORE + 2] = reference, y1, y2
    state[SEEN] = min(seen + 1.0, 3.0)
    return rate, bend


@njit
def backstepping_step(reference: float, angle: float, wheel_angle: float, state: Array, parameters: Array) -> float:
    """Voltage (V) to hold from this sample to the next; moves `state` on by one sample in place. (21), (23).

    `reference`, `angle`, `wheel_angle` in rad, state from `Backstepping.initial_state`, parameters from
    `Backstepping.parameters`.
    """
    h = parameters[law.SAMPLE_TIME]
    rate, bend = reference_rates(reference, state, h)
    x2 = observer_step(angle, state[AXIS:WHEEL], parameters[AXIS_OBSERVER:WHEEL_OBSERVER])
    x4 = observer_step(wheel_angle, state[WHEEL:STATES], parameters[WHEEL_OBSERVER:PARAMETERS])
    n1, alpha2, alpha3 = parameters[N1], state[ALPHA2], state[ALPHA3]
    c4, c7 = parameters[C4], parameters[C7]
    sine = np.sin(angle)
    e1 = angle - reference
    e2 = x2 + n1 * e1 - rate
    wanted = e1 - alpha3 * x2 - alpha2 * sine + c7 * alpha2 * x4 + n1 * (x2 - rate) - bend + parameters[N2] * e2
    u2 = wanted / (c4 * alpha2)
    u0 = motor_compensation(u2, x4, parameters)
    applied = min(max(u0, -parameters[law.LIMIT]), parameters[law.LIMIT])
    u2 -= u0 - applied
    drive = -sine
    if parameters[CONSISTENT] != 0.0:
        drive += c7 * x4 - c4 * u2
    state[ALPHA3] = max(alpha3 - h * parameters[GAMMA1] * e2 * x2, parameters[LEAST])
    state[ALPHA2] = max(alpha2 + h * parameters[GAMMA2] * e2 * drive, parameters[LEAST])
    return float(applied)


@dataclass(frozen=True)
class Backstepping(SampledController):
    """The controller (21) with its gains, its first estimates and its model of rig and motor.

    Not where motor constants or b are unknown; where the reference is not smooth, y_m'' has impulses.

    Parameters
    ----------
    gravity_torque : float, N m
        b of (I).
    a12, a22, carried : float, kg m²
        Coefficients of (I) and (II); J2 + Jr.
    c4, c7 : float, 1/V and s/rad
        a4/a2 and a7/a2 of (11).
    n1, n2, gamma1, gamma2 : float, 1/s, 1/s, 1/rad², 1/s²
        Gains, by default as in section 5.
    alpha2, alpha3, least : float, 1/s², 1/s
        First estimates, and their lower bound.
    law : "printed" or "consistent"
        Of adaptation.
    observers
        Of axis and wheel, (23).
    coulomb_voltage, dead_zone_voltage, back_emf_ratio, voltage_limit
        As in `Compensator`.
    sample_time : float, s
        Used by `step` alone.

    Raises
    ------
    UsageError
        Gains out of range.
    """

    gravity_torque: float
    a12: float
    a22: float
    carried: float
    c4: float
    c7: float
    law: Literal["printed", "consistent"] = "printed"
    n1: float = 10.0
    n2: float = 10.0
    gamma1: float = 10.0
    gamma2: float = 100.0
    alpha2: float = 1.0
    alpha3: float = 1.0
    least: float = 1e-6
    observers: tuple[VelocityObserver, VelocityObserver] = (VelocityObserver(), VelocityObserver())

    _kernel = staticmethod(backstepping_step)

    def __post_init__(self) -> None:
        """Refuse gains that cannot work, in one sentence that names the gain."""
        for name in ("gravity_torque", "a12", "a22", "c4", "n1", "n2", "alpha2", "alpha3", "least"):
            value = getattr(self, name)
            self._require(0.0 < value < math.inf, f"{name} must be positive, and is {value}")
        for name in ("gamma1", "gamma2", "carried", "c7"):
            value = getattr(self, name)
            self._require(0.0 <= value < math.inf, f"{name} must be zero or positive, and is {value}")
        self._require_motor()
        self._require(self.law in ("printed", "consistent"), f"law must be 'printed' or 'consistent', not {self.law!r}")

    @classmethod
    def paper(
        cls, rig: Rig, *, law: Literal["printed", "consistent"] = "printed", sample_time: float = 1e-3
    ) -> Backstepping:
        """The gains of section 5 for a rig; sample_time (s) is used by `step` alone.

        Raises UsageError for a rig that is no reaction wheel pendulum, or without gravity torque or motor constants,
        which (21) depends on.
        """
        motor, wheel, gravity = rig.drive.motor, rig.drive.wheel, rig.axis.acting_gravity
        if rig.drive.wheel is None or motor is None or wheel is None or rig.axis.kind == "linear":
            raise refused(cls, f"rig {rig.name!r} is no reaction wheel pendulum with a motor, which (21) is made for")
        if gravity is None or gravity.value <= 0.0 or motor.torque_per_volt.value <= 0.0:
            raise refused(
                cls, f"rig {rig.name!r} must state axis.gravity_torque and drive.motor.torque_per_volt above 0"
            )
        a12, a22, n = rig.drive.a12, rig.drive.a22, motor.gear_ratio.value
        c1, c2, eta = motor.torque_per_volt.value, motor.back_emf.value, motor.efficiency.value
        ratio = a12 * n / (a22 * gravity.value)
        return cls(
            gravity_torque=gravity.value,
            a12=a12,
            a22=a22,
            carried=rig.drive.carried,
            c4=ratio * eta * c1,
            c7=ratio * (c2 * eta + motor.viscous.value * n),
            law=law,
            sample_time=sample_time,
            **motor_voltages(rig),
        )

    def initial_state(self, angle: float = 0.0, wheel_angle: float | None = None) -> Array:
        """State (14,) before the first sample: estimates, memory of the reference, observers.

        The angles are taken for interface's sake: the first sample sets the observers.
        """
        del angle, wheel_angle
        state = np.zeros(STATES)
        state[ALPHA2], state[ALPHA3] = self.alpha2, self.alpha3
        return state

    def parameters(self, sample_time: float | None = None) -> Array:
        """Parameter array of `backstepping_step` for a sample time (s), `self.sample_time` if None.

        Raises UsageError for a sample time that is not positive.
        """
        head = self._common_parameters(sample_time)
        h = float(head[law.SAMPLE_TIME])
        head[N1], head[N2], head[GAMMA1], head[GAMMA2] = self.n1, self.n2, self.gamma1, self.gamma2
        head[C4], head[C7], head[LEAST] = self.c4, self.c7, self.least
        head[CONSISTENT] = float(self.law == "consistent")
        return np.concatenate([head, *(observer.parameters(h) for observer in self.observers)])

    def inertia(self, alpha2: Array | float) -> Array:
        """J1^ (kg m^2) of (22) for estimates of alpha_2 (1/s^2), of any shape."""
        return np.asarray(self.gravity_torque / np.asarray(alpha2) + self.a12**2 / self.a22 - self.carried)

    def viscous(self, alpha2: Array | float, alpha3: Array | float) -> Array:
        """f1^ N (N m s) of (22) for estimates of alpha_2 (1/s^2) and alpha_3 (1/s)."""
        return np.asarray(np.asarray(alpha3) * self.gravity_torque / np.asarray(alpha2))
