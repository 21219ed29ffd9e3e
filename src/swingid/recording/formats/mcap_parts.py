"""A large MCAP file some chunks at a time: JSON messages parsed together, others one by one, as `mcap` reads them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import mcap
from swingid.recording.formats.isolated import is_installed
from swingid.recording.formats.mcap_messages import indexed, split
from swingid.recording.formats.table import Table, columns_of, flat, most_unpacked, resized

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Ints

SAMPLE = 200
"""Messages of a topic that are looked at to see its columns."""

BLOCK = 50_000
"""Messages whose text is held and parsed at once, about."""

CHANNELS = 1 << 16
"""Numbers that a channel may have."""


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
class File:
    """An MCAP file whose chunks follow each other in time: its path, topics, and metadata.

    rows: of the topic with the most messages.
    """

    path: str
    rows: int
    metadata: dict[str, object]
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
        return cls(path, max(topic.rows for topic in topics), contents.metadata, tuple(topics), summary)

    def header(self) -> Table:
        """The columns, each with a row of zeros in the place of its own."""
        names = [self._prefix(topic) + column for topic in self.topics for column in topic.columns]
        return Table({name: np.zeros(1) for name in names}, self.metadata)

    def together(self) -> list[str]:
        """The columns that have a value in every row: those of the topic with the most messages."""
        return self._names(max(self.topics, key=lambda topic: topic.rows))

    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """Columns of one topic in pieces of `rows` rows; InputError where the file is damaged."""
        return resized(self._blocks(min(rows, BLOCK), columns), rows)

    def _blocks(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in blocks of whole chunks, of `rows` rows or more."""
        topic = self._topic_of(columns)
        prefix = self._prefix(topic)
        wanted = [column.removeprefix(prefix) for column in columns]
        with _damaged(self.path), Path(self.path).open("rb") as stream:
            waiting = _Messages(topic, self.path)
            for index in sorted(self.summary.chunk_indexes, key=lambda chunk: int(chunk.message_start_time)):
                if not index.message_index_offsets or topic.channels & index.message_index_offsets.keys():
                    waiting.take(_chunk(stream, index), self.summary, indexed(stream, index.message_index_offsets))
                if waiting.rows >= rows:
                    yield waiting.table(wanted, prefix)
                    waiting = _Messages(topic, self.path)
            if waiting.rows:
                yield waiting.table(wanted, prefix)

    def _prefix(self, topic: _Topic) -> str:
        return "" if len(self.topics) == 1 else f"{topic.name}."

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
        return [self._prefix(topic) + column for column in topic.columns]


