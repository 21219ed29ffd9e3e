"""What becomes of a valid file: flips, cuts, copies, extreme numbers, tokens, splices; and of a rig file's keys."""

from __future__ import annotations

import json
import random
import struct
import tomllib
from copy import deepcopy
from typing import Any

import numpy as np

NUMBERS = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-0.0", "1e400", "9" * 400, "-" + "9" * 25),
    *(
        "4294967295",
        "2147483648",
        "18446744073709551616",
        "1,5",
        "1_0",
        "1.5.2",
        "true",
        "null",
        "None",
        "",
        " ",
        "°",
        "--1",
    ),
)
TOKENS = (
    *(b"\n", b"\r", b"\r\n", b"\t", b";", b",", b"|", b" ", b'"', b'"""', b"'", b"#", b"%", b"//", b"\0", b"\xff\xfe"),
    *(b"\xef\xbb\xbf", b"{", b"[", b"}", b"]", b"{" * 3000, b"[" * 3000, b'{"a":' * 900, b":", b"=", b"\\", b"\\u0000"),
    *(b"PAR1", b"\x89HDF\r\n\x1a\n", b"MATLAB 5.0", b"\x89MCAP0\r\n", b"PK\x03\x04", b"\x1f\x8b", b"<html>"),
    *(
        b"# swingid:",
        b"\n\n",
        b",,,,",
        b'""',
        b"\xc3\x28",
        b"\xed\xa0\x80",
        "µ°Ω".encode(),
        b"t,q1",
        b"NaN",
        b"a" * 5000,
    ),
)
INTEGERS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x00FFFFFF)
DOUBLES = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 0.0, 2.0**63)


