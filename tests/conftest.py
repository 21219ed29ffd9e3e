"""Fixtures that several test files share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real measurements: $SWINGID_DATA, else ../shared/data beside the project; skips without it."""
    stated = os.environ.get("SWINGID_DATA")
    folder = Path(stated) if stated else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real measurements at {folder}; set SWINGID_DATA to their folder")
    return folder
