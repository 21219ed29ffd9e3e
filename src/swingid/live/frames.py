"""Frames on a serial line: COBS of (identifier, payload, CRC-16), ended by a zero byte.

The CRC is CRC-16/IBM-3740 (polynomial 0x1021, start 0xFFFF) of identifier and payload; numbers are little-endian. On
CAN the payload goes as it is. A zero byte never stands inside a frame, so a receiver is in step again after at most
one lost frame.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from swingid.live.schema import MOST_PAYLOAD, Message, Values, missing_extra, schema

MOST_ENCODED = 2 + MOST_PAYLOAD + 2 + 1
"""Bytes of the longest frame, COBS's own byte with it, without the zero at its end."""

_TWO = struct.Struct("<H")


@dataclass(frozen=True)
class Frame:
    """A message that arrived: its name and its values by field."""

    name: str
    values: Values

    def __getattr__(self, name: str) -> Any:
        """The value of a field."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None


@cache
def _codec() -> tuple[Callable[[bytes], bytes], Callable[[bytes], bytes], Callable[..., int], type[Exception]]:
    """COBS there and back, the CRC, and COBS's error; UsageError without their packages."""
    try:
        from cobs import cobs
    except ImportError:
        raise missing_extra("cobs") from None
    try:
        from fastcrc import crc16
    except ImportError:
        raise missing_extra("fastcrc") from None
    return cobs.encode, cobs.decode, crc16.ibm_3740, cobs.DecodeError


def checksum(data: bytes, before: int = 0xFFFF) -> int:
    """CRC-16/IBM-3740, of frames and of the bytes of all parameters. before: the check of what comes before them."""
    return _codec()[2](data, before)


def wrap(identifier: int, payload: bytes) -> bytes:
    """The bytes of a frame on a serial line, with the zero at its end."""
    body = _TWO.pack(identifier) + payload
    encode, _, crc, _ = _codec()
    return encode(body + _TWO.pack(crc(body))) + b"\0"


def encode(name: str, **values: Any) -> bytes:
    """The bytes of a message on a serial line; errors as `Message.pack`."""
    message = schema().by_name[name]
    return wrap(message.id, message.pack(**values))


def unwrap(encoded: bytes) -> tuple[int, bytes] | None:
    """(identifier, payload) of the bytes between two zeros; None for what is no frame."""
    _, decode, crc, error = _codec()
    try:
        body = decode(encoded)
    except error:
        return None
    if len(body) < 4 or crc(body[:-2]) != _TWO.unpack(body[-2:])[0]:
        return None
    return _TWO.unpack(body[:2])[0], body[2:-2]


class Decoder:
    """Frames out of a stream of bytes that comes in any pieces, with anything between them.

    from_host: which messages are expected; others count as `bad`, as do wrong lengths, checks and unknown identifiers.
    """

    def __init__(self, *, from_host: bool = False) -> None:
        self.bad = 0
        self._from_host = from_host
        self._by_id = schema().by_id
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that end in these bytes; what is no frame is counted in `bad` and left out."""
        *ended, self._rest = (self._rest + data).split(b"\0")
        frames = []
        for encoded in ended:
            if self._skipping or len(encoded) > MOST_ENCODED:
                self.bad += 1
                self._skipping = False
            elif encoded:
                frame = self._frame(encoded)
                if frame is None:
                    self.bad += 1
                else:
                    frames.append(frame)
        if len(self._rest) > MOST_ENCODED:
            self._rest, self._skipping = b"", True
        return frames

    def _frame(self, encoded: bytes) -> Frame | None:
        frame = unwrap(encoded)
        if frame is None:
            return None
        message: Message | None = self._by_id.get(frame[0])
        if message is None or message.from_host != self._from_host or message.length != len(frame[1]):
            return None
        return Frame(message.name, message.unpack(frame[1]))
