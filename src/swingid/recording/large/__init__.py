"""Logs that are too large to be read whole: read in parts, the rows averaged as far as the motion allows."""

from __future__ import annotations

from swingid.recording.large.log import LARGE, LargeLog, is_large

__all__ = ["LARGE", "LargeLog", "is_large"]
