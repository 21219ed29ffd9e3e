"""Figures and the HTML report of a result."""

from __future__ import annotations

from swingid.report.html import write_report

__all__ = ["write_report"]
