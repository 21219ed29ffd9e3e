"""MCAP, the container of robotics: topics of JSON messages and of ROS 2 `sensor_msgs/JointState`; by package mcap."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.isolated import require
from swingid.recording.formats.table import METADATA_KEY, Table, columns_of, flat

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Columns

ENDINGS = (".mcap",)
MAGIC = b"\x89MCAP0\r\n"

JOINT_STATE = "sensor_msgs/msg/JointState"
LONGEST = 9e9
"""Of a log, s: its instants in ns have 64 bits."""

KINDS = ("position", "velocity", "effort")


LIVE, RUN = "/sample", "swingid.run"
"""The topic of the log in the journal of a live run, whose metadata have the key "live"; the record about the run."""


def read(content: bytes, name: str) -> Table:
    """One column per field: ``topic.field`` of JSON messages, ``topic.joint.position`` (velocity, effort) of joints.

    The instants are those of the header's stamp where a message has one, else of the log: ``topic.time``. Where the
    file has one topic, its name is left out: ``time``, ``joint.position``. Of the journal of a live run only the log
    is read, and one that was cut off up to there, with a finding in the metadata. Raises InputError for a damaged file,
    one without such messages, and where mcap is missing.
    """
    require("mcap.reader", "mcap", name, "an MCAP file")
    topics: dict[str, list[dict[str, float]]] = {}
    with damaged(name):
        contents = _contents(content)
        decode = ros2_decoder()
        for schema, channel, message in contents.messages:
            if contents.metadata.get("live") and channel.topic != LIVE:
                continue
            cells = cells_of(schema, channel, message.data, message.log_time, decode, name)
            if cells:
                topics.setdefault(channel.topic.strip("/").replace("/", "."), []).append(cells)
    if not topics:
        message = f"{name} holds no messages in JSON and none of {JOINT_STATE}; export the log as CSV or Parquet."
        raise InputError(message, code="not-a-table")
    columns: Columns = {}
    for topic, rows in topics.items():
        prefix = "" if len(topics) == 1 else f"{topic}."
        columns |= {prefix + key: values for key, values in columns_of(rows).items()}
    return Table(columns, contents.metadata)


@contextmanager
def damaged(name: str) -> Iterator[None]:
    """What a damaged file raises, in one sentence."""
    try:
        yield
    except (InputError, GeneratorExit):
        raise
    except Exception as error:  # a damaged file may fail anywhere in the other package
        message = f"{name} is not a whole MCAP file ({type(error).__name__}): damaged or cut off; record it again."
        raise InputError(message, code="not-a-table") from None


@dataclass
class Contents:
    """The messages of a file with their schemas and channels, swingid's metadata."""

    messages: list[tuple[Any, Any, Any]] = field(default_factory=list)
    metadata: dict[str, object] = field(default_factory=dict)

    def note(self, record: Any) -> None:
        """Keep a metadata record of swingid; of a journal also what it states of its run."""
        if record.name == METADATA_KEY:
            known = json.loads(record.metadata.get("json", "{}"))
            self.metadata |= known if isinstance(known, dict) else {}
        elif record.name == RUN:
            self.metadata["run"] = dict(record.metadata)


def _contents(content: bytes) -> Contents:
    """What a file holds, each block compared with its checksum, messages by log time; of a journal up to a cut."""
    import struct

    from mcap.exceptions import EndOfFile
    from mcap.records import Channel, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader

    contents = Contents()
    schemas: dict[int, Any] = {0: None}
    channels: dict[int, Any] = {}
    try:
        for record in StreamReader(io.BytesIO(content), validate_crcs=True).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Metadata):
                contents.note(record)
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                contents.messages.append((schemas[channel.schema_id], channel, record))
    except (EndOfFile, struct.error):  # the second within the last bytes
        if not contents.metadata.get("live"):
            raise
        saved = contents.metadata.get("findings")
        cut = {"code": "cut-off", "message": CUT, "level": "warning"}
        contents.metadata["findings"] = [*(saved if isinstance(saved, list) else []), cut]
    contents.messages.sort(key=lambda entry: int(entry[2].log_time))
    return contents


CUT = (
    "the file was cut off while it was written; the log goes up to there, and what was measured after it is lost; "
    "swingid recover FILE writes a whole file of the rest."
)


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of an MCAP file with one topic of JSON messages, one per row; reads back bit for bit.

    The log time of a message is its column `t` or `time` in ns where there is one.
    """
    writer_of = require("mcap.writer", "mcap", "the output", "an MCAP file").Writer
    buffer = io.BytesIO()
    writer = writer_of(buffer)
    writer.start(library="swingid")
    schema = writer.register_schema("swingid.row", "jsonschema", b'{"type": "object"}')
    channel = writer.register_channel("/swingid", "json", schema)
    writer.add_metadata(METADATA_KEY, {"json": json.dumps(metadata)})
    names = list(columns)
    stamps = _stamps(columns, len(next(iter(columns.values()))))
    for stamp, row in zip(stamps, zip(*(columns[name].tolist() for name in names), strict=True), strict=True):
        cells = {name: value for name, value in zip(names, row, strict=True) if np.isfinite(value)}
        writer.add_message(channel, log_time=stamp, publish_time=stamp, data=json.dumps(cells).encode())
    writer.finish()
    return buffer.getvalue()


def _stamps(columns: Mapping[str, Array], rows: int) -> list[int]:
    """Log times in ns: the column `t` or `time` from its start where it rises, else the number of the row.

    Readers sort messages by them, so they must rise.
    """
    clock = next((columns[name] for name in ("t", "time") if name in columns), None)
    if clock is None or not (np.diff(clock) > 1e-9).all() or not clock[-1] - clock[0] < LONGEST:
        return list(range(rows))
    return [round(1e9 * since) for since in (clock - clock[0]).tolist()]


def ros2_decoder() -> Any:
    """What decodes messages of ROS 2; None without the package mcap-ros2-support."""
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        return None
    return DecoderFactory()


def cells_of(schema: Any, channel: Any, data: bytes, log_time: int, decode: Any, name: str) -> dict[str, float]:
    """The numbers of one message with its instant (ns) as "time" (unless it has a "t" or "time" of its own)."""
    cells: dict[str, float] = {}
    if channel.message_encoding == "json":
        row = json.loads(data)
        cells = flat(row) if isinstance(row, dict) else {}
        cells = {key: float(value) for key, value in cells.items() if isinstance(value, int | float)}
    elif channel.message_encoding == "cdr" and schema is not None and schema.name == JOINT_STATE:
        if decode is None:
            require("mcap_ros2.decoder", "mcap-ros2-support", name, "an MCAP file with ROS 2 messages")
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):  # the package prints what it cannot parse
            decoder = decode.decoder_for(channel.message_encoding, schema)
            state = decoder(data)
        stamp = state.header.stamp
        cells["time"] = stamp.sec + 1e-9 * stamp.nanosec
        for kind in KINDS:
            for joint, value in zip(state.name, getattr(state, kind), strict=False):
                cells[f"{joint}.{kind}"] = float(value)
    if cells and not {"t", "time"} & cells.keys():
        cells["time"] = 1e-9 * log_time
    return cells
