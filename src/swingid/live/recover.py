"""A whole MCAP file of what a broken one holds: cut off while it was written, or with damaged blocks."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swingid.errors import InputError
from swingid.live.schema import missing_extra
from swingid.system import read_input, write_whole


@dataclass
class Recovered:
    """What was found: messages by topic, damaged blocks, whether the end was missing; content: the whole file."""

    messages: dict[str, int] = field(default_factory=dict)
    damaged: int = 0
    cut: bool = False
    content: bytes = b""

    @property
    def whole(self) -> bool:
        """Return whether there was nothing to recover."""
        return not self.damaged and not self.cut


def recover(path: str | Path, target: str | Path | None = None) -> tuple[Recovered, Path | None]:
    """Write what a broken MCAP file holds to `target`, default NAME.recovered.mcap; nothing where the file is whole.

    Raises InputError for a file that is no MCAP or holds no message, and where the target can't be written.
    """
    source = Path(path)
    content = read_input(path, missing="give the path of an MCAP file", folder=("is-a-folder", "give one file in it"))
    result = recovered(content, str(path))
    if result.whole:
        return result, None
    out = source.with_suffix(".recovered.mcap") if target is None else Path(target)
    write_whole(out, result.content)
    return result, out


def recovered(content: bytes, name: str) -> Recovered:
    """The records of all blocks whose checksum is right, in a file of their own."""
    try:
        from mcap.exceptions import InvalidMagic
        from mcap.records import Footer
        from mcap.stream_reader import StreamReader
        from mcap.writer import Writer
    except ImportError:
        raise missing_extra("mcap") from None
    result, out = Recovered(), io.BytesIO()
    copy = _Copy(Writer(out), result)
    copy.writer.start(library="swingid recover")
    result.cut = True
    try:
        for record in StreamReader(io.BytesIO(content), emit_chunks=True).records:
            if isinstance(record, Footer):
                result.cut = False
                break
            copy.take(record)
    except InvalidMagic:
        raise InputError(f"{name} is no MCAP file; give the journal of a live run", code="not-a-table") from None
    except Exception:  # a damaged length or a cut may fail anywhere in the other package
        result.cut = True
    if not result.messages:
        raise InputError(f"{name} holds no whole block of messages; nothing can be recovered", code="not-a-table")
    copy.writer.finish()
    result.content = out.getvalue()
    return result


@dataclass
class _Copy:
    """Records from one file into another, which numbers schemas and channels anew."""

    writer: Any
    found: Recovered
    schemas: dict[int, int] = field(default_factory=lambda: {0: 0})
    channels: dict[int, tuple[int, str]] = field(default_factory=dict)

    def take(self, record: Any) -> None:
        from mcap.records import Attachment, Chunk, Metadata
        from mcap.stream_reader import breakup_chunk

        if isinstance(record, Chunk):
            try:
                inner = breakup_chunk(record, validate_crc=True)
            except Exception:  # damaged compression or checksum
                self.found.damaged += 1
                return
            for entry in inner:
                self._one(entry)
            self.writer.flush()
        elif isinstance(record, Attachment):
            self.writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
        elif isinstance(record, Metadata):
            self.writer.add_metadata(record.name, record.metadata)
        else:
            self._one(record)

    def _one(self, record: Any) -> None:
        from mcap.records import Channel, Message, Schema

        if isinstance(record, Schema) and record.id not in self.schemas:
            self.schemas[record.id] = self.writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel) and record.id not in self.channels and record.schema_id in self.schemas:
            number = self.writer.register_channel(
                record.topic, record.message_encoding, self.schemas[record.schema_id], record.metadata
            )
            self.channels[record.id] = number, record.topic
        elif isinstance(record, Message) and record.channel_id in self.channels:
            number, topic = self.channels[record.channel_id]
            self.found.messages[topic] = self.found.messages.get(topic, 0) + 1
            self.writer.add_message(number, record.log_time, record.data, record.publish_time, record.sequence)
