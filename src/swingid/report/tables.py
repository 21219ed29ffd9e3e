"""The tables of the report as rows of text; the template lays them out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.checks.stability import DIVIDED
from swingid.checks.table import CHECKS
from swingid.format import interval, number, percent, plus_minus, span
from swingid.numerics.arrays import robust_spread
from swingid.report.words import DRIVES, EXTRA, METHODS, NOT_USED, RIG, SENSORS, Word, parameter_word
from swingid.result.result import Result
from swingid.result.summary import (
    AGREEMENT,
    correlated_pairs,
    freedom_text,
    relative,
    segment_text,
    value_text,
    why_unknown,
)
from swingid.uncertainty.budget import Parameter
from swingid.uncertainty.freedom import MANY
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

FEWEST_SWINGS = 4

UNCHANGED = {("wheel-angle-reading", "note")}
"""Messages of checks that found nothing: what they state is how the log was read."""

LONGEST = 160
"""Characters of a provenance or metadata value beyond which only its size is given."""


@dataclass(frozen=True)
class Row:
    """One line of a table: what, its name in files, its value, how sure, a remark or interval."""

    words: str
    key: str
    value: str
    spread: str = ""
    remark: str = ""
    bounded: bool = False


def swings_off(result: Result) -> str:
    """A sentence where the swings lie off the answer by more than its interval and their scatter allow, else ""."""
    swings = result.details.swings if result.details else None
    if swings is None or len(swings.values) < FEWEST_SWINGS or result.main.interval95 is None:
        return ""
    answer, (low, high) = result.main.value, result.main.interval95
    middle = float(np.median(swings.values))
    scatter = robust_spread(swings.values)
    if not abs(middle - answer) > (high - low) / 2 + 3 * scatter / math.sqrt(len(swings.values)):
        return ""
    window = result.details.window if result.details else None
    short = "" if window is None else f", while the estimate comes from windows of ±{number(window, 's', 3, fine=True)}"
    return (
        f"Here they lie {percent(middle / answer - 1, sign=True, fine=True)} from the answer, more than its interval "
        f"allows: each comes from a whole swing, which contains what the model lacks, such as friction that is not a "
        f"function of speed alone{short}."
    )


def parameter_rows(result: Result, *, linear: bool) -> list[Row]:
    """Identified parameters with relative uncertainty and 95 % interval."""
    rows = []
    for name, parameter in result.parameters.items():
        word = parameter_word(name, linear=linear)
        bounds = parameter.interval95
        rows.append(
            Row(
                words=f"{word.words} {word.symbol}".strip(),
                key=name,
                value=value_text(parameter, fine=True),
                spread=relative(parameter, fine=True),
                remark=interval(bounds, middle=parameter.value, fine=True) + _coverage(parameter)
                if bounds
                else f"uncertainty unknown: {why_unknown(result, name)}",
                bounded=bounds is not None,
            )
        )
    return rows


def _coverage(parameter: Parameter) -> str:
    """Coverage factor and degrees of freedom where these are so few that they widen the interval."""
    if parameter.degrees_of_freedom >= MANY:
        return ""
    return f" (k = {parameter.coverage_factor:.2f}, ν = {freedom_text(parameter)})"


def rig_rows(rig: Rig) -> list[Row]:
    """Every constant that the rig states and identification may use, in the order of rig.toml."""
    linear = rig.axis.kind == "linear"
    rows = []
    for key, value in _constants(rig):
        word = RIG.get(key, Word(key.rpartition(".")[2].replace("_", " ")))
        unit = word.unit_on(linear=linear)
        words = f"{word.words} {word.symbol}".strip()
        if key.startswith(NOT_USED) or (linear and key == "axis.gravity_torque"):
            continue
        if isinstance(value, Quantity):
            known = "exact"
            if value.std:
                known = percent(value.std / abs(value.value), fine=True) if value.value else ""
            rows.append(Row(words, key, plus_minus(value.value, value.std, unit, fine=True), known))
        elif value == "unknown":
            rows.append(Row(words, key, "unknown, identified with the inertia"))
        else:
            exact = "" if key.endswith("_limit") else "exact"
            rows.append(Row(words, key, _plain_constant(value, unit), exact))
    return rows


def _constants(rig: Rig) -> Iterator[tuple[str, object]]:
    """Dotted key and value of all quantities under [axis] and [drive] that rig.toml sets, and of the torque's gain."""
    for section in ("axis", "drive"):
        yield from _leaves(getattr(rig, section), section)
    gain = getattr(rig.log, "torque_gain", None)
    if rig.drive.channel == "torque" and isinstance(gain, Quantity):
        yield "log.torque_gain", gain
    for key in ("angle_scale", "angle_offset", "angle_speed_scale", "wheel_scale", "voltage_scale"):
        value = getattr(rig.log, key)
        if isinstance(value, Quantity) and value.std:
            yield f"log.{key}", value