@dataclass
class _Messages:
    """Messages of a topic as they come: their payloads, one line each, and their times in the log (ns)."""

    topic: _Topic
    path: str
    rows: int = 0
    lines: list[bytes] = field(default_factory=list)
    stamps: list[Ints] = field(default_factory=list)
    ends: list[Ints] = field(default_factory=list)
    records: list[tuple[Any, Any, Any]] = field(default_factory=list)

    def take(self, chunk: Any, summary: Any, begins: Ints) -> None:
        """The messages of a chunk, which begin there (see `indexed`); ValueError where it is damaged."""
        if not self.topic.paths:
            self._take_records(chunk, summary)
            return
        from mcap.stream_reader import get_chunk_data_stream

        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        wanted = np.zeros(CHANNELS, np.bool_)
        wanted[list(self.topic.channels)] = True
        lines, stamps, ends = split(np.frombuffer(stream.read(size), np.uint8), wanted, begins)
        if stamps.size:
            self.rows += stamps.size
            self.lines.append(lines)
            self.stamps.append(stamps)
            self.ends.append(ends)

    def _take_records(self, chunk: Any, summary: Any) -> None:
        from mcap.records import Message
        from mcap.stream_reader import breakup_chunk

        for record in breakup_chunk(chunk, validate_crc=True):
            if isinstance(record, Message) and record.channel_id in self.topic.channels:
                channel = summary.channels[record.channel_id]
                self.records.append((summary.schemas.get(channel.schema_id), channel, record))
                self.rows += 1

    def table(self, wanted: list[str], prefix: str) -> Table:
        """The wanted columns, in the order of the log's time."""
        columns = self._together(wanted) if self.topic.paths else None
        columns = columns if columns is not None else self._one_by_one(wanted)
        return Table({prefix + name: columns[name] for name in wanted})

    def _together(self, wanted: list[str]) -> dict[str, Array] | None:
        """Columns of all messages parsed at once; None where a message is not like the others."""
        import pyarrow as pa
        import pyarrow.json as pj

        stamps = np.concatenate(self.stamps)
        read = [name for name in wanted if name != self.topic.clock]
        columns: dict[str, Array] = {}
        if read:
            clocks = [name for name in ("t", "time") if name not in read]  # where a message has one, its time is that
            paths = {name: (name,) for name in clocks} | {name: self.topic.paths[name] for name in read}
            schema = _schema(paths)
            try:
                table = pj.read_json(
                    pa.BufferReader(b"".join(self.lines)),
                    read_options=pj.ReadOptions(use_threads=False),  # as `csv.BLOCK`
                    parse_options=pj.ParseOptions(explicit_schema=schema, unexpected_field_behavior="ignore"),
                )
            except pa.ArrowException:
                return None
            if table.num_rows != stamps.size:
                return None
            for name, place in paths.items():
                column = table.column(place[0])
                for key in place[1:]:
                    column = pa.chunked_array([chunk.field(key) for chunk in column.chunks])
                absent = name in clocks and name not in self.topic.paths
                if column.null_count != (stamps.size if absent else 0):
                    return None
                if not absent:
                    columns[name] = np.concatenate([np.from_dlpack(chunk) for chunk in column.chunks])
        if self.topic.clock in wanted:
            columns[self.topic.clock] = 1e-9 * stamps.astype(np.float64)
        if not (stamps[1:] >= stamps[:-1]).all():
            order = np.argsort(stamps, kind="stable")
            columns = {name: values[order] for name, values in columns.items()}
        return columns

    def _one_by_one(self, wanted: list[str]) -> dict[str, Array]:
        """Columns of messages as `mcap.read` has them."""
        decode = mcap.ros2_decoder()
        rows = [mcap.cells_of(*entry, decode, self.path) for entry in self._entries()]
        columns = columns_of([cells for cells in rows if cells])
        length = sum(1 for cells in rows if cells)
        return {name: np.asarray(columns.get(name, np.full(length, np.nan)), np.float64) for name in wanted}

    def _entries(self) -> list[tuple[Any, Any, Any]]:
        """Schema, channel and message of each in the order of the log's time."""
        if not self.topic.paths:
            return sorted(self.records, key=lambda entry: int(entry[2].log_time))
        plain = [
            (None, _JSON, _Line(lines[begin:end], stamp))
            for lines, stamps, ends in zip(self.lines, self.stamps, self.ends, strict=True)
            for stamp, begin, end in zip(stamps.tolist(), [0, *ends.tolist()], ends.tolist(), strict=False)
        ]
        return sorted(plain, key=lambda entry: entry[2].log_time)


@dataclass(frozen=True)
class _Line:
    """A message that is its data and its time in the log (ns)."""

    data: bytes
    log_time: int


@dataclass(frozen=True)
class _Encoding:
    message_encoding: str


_JSON = _Encoding("json")


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


def _chunk(stream: Any, index: Any) -> Any:
    """The chunk at a place of the file."""
    from mcap.stream_reader import StreamReader

    stream.seek(index.chunk_start_offset)
    return next(iter(StreamReader(stream, skip_magic=True, emit_chunks=True).records))


@contextmanager
def _damaged(path: str) -> Iterator[None]:
    """What a damaged file raises, in one sentence."""
    try:
        yield
    except (InputError, GeneratorExit):
        raise
    except Exception as error:
        message = f"{path} is not a whole MCAP file ({type(error).__name__}): damaged or cut off; record it again."
        raise InputError(message, code="not-a-table") from None
