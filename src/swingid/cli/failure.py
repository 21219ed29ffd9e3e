"""From an exception to one sentence on standard error and an exit code; no traceback reaches a user."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import typer

from swingid.cli.output import flush, say, tell
from swingid.errors import SwingidError
from swingid.system import WRITTEN, keep_traceback

INTERRUPTED, CLOSED_PIPE, BUG = 130, 141, 70
"""128 + SIGINT, 128 + SIGPIPE, and EX_SOFTWARE of sysexits.h."""

EXPLAINED = "docs/errors.md"
"""The page with every code, written by tools/list_errors.py."""

_WrongUsage: type[Exception] = typer.BadParameter.__mro__[2]
"""click's ClickException, which newer versions of typer hold inside and older ones import."""


def exit_code(error: Exception, arguments: Sequence[str]) -> int:
    """Print in one sentence what went wrong; returns the exit code that stands for it."""
    decided()
    if isinstance(error, SwingidError):
        say(error.message)
        if sys.stderr is not None and sys.stderr.isatty():  # scripts get the one sentence alone
            tell(f"         {EXPLAINED}#{error.code}", to_error=True)
        return error.exit_code
    if isinstance(error, _WrongUsage):
        say(_usage(error))
        return 2
    if isinstance(error, typer.Abort):
        if not isinstance(error.__cause__, EOFError):
            return interrupted()
        error = error.__cause__  # typer takes the end of any file for that of the terminal
    if isinstance(error, BrokenPipeError):
        return CLOSED_PIPE
    if isinstance(error, OSError) and (broken := _broken_output()) is not None:
        say(broken.message)
        return broken.exit_code
    if _Presses.lost:  # what the callback was called from misses its answer
        return interrupted()
    path = keep_traceback(error, arguments)
    what = f"{type(error).__name__}" + (f" ({error})" if str(error) else "")
    where = f"please report it with the file {path}" if path else "please report it with the command you gave"
    say(f"this is a bug of swingid, {what}; {where}")
    return BUG


QUIET = 0.2
"""Seconds after a Ctrl-C in which another one does nothing: a key that is held sends thirty in a second."""


class _Presses:
    """What has come of Ctrl-C in this command."""

    raised = -1e9
    decided = False
    lost = False


def _pressed(_number: int, _frame: object) -> None:
    """KeyboardInterrupt at Ctrl-C, once: what it ends must not be interrupted while it says so."""
    now = time.monotonic()
    if _Presses.decided or now - _Presses.raised < QUIET:
        return
    _Presses.raised = now
    raise KeyboardInterrupt


@contextmanager
def attending(*, last: bool) -> Iterator[None]:
    """Within the block Ctrl-C is `_pressed`; after it as before, or ignored where the process ends then (last)."""
    _Presses.raised, _Presses.decided, _Presses.lost = -1e9, False, False
    before = signal.getsignal(signal.SIGINT)
    ours = threading.current_thread() is threading.main_thread() and before is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, _pressed)
    try:
        yield
    finally:
        if ours and last:
            decided()
        elif ours:
            signal.signal(signal.SIGINT, before)


def interruption_lost() -> None:
    """Ctrl-C came in a callback, as of the compiler, whose caller may fail before it is sent again."""
    _Presses.lost = True


def decided() -> None:
    """The command's end is known: Ctrl-C changes nothing any more."""
    _Presses.decided = True
    exec("")  # else CPython ends by the signal, without the exit code, where Ctrl-C came within an `exec`
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is _pressed:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


_kept: list[Callable[[], str]] = []


@contextmanager
def keeps(what: Callable[[], str]) -> Iterator[None]:
    """What a command that is interrupted within the block says about what is kept."""
    _kept.append(what)
    try:
        yield
    except KeyboardInterrupt:
        raise  # `interrupted` says it
    except BaseException:
        if not _Presses.lost:
            _kept.clear()
        raise
    else:
        _kept.clear()


def interrupted() -> int:
    """Print that the user stopped the run, and what is kept of it; returns the exit code."""
    decided()
    say(f"interrupted; {_what_is_kept()}")
    return INTERRUPTED


def _what_is_kept() -> str:
    """What is kept of the command's work, and how to go on."""
    if _kept:
        with suppress(Exception):
            return _kept.pop()()
    files = list(dict.fromkeys(str(path) for path in WRITTEN if path.exists()))
    if files:
        return f"{', '.join(files)} {'is' if len(files) == 1 else 'are'} whole, nothing else was written; start again"
    return "nothing was written, so start again"


def _broken_output() -> SwingidError | None:
    """What standard output, when what was written to it still waits, refuses to take; None if it takes all."""
    try:
        flush(sys.stdout)
    except BrokenPipeError:
        return None
    except SwingidError as error:
        return error
    return None


def settle_output() -> None:
    """Give up standard output where it takes nothing any more; the interpreter would complain at its end."""
    try:
        flush(sys.stdout)
    except (OSError, SwingidError):
        with suppress(OSError, ValueError, AttributeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _usage(error: Exception) -> str:
    """One sentence out of typer's, with the way to the help."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "swingid"
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    sentence = " ".join(message.split()).rstrip(".").replace("Value error, ", "").replace("Input should be", "must be")
    sentence = sentence.partition(", unable to parse")[0]  # pydantic's words, which newer versions of typer pass on
    link = " See" if sentence.endswith("?") else "; see"
    return f"{sentence[:1].lower()}{sentence[1:]}{link} {command} --help"
