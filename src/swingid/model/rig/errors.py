"""From pydantic's findings to one sentence with the key, what is wrong and what to do."""

from __future__ import annotations

import difflib
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError

from swingid.model.rig.fields import TermTable
from swingid.quantity_text import shown
from swingid.units import UnknownScale


def describe(error: ValidationError, root: type[BaseModel], what: str = "a rig file") -> tuple[str, str]:
    """(code, sentence) of the finding that most likely caused the others: an unknown key before all.

    what: the kind of file, in words.
    """
    findings: list[Any] = sorted(error.errors(), key=lambda finding: finding["type"] != "extra_forbidden")
    finding = findings[0]
    context = finding.get("ctx", {})
    place = tuple(str(part) for part in finding["loc"])
    if finding["type"] == "extra_forbidden" and "key" in context:
        place = (*place, context["key"])
    match finding["type"]:
        case "swingid":
            key = (*place, context["key"]) if context["key"] else place
            return context["slug"], f"{dotted(key)} {context['problem']}"
        case "extra_forbidden":
            return "unknown-key", _unknown_key(place, root, what)
        case "missing":
            return "missing-key", f"{dotted(place)} is missing; {_to_add(place, root)}"
        case "literal_error":
            return "wrong-value", f"{dotted(place)} must be {context['expected']}, not {shown(finding['input'])}"
        case "model_type" | "model_attributes_type":
            return "wrong-value", f"{dotted(place)} must be a table, not {shown(finding['input'])}"
        case _:
            wanted = {
                "string_type": "text",
                "string_too_short": "text that is not empty",
                "int_type": "a whole number",
                "int_parsing": "a whole number",
                "greater_than": "positive",
            }.get(finding["type"])
            if wanted is None:
                return "wrong-value", f"{dotted(place)}: {finding['msg']}"
            return "wrong-value", f"{dotted(place)} must be {wanted}, not {shown(finding['input'])}"


def dotted(place: tuple[str, ...]) -> str:
    """A key as people write it: "drive.wheel.inertia"; "the file" for the top level."""
    return ".".join(part[:60] for part in place) or "the file"


def known_keys(table: type[BaseModel], prefix: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key of a table and of the tables inside it, as paths."""
    keys = [(*prefix, name) for name in _keys_of(table) if name not in table.model_fields]
    for name, field in table.model_fields.items():
        keys.append((*prefix, name))
        inner = _table_of(field.annotation)
        if inner is not None:
            keys += known_keys(inner, (*prefix, name))
    return keys


def _keys_of(table: type[BaseModel]) -> list[str]:
    """The keys of a table, those of further terms included."""
    return [*table.model_fields, *(table.term_keys() if issubclass(table, TermTable) else ())]


def _to_add(place: tuple[str, ...], root: type[BaseModel]) -> str:
    """What to do about a missing key: the values it may have, or the keys that its table needs."""
    annotation = _model_at(root, place[:-1]).model_fields[place[-1]].annotation
    table = _table_of(annotation)
    if table is not None:
        needed = [name for name, field in table.model_fields.items() if field.is_required()]
        return f"add the table [{dotted(place)}]" + (f" with {', '.join(needed)}" if needed else "")
    if get_origin(annotation) is Literal:
        return f"give one of {', '.join(repr(value) for value in get_args(annotation))}"
    return 'add it, or "unknown" for ratios' if UnknownScale in get_args(annotation) else "add it"


def _unknown_key(place: tuple[str, ...], root: type[BaseModel], what: str) -> str:
    table, key = place[:-1], place[-1]
    everywhere = known_keys(root)
    siblings = _keys_of(_model_at(root, table))
    near = difflib.get_close_matches(key.lower(), siblings, n=1, cutoff=0.6)
    if near:
        return f"{dotted(place)} is not a known key; did you mean {dotted((*table, near[0]))}?"
    elsewhere = difflib.get_close_matches(key.lower(), sorted({path[-1] for path in everywhere}), n=1, cutoff=0.75)
    if elsewhere:
        full = next(path for path in everywhere if path[-1] == elsewhere[0])
        return f"{dotted(place)} is not a known key; did you mean {dotted(full)}?"
    where = f"[{dotted(table)}]" if table else what
    near = difflib.get_close_matches(key.lower(), siblings, n=1, cutoff=0.0)
    hint = f" (nearest: {near[0]})" if near else ""
    return f"{dotted(place)} is not a known key{hint}; {where} has {', '.join(siblings)}"


def _model_at(root: type[BaseModel], place: tuple[str, ...]) -> type[BaseModel]:
    """The model of the table at a place; tables of tables have a name of the user's between."""
    model, parts = root, list(place)
    while parts:
        annotation = model.model_fields[parts.pop(0)].annotation
        model = _table_of(annotation) or model
        if get_origin(annotation) is dict:
            parts.pop(0)
    return model


def _table_of(annotation: Any) -> type[BaseModel] | None:
    for candidate in (annotation, *get_args(annotation)):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return None
