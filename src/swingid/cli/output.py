"""What a command prints and writes: people read standard error and output, scripts read JSON and files."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TextIO

from swingid.errors import InputError, SwingidError, UsageError
from swingid.system import write_whole

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.report.certificate import Certificate
    from swingid.result.result import Result

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""Characters that a terminal obeys, but for the end of a line and the tabulator."""


def say(message: str) -> None:
    """One line on standard error, for people."""
    sentence = " ".join(str(message).split())
    end = "" if sentence.endswith((".", "!", "?", "…")) else "."
    tell(f"swingid: {sentence}{end}", to_error=True)


def tell(text: str, *, to_error: bool = False) -> None:
    """Text on standard output, or on standard error where the output belongs to JSON.

    A control character that a file has, as in the name of a column, is shown, for a terminal would obey it. Raises
    InputError where standard output takes nothing; a broken standard error is passed over.
    """
    line = CONTROL.sub(lambda match: repr(match[0])[1:-1], text.rstrip("\n")) + "\n"
    _close_progress()
    if to_error:
        with suppress(OSError, InputError):  # a broken standard error is no reason to fail
            _write(sys.stderr, line)
    else:
        _write(sys.stdout, line)


def write_json(text: str, target: str) -> None:
    """Write JSON text (UTF-8) to a file, or to standard output where `target` is "-"; InputError where that fails."""
    content = text.encode("utf-8", "backslashreplace")
    if target != "-":
        write_whole(Path(target), content)
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

    Raises InputError for a --report as PDF without the extra `pdf`.

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
        if option == "--report":
            _check_form(target)


def check_report(report: str | None, certificate: str | None) -> Certificate | None:
    """What the laboratory states for a report, read before any work; None without such a file.

    Raises InputError for a file that cannot be used, UsageError without a report.
    """
    if certificate is None:
        return None
    if report is None:
        raise UsageError("--certificate is for a report; give --report FILE as well", code="no-report")
    from swingid.report.certificate import load_certificate

    return load_certificate(certificate)


def _check_form(report: str) -> None:
    """Raise UsageError for a report that is neither HTML nor PDF, InputError for a PDF without the extra `pdf`."""
    from swingid.report.page import is_pdf

    if Path(report).suffix.lower() not in ("", ".html", ".htm", ".pdf"):
        raise UsageError(
            f"--report {report}: a report is an HTML or a PDF file; let its name end in .html or .pdf",
            code="bad-target",
        )
    if is_pdf(report):
        from swingid.report.pdf import require_typst

        require_typst()


def check_files(inputs: Mapping[str, str], **targets: str | None) -> None:
    """`check_targets` and `check_writable` for what options write: `json` is the file of --json."""
    check_targets({f"--{option}": target for option, target in targets.items()}, inputs)
    check_writable(*targets.values())


def on_terminal() -> bool:
    """Return whether standard error is a terminal that can go back to the begin of a line."""
    return sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


_open = [False]
"""Whether the line of progress waits to be overwritten."""


def _close_progress() -> None:
    """End the line of progress, so that what follows does not stand behind it."""
    waits, _open[0] = _open[0], False
    if waits and on_terminal():
        with suppress(OSError, AttributeError):
            sys.stderr.write("\n")
            sys.stderr.flush()


def overwrite(line: str, *, last: bool) -> bool:
    """Show progress on a terminal in a line that overwrites itself; False where standard error is none."""
    if not on_terminal():
        return False
    width = shutil.get_terminal_size().columns - 1
    with suppress(OSError):
        sys.stderr.write(f"\r{line[:width]:<{width}}" + ("\n" if last else ""))
        sys.stderr.flush()
    _open[0] = not last
    return True


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


def make_folder(folder: Path) -> None:
    """Make a folder where there is none; InputError where that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(folder, error.strerror or str(error)) from None


def cannot_write(path: Path, reason: str) -> InputError:
    """The error that names the file which cannot be written and why."""
    return InputError(f"cannot write {path}: {reason}", code="cannot-write")


class Answer(Protocol):
    """What a command has found: JSON for scripts, a summary for people."""

    def to_json(self) -> str:
        """JSON text."""
        ...

    def summary(self) -> str:
        """Text for people."""
        ...


def hand_over(answer: Answer, json: str | None, *written: str | None, text: str | None = None) -> None:
    """Write the JSON to its file, show the text or else the summary, name the files written before, None left out."""
    if json is not None:
        write_json(answer.to_json(), json)
    tell(answer.summary() if text is None else text, to_error=json == "-")
    for target in written:
        if target is not None:
            say(f"wrote {target}")


@contextmanager
def refusals_to(
    json: str | None,
    method: str,
    provenance: dict[str, object],
    report: str | None = None,
    certificate: Certificate | None = None,
) -> Iterator[None]:
    """Write JSON and report with the reason why there is no number where the block raises; its error goes on.

    A second error while doing so gives way to the first.
    """
    try:
        yield
    except Exception as error:
        import swingid
        from swingid.result.result import refusal

        known = error
        if not isinstance(known, SwingidError):
            known = SwingidError(f"a bug of swingid: {type(error).__name__}", code="bug")
        refused = refusal(method, known, provenance | {"versions": {"swingid": swingid.__version__}})
        if json is not None:
            with suppress(SwingidError):
                write_json(refused.to_json(), json)
        with suppress(SwingidError):
            write_report(refused, None, None, report, certificate)
        raise


def write_report(
    result: Result, log: Recording | None, rig: Rig | None, report: str | None, certificate: Certificate | None = None
) -> None:
    """Write the report of a result where one is wanted."""
    if report is not None:
        from swingid.report import write_report as write

        write(result, log, rig, report, certificate)


def time_left(seconds: float) -> str:
    """A duration in its largest fitting unit."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
