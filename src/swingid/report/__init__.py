"""Figures and the report of a result, as HTML or PDF."""

from __future__ import annotations

from swingid.report.measurement import write_report

__all__ = ["write_report"]
