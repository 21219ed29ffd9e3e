"""The tables of the report of a result."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.checks.stability import DIVIDED
from swingid.checks.table import CHECKS
from swingid.format import interval, number, percent, plus_minus, span
from swingid.model.terms import further_terms, stated_at
from swingid.numerics.arrays import robust_spread
from swingid.report.words import DRIVES, EXTRA, METHODS, NOT_USED, RIG, SENSORS, Word, last_part, parameter_word
from swingid.result.result import Result
from swingid.result.summary import (
    AGREEMENT,
    correlated_pairs,
    freedom_text,
    log_row,
    relative,
    segment_text,
    value_text,
    why_unknown,
)
from swingid.table import Cell, Column, Table, pairs
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


VALUE = Column("value ± standard uncertainty", "value-cell")


def parameter_table(result: Result, *, linear: bool) -> Table:
    """Identified parameters with relative uncertainty and 95 % interval."""
    rows = []
    for name, parameter in result.parameters.items():
        bounds = parameter.interval95
        ends = interval(bounds, middle=parameter.value, fine=True) if bounds else ""
        if ends and parameter.degrees_of_freedom < MANY:  # so few that they widen the interval
            ends += f" (k = {parameter.coverage_factor:.2f}, ν = {freedom_text(parameter)})"
        reach = ends or f"uncertainty unknown: {why_unknown(result, name)}"
        words = str(parameter_word(name, linear=linear))
        rows.append((Cell(words, name), value_text(parameter, fine=True), relative(parameter, fine=True), reach))
    columns = (Column("parameter"), VALUE, Column("relative", "number", True), Column("95 % interval", "", True))
    return Table(columns, tuple(rows))


def log_table(result: Result, body: str) -> Table:
    """What each of several logs says of the inertia, and how far it is off; body: "inertia" or "mass"."""
    columns = (
        Column("log", "text"),
        Column(f"{body} ± standard uncertainty", "value-cell"),
        Column("from the answer", "number"),
        Column("", "text"),
    )
    return Table(columns, tuple(tuple(log_row(of_log, result, fine=True)) for of_log in result.per_log))


def rig_table(rig: Rig) -> Table:
    """Every constant that the rig states and identification may use, in the order of rig.toml."""
    linear = rig.axis.kind == "linear"
    rows = []
    for key, value in _constants(rig):
        word = RIG.get(key, Word(last_part(key)))
        unit = word.unit_on(linear=linear)
        if key.startswith(NOT_USED) or (linear and key == "axis.gravity_torque"):
            continue
        if isinstance(value, Quantity):
            known = "exact"
            if value.std:
                known = percent(value.std / abs(value.value), fine=True) if value.value else ""
            shown = plus_minus(value.value, value.std, unit, fine=True)
        elif value == "unknown":
            shown, known = "unknown, identified with the inertia", ""
        else:
            shown, known = _plain_constant(value, unit), "" if key.endswith("_limit") else "exact"
        rows.append((Cell(str(word), key), shown, known))
    return Table((Column("constant"), VALUE, Column("relative", "number")), tuple(rows))


def _constants(rig: Rig) -> Iterator[tuple[str, object]]:
    """Dotted key and value of all quantities under [axis] and [drive] that rig.toml sets, and of the torque's gain."""
    axis = dict(_leaves(rig.axis, "axis"))
    keys = (key for term in further_terms() for key in (term.key, term.order, term.shift) if key)
    terms = {key: value for key in dict.fromkeys(keys) if (value := stated_at(rig, key)) not in (None, Quantity(0.0))}
    yield from (axis | terms).items()
    yield from _leaves(rig.drive, "drive")
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


def sensor_table(rig: Rig) -> Table:
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
        rows += [(f"{word.words}, {' and '.join(called)}", text) for text, called in texts.items()]
    return Table((Column("sensor"), Column("as stated", "value-cell")), tuple(rows), "")


def _sensor_text(value: object, unit: str) -> str:
    if isinstance(value, Quantity):
        return plus_minus(value.value, value.std, unit, fine=True) if value.value or value.std else ""
    return number(float(value), unit, 3, fine=True) if isinstance(value, int | float) and value else ""


