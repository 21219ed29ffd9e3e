"""Ctrl-C while a rig moves: once a soft stop, twice 0 V at once; SIGTERM and SIGHUP too."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from swingid.live.codes import StopMode
from swingid.processes import END_SIGNALS


@contextmanager
def stopping(stop: Callable[[StopMode, str], None]) -> Iterator[None]:
    """Ctrl-C once is a soft stop, twice a hard one; more, as of a key that is held, do nothing, for a hard stop ends.

    The signals SIGTERM and SIGHUP (a closed terminal; not under nohup) count as Ctrl-C. Restores what was before.
    """
    pressed = 0

    def handle(number: int, _frame: object) -> None:
        nonlocal pressed
        pressed += 1
        name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        if pressed == 1:
            stop(StopMode.SOFT, f"stopped by {name}")
        elif pressed == 2:
            stop(StopMode.HARD, f"stopped by {name} twice" if name == "Ctrl-C" else f"stopped by {name}")

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    taken = [n for n in END_SIGNALS if n == signal.SIGINT or signal.getsignal(n) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in taken}
    try:
        yield
    finally:
        for number, was in before.items():
            signal.signal(number, was)
