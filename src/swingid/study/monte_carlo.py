"""Propagation of distributions through a whole method (GUM Supplement 1, JCGM 101:2008), beside the linear budget.

Each draw changes what the rig file declares as uncertain and the readings, and identifies the log anew:

- a constant: its stated value is drawn from N(value, standard uncertainty); a tilt is drawn and then counts as exact;
- an encoder: the readings get a drawn latency and once-per-turn nonlinearity, and white noise as large as the log's;
- the log's clock: the time is stretched by a drawn share; scales of logged channels multiply them.

What has no such draw (lack of fit, disagreement of windows, the model's share, the scatter beyond the sensors' noise)
is a correction that is added to each estimate, drawn from its distribution in the budget (JCGM 101, 5.1.1, 6.4).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identification import identify
from swingid.model.parameters import TILTS
from swingid.model.rig import Rig
from swingid.model.rig.fields import Table
from swingid.model.terms import further_terms, stated_at
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import moved
from swingid.preparation.prepared import as_recorded
from swingid.processes import map_in_processes
from swingid.recording.recording import Recording
from swingid.result.data import Distributed, MonteCarlo
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import BudgetEntry
from swingid.uncertainty.freedom import COVERAGE
from swingid.units import Quantity, UnknownScale

FEWEST, MOST = 100, 1_000_000
NOISE_DRAWS = 100
"""Draws of the noise alone, by which the scatter beyond it is found, at most."""

SCATTER = "scatter"
"""First word of the source of the scatter in a budget, part of which is the sensors' noise."""

SCALES = ("log.torque_gain", "log.angle_scale", "log.angle_offset", "log.wheel_scale", "log.voltage_scale")
CLOCK = "log.clock"
UNDRAWN = ("axis.inertia", "axis.friction.", "axis.model_uncertainty")
"""Keys that identification does not read, and the share that is a correction."""


@dataclass(frozen=True)
class Draw:
    """One draw: standard normal numbers by key of the rig, and the seed of the noise (None: no noise).

    units: "sensors.angle.latency" and the like are those of the encoders.
    """

    units: Mapping[str, float]
    noise: int | None


@dataclass(frozen=True)
class Experiment:
    """What every draw has in common: log, rig, method, options, standard deviations of the noise of both angles."""

    log: Recording
    rig: Rig
    method: str
    options: Mapping[str, object]
    noise: tuple[float, float]
    constants: Mapping[str, Quantity] = field(default_factory=dict)

    def estimate(self, draw: Draw) -> dict[str, float] | str:
        """Parameters of one draw by name, or the code of its refusal."""
        try:
            result = identify(self._log(draw), self._rig(draw), self.method, **self.options)
        except (UnanswerableError, InputError) as error:
            return error.code
        return {name: parameter.value for name, parameter in result.parameters.items()}

    def _rig(self, draw: Draw) -> Rig:
        changes: dict[str, object] = {}
        for key, constant in self.constants.items():
            if key in draw.units and key != CLOCK:
                value = constant.value + self._error(key, draw.units)
                changes[key] = Quantity(value, None if key in TILTS else constant.std)
        return self.rig.changed(changes) if changes else self.rig

    def _log(self, draw: Draw) -> Recording:
        """The log as it would have been read with other errors of its sensors, clock and scales."""
        log, units = self.log, draw.units
        channels = {"angle": log.angle, "wheel": log.wheel_angle}
        generator = None if draw.noise is None else np.random.default_rng(draw.noise)
        for (name, values), sigma in zip(channels.items(), self.noise, strict=True):
            if values is None:
                continue
            sensor, prefix = self.rig.sensors.of(name), f"sensors.{name}."  # type: ignore[arg-type]
            late = (sensor.latency.std or 0.0) * units.get(f"{prefix}latency", 0.0)
            alpha, beta = ((part.std or 0.0) * units.get(f"{prefix}{kind}", 0.0) for kind, part in sensor.parts.items())
            read = moved(log.time, values, late)
            read = read + alpha * np.cos(values) + beta * np.sin(values)
            channels[name] = read if generator is None else read + sigma * generator.standard_normal(len(read))
        time = log.time * (1 + self._error(CLOCK, units))
        angle = channels["angle"]
        assert angle is not None
        angle = angle * self._ratio("log.angle_scale", units) + self._error("log.angle_offset", units)
        wheel = channels["wheel"]
        wheel = None if wheel is None else wheel * self._ratio("log.wheel_scale", units)
        volts, torque = (
            None if values is None else values * self._ratio(key, units)
            for values, key in ((log.voltage, "log.voltage_scale"), (log.torque, "log.torque_gain"))
        )
        return replace(log, time=time, angle=angle, wheel_angle=wheel, voltage=volts, torque=torque)

    def _error(self, key: str, units: Mapping[str, float]) -> float:
        constant = self.constants.get(key)
        return 0.0 if constant is None else (constant.std or 0.0) * units.get(key, 0.0)

    def _ratio(self, key: str, units: Mapping[str, float]) -> float:
        return 1 + self._error(key, units) / self.constants[key].value if key in self.constants else 1.0