def mutated(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    """The content after one to four mutations."""
    for _ in range(draw.choice((1, 1, 1, 2, 2, 4))):
        content = draw.choice(MUTATIONS)(content, others, draw)
    return content


def _flip(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(draw.choice((1, 1, 2, 8, 64)) if changed else 0):
        changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
    return bytes(changed)


def _set(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(draw.choice((1, 2, 8)) if changed else 0):
        changed[draw.randrange(len(changed))] = draw.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, 10, 44, draw.randrange(256)))
    return bytes(changed)


def _cut(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    return content[: draw.randrange(len(content) + 1)]


def _behead(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    return content[draw.randrange(min(len(content), 600) + 1) :]


def _remove(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    at, size = _span(content, draw)
    return content[:at] + content[at + size :]


def _repeat(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    at, size = _span(content, draw)
    return content[:at] + content[at : at + size] * draw.choice((2, 2, 3, 20)) + content[at + size :]


def _move(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    at, size = _span(content, draw)
    rest, piece = content[:at] + content[at + size :], content[at : at + size]
    to = draw.randrange(len(rest) + 1)
    return rest[:to] + piece + rest[to:]


def _insert(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    at = draw.randrange(len(content) + 1)
    return content[:at] + draw.randbytes(draw.choice((1, 2, 4, 8, 100))) + content[at:]


def _token(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    at = draw.randrange(len(content) + 1)
    over = draw.choice((0, 0, 1, 4))
    return content[:at] + draw.choice(TOKENS) + content[at + over :]


def _number(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    """An extreme number in the place of what looks like one."""
    at = draw.randrange(len(content) + 1)
    while at < len(content) and content[at : at + 1] not in b"0123456789":
        at += 1
    end = at
    while end < len(content) and content[end : end + 1] in b"0123456789.eE+-":
        end += 1
    return content[:at] + draw.choice(NUMBERS).encode() + content[end:]


def _binary(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    """An extreme integer or double over some bytes: a length, a count, a value."""
    if draw.random() < 0.3:
        new = struct.pack("<d", draw.choice(DOUBLES))
    else:
        new = draw.choice(INTEGERS).to_bytes(8, "little")[: draw.choice((2, 4, 8))]
    at = draw.randrange(max(len(content) - len(new), 0) + 1)
    if draw.random() < 0.5:
        at -= at % 4
    return content[:at] + new + content[at + len(new) :]


def _splice(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    """The beginning of one file and the end of another."""
    other = draw.choice(others)
    return content[: draw.randrange(len(content) + 1)] + other[draw.randrange(len(other) + 1) :]


def _graft(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    """A stretch of another file over one of this."""
    other = draw.choice(others)
    start, size = _span(other, draw)
    at = draw.randrange(len(content) + 1)
    return content[:at] + other[start : start + size] + content[at + size :]


def _span(content: bytes, draw: random.Random) -> tuple[int, int]:
    return draw.randrange(len(content) + 1), draw.choice((1, 4, 8, 16, 64, 256, draw.randrange(len(content) + 1)))


MUTATIONS = (
    *(_flip, _flip, _set, _cut, _behead, _remove, _repeat, _move, _insert),
    *(_token, _token, _number, _number, _binary, _binary, _splice, _graft),
)

VALUES: tuple[Any, ...] = (
    *(0, 1, -1, 1e308, -1e308, 1e-320, float("inf"), float("nan"), 2**62, -(2**62), True, False, "", " ", "x", "rad"),
    *("5 ± 1 g*cm^2", "5 ± -1 kg*m^2", "± 1", "1e999 kg*m^2", "1 parsec", "1 kg", "5 +/- nan N*m", "1/0 m", "up"),
    *([], [1], [1, 2, 3], [[1]], ["a", 0], {}, "unknown", {"value": 1}, {"value": "x", "std": "x", "unit": 3}),
    *("9" * 400 + " kg*m^2", "1 " + "m*" * 500 + "m", "kg" * 300, "1 m**999999999", "2**99999 N*m", "\u0000", "± µ Ω"),
    *({"value": 1, "std": -1, "unit": "kg*m^2"}, {"bristle_stiffness": 1, "bristle_damping": -1}, -0.0, "1 ± 1e400"),
)
"""What a key of a rig file is set to."""


def mutated_rig(content: bytes, others: tuple[bytes, ...], draw: random.Random) -> bytes:
    """A rig file after mutations of its bytes, or of its keys and values."""
    if draw.random() < 0.4:
        return mutated(content, others, draw)
    tree: dict[str, Any] = tomllib.loads(content.decode())
    for _ in range(draw.choice((1, 1, 2, 3))):
        _change(tree, draw)
    return _toml(tree, "").encode("utf-8", "surrogatepass")


def _change(tree: dict[str, Any], draw: random.Random) -> None:
    """Set, remove, rename, move or add a key of a random table."""
    tables = [tree, *(value for value in tree.values() if isinstance(value, dict))]
    tables += [inner for table in tables[1:] for inner in table.values() if isinstance(inner, dict)]
    tables += [one for value in tree.values() if isinstance(value, list) for one in value if isinstance(one, dict)]
    table = draw.choice(tables)
    keys = list(table)
    action = draw.choice(("set", "set", "set", "remove", "rename", "add", "move"))
    if action == "add" or not keys:
        names = ("inertia", "kind", "noise", "x", "", "a.b", "angle", "rate", "unit", "q" * 300)
        table[draw.choice(names)] = _value(draw)
        return
    key = draw.choice(keys)
    if action == "set":
        table[key] = _value(draw)
    elif action == "remove":
        del table[key]
    elif action == "rename":
        table[key[:-1] + draw.choice(("", "x", "_"))] = table.pop(key)
    else:
        draw.choice(tables)[key] = deepcopy(table[key])


def _value(draw: random.Random) -> Any:
    return deepcopy(draw.choice(VALUES))


def _toml(tree: dict[str, Any], path: str) -> str:
    """The tree as TOML text; values only of the kinds that tomllib gives."""
    lines = [f"{_key(key)} = {_inline(value)}" for key, value in tree.items() if not isinstance(value, dict)]
    for key, value in tree.items():
        if isinstance(value, dict):
            inner = f"{path}{_key(key)}"
            lines += [f"[{inner}]", _toml(value, f"{inner}.")]
    return "\n".join(lines)


def _key(key: str) -> str:
    return key if key.isidentifier() and key.isascii() else json.dumps(key)


def _inline(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(_inline(one) for one in value)}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, str):
        return json.dumps(value)
    return repr(value)


def mutated_columns(columns: dict[str, np.ndarray], draw: random.Random) -> dict[str, np.ndarray]:
    """Columns of numbers after faults: extreme, missing, repeated, swapped, frozen, scaled, coarse, torn values."""
    columns = {name: values.copy() for name, values in columns.items()}
    for _ in range(draw.choice((1, 1, 2, 3))):
        name = draw.choice(list(columns))
        columns[name] = draw.choice(FAULTS)(columns[name], draw)
    if draw.random() < 0.1:
        a, b = draw.choice(list(columns)), draw.choice(list(columns))
        columns[a], columns[b] = columns[b], columns[a]
    if draw.random() < 0.15:
        rows = slice(*sorted((draw.randrange(len(columns["t"])), draw.randrange(len(columns["t"])))))
        columns = {name: values[rows] for name, values in columns.items()}
    return columns


def _some(values: np.ndarray, draw: random.Random) -> slice | list[int]:
    first = draw.randrange(len(values))
    few = [draw.randrange(len(values)) for _ in range(draw.choice((1, 3, 20)))]
    return draw.choice((few, few, slice(first, None), slice(None, first), slice(first, first + 30)))


def _put(values: np.ndarray, draw: random.Random) -> np.ndarray:
    values[_some(values, draw)] = draw.choice((*DOUBLES, 1e6, -1e12, 1e-300, 3.14, float("nan")))
    return values


def _freeze(values: np.ndarray, draw: random.Random) -> np.ndarray:
    values[_some(values, draw)] = values[draw.randrange(len(values))]
    return values


def _scale(values: np.ndarray, draw: random.Random) -> np.ndarray:
    factor = draw.choice((0.0, -1.0, 1e-3, 1e3, 57.3, 1e-12, 1e12, 1e150, 1e-150, 1e300))
    with np.errstate(over="ignore"):
        return values * factor + draw.choice((0.0, 0.0, np.pi, 1e9, -1e5))


def _round(values: np.ndarray, draw: random.Random) -> np.ndarray:
    step = draw.choice((1e-4, 0.01, 0.1, 0.5, 2.0))
    return np.round(values / step) * step


def _noise(values: np.ndarray, draw: random.Random) -> np.ndarray:
    rng = np.random.default_rng(draw.randrange(2**32))
    return values + draw.choice((1e-9, 1e-3, 0.1, 10.0)) * rng.normal(size=len(values))


def _disorder(values: np.ndarray, draw: random.Random) -> np.ndarray:
    at, other = draw.randrange(len(values)), draw.randrange(len(values))
    if draw.random() < 0.5:
        values[[at, other]] = values[[other, at]]
        return values
    return np.roll(values, at) if draw.random() < 0.5 else values[::-1].copy()


def _jump(values: np.ndarray, draw: random.Random) -> np.ndarray:
    values[draw.randrange(len(values)) :] += draw.choice((1e-3, 0.3, 2 * np.pi, -100.0, 1e8))
    return values


def _wrap(values: np.ndarray, draw: random.Random) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.mod(values, draw.choice((2 * np.pi, 360.0, 1.0, 0.1)))


FAULTS = (_put, _put, _put, _freeze, _freeze, _scale, _round, _noise, _disorder, _jump, _wrap)
