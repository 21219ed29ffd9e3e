"""A rig file with some values changed: dotted keys into TOML tables, and tables back into text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from swingid.errors import InputError
from swingid.units import Quantity


def with_values(document: Mapping[str, Any], values: Mapping[str, object]) -> dict[str, Any]:
    """A copy of the tables with `values` at dotted keys; None takes a key away. InputError for a key inside a value."""
    tables = _copied(document)
    for dotted, value in values.items():
        *path, key = dotted.split(".")
        table = tables
        for part in path:
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                raise InputError(f"{dotted} lies inside {part}, which is no table", code="unknown-key")
        if value is None:
            table.pop(key, None)
        else:
            table[key] = value
    return tables


def to_toml(tables: Mapping[str, Any], prefix: str = "") -> str:
    """TOML text of tables of numbers, texts, lists, Quantities and tables; InputError for any other value."""
    plain = [f"{_key(k)} = {_value(v, k)}" for k, v in tables.items() if not isinstance(v, Mapping)]
    blocks = ["\n".join(plain)] if plain else []
    for key, value in tables.items():
        if isinstance(value, Mapping):
            path = f"{prefix}{_key(key)}"
            blocks.append(f"[{path}]\n{to_toml(value, f'{path}.')}")
    return "\n".join(blocks)


def _copied(tables: Mapping[str, Any]) -> dict[str, Any]:
    return {key: _copied(value) if isinstance(value, Mapping) else value for key, value in tables.items()}


def _key(key: str) -> str:
    return key if key.isascii() and key.replace("_", "").replace("-", "").isalnum() else json.dumps(key)


def _value(value: object, key: str) -> str:
    match value:
        case Quantity():
            std = "" if value.std is None else f", std = {value.std!r}"
            return f"{{value = {value.value!r}{std}}}"
        case bool() | str():
            # JSON's escapes are TOML's, bar DEL
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
        case int():
            return str(value)
        case float():
            return repr(float(value))
        case list() | tuple():
            return f"[{', '.join(_value(item, key) for item in value)}]"
        case _:
            raise InputError(
                f"{key} cannot be {type(value).__name__}; give a number, text or Quantity", code="wrong-value"
            )
