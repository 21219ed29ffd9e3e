"""The journal of a run: an MCAP file that holds every byte of the link, and the run as a log that `identify` reads.

Channels: ``/raw/device`` and ``/raw/host`` (the bytes as they came, in the schema of the DBC file inside), ``/sample``
(one JSON object per sample of the run: t, q1, q2, u, k, ym in SI units, host: its arrival in s by the computer's
clock, flags where its readings are not to be used) and ``/event`` (states, faults, the end).
Attachments: rig.toml, swingid.dbc, reference.f32, parameters.f64. Everything so far is flushed every 0.25 s and
synchronised with the disk every second, so a process that is killed loses less than half a second; a file that was
cut off is read up to the cut. Where no sample of a run came the file is removed: it would be no measurement.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol

from swingid.errors import InputError
from swingid.live.codes import FaultCode, State
from swingid.live.frames import Decoder, Frame
from swingid.live.rows import Row, Rows
from swingid.live.schema import database_text, missing_extra, schema
from swingid.recording.formats.mcap import RUN
from swingid.recording.formats.table import METADATA_KEY
from swingid.recording.live import ARRIVAL

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

FLUSH, SYNC = 0.25, 1.0
"""Seconds between two flushes, and between two synchronisations with the disk."""

_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
SAMPLE = {"type": "object", "properties": dict.fromkeys((*Row._fields, ARRIVAL), _NUMBER)}
EVENT = {"type": "object", "properties": {"event": _TEXT, "text": _TEXT}}


@dataclass(frozen=True)
class Plan:
    """What a run will do: parameters of the device, samples of the reference (rad), and words for people."""

    parameters: Array
    reference: Array
    words: str = ""


class Recorder(Protocol):
    """What keeps a run: `Journal`, or the way to one in another process. error: why it has stopped, in words."""

    error: str

    def take(self, came: bool, now: float, data: bytes) -> None:
        """Bytes of the link."""

    def plan(self, plan: Plan, **facts: object) -> None:
        """What is about to be run."""

    def event(self, event: str, text: str, now: float | None = None) -> None:
        """Something that a reader of the journal wants to know."""

    def close(self) -> None:
        """The end of the file."""


def require_new(path: str | Path) -> None:
    """Raise InputError where a file with content stands there: a run does not overwrite a measurement."""
    file = Path(path)
    if file.is_file() and file.stat().st_size:
        text = f"{path} exists, and a run does not overwrite a measurement; give another --out, or remove it"
        raise InputError(text, code="file-exists")


def new_file(path: Path, mode: str = "wb", encoding: str | None = None, newline: str | None = None) -> IO[Any]:
    """A file that is opened to be written; InputError where it can't be made."""
    try:
        return path.open(mode, encoding=encoding, newline=newline)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot write {path}: {reason}; give another --out", code="cannot-write") from None


