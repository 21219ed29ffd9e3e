"""`log_dashboard` and `live_dashboard`: the page, served until it is ended."""

from __future__ import annotations

from pathlib import Path

from nicegui import app

from swingid.app.analysis import Analyst
from swingid.app.live_page import Desk, live_page
from swingid.app.log_page import LogPage
from swingid.app.parts import heading, page_frame
from swingid.app.server import Place, serve
from swingid.errors import SwingidError

POLLED = 0.02
"""Seconds between two looks at what the rig's process sent."""


def log_dashboard(log: str, rig: str, place: Place, *, show: bool) -> None:
    """Serve the page on a log and its rig file, which can be loaded."""
    analyst = Analyst()

    def build() -> None:
        try:
            page = LogPage(log, rig, analyst)
        except SwingidError as error:  # a file that is gone, or that changed since the start
            page_frame(log, rig=rig)
            heading(error.message)
        else:
            page.build()

    serve(build, place, show=show, closing=analyst.close)


def live_dashboard(address: str, rig: str, folder: Path, place: Place, *, show: bool) -> None:
    """Serve the page beside a device ("" for the emulator of the rig file); journals go into `folder`."""
    desk = Desk(rig, address, folder, Analyst())

    def close() -> None:
        desk.analyst.close()
        desk.runner.close()

    app.timer(POLLED, desk.runner.poll)
    serve(live_page(desk), place, show=show, closing=close)
