"""A large MCAP file some chunks at a time: JSON messages parsed together, others one by one, as `mcap` reads them."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import mcap
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
    """A topic: its channels, about how many messages, its columns with their places in a JSON message.

    paths: empty where the messages are not in JSON. clock: the column that is the time of the log, where no message
    has a time of its own.
    """

    name: str
    channels: frozenset[int]
    rows: int
    columns: tuple[str, ...]
    paths: Mapping[str, tuple[str, ...]]
    clock: str | None


@dataclass(frozen=True)
class File(PartFile):
    """An MCAP file whose chunks follow each other in time: its topics; `rows` are of the one with the most messages."""

    topics: tuple[_Topic, ...]
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
        names = [_prefix(topic, topics) + column for topic in topics for column in topic.columns]
        rows = max(topic.rows for topic in topics)
        return cls(path, rows, header_of(names, contents.metadata), tuple(topics), summary)

    def together(self) -> list[str]:
        """The columns that have a value in every row: those of the topic with the most messages."""
        return self._names(max(self.topics, key=lambda topic: topic.rows))

    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """Columns of one topic in pieces of `rows` rows; InputError where the file is damaged."""
        return resized(self._blocks(min(rows, BLOCK), columns), rows)

    def _blocks(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in blocks of whole chunks, of `rows` rows or more."""
        topic = self._topic_of(columns)
        prefix = _prefix(topic, self.topics)
        wanted = [column.removeprefix(prefix) for column in columns]
        waiting: list[_Message] = []
        with mcap.damaged(self.path), Path(self.path).open("rb") as stream:
            for index in sorted(self.summary.chunk_indexes, key=lambda chunk: int(chunk.message_start_time)):
                if not index.message_index_offsets or topic.channels & index.message_index_offsets.keys():
                    waiting += _messages(_chunk(stream, index), topic.channels)
                if len(waiting) >= rows:
                    yield self._table(topic, waiting, wanted)
                    waiting = []
            if waiting:
                yield self._table(topic, waiting, wanted)

    def _table(self, topic: _Topic, messages: list[_Message], wanted: list[str]) -> Table:
        """The wanted columns of messages, in the order of the log's time."""
        messages.sort(key=lambda message: message.log_time)
        columns = _together(topic, messages, wanted) if topic.paths else None
        if columns is None:  # as `mcap.read` has them
            decode, summary = mcap.ros2_decoder(), self.summary
            channels = {number: summary.channels[number] for number in topic.channels}
            kinds = {number: summary.schemas.get(channel.schema_id) for number, channel in channels.items()}
            each = [(kinds[m.channel], channels[m.channel], m) for m in messages]
            rows = [cells for entry in each if (cells := mcap.cells_of(*entry, decode, self.path))]
            found, none = columns_of(rows), np.full(len(rows), np.nan)
            columns = {name: np.asarray(found.get(name, none), np.float64) for name in wanted}
        return Table({_prefix(topic, self.topics) + name: columns[name] for name in wanted})

    def _topic_of(self, columns: list[str]) -> _Topic:
        """The topic of which the columns are; InputError where they are of several."""
        owners = {column: topic for topic in self.topics for column in self._names(topic)}
        topics = {owners[column].name: owners[column] for column in columns}
        if len(topics) > 1:
            message = f"{self.path} has the columns {', '.join(columns)} in several topics ({', '.join(topics)}), which"
            message += " are not read in parts; write them into one topic, or convert a shorter log."
            raise InputError(message, code="not-in-parts")
        return next(iter(topics.values()))

    def _names(self, topic: _Topic) -> list[str]:
        return [_prefix(topic, self.topics) + column for column in topic.columns]


def _prefix(topic: _Topic, topics: Sequence[_Topic]) -> str:
    return "" if len(topics) == 1 else f"{topic.name}."


class _Message(NamedTuple):
    """A message of a chunk: the number of its channel, its time in the log (ns), its data."""

    channel: int
    log_time: int
    data: bytes