def recording_table(log: Recording, result: Result) -> Table:
    """Size and rate of the log, whether a twin made it, and the error of the result against the twin's inertia."""
    rows = [("file", log.source.path or "made in memory"), ("rows", f"{len(log):,}".replace(",", " "))]
    if len(log) > 1:
        span = f"{log.time[0]:.4g} s to {log.time[-1]:.4g} s"
        rows.append(("time", f"{span}, {number(log.rate, '', 4)} rows per second"))
    if log.voltage is not None or log.torque is not None:
        held = "held from each row to the next" if log.drive_held else "measured at each row"
        rows.append(("voltage" if log.voltage is not None else "drive", held))
    if log.metadata.get("made_by"):
        rows.append(("made by", str(log.metadata["made_by"])))
    run = log.metadata.get("run")
    if isinstance(run, dict) and run.get("firmware"):
        rows.append(("device", f"{run.get('device', '')}, firmware {run['firmware']}"))
    return pairs([*rows, *_truth(result, log)])


def law_table(result: Result, most: int = 8) -> tuple[Table, int]:
    """Friction laws tried, best first, with the distance of their criterion; and how many are left out."""
    curve = result.details.friction if result.details else None
    ranked = sorted(curve.candidates.items(), key=lambda item: item[1]) if curve else []
    rows = [(name, f"+{score - ranked[0][1]:.1f}" if k else "0") for k, (name, score) in enumerate(ranked[:most])]
    chosen = next((k for k, (name, _) in enumerate(rows) if curve and name == curve.law), None)
    columns = (Column("law"), Column("information criterion, from the best", "number"))
    return Table(columns, tuple(rows), "", chosen=chosen), max(0, len(ranked) - most)


def extra_table(result: Result) -> Table:
    """Further figures of merit that the method gives, as shares where they are known to be shares."""
    extra = result.details.extra if result.details else {}
    rows = [
        (EXTRA[name], percent(value, fine=True))
        if name in EXTRA
        else (name.replace("_", " "), number(value, fine=True))
        for name, value in extra.items()
    ]
    return pairs(rows, "number")


def agreement_table(result: Result) -> Table:
    """Inertias (without a scale: leading ratios) of two parts of the log; the difference in standard uncertainties."""
    agreements = result.details.agreement if result.details else ()
    unit = result.main.unit if agreements else ""
    inverse = result.leading.endswith("/inertia")  # the fit had the inertia over what is in the numerator here

    def shown(value: float, u: float) -> str:
        return plus_minus(*((1 / value, u / value**2) if inverse else (value, u)), unit, fine=True)

    rows = [
        (
            DIVIDED[agreement.division],
            shown(*agreement.first),
            shown(*agreement.second),
            number(agreement.difference / agreement.standard_uncertainty, "", 2, fine=True),
        )
        for agreement in agreements
    ]
    parts = (Column(name, "number", True) for name in ("first", "second", "difference over u"))
    return Table((Column("parts", "text"), *parts), tuple(rows), "wide budget")


def distribution_table(result: Result) -> Table:
    """Each parameter by propagation of distributions: value, shortest interval, and the comparison in words."""
    distributions = result.monte_carlo.parameters if result.monte_carlo else {}
    rows = []
    for name, distribution in distributions.items():
        unit = result.parameters[name].unit
        value = plus_minus(distribution.mean, distribution.standard_uncertainty, unit, fine=True)
        ends = interval(distribution.interval95, middle=distribution.mean, fine=True)
        tolerance = number(distribution.tolerance, unit, 2, fine=True)
        rows.append((Cell("", name), value, ends, f"{AGREEMENT[distribution.agrees]} (δ = {tolerance})"))
    columns = (
        Column("parameter"),
        Column("mean ± standard uncertainty", "value-cell"),
        Column("shortest 95 % interval", "number", True),
        Column("comparison", "text"),
    )
    return Table(columns, tuple(rows))


