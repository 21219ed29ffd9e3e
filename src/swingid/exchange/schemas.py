"""JSON schemas (draft 2020-12) of a result, a rig file and a plan of a campaign, for editors and for other programs.

Those of rig file and plan follow from the tables that read them, so they have every key and no other. A value that is
right by the schema may still be refused: units, limits and keys that exclude each other are checked when it is read.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

from swingid.errors import UsageError

Schema = dict[str, Any]

DRAFT = "https://json-schema.org/draft/2020-12/schema"

VALUE: Schema = {
    "description": 'A number in SI units; text with a unit and a standard uncertainty, "1134 ± 5 g*cm^2"; a table with '
    "value, std and unit; or a list of numbers where the key takes one.",
    "anyOf": [
        {"type": "number"},
        {"type": "string"},
        {
            "type": "object",
            "properties": {"value": {"type": "number"}, "std": {"type": "number"}, "unit": {"type": "string"}},
            "required": ["value"],
        },
        {"type": "array"},
    ],
}

NUMBER, TEXT = {"type": "number"}, {"type": "string"}
MAYBE = {"type": ["number", "null"]}


def _object(required: dict[str, Schema], optional: dict[str, Schema] | None = None) -> Schema:
    return {"type": "object", "properties": required | (optional or {}), "required": list(required)}


def _list(of: Schema) -> Schema:
    return {"type": "array", "items": of}


def _map(of: Schema) -> Schema:
    return {"type": "object", "additionalProperties": of}


def result_schema() -> Schema:
    """The schema of what ``identify --json`` writes, "swingid.result/1"."""
    parameter = _object(
        {
            "value": NUMBER,
            "standard_uncertainty": MAYBE,
            "interval95": {"type": ["array", "null"], "items": NUMBER, "minItems": 2, "maxItems": 2},
            "unit": TEXT,
        },
        {"degrees_of_freedom": MAYBE, "coverage_factor": MAYBE},
    )
    entry = _object(
        {"source": TEXT, "type": {"enum": ["A", "B"]}, "parameter": TEXT, "standard_uncertainty": MAYBE},
        {
            "sensitivity": MAYBE,
            "shared_id": {"type": ["string", "null"]},
            "degrees_of_freedom": MAYBE,
            "distribution": {"enum": ["normal", "rectangular"]},
            "averages_over_logs": {"type": "boolean"},
        },
    )
    message = _object({"code": TEXT, "message": TEXT})
    ends_and_value = dict.fromkeys(("start", "stop", "value", "standard_uncertainty"), MAYBE)
    part = _object({**ends_and_value, "status": {"enum": ["ok", "warning", "refused"]}})
    anything: Schema = {"type": ["object", "null"]}
    return {
        "$schema": DRAFT,
        "title": "Result of swingid",
        **_object(
            {
                "schema": {"const": "swingid.result/1"},
                "method": TEXT,
                "status": {"enum": ["ok", "warning", "refused"]},
                "parameters": _map({"$ref": "#/$defs/parameter"}),
                "warnings": _list({"$ref": "#/$defs/message"}),
                "notes": _list({"$ref": "#/$defs/message"}),
                "budget": _list({"$ref": "#/$defs/entry"}),
                "provenance": {"type": "object"},
                "error": {"anyOf": [{"$ref": "#/$defs/message"}, {"type": "null"}]},
            },
            {
                "details": anything,
                "sensitivities": _map(MAYBE),
                "covariance": _map(_map(MAYBE)),
                "correlation": _map(_map(MAYBE)),
                "ratios": {"type": "boolean"},
                "monte_carlo": anything,
                "per_log": _list({"$ref": "#"}),
                "per_part": _list(part),
            },
        ),
        "$defs": {"parameter": parameter, "entry": entry, "message": message},
    }


def rig_schema() -> Schema:
    """The schema of a rig file, by which editors complete and check rig.toml."""
    from swingid.model.rig import Rig

    schema = _of_tables(Rig, "Rig file of swingid")
    schema["required"] = [key for key in schema["required"] if key != "name"]  # else it is the name of the file
    return schema


def plan_schema() -> Schema:
    """The schema of the plan of a campaign."""
    from swingid.study.campaign.tables import PlanTables

    return _of_tables(PlanTables, "Plan of a campaign of swingid")


def _of_tables(root: Any, title: str) -> Schema:
    """The schema of a table and of those inside it: values that a table reads itself, and further terms, included."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # defaults are not as a file would have them, and are not kept
        schema: Schema = root.model_json_schema(mode="validation", ref_template="#/$defs/{model}")
    definitions: Schema = schema.pop("$defs", {})
    places = _places(root)
    for name, part in [(root.__name__, schema), *definitions.items()]:
        part.pop("description", None)
        table, path = places.get(name, (None, ""))
        if table is not None and hasattr(table, "term_keys"):
            part.setdefault("properties", {}).update({key: {} for key in table.term_keys()})
            part["additionalProperties"] = False
        _fill(part, path)
    return {"$schema": DRAFT, **schema, "title": title, "$defs": {**definitions, "value": VALUE}}


def _places(root: Any) -> dict[str, tuple[Any, str]]:
    """The tables inside `root` by the names of their classes, each with its first place in the file, "drive.motor."."""
    places: dict[str, tuple[Any, str]] = {}
    todo = [(root, "")]
    while todo:
        table, path = todo.pop(0)
        if table.__name__ in places:
            continue
        places[table.__name__] = table, path
        for key, field in table.model_fields.items():
            inner = [field.annotation, *getattr(field.annotation, "__args__", ())]
            todo += [(model, f"{path}{key}.") for model in inner if hasattr(model, "model_fields")]
    return places


def _fill(schema: Schema, path: str) -> None:
    """Refer to `VALUE` where a table reads the value itself, and say what a key of the rig is."""
    from swingid.report.words import RIG

    for key, part in schema.get("properties", {}).items():
        branches = part.get("anyOf", [part])
        for k, branch in enumerate(branches):
            if not set(branch) & {"$ref", "type", "enum", "const", "anyOf"}:
                branches[k] = {"$ref": "#/$defs/value"}
        kept = {name: value for name, value in part.items() if name not in ("title", "default", "anyOf")}
        kept = {"anyOf": branches} | kept if "anyOf" in part else branches[0] if len(branches) == 1 else kept
        kept = {name: value for name, value in kept.items() if name not in ("title", "default")}
        word = RIG.get(path + key)
        if word is not None:
            kept = {
                **kept,
                "description": f"{word.words} {word.symbol} {f'({word.unit})' if word.unit else ''}".strip(),
            }
        schema["properties"][key] = kept


SCHEMAS: dict[str, Callable[[], Schema]] = {"result": result_schema, "rig": rig_schema, "plan": plan_schema}
"""The schemas by name."""


def schema(name: str) -> Schema:
    """A JSON schema by its name: "result", "rig" or "plan". Raises UsageError for another."""
    if name not in SCHEMAS:
        raise UsageError(f"unknown schema {name!r}; choose one of {', '.join(SCHEMAS)}.", code="unknown-schema")
    return SCHEMAS[name]()
