"""What the libraries of the page log, as one line each: a terminal gets no traceback, and not line after line."""

from __future__ import annotations

import logging
import sys

LOGGERS = "asyncio", "engineio.server", "nicegui", "socketio.server", "uvicorn", "uvicorn.error"

MOST = 10
"""Lines; a page that goes on and on with something wrong must not fill a pipe, whose writer then waits for ever."""


class OneLine(logging.Handler):
    """A record as one line on standard error; after `MOST` of them nothing."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.left = MOST

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record."""
        error = record.exc_info[1] if record.exc_info else None
        if self.left <= 0 or record.getMessage().startswith(IN_VAIN):
            return
        self.left -= 1
        lines = (str(error) if error is not None else record.getMessage()).splitlines()
        text = lines[0][:200] if lines else ""
        if error is not None:
            text = f"this is a bug of the page, {type(error).__name__} ({text}); please report it"
        try:
            sys.stderr.write(f"swingid: {text}\n")
            sys.stderr.flush()
        except (OSError, ValueError, AttributeError):
            self.left = 0


IN_VAIN = "Cancel "
"""How uvicorn says at its end that a browser has not closed its connection."""


def log_in_lines() -> None:
    """Take over what `LOGGERS` write."""
    handler = OneLine()
    for name in LOGGERS:
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
