"""What a command says and writes: people read standard error and output, scripts read JSON and files."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from swingid.errors import InputError, UsageError


def say(message: str) -> None:
    """One line on standard error, for people."""
    sentence = " ".join(str(message).split())
    end = "" if sentence.endswith((".", "!", "?", "…")) else "."
    tell(f"swingid: {sentence}{end}", to_error=True)


def tell(text: str, *, to_error: bool = False) -> None:
    """Text on standard output, or on standard error where the output belongs to JSON.

    Raises InputError where standard output takes nothing; a broken standard error is passed over.
    """
    line = text.rstrip("\n") + "\n"
    if to_error:
        with suppress(OSError, InputError):  # a broken standard error is no reason to fail
            _write(sys.stderr, line)
    else:
        _write(sys.stdout, line)


def write_json(text: str, target: str) -> None:
    """Write JSON text (UTF-8) to a file, or to standard output where `target` is "-"; InputError where that fails."""
    content = text.encode("utf-8", "backslashreplace")
    if target != "-":
        write_file(Path(target), content)
        return
    if sys.stdout is None:
        raise InputError("cannot write to standard output: it is closed", code="cannot-write")
    flush(sys.stdout)
    try:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"cannot write to standard output: {error.strerror}", code="cannot-write") from None


def write_file(path: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all (devices and pipes are written as they are).

    Raises InputError that names the file and the reason.
    """
    path = Path(os.path.realpath(path))
    partial = path.with_name(f".{path.name[:100]}.{os.getpid()}.part")
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(content)
            return
        try:
            partial.write_bytes(content)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise cannot_write(path, error.strerror or str(error)) from None


def check_target(path: Path) -> None:
    """Raise InputError now where writing `path` would fail after the work is done."""
    folder = path.parent
    try:
        if path.is_dir():
            raise cannot_write(path, "it is a folder, so give a file name in it")
        if not folder.exists():
            raise cannot_write(path, f"the folder {folder} does not exist, so make it first")
        if not folder.is_dir():
            raise cannot_write(path, f"{folder} is not a folder")
        if not os.access(path if path.exists() else folder, os.W_OK):
            raise cannot_write(path, "permission denied")
    except (OSError, ValueError) as error:  # a name too long, or with a null character
        raise cannot_write(path, getattr(error, "strerror", None) or str(error)) from None


def check_writable(*targets: str | None) -> None:
    """Raise InputError now where writing one of the files would fail; None and "-" (standard output) are no files."""
    for target in targets:
        if target is not None and target != "-":
            check_target(Path(target))


def check_targets(targets: Mapping[str, str | None], inputs: Mapping[str, str]) -> None:
    """Raise UsageError where what an option writes would overwrite an input or what another option writes.

    targets: file by option, "-" only for --json; inputs: what each input file is in words, by its path.
    """
    used = {os.path.realpath(path): words for path, words in inputs.items()}
    for option, target in targets.items():
        if target is None or (target == "-" and option == "--json"):
            continue
        if target == "-":
            raise UsageError(
                f"{option} needs the name of a file; only --json can go to standard output", code="bad-target"
            )
        path = os.path.realpath(target)
        if path in used:
            raise UsageError(f"{option} {target} would overwrite {used[path]}; give another name", code="overwrite")
        used[path] = f"what {option} writes"


def check_once(logs: Sequence[str]) -> None:
    """Raise UsageError where the same file is given twice."""
    if len({os.path.realpath(log) for log in logs}) < len(logs):
        raise UsageError("a log was given twice; give each once", code="same-log")


def flush(stream: TextIO | None) -> None:
    """Write out what a stream buffers; InputError where the disk is full or the like."""
    _write(stream, "")


def _write(stream: TextIO | None, text: str) -> None:
    if stream is None:
        return
    try:
        stream.write(text)
        stream.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"cannot write to standard output: {error.strerror}", code="cannot-write") from None


def cannot_write(path: Path, reason: str) -> InputError:
    """The error that names the file which cannot be written and why."""
    return InputError(f"cannot write {path}: {reason}", code="cannot-write")
