"""From the JSON file of a result back to a Result: what `difference` and other commands take in."""

from __future__ import annotations

import json
import math
from pathlib import Path

from swingid.errors import InputError
from swingid.result.result import SCHEMA, Message, Result
from swingid.system import is_file, read_input
from swingid.uncertainty.budget import BudgetEntry, Distribution, Parameter, Source

LARGEST = 200_000_000
"""Bytes beyond which no result file is read."""


def load_result(path: str | Path) -> Result:
    """The result in a file that ``identify --json`` or ``difference --json`` wrote, without its `details`.

    Raises InputError, naming the file, for one that is missing or unreadable, is no JSON, no result, or lacks a key.
    """
    name = str(path)
    data = _document(name)
    schema = data.get("schema")
    if schema != SCHEMA:
        kind = str(schema)
        if kind.startswith("swingid.compare/"):
            hint = "it compares several methods; write the result of one with swingid identify LOG --json FILE"
        elif kind.startswith("swingid.result/"):
            hint = f"its schema {kind[:40]!r} is of another version of swingid; identify the log again"
        else:
            hint = "write one with swingid identify LOG --json FILE"
        raise InputError(f"{name} is no result file of swingid: {hint}.", code="not-a-result")
    if str(data.get("method")).startswith("calibrate"):
        raise InputError(
            f"{name} is a result of swingid calibrate, which has no inertia of a body; write one with swingid identify "
            "LOG --json FILE.",
            code="not-a-result",
        )
    try:
        return _result(data)
    except _MalformedError as problem:
        raise InputError(
            f"{name} is a damaged result file: {problem}; identify the log again.", code="damaged-result"
        ) from None


class _MalformedError(Exception):
    """What is wrong with a result's data, as a clause."""


def _document(name: str) -> dict[str, object]:
    if is_file(name) and Path(name).stat().st_size > LARGEST:
        raise InputError(f"{name} is too large for a result file.", code="not-a-result")
    writes, folder = f"swingid identify LOG --json {name} writes it", ("not-a-file", "give the result file in it")
    try:
        text = read_input(name, missing=writes, folder=folder, most=LARGEST).decode("utf-8-sig")
    except UnicodeDecodeError:
        message = f"{name} is no result file: it is not text; give what swingid identify LOG --json FILE wrote."
        raise InputError(message, code="not-a-result") from None
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        message = f"{name} is not JSON; give what swingid identify LOG --json FILE wrote."
        raise InputError(message, code="not-json") from None
    if not isinstance(data, dict):
        raise InputError(
            f"{name} is no result file of swingid: write one with swingid identify LOG --json FILE.",
            code="not-a-result",
        )
    return data


def _result(data: dict[str, object]) -> Result:
    status = data.get("status")
    if status not in ("ok", "warning", "refused"):
        raise _MalformedError("status is not ok, warning or refused")
    parameters = _table(data, "parameters")
    if status != "refused" and "inertia" not in parameters:
        raise _MalformedError("parameters.inertia is missing")
    error = data.get("error")
    return Result(
        method=_text(data, "method"),
        status=status,
        parameters={name: _parameter(name, value) for name, value in parameters.items()},
        warnings=_messages(data, "warnings"),
        notes=_messages(data, "notes"),
        budget=tuple(_entry(k, value) for k, value in enumerate(_list(data, "budget"))),
        provenance=_table(data, "provenance"),
        error=None if error is None else _message("error", error),
        sensitivities=_numbers(data, "sensitivities"),
        correlation={name: _numbers(_table(data, "correlation"), name) for name in _table(data, "correlation")},
    )


def _parameter(name: str, value: object) -> Parameter:
    place = f"parameters.{name}"
    table = _as_table(place, value)
    u = table.get("standard_uncertainty")
    if u is not None and _number(f"{place}.standard_uncertainty", u) < 0:
        raise _MalformedError(f"{place}.standard_uncertainty is negative")
    bounds = table.get("interval95")
    interval = None
    if bounds is not None:
        if not isinstance(bounds, list) or len(bounds) != 2:
            raise _MalformedError(f"{place}.interval95 is not a pair")
        low, high = (_number(f"{place}.interval95", bound) for bound in bounds)
        interval = low, high
    spread = None if u is None else _number(place, u)
    value, freedom = _number(f"{place}.value", table.get("value")), _freedom(place, table)
    return Parameter(value, spread, interval, _text(table, "unit", place), freedom)


def _entry(k: int, value: object) -> BudgetEntry:
    place = f"budget[{k}]"
    table = _as_table(place, value)
    kind = table.get("type")
    if kind not in ("A", "B"):
        raise _MalformedError(f"{place}.type is not A or B")
    sensitivity, shared = table.get("sensitivity"), table.get("shared_id")
    if shared is not None and not isinstance(shared, str):
        raise _MalformedError(f"{place}.shared_id is not text")
    u = _number(f"{place}.standard_uncertainty", table.get("standard_uncertainty"))
    if u < 0:
        raise _MalformedError(f"{place}.standard_uncertainty is negative")
    slope = None if sensitivity is None else _number(f"{place}.sensitivity", sensitivity)
    source, parameter = (_text(table, key, place) for key in ("source", "parameter"))
    averages, shape = table.get("averages_over_logs", False), table.get("distribution", "normal")
    if not isinstance(averages, bool):
        raise _MalformedError(f"{place}.averages_over_logs is not true or false")
    distribution: Distribution = "rectangular" if shape == "rectangular" else "normal"
    origin = Source(source, kind, shared, averages, _freedom(place, table), distribution)
    return BudgetEntry(origin, parameter, u, slope)


def _freedom(place: str, table: dict[str, object]) -> float:
    """Degrees of freedom; infinite where none are stated, as in files of earlier versions."""
    freedom = table.get("degrees_of_freedom")
    if freedom is None:
        return math.inf
    found = _number(f"{place}.degrees_of_freedom", freedom)
    if found <= 0:
        raise _MalformedError(f"{place}.degrees_of_freedom is not positive")
    return found


def _messages(data: dict[str, object], key: str) -> tuple[Message, ...]:
    return tuple(_message(f"{key}[{k}]", value) for k, value in enumerate(_list(data, key)))


def _message(place: str, value: object) -> Message:
    table = _as_table(place, value)
    return Message(_text(table, "code", place), _text(table, "message", place))


def _as_table(place: str, value: object) -> dict[str, object]:
    if not isinstance(value, dict):
        raise _MalformedError(f"{place} is not a table")
    return value


def _table(data: dict[str, object], key: str) -> dict[str, object]:
    return _as_table(key, data.get(key, {}))


def _list(data: dict[str, object], key: str) -> list[object]:
    value = data.get(key, [])
    if not isinstance(value, list):
        raise _MalformedError(f"{key} is not a list")
    return value


def _numbers(data: dict[str, object], key: str) -> dict[str, float]:
    return {name: _number(f"{key}.{name}", value) for name, value in _table(data, key).items()}


def _text(data: dict[str, object], key: str, place: str = "") -> str:
    value = data.get(key)
    if not isinstance(value, str):
        raise _MalformedError(f"{place}{'.' if place else ''}{key} is not text")
    return value


def _number(place: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _MalformedError(f"{place} is not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise _MalformedError(f"{place} is not finite")
    return number