def _leaves(model: object, path: str) -> Iterator[tuple[str, object]]:
    stated: set[str] = getattr(model, "model_fields_set", set())
    for name in type(model).model_fields:  # type: ignore[attr-defined]
        value = getattr(model, name)
        if value is None or name == "kind":
            continue
        if hasattr(value, "model_fields_set"):
            yield from _leaves(value, f"{path}.{name}")
        elif name in stated or name == "gravity_torque":
            yield f"{path}.{name}", value


def _plain_constant(value: object, unit: str) -> str:
    if isinstance(value, tuple):
        return span(float(value[0]), float(value[1]), unit, fine=True)
    if isinstance(value, int | float):
        return number(float(value), unit, 6, fine=True)
    return str(value)


def sensor_rows(rig: Rig) -> list[Row]:
    """What the rig states of its sensors, angle and wheel; what is zero is left out."""
    linear = rig.axis.kind == "linear"
    channels = {"position" if linear else "angle": rig.sensors.of("angle")}
    if rig.drive.wheel is not None:
        channels["wheel angle"] = rig.sensors.of("wheel")
    rows = []
    for name, word in SENSORS.items():
        if linear and name in ("cosine", "sine", "twice"):
            continue  # a length has no turn
        texts: dict[str, list[str]] = {}
        for called, sensor in channels.items():
            text = _sensor_text(getattr(sensor, name), word.unit_on(linear=linear))
            if text:
                texts.setdefault(text, []).append(called)
        rows += [Row(f"{word.words}, {' and '.join(called)}", name, text) for text, called in texts.items()]
    return rows


def _sensor_text(value: object, unit: str) -> str:
    if isinstance(value, Quantity):
        return plus_minus(value.value, value.std, unit, fine=True) if value.value or value.std else ""
    return number(float(value), unit, 3, fine=True) if isinstance(value, int | float) and value else ""


def log_rows(log: Recording, result: Result) -> list[Row]:
    """Size and rate of the log, whether a twin made it, and the error of the result against the twin's inertia."""
    rows = [Row("file", "", log.source.path or "made in memory"), Row("rows", "", f"{len(log):,}".replace(",", " "))]
    if len(log) > 1:
        span = f"{log.time[0]:.4g} s to {log.time[-1]:.4g} s"
        rows.append(Row("time", "", f"{span}, {number(log.rate, '', 4)} rows per second"))
    if log.voltage is not None or log.torque is not None:
        held = "held from each row to the next" if log.drive_held else "measured at each row"
        rows.append(Row("voltage" if log.voltage is not None else "drive", "", held))
    if log.metadata.get("made_by"):
        rows.append(Row("made by", "", str(log.metadata["made_by"])))
    run = log.metadata.get("run")
    if isinstance(run, dict) and run.get("firmware"):
        rows.append(Row("device", "", f"{run.get('device', '')}, firmware {run['firmware']}"))
    truth = truth_row(result, log)
    return [*rows, truth] if truth else rows


def law_rows(result: Result, most: int = 8) -> tuple[list[tuple[str, str]], int]:
    """Friction laws tried, best first, with the distance of their criterion; and how many are left out."""
    curve = result.details.friction if result.details else None
    ranked = sorted(curve.candidates.items(), key=lambda item: item[1]) if curve else []
    rows = [(name, f"+{score - ranked[0][1]:.1f}" if k else "0") for k, (name, score) in enumerate(ranked[:most])]
    return rows, max(0, len(ranked) - most)


def extra_rows(result: Result) -> list[Row]:
    """Further figures of merit that the method gives, as shares where they are known to be shares."""
    extra = result.details.extra if result.details else {}
    return [
        Row(
            EXTRA.get(name, name.replace("_", " ")),
            "",
            percent(value, fine=True) if name in EXTRA else number(value, fine=True),
        )
        for name, value in extra.items()
    ]


def agreement_rows(result: Result) -> list[Row]:
    """Inertias (without a scale: leading ratios) of two parts of the log; the difference in standard uncertainties."""
    found = result.details.agreement if result.details else ()
    unit = result.main.unit if found else ""
    inverse = result.leading.endswith("/inertia")  # the fit had the inertia over what is in the numerator here

    def shown(value: float, u: float) -> str:
        return plus_minus(*((1 / value, u / value**2) if inverse else (value, u)), unit, fine=True)

    return [
        Row(
            DIVIDED[one.division],
            one.division,
            shown(*one.first),
            shown(*one.second),
            number(one.difference / one.standard_uncertainty, "", 2, fine=True),
        )
        for one in found
    ]


