"""Ctrl-C while a rig moves: once a soft stop, twice 0 V at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from swingid.live.codes import StopMode


@contextmanager
def stopping(stop: Callable[[StopMode, str], None]) -> Iterator[None]:
    """Ctrl-C once is a soft stop, twice a hard one; a third time ends the program. Restores what was before."""
    pressed = 0

    def handle(_number: int, _frame: object) -> None:
        nonlocal pressed
        pressed += 1
        if pressed > 2:
            raise KeyboardInterrupt
        stop(*((StopMode.SOFT, "stopped by Ctrl-C") if pressed == 1 else (StopMode.HARD, "stopped by Ctrl-C twice")))

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
