"""All methods on the same logs, side by side."""

from __future__ import annotations

from swingid.study.compare.comparison import Comparison, Trial, compare

__all__ = ["Comparison", "Trial", "compare"]