def distribution_rows(result: Result) -> list[Row]:
    """Each parameter by propagation of distributions: value, shortest interval, and the comparison in words."""
    found = result.monte_carlo.parameters if result.monte_carlo else {}
    rows = []
    for name, one in found.items():
        unit = result.parameters[name].unit
        value = plus_minus(one.mean, one.standard_uncertainty, unit, fine=True)
        ends = interval(one.interval95, middle=one.mean, fine=True)
        tolerance = number(one.tolerance, unit, 2, fine=True)
        rows.append(Row(name, "", value, ends, f"{AGREEMENT[one.agrees]} (δ = {tolerance})"))
    return rows


def check_rows(result: Result) -> list[Row]:
    """Consistency checks that the identification carried out, and what each found; [] where none is recorded."""
    found = [(m.code, "warning") for m in result.warnings] + [(m.code, "note") for m in result.notes]
    rows = []
    for name in result.details.checks if result.details else ():
        one = CHECKS[name]
        codes = [(code, level) for code, level in found if code in one.codes and (code, level) not in UNCHANGED]
        levels = {level for _, level in codes}
        outcome = next((level for level in ("warning", "note") if level in levels), "passed")
        rows.append(Row(one.words, name, outcome, remark=", ".join(dict.fromkeys(code for code, _ in codes))))
    return rows


def method_rows(result: Result, rig: Rig | None) -> list[Row]:
    """The method, its options, the corrections that were made and the repairs of the log."""
    origin = result.provenance
    rows = [Row("method", result.method, METHODS.get(result.method, ""))]
    options = origin.get("options")
    if isinstance(options, dict) and options:
        rows.append(Row("options", "", ", ".join(f"{key} = {value}" for key, value in options.items())))
    if result.details:
        rows.append(Row("part used", "", segment_text(result.details, fine=True)))
    decided = origin.get("preparation")
    corrections = decided.get("corrections") if isinstance(decided, dict) else None
    if isinstance(corrections, list) and corrections:
        rows.append(Row("corrections", "", "; ".join(_correction(one) for one in corrections)))
    repairs = origin.get("repairs")
    done = [str(one.get("what")) for one in repairs if one.get("done")] if isinstance(repairs, list) else []
    if done:
        rows.append(Row("repairs of the log", "", " ".join(done)))
    if rig is not None:
        rows.append(Row("rig", "", f"{rig.name}: {rig.axis.kind} axis, {DRIVES.get(rig.drive.kind, rig.drive.kind)}"))
    return rows


def _correction(one: dict[str, Any]) -> str:
    """'wheel latency (0.20 ± 0.10) ms, stated'."""
    size = (
        ""
        if one.get("value") is None
        else plus_minus(one["value"], one["standard_uncertainty"], one["unit"], fine=True)
    )
    return f"{one['channel']} {str(one['kind']).replace('_', ' ')} {size}".strip() + f", {one['origin']}"


def correlation_rows(result: Result) -> list[Row]:
    """Pairs of parameters whose errors go together, the strongest first."""
    return [Row(one, two, f"{r:+.2f}".replace("-", "−")) for one, two, r in correlated_pairs(result)]


def truth_row(result: Result, log: Recording) -> Row | None:
    """Return, for a log of the twin, the inertia it was made with, and how far the answer is off."""
    truth = log.metadata.get("truth")
    inertia = truth.get("inertia") if isinstance(truth, dict) else None
    if not isinstance(inertia, int | float) or not inertia or "inertia" not in result.parameters:
        return None
    off = percent(result.inertia.value / inertia - 1, sign=True, fine=True)
    text = f"{number(inertia, result.inertia.unit, 6, fine=True)}; the error of the estimate is {off}"
    return Row("the twin's truth", "", text)


def provenance_rows(result: Result) -> list[Row]:
    """Files, hashes, options, and the versions in one line."""
    data = dict(result.provenance)
    versions = data.pop("versions", None)
    data.pop("constants", None)  # they have a table of their own
    rows = [replace(row, words=row.words.replace("_", " ")) for row in flat_rows(data)]
    if isinstance(versions, dict):
        rows.append(Row("versions", "", ", ".join(f"{name} {value}" for name, value in versions.items())))
    return rows


def flat_rows(data: object) -> list[Row]:
    """Nested data, as a log's metadata, line by line."""
    return [Row(key, "", value) for key, value in _flat(data)]


def _flat(data: object, path: str = "") -> Iterator[tuple[str, str]]:
    """Nested data as dotted keys and short texts; empty values are left out."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _flat(value, f"{path}.{key}" if path else str(key))
    elif text := _short(data):
        yield path, text if len(text) <= LONGEST else f"{text[:60]}… ({len(text)} characters)"


def _short(data: object) -> str:
    """A value as text, numbers by 7 digits, those of a list one after the other; "" for nothing."""
    if isinstance(data, np.ndarray):
        data = data.tolist()
    if isinstance(data, list | tuple):
        return ", ".join(_short(one) for one in data)
    if isinstance(data, dict):
        return " ".join(f"{key} {_short(value)}" for key, value in data.items())
    if data is None:
        return ""
    return f"{data:.7g}" if isinstance(data, float) else " ".join(str(data).split())
