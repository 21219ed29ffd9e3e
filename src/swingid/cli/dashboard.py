"""``swingid dashboard``: the page in a browser, on a log or beside a live rig."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from swingid.cli import output
from swingid.errors import UsageError
from swingid.processes import END_SIGNALS

TOKEN = "SWINGID_TOKEN"

HELD = 1.0
"""Seconds within which a further Ctrl-C is that of a key that is held; the page has ended by then."""


def dashboard(
    rig: Annotated[
        str | None,
        typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name; without --log its live page."),
    ] = None,
    log: Annotated[
        list[str] | None, typer.Option(metavar="FILE", help="Begin with this log; repeatable. Else drop one there.")
    ] = None,
    device: Annotated[
        str | None,
        typer.Option(metavar="DEV", help="Beside this device; default: device.address of RIG, else its twin."),
    ] = None,
    folder: Annotated[str, typer.Option(metavar="DIR", help="Where journals of runs are written.")] = ".",
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Where the page is served; 0.0.0.0: to other machines, by a token.")
    ] = "127.0.0.1",
    allow_host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A further name under which browsers reach it, as through a proxy."),
    ] = None,
    port: Annotated[int, typer.Option(metavar="PORT", min=1, max=65535, help="The next free one is taken.")] = 8080,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
) -> None:
    """Serve a page in the browser until Ctrl-C: from a log to its number step by step, or beside a live rig.

    Without --rig it takes a log: drop one there, or begin with --log. With --rig alone it is the page of the live rig.

    The page is for this machine alone, unless --host is another address or --allow-host is given; then it needs the
    token that is printed, or the one in $SWINGID_TOKEN. Ctrl-C stops a run softly and says what is kept (exit code 0).
    """
    if log and device is not None:
        raise UsageError("--log and --device are two different pages; give one of them", code="contradiction")
    if find_spec("nicegui") is None:
        text = "the page needs the package nicegui; run: pip install 'swingid[app]'"
        raise UsageError(text, code="missing-package")
    import secrets

    from swingid.app.gate import LOCAL, Place
    from swingid.app.server import free_port
    from swingid.model.rig import Rig

    if rig is None and device is not None:
        raise UsageError("--device needs the rig file that belongs to it; give --rig", code="missing-option")
    plant = None if rig is None else Rig.load(rig)
    for each in log or ():
        _require_log(each)
    if plant is not None and not log:
        _require_live(folder)
    if not host.strip():
        raise UsageError("--host is empty; give an address of this machine, or 0.0.0.0 for all", code="out-of-range")
    # a proxy lets others in, too
    token = "" if host in LOCAL and not allow_host else os.environ.get(TOKEN) or secrets.token_urlsafe(16)
    place = Place(host, free_port(host, port), token, tuple(allow_host or ()))
    from swingid.app.dashboard import LiveDashboard, LogDashboard

    page: LogDashboard | LiveDashboard = LogDashboard(log or (), plant)
    if rig is not None and plant is not None and not log:
        page = LiveDashboard(device if device is not None else plant.device.address or "", rig, Path(folder))
    with _ended_by_signals():
        output.tell(f"the page is {place.address}\nCtrl-C ends it")
        page.serve(place, show=browser)
    output.tell(page.words_at_end())


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """End the block at the first signal that ends the page; later ones, as of a key that is held, change nothing."""
    last = -HELD

    def end(_number: int, _frame: object) -> None:
        nonlocal last
        if time.monotonic() - last > HELD:
            last = time.monotonic()
            raise KeyboardInterrupt

    taken = [number for number in END_SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, end)
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        for number in taken:  # this process has nothing left to do but to say its sentence
            signal.signal(number, signal.SIG_IGN)


def _require_log(log: str) -> None:
    """Raise where there is no page of this log."""
    from swingid.recording.formats import read_table
    from swingid.recording.large import is_large
    from swingid.recording.load import read_bytes

    output.check_files({log: "the log"})
    if is_large(log):
        text = f"{log} is too large for a page; identify it, or show a part of it that you saved to a file of its own"
        raise UsageError(text, code="too-large")
    read_table(read_bytes(log), log)  # what the rig file has against it the page says, and mends


def _require_live(folder: str) -> None:
    """Raise where nothing could be run or recorded."""
    if find_spec("cantools") is None or find_spec("mcap") is None:
        text = "a live rig needs more packages; run: pip install 'swingid[app,live]'"
        raise UsageError(text, code="missing-package")
    output.check_writable(str(Path(folder) / "run.mcap"))
