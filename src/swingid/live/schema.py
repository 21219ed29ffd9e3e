"""The messages of the link, read from ``swingid.dbc``: the one place that says what a frame holds.

cantools reads the file. Every signal of it is a whole number of bytes, little-endian, one after the other, so a
message is one `struct.Struct`, ten times as fast as the general decoder; `load` refuses a file of which that is not
true. Signals ``value_0, value_1, ...`` are one array.
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from swingid.errors import InputError, UsageError

FORMATS = {
    (8, False, False): "B",
    (16, False, False): "H",
    (32, False, False): "I",
    (32, True, False): "i",
    (32, True, True): "f",
    (64, True, True): "d",
}
"""Code of `struct` by bits, signed, floating."""

MOST_PAYLOAD = 64
"""Bytes of a CAN-FD frame."""

Values = dict[str, Any]


def missing_extra(package: str, extra: str = "live") -> UsageError:
    """The error that names the extra of a package that is not installed."""
    text = f"a live rig needs the package {package}; run: pip install 'swingid[{extra}]'."
    return UsageError(text, code="missing-package")


@dataclass(frozen=True)
class Message:
    """One message: its CAN identifier, name, length in bytes, who sends it, and its fields in order.

    fields: (name, count, code of `struct`), count 0 for a plain number. choices: words of numbers by field.
    """

    id: int
    name: str
    length: int
    from_host: bool
    fields: tuple[tuple[str, int, str], ...]
    choices: dict[str, dict[int, str]]
    packer: struct.Struct

    def pack(self, **values: Any) -> bytes:
        """The payload; what is not given is 0, an array may be shorter than its place.

        Raises UsageError for a name that the message does not have and a number that its field does not hold.
        """
        flat: list[Any] = []
        for name, count, _ in self.fields:
            value = values.pop(name, 0 if count == 0 else ())
            if count == 0:
                flat.append(value)
            else:
                flat += [*value, *[0] * (count - len(value))]
        if values:
            raise UsageError(f"message {self.name} has no field {', '.join(values)}", code="bad-frame")
        try:
            return self.packer.pack(*flat)
        except (struct.error, OverflowError) as error:
            raise UsageError(f"message {self.name} can't hold {flat}: {error}", code="bad-frame") from None

    def unpack(self, payload: bytes) -> Values:
        """Values by field of a payload of the right length."""
        flat = self.packer.unpack(payload)
        values: Values = {}
        place = 0
        for name, count, _ in self.fields:
            if count == 0:
                values[name] = flat[place]
            else:
                values[name] = flat[place : place + count]
            place += count or 1
        return values


@dataclass(frozen=True)
class Schema:
    """All messages by name and by identifier, and the hash (32 bits) of what they hold."""

    by_name: dict[str, Message]
    by_id: dict[int, Message]
    hash: int


def _fields(signals: list[Any], name: str) -> tuple[tuple[str, int, str], ...]:
    """Fields of a message in order; InputError unless they are whole bytes, little-endian and without gaps."""
    fields: list[tuple[str, int, str]] = []
    place = 0
    for signal in sorted(signals, key=lambda signal: int(signal.start)):
        code = FORMATS.get((signal.length, signal.is_signed, signal.is_float))
        plain = signal.byte_order == "little_endian" and signal.scale == 1 and signal.offset == 0
        if code is None or not plain or signal.start != place:
            message = f"signal {signal.name} of message {name} is not made of whole bytes that follow one another"
            raise InputError(message, code="bad-schema")
        place += signal.length
        array = re.fullmatch(r"(\w+)_(\d+)", signal.name)
        if array is None:
            fields.append((signal.name, 0, code))
        elif fields and fields[-1][0] == array[1]:
            fields[-1] = (array[1], fields[-1][1] + 1, code)
        else:
            fields.append((array[1], 1, code))
    return tuple(fields)


def database_text() -> str:
    """The DBC file of this version."""
    return resources.files("swingid.live").joinpath("swingid.dbc").read_text(encoding="ascii")


def read(text: str) -> Schema:
    """Schema of a DBC text; UsageError without cantools, InputError for a layout that `Message` can't hold."""
    try:
        import cantools
    except ImportError:
        raise missing_extra("cantools") from None
    messages = []
    for described in sorted(
        cantools.database.load_string(text, "dbc").messages, key=lambda described: int(described.frame_id)
    ):
        fields = _fields(list(described.signals), described.name)
        packer = struct.Struct("<" + "".join(code * (count or 1) for _, count, code in fields))
        if packer.size != described.length or packer.size > MOST_PAYLOAD:
            raise InputError(
                f"message {described.name} has {described.length} bytes, its fields {packer.size}", code="bad-schema"
            )
        choices = {
            signal.name: {int(number): str(word) for number, word in signal.choices.items()}
            for signal in described.signals
            if signal.choices
        }
        message = Message(
            id=described.frame_id,
            name=described.name,
            length=described.length,
            from_host="HOST" in described.senders,
            fields=fields,
            choices=choices,
            packer=packer,
        )
        messages.append(message)
    meaning = [(m.id, m.name, m.from_host, m.fields, sorted(m.choices.items())) for m in messages]
    return Schema({m.name: m for m in messages}, {m.id: m for m in messages}, zlib.crc32(repr(meaning).encode()))


@cache
def schema() -> Schema:
    """The schema of this version; UsageError without cantools."""
    return read(database_text())