class Journal:
    """Writes one journal. Feed it every byte (`take`, a `link.Tap`); a full disk stops the journal, never the run.

    rig: its text goes inside. began: time of its first byte, ns since 1970, 0 in virtual time. sync: whether to
    synchronise with the disk. error: why writing has stopped, in words. Raises InputError where the file can't be
    made, UsageError without the package mcap.
    """

    def __init__(self, path: str | Path, rig: Rig, *, began: int = 0, sync: bool = True) -> None:
        try:
            from mcap.writer import Writer
        except ImportError:
            raise missing_extra("mcap") from None
        self.path, self.error = Path(path), ""
        self._file: IO[bytes] = new_file(self.path)
        self._began, self._sync = began, sync
        self._writer: Any = Writer(self._file)
        self._decoder = Decoder()
        self._rows: Rows | None = None
        self._first: float | None = None
        self._now = self._flushed = self._synced = 0.0
        self._state: State | None = None
        self._start: int | None = None
        self._guarded(lambda: self._open(rig))

    def _open(self, rig: Rig) -> None:
        writer = self._writer
        writer.start(library="swingid")
        metadata = {"live": 1, "drive": rig.drive.kind, "log": {"drive_held": True}, "metadata": {"live": True}}
        writer.add_metadata(METADATA_KEY, {"json": json.dumps(metadata)})
        writer.add_attachment(0, 0, "rig.toml", "application/toml", rig.text.encode())
        writer.add_attachment(0, 0, "swingid.dbc", "text/plain", database_text().encode())
        frames = writer.register_schema("swingid.frames", "dbc", database_text().encode())
        self._raw = [writer.register_channel(f"/raw/{who}", "swingid", frames) for who in ("host", "device")]
        sample = writer.register_schema("swingid.sample", "jsonschema", json.dumps(SAMPLE).encode())
        self._sample = writer.register_channel("/sample", "json", sample)
        event = writer.register_schema("swingid.event", "jsonschema", json.dumps(EVENT).encode())
        self._event = writer.register_channel("/event", "json", event)
        writer.flush()

    def _guarded(self, do: Any) -> None:
        """Do it, unless writing has failed before; where it fails now, say why and stop writing."""
        if self.error:
            return
        try:
            do()
        except (OSError, ValueError) as error:
            self.error = getattr(error, "strerror", None) or str(error)
            # a buffer that the disk does not take would fail again at every call, at exit too
            with suppress(OSError, ValueError):
                self._file.close()

    def plan(self, plan: Plan, **facts: object) -> None:
        """What is about to be run, and facts such as the firmware's hash; rows of the log follow from here on."""
        parameters, reference = plan.parameters.astype("<f8"), plan.reference.astype("<f4")
        self._rows = Rows([float(x) for x in parameters], [float(x) for x in reference])

        def write() -> None:
            self._writer.add_attachment(0, 0, "parameters.f64", "application/octet-stream", parameters.tobytes())
            self._writer.add_attachment(0, 0, "reference.f32", "application/octet-stream", reference.tobytes())
            known = {"reference": plan.words, "schema": f"{schema().hash:08x}", **facts}
            self._writer.add_metadata(RUN, {name: str(value) for name, value in known.items()})

        self._guarded(write)

    def take(self, came: bool, now: float, data: bytes) -> None:
        """Bytes of the link at its time `now` (s)."""
        self._guarded(lambda: self._take(came, now, data))
        self.tick(now)

    def _take(self, came: bool, now: float, data: bytes) -> None:
        stamp = self._stamp(now)
        arrival = round(1e-9 * (stamp - self._began), 6)
        self._writer.add_message(self._raw[came], log_time=stamp, publish_time=stamp, data=data)
        if not came:
            return
        frames = self._decoder.feed(data)
        for frame in frames:
            self._note(frame, now)
        for row in self._rows.feed(frames) if self._rows is not None else ():
            cells = {name: value for name, value in row._asdict().items() if value is not None}
            text = json.dumps(cells | {ARRIVAL: arrival}, separators=(",", ":")).encode()
            if self._start is None:
                self._start = stamp - round(row.t * 1e9)
            stamp = self._start + round(row.t * 1e9)  # a reader draws over it, so it has the device's even steps
            self._writer.add_message(self._sample, log_time=stamp, publish_time=stamp, data=text)

    def _note(self, frame: Frame, now: float) -> None:
        """An event for a fault or a change of state."""
        if frame.name == "Fault":
            code = FaultCode(frame.code).name.lower() if frame.code in set(FaultCode) else str(frame.code)
            self.event("fault", f"{code}, value {frame.value:.6g}, at {frame.time} us of the device", now)
        elif frame.name == "Sample" and frame.state != self._state and frame.state in set(State):
            self._state = State(frame.state)
            self.event("state", f"{self._state.name.lower()} from sample {frame.sequence} on", now)

    def event(self, event: str, text: str, now: float | None = None) -> None:
        """Something that a reader of the journal wants to know."""
        stamp = self._stamp(self._now if now is None else now)
        data = json.dumps({"event": event, "text": text}).encode()
        self._guarded(lambda: self._writer.add_message(self._event, log_time=stamp, publish_time=stamp, data=data))

    def _stamp(self, now: float) -> int:
        if self._first is None:
            self._first = self._flushed = self._synced = now
        self._now = max(self._now, now)
        return self._began + round((now - self._first) * 1e9)

    def tick(self, now: float) -> None:
        """Flush and synchronise where it is time; to be called now and then where no bytes come."""
        if now - self._flushed >= FLUSH:
            self._flushed = now
            self._guarded(self._writer.flush)
            if self._sync and now - self._synced >= SYNC:
                self._synced = now
                self._guarded(lambda: os.fsync(self._file.fileno()))

    def close(self) -> None:
        """Write the end of the file; a second call does nothing."""
        if self._file.closed:
            return

        def finish() -> None:
            self._writer.finish()
            self._file.flush()
            if self._sync:
                os.fsync(self._file.fileno())

        self._guarded(finish)
        with suppress(OSError, ValueError):
            self._file.close()
        if self._start is None and self.path.is_file():
            with suppress(OSError):
                self.path.unlink()
