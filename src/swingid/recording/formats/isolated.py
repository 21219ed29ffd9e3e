"""Packages that only the rarer formats need, imported where installed; the fragile ones in a process of their own.

Damaged files can crash or hang the readers of other packages. That process outlives the file: it reads requests, one
JSON line each, from its standard input, and answers with one; arrays go through a file. It is started by the first such
file and ends with this process, or where a file takes too long.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import threading
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.processes import limit_process

if TYPE_CHECKING:
    from swingid.recording.formats.table import Columns


def require(module: str, package: str, name: str, what: str, *, extra: str = "formats") -> Any:
    """The module, imported; InputError that names the file, what it is, and how to install what reads it (`extra`)."""
    try:
        return import_module(module)
    except ImportError:
        message = f"{name} is {what}, which needs the package {package}; run: pip install 'swingid[{extra}]'."
        raise InputError(message, code="missing-package") from None


STARTING, LONGEST, SPEED = 60.0, 8.0, 5e6
"""Seconds that importing a package may take; that a file may take, and bytes a second that it may take beyond."""

MEMORY, TIMES = 4 << 30, 40
"""Address space of the process: bytes for its packages, and multiples of the file."""

_lock = threading.Lock()
_worker: list[subprocess.Popen[bytes]] = []


class UnreadableError(Exception):
    """Why the process could not read a file, in some words."""


def read_apart(package: str, reader: str, content: bytes) -> tuple[Columns, str]:
    """What the function `reader` ("module:name") makes of a file: columns, and the JSON text of swingid's metadata.

    The function takes a path and uses `package`. Raises UnreadableError where it fails, crashes, or takes too long.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        path.write_bytes(content)
        return read_part_apart(package, reader, path, len(content))


def read_part_apart(package: str, reader: str, path: Path, size: int, **options: object) -> tuple[Columns, str]:
    """Read as `read_apart` a file with options of the function, that takes and gives some `size` bytes."""
    with tempfile.TemporaryDirectory() as folder, _lock:
        target = Path(folder) / "columns.npy"
        answer = _ask({"package": package}, STARTING)
        if "error" not in answer:
            request = {"reader": reader, "path": str(path), "target": str(target), "size": size, "options": options}
            answer = _ask(request, LONGEST + size / SPEED)
        if "error" in answer:
            raise UnreadableError(str(answer["error"]))
        with target.open("rb") as saved:
            names = np.load(saved)
            return {str(name): np.load(saved) for name in names}, str(answer["metadata"])


def _ask(request: dict[str, object], longest: float) -> dict[str, Any]:
    worker = _running()
    stdin, stdout = worker.stdin, worker.stdout
    assert stdin is not None
    assert stdout is not None
    lines: list[bytes] = []
    reading = threading.Thread(target=lambda: lines.append(stdout.readline()), daemon=True)
    try:
        stdin.write(json.dumps(request).encode() + b"\n")
        stdin.flush()
        reading.start()
        reading.join(longest)
        if not lines:
            _stop()
            return {"error": f"it takes more than {longest:.0f} s"}
        answer: dict[str, Any] = json.loads(lines[0])
    except (OSError, ValueError):
        _stop()
        return {"error": "its reader crashed"}
    return answer


def _running() -> subprocess.Popen[bytes]:
    if _worker and _worker[0].poll() is None:
        return _worker[0]
    _stop()
    command = [sys.executable, "-W", "ignore", "-m", __name__]
    try:
        _worker.append(
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        )
    except OSError as error:
        raise InputError(f"cannot start a process of {sys.executable}: {error.strerror}.", code="no-process") from None
    return _worker[0]


@atexit.register
def _stop() -> None:
    while _worker:
        worker = _worker.pop()
        worker.kill()
        worker.wait()
        for stream in (worker.stdin, worker.stdout):
            with contextlib.suppress(OSError):
                if stream is not None:
                    stream.close()


def is_installed(module: str) -> bool:
    """Return whether a package can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None


def serve() -> None:
    """Answer requests until there are no more; runs in the process of its own."""
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what a package prints is no answer
    for line in sys.stdin.buffer:
        answers.write(json.dumps(_answer(json.loads(line))).encode() + b"\n")


def _answer(request: dict[str, Any]) -> dict[str, str]:
    if "package" in request:
        try:
            import_module(request["package"])
        except Exception as error:
            return {"error": type(error).__name__}
        return {}
    size = int(request["size"])
    # of time too, for nobody may be there any more to end a reader that hangs
    limit_process(MEMORY + TIMES * size, 2 * (LONGEST + size / SPEED))
    module, _, name = str(request["reader"]).partition(":")
    try:
        columns, metadata = getattr(import_module(module), name)(request["path"], **request.get("options", {}))
        with Path(request["target"]).open("wb") as target:  # one after the other: an archive has checksums of all bytes
            for values in (np.array(list(columns), dtype=str), *columns.values()):
                np.save(target, values, allow_pickle=False)
    except Exception as error:  # a damaged file may fail anywhere in the other package
        return {"error": type(error).__name__}
    return {"metadata": metadata}


if __name__ == "__main__":
    serve()
