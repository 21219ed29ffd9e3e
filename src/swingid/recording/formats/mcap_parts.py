"""A large MCAP file some chunks at a time: JSON messages parsed together, others one by one, as `mcap` reads them."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, pairwise
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import mcap
from swingid.recording.formats.arrow import numbers_of
from swingid.recording.formats.isolated import is_installed
from swingid.recording.formats.table import PartFile, Table, columns_of, flat, header_of, most_unpacked, resized

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array

SAMPLE = 200
"""Messages of a topic that are looked at to see its columns."""

BLOCK = 50_000
"""Messages whose text is held and parsed at once, about."""


@dataclass(frozen=True)
class _Topic:
    """A topic: its channels, about how many messages, its columns; of messages in JSON those that are in them.

    Where no message has a time of its own, the column "time" is the time of the log.
    """

    name: str
    channels: frozenset[int]
    rows: int
    columns: tuple[str, ...]
    in_json: frozenset[str]


@dataclass(frozen=True)
class File(PartFile):
    """An MCAP file whose chunks follow each other in time; `rows` are of the topic with the most messages.

    owners: by column its topic, and its name there.
    """

    owners: dict[str, tuple[_Topic, str]]
    summary: Any = field(repr=False)

    @classmethod
    def open(cls, path: str) -> File | None:
        """Look at its summary; None where it has none, its chunks overlap in time, or mcap is missing."""
        if not is_installed("mcap"):
            return None
        from mcap.reader import make_reader

        try:
            with Path(path).open("rb") as stream:
                reader = make_reader(stream)
                summary = reader.get_summary()
                if summary is None or summary.statistics is None or not _follow(summary.chunk_indexes):
                    return None
                contents = mcap.Contents()
                for record in reader.iter_metadata():
                    contents.note(record)
                topics = _topics(reader, summary, bool(contents.metadata.get("live")))
        except InputError:
            raise
        except Exception:  # damage may fail anywhere in the other package; reading it whole gives the reason
            return None
        if not topics:
            return None
        several = len(topics) > 1
        owners = {f"{topic.name}." * several + column: (topic, column) for topic in topics for column in topic.columns}
        rows = max(topic.rows for topic in topics)
        return cls(path, rows, header_of(owners, contents.metadata), owners, summary)

    def together(self) -> list[str]:
        """The columns that have a value in every row: those of the topic with the most messages."""
        most = max((topic for topic, _ in self.owners.values()), key=lambda topic: topic.rows)
        return [column for column, (topic, _) in self.owners.items() if topic is most]

    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """Columns of one topic in pieces of `rows` rows; InputError where the file is damaged."""
        return resized(self._blocks(min(rows, BLOCK), columns), rows)

    def _blocks(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in blocks of whole chunks, of `rows` rows or more."""
        topic = self._topic_of(columns)
        waiting: list[_Message] = []
        with mcap.damaged(self.path), Path(self.path).open("rb") as stream:
            for index in sorted(self.summary.chunk_indexes, key=lambda chunk: int(chunk.message_start_time)):
                if not index.message_index_offsets or topic.channels & index.message_index_offsets.keys():
                    waiting += _messages(_chunk(stream, index), topic.channels)
                if len(waiting) >= rows:
                    yield self._table(topic, waiting, columns)
                    waiting = []
            if waiting:
                yield self._table(topic, waiting, columns)

    def _table(self, topic: _Topic, messages: list[_Message], names: list[str]) -> Table:
        """The columns of these names of messages, in the order of the log's time."""
        wanted = [self.owners[name][1] for name in names]
        messages.sort(key=itemgetter(1))
        columns = _together(topic, messages, wanted) if topic.in_json else None
        if columns is None:  # as `mcap.read` has them
            decode, summary = mcap.ros2_decoder(), self.summary
            channels = {number: summary.channels[number] for number in topic.channels}
            kinds = {number: summary.schemas.get(channel.schema_id) for number, channel in channels.items()}
            each = [(kinds[number], channels[number], data, log_time) for number, log_time, data in messages]
            rows = [cells for entry in each if (cells := mcap.cells_of(*entry, decode, self.path))]
            decoded, none = columns_of(rows), np.full(len(rows), np.nan)
            columns = {name: np.asarray(decoded.get(name, none), np.float64) for name in wanted}
        return Table({name: columns[column] for name, column in zip(names, wanted, strict=True)})

    def _topic_of(self, columns: list[str]) -> _Topic:
        """The topic of which the columns are; InputError where they are of several."""
        topics = {self.owners[column][0].name: self.owners[column][0] for column in columns}
        if len(topics) > 1:
            message = f"{self.path} has the columns {', '.join(columns)} in several topics ({', '.join(topics)}), which"
            message += " are not read in parts; write them into one topic, or convert a shorter log."
            raise InputError(message, code="not-in-parts")
        return next(iter(topics.values()))


