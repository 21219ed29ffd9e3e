"""``swingid dashboard``: the page in a browser, on a log."""

from __future__ import annotations

import os
import secrets
from importlib.util import find_spec
from typing import Annotated

import typer

from swingid.cli import output
from swingid.cli.options import RigFile
from swingid.errors import UsageError

TOKEN = "SWINGID_TOKEN"


def dashboard(
    rig: RigFile,
    log: Annotated[
        str | None, typer.Option(metavar="FILE", help="Show this log: findings, all methods, effect of constants.")
    ] = None,
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Where the page is served; 0.0.0.0: to other machines, by a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(metavar="PORT", min=1, max=65535, help="The next free one is taken.")] = 8080,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
) -> None:
    """Serve a page in the browser until Ctrl-C: a log with all methods side by side.

    The page is for this machine alone, unless --host is another address; then it needs the token that is printed, or
    the one in $SWINGID_TOKEN.
    """
    if log is None:
        raise UsageError("give the log to show: swingid dashboard --rig RIG --log FILE", code="no-log")
    if find_spec("nicegui") is None:
        text = "the page needs the package nicegui; run: pip install 'swingid[app]'"
        raise UsageError(text, code="missing-package")
    output.check_files({log: "the log", rig: "the rig file"})
    from swingid.app.dashboard import log_dashboard
    from swingid.app.server import LOCAL, Place, free_port
    from swingid.model.rig import Rig
    from swingid.recording.large import is_large
    from swingid.recording.recording import Recording

    if is_large(log):
        text = f"{log} is too large for a page; identify it, or show a part of it that you saved to a file of its own"
        raise UsageError(text, code="too-large")
    Recording.load(log, Rig.load(rig))
    token = "" if host in LOCAL else os.environ.get(TOKEN) or secrets.token_urlsafe(16)
    place = Place(host, free_port(host, port), token)
    output.announce_compilation("identify")
    output.tell(f"the page is {place.address}\nCtrl-C ends it")
    log_dashboard(log, rig, place, show=browser)
