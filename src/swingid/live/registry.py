"""The runs of this user on this machine, so that `swingid stop` finds and stops them: a small folder of files.

Each run has an entry (JSON) and a lock that its process holds, so an entry without a lock is that of a dead process. A
request is a file beside the entry, which the run looks for now and then; the run's last words are another one. Where
the folder cannot be made a run goes on unannounced.
"""

from __future__ import annotations

import json
import os
import secrets
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from swingid.live.codes import StopMode
from swingid.system import locked, user

LOOK = 0.05
"""Seconds between two looks for a request: one of a file system costs microseconds, a turn of the link is 5 ms."""

OLD = 3600.0
"""Seconds after which a file without an entry is swept: no process is that long between making two files."""

ENTRY, LOCK, REQUEST, WORDS = ".json", ".lock", ".stop", ".end"


@dataclass(frozen=True)
class Entry:
    """A run: its process, device and journal ("" for a commissioning), when it began (s since 1970), planned duration
    and fade (s).
    """

    pid: int
    device: str
    journal: str
    began: float
    duration: float
    fade: float

    def words(self) -> str:
        """Which run this is, for people."""
        what = f"the run on {self.device} ({self.journal}" if self.journal else f"the commissioning of {self.device} ("
        return f"{what}{', ' if self.journal else ''}process {self.pid})"


def folder() -> Path:
    """The folder of this user's runs, made where it is missing; OSError where it cannot be used."""
    runtime = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/run/user/{user()}")  # a service may lack the variable
    place = runtime / "swingid" if runtime.is_dir() else Path(tempfile.gettempdir()) / f"swingid-{user()}"
    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    status = place.lstat()
    if hasattr(os, "getuid"):
        alone = status.st_uid == os.getuid() and not status.st_mode & 0o077 and not place.is_symlink()
        if not alone:
            raise PermissionError(f"{place} is not this user's alone")
    return place


class Announced:
    """A run's side of its entry. ended: its last words, which who asked for a stop gets."""

    def __init__(self, place: Path | None) -> None:
        self._place, self._looked = place, 0.0
        self._asked: tuple[StopMode, str] | None = None
        self.ended = ""

    def asked(self) -> tuple[StopMode, str] | None:
        """The stop that `swingid stop` has asked for."""
        now = time.monotonic()
        if self._place is not None and now - self._looked >= LOOK:
            self._looked = now
            with suppress(OSError):
                hard = self._place.with_suffix(REQUEST).read_text(encoding="utf-8") == "hard"
                words = "stopped by swingid stop" + (" --hard" if hard else "")
                self._asked = (StopMode.HARD if hard else StopMode.SOFT), words
        return self._asked


@contextmanager
def announced(device: str, journal: str | Path, *, duration: float, fade: float) -> Iterator[Announced]:
    """A run that `swingid stop` finds while the block lasts."""
    entry = Entry(os.getpid(), device, os.path.abspath(journal) if journal else "", time.time(), duration, fade)
    with ExitStack() as stack:
        place: Path | None = None
        with suppress(OSError):
            runs()  # sweeps
            path = folder() / f"run-{os.getpid()}-{secrets.token_hex(4)}{ENTRY}"
            stack.callback(_remove, path, LOCK)  # after its lock has been given up
            stack.enter_context(locked(path.with_suffix(LOCK), wait=False))
            place = path
            _write(path, json.dumps(asdict(entry)))
        run = Announced(place)
        try:
            yield run
        finally:
            if place is not None:
                if place.with_suffix(REQUEST).exists():
                    with suppress(OSError):
                        _write(place.with_suffix(WORDS), run.ended)
                _remove(place, ENTRY, REQUEST)


@dataclass(frozen=True)
class Found:
    """A run that goes on, as `swingid stop` sees it."""

    entry: Entry
    _place: Path

    def ask(self, *, hard: bool) -> None:
        """Ask for a stop; OSError where that cannot be written."""
        _write(self._place.with_suffix(REQUEST), "hard" if hard else "soft")

    def is_on(self, device: str) -> bool:
        """Return whether it is on the device of an address; a bare port is a serial one."""
        known = self.entry.device
        return device in (known, known.partition("?")[0], known.partition("?")[0].removeprefix("serial://"))

    @property
    def alive(self) -> bool:
        """Return whether its process still announces it."""
        return self._place.exists() and not _free(self._place)

    def last_words(self) -> str:
        """How it ended, "" where it has not said so; once."""
        place = self._place.with_suffix(WORDS)
        try:
            words = place.read_text(encoding="utf-8")
        except OSError:
            words = ""
        _remove(self._place, WORDS, REQUEST)
        return words


def runs() -> list[Found]:
    """The runs of this user that go on; what dead ones have left is removed. OSError without a folder."""
    place, active = folder(), []
    for path in sorted(place.glob(f"run-*{ENTRY}")):
        if _free(path):
            _remove(path, ENTRY, REQUEST, WORDS, LOCK)
            continue
        with suppress(OSError, ValueError, TypeError):  # one that ends just now
            active.append(Found(Entry(**json.loads(path.read_text(encoding="utf-8"))), path))
    for path in place.glob("run-*"):
        with suppress(OSError):
            if not path.with_suffix(ENTRY).exists() and time.time() - path.stat().st_mtime > OLD:
                path.unlink()
    return active


def _free(path: Path) -> bool:
    """Return whether nobody holds the lock of an entry."""
    lock = path.with_suffix(LOCK)
    try:
        if lock.exists():
            with locked(lock, wait=False):
                pass
    except OSError:
        return False
    return True


def _write(path: Path, text: str) -> None:
    """A file that appears whole."""
    new = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


def _remove(path: Path, *suffixes: str) -> None:
    for suffix in suffixes:
        with suppress(OSError):
            path.with_suffix(suffix).unlink()