_Message = tuple[int, int, bytes]
"""A message of a chunk: the number of its channel, its time in the log (ns), its data."""

MESSAGE, RECORD, HEAD = 5, struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Opcode of a message; a record's opcode and length; a message's channel, sequence and two times before its data."""


def _messages(records: bytes, channels: frozenset[int]) -> list[_Message]:
    """The messages of these channels among the records of a chunk; ValueError where one is damaged.

    Layout: https://mcap.dev/spec.
    """
    messages: list[_Message] = []
    at = 0
    while at + RECORD.size <= len(records):
        opcode, length = RECORD.unpack_from(records, at)
        at += RECORD.size
        if length > len(records) - at:
            raise ValueError("a record is longer than its chunk")
        if opcode == MESSAGE:
            if length < HEAD.size:
                raise ValueError("a message is shorter than its head")
            channel, _, log_time, _ = HEAD.unpack_from(records, at)
            if channel in channels:
                messages.append((channel, log_time, records[at + HEAD.size : at + length]))
        at += length
    return messages


def _together(topic: _Topic, messages: list[_Message], wanted: list[str]) -> dict[str, Array] | None:
    """Columns of all messages parsed at once; None where a message is not like the others."""
    import pyarrow as pa
    import pyarrow.json as pj

    content = pa.BufferReader(b"\n".join([data for _, _, data in messages]))
    try:
        table = pj.read_json(content, read_options=pj.ReadOptions(use_threads=False))  # as `csv.read_rows`
        while any(pa.types.is_struct(column.type) for column in table.columns):
            table = table.flatten()
        times = {"t", "time"} & set(table.column_names)  # where a message has a time, its time is that
        read = {name: table.column(name) for name in {*times, *wanted} & topic.in_json}
    except (pa.ArrowException, KeyError):  # no such column, or several
        return None
    kinds = [column.type for column in read.values()]
    plain = all(pa.types.is_floating(kind) or pa.types.is_integer(kind) for kind in kinds)
    whole = not any(column.null_count for column in read.values())
    if not (plain and whole and table.num_rows == len(messages) and times == {"t", "time"} & topic.in_json):
        return None
    columns = {name: numbers_of(column) for name, column in read.items()}
    return columns | {"time": columns.get("time", 1e-9 * np.array([log_time for _, log_time, _ in messages]))}


def _follow(indexes: list[Any]) -> bool:
    """Return whether chunks follow each other in time, and none claims to hold more than it can."""
    ordered = sorted(indexes, key=lambda index: int(index.message_start_time))
    apart = all(index.message_end_time <= other.message_start_time for index, other in pairwise(ordered))
    possible = all(index.uncompressed_size <= most_unpacked(index.compressed_size) for index in ordered)
    return bool(ordered) and apart and possible


def _topics(reader: Any, summary: Any, live: bool) -> list[_Topic]:
    """The topics that hold numbers, by their first messages."""
    channels: dict[str, list[Any]] = {}
    for channel in summary.channels.values():
        if not live or channel.topic == mcap.LIVE:
            channels.setdefault(channel.topic, []).append(channel)
    decode = mcap.ros2_decoder()
    topics = []
    for name, of_topic in channels.items():
        counts = summary.statistics.channel_message_counts
        rows = sum(int(counts.get(channel.id, 0)) for channel in of_topic)
        sample = list(islice(reader.iter_messages(topics=[name]), SAMPLE)) if rows else []
        cells = [mcap.cells_of(kind, channel, m.data, m.log_time, decode, name) for kind, channel, m in sample]
        columns = tuple(dict.fromkeys(column for row in cells for column in row))
        if not columns:
            continue
        texts = sample if all(channel.message_encoding == "json" for channel in of_topic) else []
        rows_in_json = [row for entry in texts if isinstance(row := json.loads(entry[2].data), dict)]
        numbers = ((key, cell) for row in rows_in_json for key, cell in flat(row).items())
        in_json = frozenset(key for key, cell in numbers if isinstance(cell, int | float))
        ids = frozenset(int(channel.id) for channel in of_topic)
        topics.append(_Topic(name.strip("/").replace("/", "."), ids, rows, columns, in_json))
    return topics


def _chunk(stream: BinaryIO, index: Any) -> bytes:
    """The records of the chunk at a place of the file."""
    from mcap.stream_reader import StreamReader, get_chunk_data_stream

    stream.seek(index.chunk_start_offset)
    chunk: Any = next(iter(StreamReader(stream, skip_magic=True, emit_chunks=True).records))
    data, size = get_chunk_data_stream(chunk, validate_crc=True)
    return bytes(data.read(size))
