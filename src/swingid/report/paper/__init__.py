"""The paper, reproduced: its figures 2 to 8, the page, and the tables of docs/paper.md."""

from __future__ import annotations

from swingid.report.paper.drawing import Drawing, drawn_figures
from swingid.report.paper.page import write_paper

__all__ = ["Drawing", "drawn_figures", "write_paper"]
