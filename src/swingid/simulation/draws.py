"""What one run of the twin draws by its seed: constants, encoders, read times, noise, lost rows; and its metadata.

Each kind of draw has a random stream of its own, so that turning one imperfection on leaves the draws of
the others as they were.
"""

from __future__ import annotations

import platform
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.model.parameters import TILTS, constants
from swingid.model.sensors import Encoder

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array, Bools


STREAMS = ("constants", "nonlinearity", "latency", "jitter", "noise", "dropouts", "rates")
SIGNED = ("axis.gravity_torque", "axis.friction.offset", *TILTS)
CHANNELS: tuple[Literal["angle"], Literal["wheel"]] = ("angle", "wheel")


@dataclass(frozen=True)
class Draws:
    """What a run is made with, in the order angle, wheel where it concerns encoders.

    values: constants by rig.toml key (SI). latencies (s): as drawn for each encoder. delays (2, rows): read time minus
    row time (s). noise (2, rows) (rad). kept (rows,): rows that reach the log.
    """

    values: dict[str, float]
    encoders: tuple[Encoder, Encoder]
    latencies: tuple[float, float]
    delays: Array
    noise: Array
    kept: Bools


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one kind of draw, a name out of `STREAMS`; the same seed gives the same stream."""
    return np.random.default_rng([seed, STREAMS.index(name)])


def draw_constants(rig: Rig, seed: int) -> dict[str, float]:
    """Every constant drawn from N(value, std); those that can't be negative drawn again until they are not.

    Returns SI values by rig.toml key. Constants without a stated uncertainty keep their value, and use up a draw all
    the same.
    """
    values = {}
    generator = stream(seed, "constants")
    for key, quantity in constants(rig).items():
        std = quantity.std or 0.0
        retry = generator.spawn(1)[0]
        value = quantity.value + std * generator.standard_normal()
        while std > 0.0 and value < 0.0 and key not in SIGNED:
            value = quantity.value + std * retry.standard_normal()
        values[key] = float(value)
    return values


def draw_nonlinearity(rig: Rig, seed: int) -> list[tuple[float, float]]:
    """α and β (rad) of each encoder: as stated, drawn where they are declared by a standard deviation."""
    units = stream(seed, "nonlinearity").standard_normal((2, 2))
    drawn_parts = []
    for sensor, normals in zip([rig.sensors.of(name) for name in CHANNELS], units, strict=True):
        parts = zip(sensor.drawn, normals, strict=True)
        alpha, beta = (part.value + (part.std or 0.0) * normal + 0.0 for part, normal in parts)  # + 0.0: no -0.0
        drawn_parts.append((float(alpha), float(beta)))
    return drawn_parts


def draw_delays(rig: Rig, rows: int, seed: int) -> tuple[Array, Array, Array]:
    """How much after its row each encoder is read: latencies (2,), jitters (2,) (s), draws (rows or 1,).

    A delay is the latency and jitter times draw.
    """
    sensors = [rig.sensors.of(name) for name in CHANNELS]
    units = stream(seed, "latency").standard_normal(2)
    latencies = [s.latency.value + (s.latency.std or 0.0) * unit for s, unit in zip(sensors, units, strict=True)]
    jitters = np.array([s.jitter for s in sensors])
    draws = stream(seed, "jitter").standard_normal(rows) if jitters.any() else np.zeros(1)
    return np.array(latencies), jitters, draws


def draw_noise(rig: Rig, rows: int, seed: int) -> Array:
    """Noise (2, rows) (rad) of the two encoders."""
    levels = np.array([rig.sensors.of(name).noise for name in CHANNELS])
    noise: Array = stream(seed, "noise").standard_normal((2, rows)) * levels[:, None]
    return noise


def draw(
    rig: Rig,
    rows: int,
    seed: int,
    *,
    constants_too: bool = False,
    encoder_zero: tuple[float, float] = (0.0, 0.0),
) -> Draws:
    """All draws of a run of `rows` rows; `constants_too`: also the constants, else they have their values;
    `encoder_zero` (rad): what each encoder reads at angle 0.

    A row is read as a whole: both encoders share a row's jitter and are lost together.
    """
    nonlinearity, (latencies, jitters, jitter) = draw_nonlinearity(rig, seed), draw_delays(rig, rows, seed)
    sensors = [rig.sensors.of(name) for name in CHANNELS]
    lost = stream(seed, "dropouts").random(rows) < max(sensor.dropouts for sensor in sensors)
    angle, wheel = (
        Encoder(sensor.resolution, *bent, zero)
        for sensor, bent, zero in zip(sensors, nonlinearity, encoder_zero, strict=True)
    )
    delays = np.zeros((2, rows)) + (latencies[:, None] + jitters[:, None] * jitter)
    if constants_too:
        values = draw_constants(rig, seed)
    else:
        values = {key: quantity.value for key, quantity in constants(rig).items()}
    late = (float(latencies[0]), float(latencies[1]))
    return Draws(values, (angle, wheel), late, delays, draw_noise(rig, rows, seed), ~lost)


PACKAGES = ("swingid", "numpy", "numba")


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of what computes the motion."""
    by_name = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            by_name[package] = version(package)
        except PackageNotFoundError:
            by_name[package] = "unknown"
    return by_name


def describe(reference: object) -> str | None:
    """A reference in words: its own `describe()`, else its name; None stays None."""
    if reference is None:
        return None
    description = getattr(reference, "describe", None)
    return (
        str(description()) if callable(description) else str(getattr(reference, "__name__", type(reference).__name__))
    )


def truth(draws: Draws) -> dict[str, object]:
    """What the run was really made with (SI), under the names of identified parameters.

    For comparisons after the fact only: no method of identification may read it.
    """
    values = draws.values
    by_name: dict[str, object] = {
        "inertia": values["axis.inertia"],
        "gravity_torque": values["axis.gravity_torque"],
    }
    prefix = "axis.friction."
    by_name |= {key.removeprefix(prefix): value for key, value in values.items() if key.startswith(prefix)}
    by_name["constants"] = dict(values)
    for i, name in enumerate(("angle", "wheel")):
        encoder = draws.encoders[i]
        by_name[f"{name}_encoder"] = {
            "nonlinearity_cosine": encoder.alpha,
            "nonlinearity_sine": encoder.beta,
            "latency": draws.latencies[i],
        }
    return by_name


def metadata(rig: Rig, made: Draws, controller: object, reference: object, **arguments: object) -> dict[str, object]:
    """Metadata of a twin's recording: how it was made, rig, versions, and the true values for comparisons.

    controller: None where the loop was open; arguments: the others of `simulate`, by name.
    """
    return {
        "made_by": "swingid simulate",
        "simulation": {
            **arguments,
            "controller": "open loop" if controller is None else repr(controller),
            "reference": describe(reference),
        },
        "rig": rig.text,
        "rig_name": rig.name,
        "rig_source": str(rig.source),
        "versions": dict(versions()),
        "truth": truth(made),
    }
