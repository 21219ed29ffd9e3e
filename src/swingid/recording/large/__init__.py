"""Logs that are too large to be read whole: read in parts, the rows averaged as far as the motion allows."""

from __future__ import annotations

from swingid.recording.large.log import LARGE, LargeLog, first_rows, is_large, opened

__all__ = ["LARGE", "LargeLog", "first_rows", "is_large", "opened"]
