"""The Cramér–Rao bound: the least variance of any unbiased estimate from angles with white noise.

The voltage (torque) is what it was in the log. It may depend on noise through the controller, but only on noise that
was measured before; then the likelihood of the angles factors into that of each sample given the earlier ones, and the
information is that of the simulation under the held voltage: I = Sᵀ S / σ² with S the sensitivities of the angles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swingid.errors import InputError, UnanswerableError
from swingid.methods.output_error.problem import INPUTS
from swingid.methods.output_error.segments import problem_of
from swingid.methods.output_error.unknowns import unknowns_of
from swingid.model.parameters import rig_vector
from swingid.model.rig import Rig
from swingid.preparation.encoders import Encoders
from swingid.preparation.noise import Noise
from swingid.preparation.scale import equation_of, refuse_motor
from swingid.recording.recording import Recording

SINGULAR = 1e-12
"""Least eigenvalue of the information, scaled to a diagonal of ones, below which the unknowns are not identifiable."""


def cramer_rao(
    log: Recording, rig: Rig, law: str = "viscous", *, free: Sequence[str] = (), start: Sequence[float] | None = None
) -> dict[str, float]:
    """Least standard deviations of inertia, friction of a known law, and the constants `free`, by name.

    log: gives the instants, the voltage (torque) and, without `start`, the initial values; only the voltage's values
    matter beside them. rig: the true values, with inertia, friction and the white noise of its sensors; quantisation is
    not counted. start: true angle, speed and, with a wheel, its angle and speed at the first row. They count as
    unknown; all other constants as known. Use it beside estimates from many runs, not for a log without true values.

    Raises InputError for a rig without inertia or noise, UnanswerableError where the unknowns are not identifiable,
    or a motor is on the axis.
    """
    refuse_motor(rig, "the bound")
    equation, source = equation_of(rig), INPUTS[rig.drive.channel]
    encoders = Encoders.of(rig)
    noise = Noise(encoders.angle.noise, encoders.wheel.noise, 1 / log.rate)
    if rig.axis.inertia is None or noise.angle == 0.0:
        missing = "axis.inertia" if rig.axis.inertia is None else "sensors.noise"
        raise InputError(f"rig {rig.name}: {missing} is missing, but the bound needs it; give it.", code="missing-key")
    duration = float(log.time[-1] - log.time[0])
    problem = problem_of(log, encoders, noise, source, 2 * duration, np.inf)
    # the last two only bound a search, and there is none here
    unknowns = unknowns_of(rig, equation, law, tuple(free), 1.0, 1.0)
    states = problem.starts if start is None else np.array([start], dtype=np.float64)
    prediction = problem.predict(rig_vector(rig), unknowns.entries(problem.states), states, len(unknowns))
    if not (prediction.finite and np.isfinite(prediction.slopes).all()):
        raise UnanswerableError(
            "the simulated motion under the log's voltage diverges; check the rig's constants.", code="not-finite"
        )
    shooting, count = problem.shooting(unknowns), len(problem.measured)
    reduced = shooting.reduced(shooting.grams(prediction.slopes, np.zeros(count), np.ones(count)))
    size = np.sqrt(np.maximum(np.diag(reduced.matrix), 1e-300))
    if np.linalg.eigvalsh(reduced.matrix / np.outer(size, size))[0] < SINGULAR:
        raise UnanswerableError(
            f"{', '.join(unknowns.names)} are not identifiable from this log together; leave fewer free.",
            code="not-identifiable",
        )
    return dict(zip(unknowns.names, np.sqrt(np.diag(reduced.inverse)).tolist(), strict=True))
