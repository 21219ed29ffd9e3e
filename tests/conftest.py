"""Fixtures that several test files share."""

from __future__ import annotations

import os
import signal
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: a core has a worker of its own, threads only spin

import pytest

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell sets it for what runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # else the commands under test never see Ctrl-C


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real measurements: $SWINGID_DATA, else ../shared/data beside the project; skips without it."""
    stated = os.environ.get("SWINGID_DATA")
    folder = Path(stated) if stated else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real measurements at {folder}; set SWINGID_DATA to their folder")
    return folder
