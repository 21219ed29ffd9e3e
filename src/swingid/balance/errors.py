"""Perturbations as they act on modulated rows, ρ = −Σ c ∫φ ∂f/∂channel s: one rule for every error of a channel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from swingid.balance.motor_on_axis import volts
from swingid.balance.perturbations import (
    BENDS,
    SHAPES,
    Perturbation,
    RowError,
    Slope,
    channel_of,
    encoder_error,
    of_channels,
    of_constants,
    slopes_by,
)
from swingid.balance.rows import Rows, Signals
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import project


def errors_of(
    rows: Rows, signals: Signals, rig: Rig, equation: Equation, values: Mapping[str, float]
) -> list[RowError]:
    """All perturbations that are stated with an uncertainty, as they act on these rows; always in the same order.

    values: of all coefficients of the equation by name, stated and fitted.
    """
    constants = [constant_error(rows, equation, error) for error in of_constants(equation) if error.std > 0]
    return [*constants, *channel_errors(rows, signals, of_channels(rig, signals.encoders), values)]


def constant_error(rows: Rows, equation: Equation, error: Perturbation) -> RowError:
    """The error of a constant of the equation: −Σ ∂c/∂constant ∫φ f."""
    direct = -equation.beside.sources.get(error.source, 0.0)
    return RowError(error, -rows.sum_of(equation.slopes(error.source)), direct)


def sensitivities(rows: Rows, equation: Equation, influence: Array) -> dict[str, float]:
    """Change of J1 per unit of every constant of the rig, by its key, exact ones too; influence: row of a11."""
    constants = (constant for constant in of_constants(equation) if constant.constant and constant.shared_id)
    errors = (constant_error(rows, equation, constant) for constant in constants)
    return {error.source: float(influence @ error.rows) + error.direct for error in errors}


def channel_errors(
    rows: Rows, signals: Signals, errors: Sequence[Perturbation], values: Mapping[str, float]
) -> list[RowError]:
    """Errors of channels as they act on these rows.

    An error of the angle enters friction, too: by a multiple of its own columns where it is one of the scale (see
    `Perturbation.scales_speed`), else negligibly.
    """
    terms = {error.source: [name for name, *_ in _slopes(signals, error) if values.get(name)] for error in errors}
    missing = (error for error in errors if any((error.source, name) not in rows.kept for name in terms[error.source]))
    _keep(rows, signals, list(missing))
    none = np.zeros(len(rows))
    return [
        RowError(error, -sum((values[name] * rows.kept[error.source, name] for name in terms[error.source]), none))
        for error in errors
    ]


def shaped_errors(
    rows: Rows, signals: Signals, channel: str, shapes: Iterable[Array], values: Mapping[str, float]
) -> Array:
    """Effects (rows, n) of errors of a channel, "angle" or "wheel", that are given at the nodes."""
    every_slope = slopes_by(channel, signals.terms)
    slopes = [(order, slope(signals.angle), values[name]) for name, order, slope in every_slope if values.get(name)]
    each = list(shapes)
    columns = [(shape * slope, order) for shape in each for order, slope, _ in slopes]
    parts = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
    coefficients = np.array([value for *_, value in slopes])
    result: Array = -parts.reshape(len(rows), len(each), len(slopes)) @ coefficients
    return result


def bends(rows: Rows, signals: Signals, values: Mapping[str, float]) -> Array:
    """Columns (rows, n) of a nonlinearity once per turn of each encoder: cosine and sine of the axis, of the wheel."""
    turns = (channel for channel in signals.encoders.channels if channel == "wheel" or not signals.linear)
    errors = [encoder_error(signals.encoders, channel, shape) for channel in turns for shape in BENDS]
    return np.array([error.rows for error in channel_errors(rows, signals, errors, values)]).reshape(-1, len(rows)).T


def late_error(rows: Rows, signals: Signals, values: Mapping[str, float]) -> Array:
    """Effect on the rows, per s, of a wheel read later than the angle, or of an angle later than the drive acts."""
    late = encoder_error(signals.encoders, signals.encoders.last, "latency")
    return channel_errors(rows, signals, [late], values)[0].rows


def _keep(rows: Rows, signals: Signals, errors: Sequence[Perturbation]) -> None:
    """Compute the columns ∫φ ∂f/∂channel s of these errors, which depend neither on values nor on turning points."""
    keys, columns = [], []
    for error in errors:
        shape, shift = _at_nodes(signals, error)
        for name, order, slope in _slopes(signals, error):
            keys.append((error.source, name))
            slope_of_term = signals.slopes[name] if name in signals.slopes else slope(signals.angle)
            columns.append((shape * slope_of_term, order + shift))
    if keys:
        integrals = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
        rows.kept.update(zip(keys, integrals.T, strict=True))


def _slopes(signals: Signals, error: Perturbation) -> list[tuple[str, int, Slope]]:
    """Terms that depend on the channel of an error, see `slopes_by`."""
    return slopes_by(_channel(signals, error), signals.terms)


def _channel(signals: Signals, error: Perturbation) -> str:
    return channel_of(error, signals.source[1].drive.channel)


def _at_nodes(signals: Signals, error: Perturbation) -> tuple[Array, int]:
    """The error per unit at the nodes, and the further derivative of φ that it meets.

    The rate of a drive that is held is no function of the nodes: ∫φ (−τ') = ∫φ' τ.
    """
    if error.shape == "level":
        return signals.level_shapes[error.source], 0
    channel = _channel(signals, error)
    if error.shape == "latency" and channel == "wheel":
        assert signals.wheel_rate is not None
        return (signals.wheel_rate if error.channel == "wheel" else -signals.wheel_rate), 0
    if error.shape == "latency":
        drive = signals.torque if channel == "torque" else signals.nodes.hold(volts(signals.source[0]), 0.0)
        assert drive is not None
        return drive, 1
    values = signals.wheel if channel == "wheel" else signals.angle
    assert values is not None
    return SHAPES[error.shape](values), 0
