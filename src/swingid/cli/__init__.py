"""The swingid command: `main`, one file per command, and what keeps tracebacks away from users."""

from __future__ import annotations

import os
import signal
import sys
from _thread import interrupt_main
from collections.abc import Sequence
from threading import Timer

AGAIN = 0.25
"""Seconds after which Ctrl-C is sent again, later than `failure.QUIET`."""


_waiting: list[Timer] = []
"""What will send Ctrl-C again."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (default: the process's); returns the exit code, raises nothing.

    0 fine, 2 wrong usage, 3 unusable input, 4 the data cannot answer, 70 our own bug, 130 interrupted,
    141 the reader of standard output went away.
    """
    # the matrices here are small: more threads of linear algebra wait for each other, on a busy machine for long
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    before, sys.unraisablehook = sys.unraisablehook, _let_through
    try:
        from swingid.cli.app import run

        return run(arguments)
    except KeyboardInterrupt:
        from swingid.cli.failure import interrupted

        return interrupted()
    finally:
        sys.unraisablehook = before
        while _waiting:
            _waiting.pop().cancel()
        if arguments is None:  # while Python ends nothing is left to be said
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _let_through(lost: sys.UnraisableHookArgs) -> None:
    """Send Ctrl-C again that came where no error can be raised, as in a callback; other errors as Python does."""
    if lost.exc_type is not None and issubclass(lost.exc_type, KeyboardInterrupt):
        from swingid.cli.failure import interruption_lost

        interruption_lost()
        again = Timer(AGAIN, interrupt_main)  # not here, where it would be lost again
        again.daemon = True
        again.start()
        _waiting.append(again)
    else:
        sys.__unraisablehook__(lost)
