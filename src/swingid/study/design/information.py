"""Information matrix and uncertainty budget that the momentum method will have after a planned motion.

The motion is free of noise; the errors of the sensors go through the linear fit θ = K y of the very windows that the
method would choose: an error e1(t) of the angle moves row i by ∫(a11 φ_i'' + b cos q1 φ_i) e1 dt, one of the wheel by
∫a12 φ_i'' e2 dt. What rig.toml declares as uncertain goes the way it goes in the method (`imperfections`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.choice import choose
from swingid.balance.errors import errors_of
from swingid.balance.fits import BASIS, columns_of
from swingid.balance.identifiability import Identifiability, examine, examine_information
from swingid.balance.perturbations import RowError
from swingid.balance.rows import Rows, Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensor
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.numerics.test_functions import CURVATURE_POWER, superpose
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.preparation.scale import equation_of
from swingid.recording.recording import Recording
from swingid.uncertainty.budget import BudgetEntry, Parameter, Scatter, combined, evaluate

DRAWS = 100
"""Places of the encoders' grids that are tried; the standard deviation is then known to 7 %."""

FINE = 0.5
"""White noise of this share of an encoder's step makes its rounding white too."""


@dataclass(frozen=True)
class Prediction:
    """What to expect of the method.

    parameters: the expected values with predicted uncertainties. budget: as of a result. window: half-length of the
    modulating functions (s). gravity_sensitivity: relative change of the inertia per relative change of the gravity
    torque. seen: identifiability.
    """

    parameters: dict[str, Parameter]
    budget: tuple[BudgetEntry, ...]
    window: float
    gravity_sensitivity: float
    seen: Identifiability

    @property
    def relative(self) -> float:
        """Predicted standard uncertainty of the inertia as a share of it."""
        inertia = self.parameters["inertia"]
        return (inertia.standard_uncertainty or 0.0) / inertia.value

    def part(self, kind: str) -> float:
        """The same of the entries of one type, "A" or "B"."""
        entries = [entry for entry in self.budget if entry.type == kind]
        return combined(entries, "inertia") / self.parameters["inertia"].value


def predict(log: Recording, rig: Rig, expected: Rig) -> Prediction:
    """Prediction for the noise-free `log` of a planned motion.

    rig: what the method will be given; expected: the same with the inertia, friction and gravity torque expected.
    Raises UnanswerableError where the method would find no answer.
    """
    equation = equation_of(rig)
    seen_log = with_errors(log, rig, np.random.default_rng(0))
    noise = channel_noise(seen_log, rig)
    encoders = Encoders.of(rig)
    moving = find_motion(log.time, seen_log.angle, noise.angle)
    half = choose(Signals.of(seen_log, rig, moving, encoders), rig, equation, noise).law.half
    signals = Signals.of(log, rig, find_motion(log.time, log.angle, noise.angle), encoders).suited(half)
    rows = rows_of(signals, law_windows(signals, half))
    unknowns, columns = columns_of(rows, equation, BASIS)
    if len(rows.windows) <= 2 * len(unknowns):
        raise UnanswerableError("the motion is too short for its slowest swing.", code="too-short")
    assert expected.axis.inertia is not None
    a11 = expected.axis.inertia.value + equation.carried
    b = expected.axis.acting_gravity
    gravity = 0.0 if b is None else b.value
    expecting = equation.stated | {"inertia": a11, "gravity_torque": gravity}
    items = errors_of(rows, signals, rig, equation, expecting)
    power = ((a11 * noise.angle) ** 2 + (equation.value("wheel") * noise.wheel) ** 2) * noise.step / half**3
    row_noise = float(np.sqrt(2 * power * CURVATURE_POWER))
    influence, effects = _fit(columns, items, row_noise)
    covariance = _sensors(log, rig, rows, influence, a11, gravity)
    units = units_on(linear=equation.linear)
    named = [units.get(name, "") for name in unknowns]
    if np.linalg.matrix_rank(covariance, hermitian=True) == len(unknowns):
        seen = examine_information(unknowns, named, np.asarray(np.linalg.inv(covariance), dtype=np.float64))
    else:  # perfect sensors: the regressors alone
        seen = examine(unknowns, named, columns)
    values = {"inertia": (a11 - equation.carried, units["inertia"])}
    if "gravity_torque" in unknowns:
        values["gravity_torque"] = gravity, units["gravity_torque"]
    count, declared = len(values), []
    for item, effect in zip(items, effects.T, strict=True):
        declared.append(item.on(effect[:count] / item.std))
    noise_of = Scatter("sensor noise and resolution", covariance[:count, :count], np.full(count, np.inf))
    evaluated = evaluate(values, noise_of, (), declared, relative=rig.axis.model_uncertainty)
    sensitivity = abs(float(influence[0] @ rows["gravity_torque"])) * gravity / a11
    return Prediction(evaluated.parameters, tuple(evaluated.budget), half, sensitivity, seen)