def uncertain_constants(rig: Rig) -> dict[str, Quantity]:
    """Every quantity of the rig with a standard uncertainty that a draw changes, by its dotted key."""
    constants = dict(_quantities(rig.axis, "axis")) | dict(_quantities(rig.drive, "drive"))
    keys = [key for term in further_terms() for key in (term.key, term.shift) if key]
    constants |= {
        key: quantity for key in (*keys, *SCALES, CLOCK) if isinstance(quantity := stated_at(rig, key), Quantity)
    }
    if rig.drive.channel != "torque":
        constants.pop("log.torque_gain", None)
    return {
        key: quantity
        for key, quantity in constants.items()
        if quantity.std and not isinstance(quantity, UnknownScale) and not key.startswith(UNDRAWN)
    }


def _quantities(table: Table, path: str) -> Iterator[tuple[str, Quantity]]:
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, Quantity):
            yield f"{path}.{name}", value
        elif isinstance(value, Table):
            yield from _quantities(value, f"{path}.{name}")


def monte_carlo(
    log: Recording,
    rig: Rig,
    method: str,
    result: Result,
    draws: int,
    *,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """`result` of this log with the distribution of its parameters by so many draws, see the module.

    workers: processes, by default one per core; the numbers do not depend on them. progress(done, draws).

    Ratios, and the results of logs of rates, stay as they are, with the note "no-draws". Raises UsageError for too few
    draws and for too many, UnanswerableError where hardly any draw has an answer.
    """
    if draws > MOST:
        text = f"{draws} draws would take months; the ends of a 95 % interval settle by 10 000, so take fewer."
        raise UsageError(text, code="many-draws")
    if draws < FEWEST:
        raise UsageError(f"{draws} draws are too few for a distribution; take {FEWEST} or more.", code="few-draws")
    if result.ratios or log.angle_speed is not None or log.wheel_speed is not None:
        why = "nothing sets a scale" if result.ratios else "the log has rates, whose bias a draw cannot move"
        text = f"no draws were made, for {why}: the interval is that of the linear propagation (GUM)."
        return replace(result, notes=(*result.notes, Message("no-draws", text)))
    rig = as_recorded(rig, log)
    sigma = result.origin.noise.get("angle") or 0.0, result.origin.noise.get("wheel") or 0.0
    constants = uncertain_constants(rig)
    experiment = Experiment(log, rig, method, dict(options or {}), sigma, constants)
    keys = [*constants, *_sensor_keys(rig, log)]
    planned = [Draw({}, seed * 2**32 + k) for k in range(min(NOISE_DRAWS, draws))]
    planned += [_drawn(keys, seed, k) for k in range(draws)]
    outcomes: list[dict[str, float] | str] = []
    for draw in map_in_processes(experiment.estimate, planned, workers, chunk=8):
        outcomes.append(draw)
        if progress is not None:
            progress(len(outcomes), len(planned))
    alone, whole = outcomes[: len(planned) - draws], outcomes[len(planned) - draws :]
    answered = [draw for draw in whole if not isinstance(draw, str)]
    if len(answered) < max(FEWEST // 2, draws // 2):
        codes = ", ".join(sorted({draw for draw in whole if isinstance(draw, str)}))
        message = f"only {len(answered)} of {draws} draws have an estimate ({codes}), too few for a distribution."
        raise UnanswerableError(message, code="draws-refused")
    refusals = dict(Counter(draw for draw in whole if isinstance(draw, str)))
    generator = np.random.default_rng([seed, 1])
    distributions = {}
    for name, parameter in result.parameters.items():
        values = np.array([draw[name] for draw in answered if name in draw])
        quiet = np.array([draw[name] for draw in alone if not isinstance(draw, str) and name in draw])
        if parameter.standard_uncertainty is None or len(values) < len(answered) / 2 or len(quiet) < 2:
            continue
        entries = [entry for entry in result.budget if entry.parameter == name]
        values = values + _corrections(entries, keys, float(np.std(quiet, ddof=1)), len(values), generator)
        distributions[name] = distributed(values, parameter.interval95, parameter.standard_uncertainty)
    return replace(result, monte_carlo=MonteCarlo(draws, len(answered), refusals, distributions))


def _sensor_keys(rig: Rig, log: Recording) -> list[str]:
    """Keys of what the encoders are declared to have, such as "sensors.angle.latency" and "sensors.wheel.cosine"."""
    keys = []
    for name, values in (("angle", log.angle), ("wheel", log.wheel_angle)):
        sensor = rig.sensors.of(name)  # type: ignore[arg-type]
        kinds = {"latency": sensor.latency, **sensor.parts}
        keys += [f"sensors.{name}.{kind}" for kind, quantity in kinds.items() if quantity.std and values is not None]
    return keys


def _identity(key: str) -> str:
    """The `shared_id` of a budget for a key of a draw: "sensors.angle.cosine" is "sensors.nonlinearity.cosine"."""
    if not key.startswith("sensors."):
        return key
    _, channel, kind = key.split(".")
    prefix = "sensors" if channel == "angle" else "sensors.wheel"
    return f"{prefix}.{kind}" if kind == "latency" else f"{prefix}.nonlinearity.{kind}"


def _drawn(keys: list[str], seed: int, k: int) -> Draw:
    """Draw k: a stream of its own for each number, whatever the others are."""
    generator = np.random.default_rng([seed, 0, k])
    return Draw(dict(zip(keys, generator.standard_normal(len(keys)).tolist(), strict=True)), seed * 2**32 + 2**31 + k)


def _corrections(
    entries: list[BudgetEntry], keys: list[str], noise: float, count: int, generator: np.random.Generator
) -> Array:
    """Sum of the drawn corrections (count,) for what no draw changes; noise: what the readings' noise alone does."""
    total = np.zeros(count)
    drawn = {_identity(key) for key in keys}
    for entry in entries:
        u = entry.standard_uncertainty
        if entry.shared_id in drawn or entry.source in drawn or not u > 0:
            continue
        if entry.type == "A" and entry.source.startswith(SCATTER):
            u = math.sqrt(max(u**2 - noise**2, 0.0))
        if entry.origin.distribution == "rectangular":
            total += generator.uniform(-1.0, 1.0, count) * u * math.sqrt(3.0)
        elif math.isfinite(entry.origin.degrees_of_freedom):
            total += generator.standard_t(max(entry.origin.degrees_of_freedom, 1.0), count) * u
        else:
            total += generator.standard_normal(count) * u
    return total


def distributed(values: Array, linear: tuple[float, float] | None, u: float) -> Distributed:
    """Mean, standard deviation, shortest and symmetric 95 % interval of a sample, and whether the linear one agrees.

    JCGM 101, 7.7 and 8.1: the ends of the linear and the symmetric interval must agree within δ, half of the last place
    of u to one digit. (The ends of the shortest one scatter much more from sample to sample.) None where the ends are
    themselves not certain to δ (7.9), so more draws are needed.
    """
    ordered = np.sort(values)
    count = len(ordered)
    inside = min(max(round(COVERAGE * count), 1), count - 1)
    widths = ordered[inside:] - ordered[: count - inside]
    k = int(np.argmin(widths))
    low, high = float(ordered[k]), float(ordered[k + inside])
    tail = (1 - COVERAGE) / 2
    symmetric = float(np.quantile(ordered, tail)), float(np.quantile(ordered, 1 - tail))
    tolerance = 0.5 * 10.0 ** math.floor(math.log10(u)) if u > 0 else 0.0
    error = _end_error(values)
    agrees: bool | None = None
    if linear is not None:
        apart = max(abs(end - other) for end, other in zip(linear, symmetric, strict=True))
        if apart + 2 * error <= tolerance or apart - 2 * error > tolerance:
            agrees = apart <= tolerance
    mean, spread = float(np.mean(values)), float(np.std(values, ddof=1))
    return Distributed(mean, spread, (low, high), symmetric, agrees, tolerance, error, ordered)


def _end_error(values: Array, groups: int = 10) -> float:
    """Standard error of an end of the symmetric 95 % interval, by its scatter between groups (JCGM 101, 7.9.4)."""
    parts = np.array_split(values, groups)
    tail = (1 - COVERAGE) / 2
    ends = np.array([np.quantile(part, (tail, 1 - tail)) for part in parts])
    return float(np.max(np.std(ends, axis=0, ddof=1)) / math.sqrt(groups))