MESSAGE, RECORD, HEAD = 5, struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Opcode of a message; a record's opcode and length; a message's channel, sequence and two times before its data."""


def _messages(records: bytes, channels: frozenset[int]) -> list[_Message]:
    """The messages of these channels among the records of a chunk; ValueError where one is damaged.

    Layout: https://mcap.dev/spec.
    """
    messages, at = [], 0
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
                messages.append(_Message(channel, log_time, records[at + HEAD.size : at + length]))
        at += length
    return messages


def _together(topic: _Topic, messages: list[_Message], wanted: list[str]) -> dict[str, Array] | None:
    """Columns of all messages parsed at once; None where a message is not like the others."""
    import pyarrow as pa
    import pyarrow.json as pj

    read = [name for name in wanted if name != topic.clock]
    columns: dict[str, Array] = {}
    if read:
        clocks = [name for name in ("t", "time") if name not in read]  # where a message has one, its time is that
        paths = {name: (name,) for name in clocks} | {name: topic.paths[name] for name in read}
        try:
            table = pj.read_json(
                pa.BufferReader(b"\n".join([message.data for message in messages])),
                read_options=pj.ReadOptions(use_threads=False),  # as `csv.BLOCK`
                parse_options=pj.ParseOptions(explicit_schema=_schema(paths), unexpected_field_behavior="ignore"),
            )
        except pa.ArrowException:
            return None
        if table.num_rows != len(messages):
            return None
        for name, place in paths.items():
            column = table.column(place[0])
            for key in place[1:]:
                column = pa.chunked_array([chunk.field(key) for chunk in column.chunks])
            absent = name in clocks and name not in topic.paths
            if column.null_count != (len(messages) if absent else 0):
                return None
            if not absent:
                columns[name] = np.concatenate([np.from_dlpack(chunk) for chunk in column.chunks])
    if topic.clock in wanted:
        columns[topic.clock] = 1e-9 * np.array([message.log_time for message in messages], np.float64)
    return columns


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
        cells = [mcap.cells_of(kind, channel, message, decode, name) for kind, channel, message in sample]
        columns = tuple(dict.fromkeys(column for row in cells for column in row))
        if not columns:
            continue
        in_json = all(channel.message_encoding == "json" for channel in of_topic)
        paths = _paths([json.loads(entry[2].data) for entry in sample]) if in_json else {}
        clock = next((column for column in columns if column not in paths), None) if paths else None
        ids = frozenset(int(channel.id) for channel in of_topic)
        topics.append(_Topic(name.strip("/").replace("/", "."), ids, rows, columns, paths, clock))
    return topics


def _paths(messages: list[Any]) -> dict[str, tuple[str, ...]]:
    """The place of each number in nested objects; none where two places have one name."""
    by_name: dict[str, tuple[str, ...]] = {}

    def walk(node: Mapping[str, Any], above: tuple[str, ...]) -> bool:
        for key, value in node.items():
            place = (*above, str(key))
            if isinstance(value, dict):
                if not walk(value, place):
                    return False
            elif isinstance(value, int | float) and by_name.setdefault(".".join(place), place) != place:
                return False
        return True

    plain = [message for message in messages if isinstance(message, dict) and flat(message)]
    return by_name if all(walk(message, ()) for message in plain) else {}


def _schema(paths: Mapping[str, tuple[str, ...]]) -> Any:
    """The Arrow schema of the numbers at these places."""
    import pyarrow as pa

    tree: dict[str, Any] = {}
    for place in paths.values():
        node = tree
        for key in place[:-1]:
            node = node.setdefault(key, {})
        node[place[-1]] = pa.float64()

    def fields(node: dict[str, Any]) -> list[Any]:
        return [
            pa.field(key, pa.struct(fields(kind)) if isinstance(kind, dict) else kind) for key, kind in node.items()
        ]

    return pa.schema(fields(tree))


def _chunk(stream: BinaryIO, index: Any) -> bytes:
    """The records of the chunk at a place of the file."""
    from mcap.stream_reader import StreamReader, get_chunk_data_stream

    stream.seek(index.chunk_start_offset)
    chunk: Any = next(iter(StreamReader(stream, skip_magic=True, emit_chunks=True).records))
    data, size = get_chunk_data_stream(chunk, validate_crc=True)
    return bytes(data.read(size))
