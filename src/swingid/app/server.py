"""The server of the page: where it listens, and how it ends."""

from __future__ import annotations

import errno
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from nicegui import app, core, ui

from swingid.app.faults import log_in_lines
from swingid.app.gate import Gate, Place
from swingid.errors import UsageError
from swingid.processes import END_SIGNALS

VENDOR = Path(__file__).with_name("vendor")

GOODBYE = 1
"""Seconds that open connections have for their end."""


def free_port(host: str, wanted: int) -> int:
    """The wanted port, or the next free one of twenty; UsageError where none is, or for a host that is elsewhere."""
    for port in range(wanted, min(wanted + 20, 65536)):
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                trial.bind((host, port))
            except OSError as error:
                last = error
                if error.errno == errno.EADDRNOTAVAIL or isinstance(error, socket.gaierror):
                    raise UsageError(
                        f"--host {host} is no address of this machine ({error.strerror}); "
                        "give one of its own, or 0.0.0.0 for all",
                        code="bad-address",
                    ) from None
            else:
                return port
    text = f"no port from {wanted} to {wanted + 19} of {host} is free ({last.strerror}); give another --port"
    raise UsageError(text, code="port-busy")


def serve(
    build: Callable[[], None],
    place: Place,
    *,
    show: bool,
    asked_to_end: Callable[[], None],
    closing: Callable[[], None],
) -> None:
    """Serve the page that `build` lays out for each browser, until a signal ends it.

    asked_to_end: called at each such signal, at once; closing: at the end. The handlers of signals that were there
    before are called when the server has ended.
    """
    log_in_lines()
    app.add_static_files("/swingid/vendor", str(VENDOR))
    core.sio.eio.cors_allowed_origins = None  # pages of this server alone; NiceGUI lets all in
    inner = app.build_middleware_stack
    app.build_middleware_stack = lambda: Gate(inner(), place)  # type: ignore[method-assign]  # outside of NiceGUI's own
    app.on_startup(lambda: _end_at_signals(asked_to_end))
    app.on_shutdown(closing)
    ui.run(
        build,
        host=place.host,
        port=place.port,
        title="swingid",
        favicon="⚖️",
        dark=None,
        language="en-US",
        reload=False,
        show=place.path if show else False,
        show_welcome_message=False,
        reconnect_timeout=10.0,
        timeout_graceful_shutdown=GOODBYE,
        log_config=None,
    )


def _end_at_signals(asked_to_end: Callable[[], None]) -> None:
    """Call a function at each signal that ends the server, which itself is to see the first one alone.

    At a second one it would drop what it has to do at its end, and that takes little time anyway.
    """
    ends = signal.getsignal(signal.SIGINT)  # the server's, which is running now
    if not callable(ends):
        return

    ending = False

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal ending
        asked_to_end()
        if not ending:
            ending = True
            ends(number, frame)

    for number in END_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, handle)