def _fit(columns: Array, items: list[RowError], row_noise: float) -> tuple[Array, Array]:
    """Influence of the rows (unknowns, rows), and what one standard deviation of each item does (unknowns, items).

    Encoder nonlinearities join the unknowns with their standard deviation as prior, as in the method.
    """
    unknowns = columns.shape[1]
    fitted = [k for k, item in enumerate(items) if item.of.fitted]
    amplitudes = (
        -np.column_stack([items[k].rows * items[k].std for k in fitted]) if fitted else np.empty((len(columns), 0))
    )
    prior = np.hstack([np.zeros((len(fitted), unknowns)), max(row_noise, 1e-12) * np.eye(len(fitted))])
    matrix = np.vstack([np.hstack([columns, amplitudes]), prior])
    whole = fit_linear(matrix, np.zeros(len(matrix))).influence[:unknowns]
    influence = whole[:, : len(columns)]
    effects = (
        np.column_stack([influence @ item.rows * item.std for item in items]) if items else np.empty((unknowns, 0))
    )
    for place, k in enumerate(fitted):
        effects[:, k] = whole[:, len(columns) + place] * row_noise
    return influence, effects


def _sensors(log: Recording, rig: Rig, rows: Rows, influence: Array, a11: float, b: float) -> Array:
    """Covariance of the unknowns from noise, resolution and jitter of both angles."""
    time, step = np.asarray(log.time), float(log.time[1] - log.time[0])
    windows = rows.windows
    curved, plain = (superpose(time, windows.centres, windows.half, influence, order) * step for order in (2, 0))
    axis = a11 * curved + b * np.cos(log.angle) * plain
    channels = [(axis, log.angle, rig.sensors.of("angle"))]
    if log.wheel_angle is not None:
        channels.append((rig.drive.a12 * curved, log.wheel_angle, rig.sensors.of("wheel")))
    covariance = np.zeros((len(influence), len(influence)))
    together = np.zeros_like(axis)
    for weights, values, sensor in channels:
        rounded = sensor.resolution if sensor.noise >= FINE * sensor.resolution else 0.0
        covariance += (sensor.noise**2 + rounded**2 / 12) * (weights @ weights.T)
        if sensor.resolution > rounded:
            covariance += _grid(weights, values, sensor)
        together += sensor.jitter * weights * spline_at(time, values, spline_slopes(time, values), time, 1)
    result: Array = covariance + together @ together.T  # a row's jitter is common to its channels
    return result


def _grid(weights: Array, values: Array, sensor: Sensor) -> Array:
    """Covariance from the rounding of a motion that repeats, over random places of the encoder's grid."""
    random = np.random.default_rng(1)
    effects = np.empty((DRAWS, len(weights)))
    for k in range(DRAWS):
        place = values / sensor.resolution + random.random()
        if sensor.noise > 0:
            place = place + random.standard_normal(len(values)) * sensor.noise / sensor.resolution
        effects[k] = weights @ (np.round(place) - place) * sensor.resolution
    result: Array = effects.T @ effects / DRAWS
    return result


def with_errors(log: Recording, rig: Rig, random: np.random.Generator) -> Recording:
    """A log as the rig's encoders would read it: noise and rounding."""

    def read(values: Array, sensor: Sensor) -> Array:
        noisy = values + sensor.noise * random.standard_normal(len(values))
        if sensor.resolution == 0:
            return noisy
        return np.asarray(np.round(noisy / sensor.resolution + random.random()) * sensor.resolution)

    wheel = None if log.wheel_angle is None else read(log.wheel_angle, rig.sensors.of("wheel"))
    return Recording(
        time=log.time,
        angle=read(log.angle, rig.sensors.of("angle")),
        wheel_angle=wheel,
        voltage=log.voltage,
        torque=log.torque,
        drive_held=log.drive_held,
    )
