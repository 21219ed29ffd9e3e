"""From the JSON file of a result back to a Result: what `difference` and other commands take in."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

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
    text, data = _document(name)
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
        message = f"{name} is a result of swingid calibrate, which has no inertia of a body; write one with"
        raise InputError(f"{message} swingid identify LOG --json FILE.", code="not-a-result")
    try:
        return _result(_File.model_validate_json(text))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the file"
        problem = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
        message = f"{name} is a damaged result file: {place} {problem}; identify the log again."
        raise InputError(message, code="damaged-result") from None


def _document(name: str) -> tuple[str, dict[str, object]]:
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
        message = f"{name} is no result file of swingid: write one with swingid identify LOG --json FILE."
        raise InputError(message, code="not-a-result")
    return text, data


class _Table(BaseModel):
    """A table of the file; keys that are not read here are passed over."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


Uncertainty = Annotated[float, Field(ge=0)]
Freedom = Annotated[float, Field(gt=0)]


class _Parameter(_Table):
    value: float
    unit: str
    standard_uncertainty: Uncertainty | None = None
    interval95: tuple[float, float] | None = None
    degrees_of_freedom: Freedom | None = None  # none in files of earlier versions


class _Entry(_Table):
    source: str
    parameter: str
    type: Literal["A", "B"]
    standard_uncertainty: Uncertainty
    sensitivity: float | None = None
    shared_id: str | None = None
    averages_over_logs: bool = False
    degrees_of_freedom: Freedom | None = None
    distribution: object = "normal"


class _Message(_Table):
    # without the kind, which no file holds
    code: str
    message: str


class _File(_Table):
    method: str
    status: Literal["ok", "warning", "refused"]
    parameters: dict[str, _Parameter] = {}
    warnings: tuple[_Message, ...] = ()
    notes: tuple[_Message, ...] = ()
    budget: tuple[_Entry, ...] = ()
    provenance: dict[str, object] = {}
    error: _Message | None = None
    sensitivities: dict[str, float] = {}
    correlation: dict[str, dict[str, float]] = {}
    ratios: bool = False

    @model_validator(mode="after")
    def _has_an_inertia(self) -> Self:
        if self.status != "refused" and "inertia" not in self.parameters and not (self.ratios and self.parameters):
            raise ValueError("has no parameters.inertia")
        return self


def _result(file: _File) -> Result:
    return Result(
        method=file.method,
        status=file.status,
        parameters={
            name: Parameter(p.value, p.standard_uncertainty, p.interval95, p.unit, p.degrees_of_freedom or math.inf)
            for name, p in file.parameters.items()
        },
        warnings=tuple(map(_message, file.warnings)),
        notes=tuple(map(_message, file.notes)),
        budget=tuple(map(_entry, file.budget)),
        provenance=file.provenance,
        error=None if file.error is None else _message(file.error),
        sensitivities=file.sensitivities,
        correlation=file.correlation,
        ratios=file.ratios,
    )


def _entry(e: _Entry) -> BudgetEntry:
    shape: Distribution = "rectangular" if e.distribution == "rectangular" else "normal"
    freedom = e.degrees_of_freedom or math.inf
    origin = Source(e.source, e.type, e.shared_id, e.averages_over_logs, freedom, shape)
    return BudgetEntry(origin, e.parameter, e.standard_uncertainty, e.sensitivity)


def _message(message: _Message) -> Message:
    return Message(message.code, message.message)
