"""`dashboard`: serves the page on a log until it is ended."""

from __future__ import annotations

from swingid.app.analysis import Analyst
from swingid.app.log_page import LogPage
from swingid.app.server import Place, serve


def log_dashboard(log: str, rig: str, place: Place, *, show: bool) -> None:
    """Serve the page on a log and its rig file, which can be loaded."""
    analyst = Analyst()
    serve(lambda: LogPage(log, rig, analyst).build(), place, show=show, closing=analyst.close)
