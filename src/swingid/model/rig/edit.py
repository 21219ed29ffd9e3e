"""A rig file with some values changed: in its tables, which become TOML text, or in its text, comments kept."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

from swingid.errors import InputError
from swingid.units import Quantity

_HEADER = re.compile(r"\s*\[\s*([\w.\s-]+?)\s*\]\s*(#.*)?$")
_PAIR = re.compile(r"(\s*)([\w-]+)(\s*=\s*)(.*)$")


def edited(text: str, values: Mapping[str, object]) -> tuple[str, bool]:
    """TOML `text` with `values` (numbers, lists, Quantities) at dotted keys, and whether its comments were kept.

    None takes a key away. A value is replaced on its own line; a missing key goes to the end of its table, a missing
    table to the end of the file. Where the file is written in another way (dotted keys, inline tables, values over
    several lines), the whole is written anew from its tables, without comments.
    """
    text = text.removeprefix("\ufeff")
    old = tomllib.loads(text)
    values = {dotted: value for dotted, value in values.items() if value is not None or _there(old, dotted)}
    document = with_values(old, values)
    lines = text.splitlines()
    for dotted, value in values.items():
        table, _, key = dotted.rpartition(".")
        _replace(lines, table, key, value)
    kept = "\n".join(lines) + "\n"
    try:
        same = tomllib.loads(kept) == plain(document)
    except tomllib.TOMLDecodeError:
        same = False
    return (kept, True) if same else (to_toml(document) + "\n", False)


def _there(document: Mapping[str, Any], dotted: str) -> bool:
    """Return whether there is a value at a dotted key."""
    at: Any = document
    for part in dotted.split("."):
        if not isinstance(at, Mapping) or part not in at:
            return False
        at = at[part]
    return True


def _replace(lines: list[str], table: str, key: str, value: object) -> None:
    """Put ``key = value`` into a table's lines, in place; None takes the line away."""
    written = "" if value is None else to_toml({key: value}).partition("=")[2].strip()
    first, last = _table(lines, table)
    if first < 0:
        lines += ["", f"[{table}]", f"{key} = {written}"] if written else []
        return
    for k in range(first, last):
        pair = _PAIR.match(lines[k])
        if pair and pair[2] == key:
            if not written:
                del lines[k]
                return
            lines[k] = f"{pair[1]}{key}{pair[3]}{written}{_comment(pair[4])}"
            return
    if not written:
        return
    while last > first and not lines[last - 1].strip():
        last -= 1
    lines.insert(last, f"{key} = {written}")


def _table(lines: list[str], name: str) -> tuple[int, int]:
    """First and last + 1 line of a table's own pairs; (−1, −1) where there is none."""
    heads = [(k, match[1].replace(" ", "")) for k, line in enumerate(lines) if (match := _HEADER.match(line))]
    if not name:
        return 0, heads[0][0] if heads else len(lines)
    for place, (k, title) in enumerate(heads):
        if title == name:
            return k + 1, heads[place + 1][0] if place + 1 < len(heads) else len(lines)
    return -1, -1


def _comment(rest: str) -> str:
    """The comment at the end of a pair's value, with the space before it; "" where there is none."""
    quote = ""
    for k, sign in enumerate(rest):
        if quote:
            quote = "" if sign == quote and rest[k - 1 : k] != "\\" else quote
        elif sign in "\"'":
            quote = sign
        elif sign == "#":
            return rest[len(rest[:k].rstrip()) :]
    return ""


def plain(value: Any) -> Any:
    """Tables as tomllib reads them back: a Quantity is a table of value and std."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, Quantity):
        return {"value": value.value} | ({} if value.std is None else {"std": value.std})
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return float(value) if isinstance(value, float) else value


def with_values(document: Mapping[str, Any], values: Mapping[str, object]) -> dict[str, Any]:
    """A copy of the tables with `values` at dotted keys; None takes a key away. InputError for a key inside a value."""
    tables = _copied(document)
    for dotted, value in values.items():
        if value is None and not _there(tables, dotted):
            continue
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
