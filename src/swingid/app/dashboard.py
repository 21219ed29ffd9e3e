"""`log_dashboard` and `live_dashboard`: the page, served until it is ended."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from nicegui import app

from swingid.app.analysis import Analyst
from swingid.app.desk import Desk
from swingid.app.draft import Draft
from swingid.app.gate import Place
from swingid.app.guide import Guide
from swingid.app.live_page import live_page
from swingid.app.runner import POLLED
from swingid.app.server import serve
from swingid.model.rig import Rig

SOFT_STOP = 1.4
"""Seconds after Ctrl-C within which the server waits for the end of a run: the fade of 0.5 s, then its journal."""


class LogDashboard:
    """The page on logs, from files or dropped there, with the rig file if there is one."""

    def __init__(self, logs: Sequence[str], rig: Rig | None) -> None:
        self.logs = {Path(log).name: Path(log) for log in logs}
        self.rig = rig

    def serve(self, place: Place, *, show: bool) -> None:
        """Serve the page until it is ended; what was dropped is then deleted."""
        analyst = Analyst()
        with TemporaryDirectory(prefix="swingid-", ignore_cleanup_errors=True) as folder:
            serve(
                lambda: Guide(analyst, Path(folder), Draft.of(self.logs, self.rig)).build(),
                place,
                show=show,
                asked_to_end=lambda: None,
                closing=analyst.close,
            )

    def words_at_end(self) -> str:
        """What a person who has ended the page wants to know."""
        return "the page has ended; the log and the rig file are as they were"


class LiveDashboard:
    """The page beside a device ("" for the emulator of the rig file); journals go into `folder`."""

    def __init__(self, address: str, rig: str, folder: Path) -> None:
        self.desk = Desk(rig, address, folder, Analyst())
        self._asked = 0.0

    def serve(self, place: Place, *, show: bool) -> None:
        """Serve the page until it is ended."""
        app.timer(POLLED, self.desk.runner.poll)
        serve(live_page(self.desk), place, show=show, asked_to_end=self._ask, closing=self._close)

    def words_at_end(self) -> str:
        """What is kept, and whether a run goes on."""
        return self.desk.runner.words_at_end()

    def _ask(self) -> None:
        """Ctrl-C: as STOP, so a run fades out, and the second time gives 0 V at once."""
        self._asked = self._asked or time.monotonic()
        self.desk.runner.stop()

    def _close(self) -> None:
        self.desk.analyst.close()
        self.desk.runner.finish(self._asked + SOFT_STOP - time.monotonic())
        self.desk.runner.close()