def check_table(result: Result) -> Table:
    """Consistency checks that the identification carried out, and what each found; empty where none is recorded."""
    messages = [(m.code, "warning") for m in result.warnings] + [(m.code, "note") for m in result.notes]
    rows = []
    for name in result.details.checks if result.details else ():
        check = CHECKS[name]
        codes = [(code, level) for code, level in messages if code in check.codes and (code, level) not in UNCHANGED]
        levels = {level for _, level in codes}
        outcome = next((level for level in ("warning", "note") if level in levels), "passed")
        said = ", ".join(dict.fromkeys(code for code, _ in codes))
        rows.append((check.words, Cell(outcome, form=f"check-{outcome}"), Cell("", said)))
    return Table((Column("check", "text"), Column("found", "name", True), Column("message", "text")), tuple(rows))


def method_table(result: Result, rig: Rig | None) -> Table:
    """The method, its options, the corrections that were made and the repairs of the log."""
    origin = result.provenance
    words = METHODS.get(result.method, "")
    rows = [("method", f"{result.method}: {words}" if words else result.method)]
    options = origin.get("options")
    if isinstance(options, dict) and options:
        rows.append(("options", ", ".join(f"{key} = {value}" for key, value in options.items())))
    if result.details:
        rows.append(("part used", segment_text(result.details, fine=True)))
    decided = origin.get("preparation")
    corrections = decided.get("corrections") if isinstance(decided, dict) else None
    if isinstance(corrections, list) and corrections:
        rows.append(("corrections", "; ".join(_correction(correction) for correction in corrections)))
    repairs = origin.get("repairs")
    done = [str(repair.get("what")) for repair in repairs if repair.get("done")] if isinstance(repairs, list) else []
    if done:
        rows.append(("repairs of the log", " ".join(done)))
    if rig is not None:
        rows.append(("rig", f"{rig.name}: {rig.axis.kind} axis, {DRIVES.get(rig.drive.kind, rig.drive.kind)}"))
    return pairs(rows)


def _correction(correction: dict[str, Any]) -> str:
    """'wheel latency (0.20 ± 0.10) ms, stated'."""
    what = f"{correction['channel']} {str(correction['kind']).replace('_', ' ')}"
    if correction.get("value") is not None:
        size = (correction[key] for key in ("value", "standard_uncertainty", "unit"))
        what += f" {plus_minus(*size, fine=True)}"
    return f"{what.strip()}, {correction['origin']}"


def correlation_table(result: Result) -> Table:
    """Pairs of parameters whose errors go together, the strongest first."""
    columns = (Column("parameter"), Column("and"), Column("correlation coefficient", "number"))
    rows = [
        (Cell("", first), Cell("", second), f"{r:+.2f}".replace("-", "−"))
        for first, second, r in correlated_pairs(result)
    ]
    return Table(columns, tuple(rows), "")


def _truth(result: Result, log: Recording) -> Iterator[tuple[str, str]]:
    """Yield, for a log of the twin, the inertia it was made with and how far the answer is off."""
    truth = log.metadata.get("truth")
    inertia = truth.get("inertia") if isinstance(truth, dict) else None
    if isinstance(inertia, int | float) and inertia and "inertia" in result.parameters:
        off = percent(result.inertia.value / inertia - 1, sign=True, fine=True)
        text = f"{number(inertia, result.inertia.unit, 6, fine=True)}; the error of the estimate is {off}"
        yield "the twin's truth", text


def provenance_table(result: Result) -> Table:
    """Files, hashes, options, and the versions in one line."""
    data = dict(result.provenance)
    versions = data.pop("versions", None)
    data.pop("constants", None)  # they have a table of their own
    if "logs" in data:
        data.pop("preparation", None)  # of the first log
    rows = [(key.replace("_", " "), Cell("", value)) for key, value in _flat(data)]
    if isinstance(versions, dict):
        rows.append(("versions", Cell("", ", ".join(f"{name} {value}" for name, value in versions.items()))))
    return pairs(rows)


def metadata_table(data: object) -> Table:
    """Nested data, as a log's metadata, line by line."""
    return pairs([(key, Cell("", value)) for key, value in _flat(data)])


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
        return ", ".join(_short(entry) for entry in data)
    if isinstance(data, dict):
        return " ".join(f"{key} {_short(value)}" for key, value in data.items())
    if data is None:
        return ""
    return f"{data:.7g}" if isinstance(data, float) else " ".join(str(data).split())
