"""The swingid command: `main`, one file per command, and what keeps tracebacks away from users."""

from __future__ import annotations

import os
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (default: the process's); returns the exit code, raises nothing.

    0 fine, 2 wrong usage, 3 unusable input, 4 the data cannot answer, 70 our own bug, 130 interrupted,
    141 the reader of standard output went away.
    """
    # the matrices here are small: more threads of linear algebra wait for each other, on a busy machine for long
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from swingid.cli.app import run

        return run(arguments)
    except KeyboardInterrupt:
        from swingid.cli.failure import interrupted

        return interrupted()
