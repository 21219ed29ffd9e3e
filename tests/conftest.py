"""Fixtures that several test files share."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Generator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: a core has a worker of its own, threads only spin

import pytest

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell sets it for what runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # else the commands under test never see Ctrl-C
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # as nohup sets it
    signal.signal(signal.SIGHUP, lambda *_: None)  # handled here, so that commands start with the system's own answer

LEAST = 2 / 3
"""Share of a core below which a test marked `real_time` cannot tell a late program from a busy machine: the emulator
alone takes a third, and a run has three processes more."""


def share_of_core(seconds: float = 0.3) -> float:
    """Share of a core that this process gets now, 1 where the machine is idle."""
    began, used = time.perf_counter(), time.process_time()
    while time.process_time() - used < seconds:
        pass
    return seconds / (time.perf_counter() - began)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip a test in real time that fails while others take the machine."""
    report = yield
    if report.failed and item.get_closest_marker("real_time") and (share := share_of_core()) < LEAST:
        path, line, _ = item.location
        report.outcome = "skipped"
        report.longrepr = str(path), line or 0, f"Skipped: no real time, a process gets {share:.0%} of a core"
    return report


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real measurements: $SWINGID_DATA, else ../shared/data beside the project; skips without it."""
    stated = os.environ.get("SWINGID_DATA")
    folder = Path(stated) if stated else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real measurements at {folder}; set SWINGID_DATA to their folder")
    return folder
