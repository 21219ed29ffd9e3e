"""From a page of the report as HTML to its blocks as plain data, of which `report.pdf` sets the pages.

Only what our own templates contain is known: headings, paragraphs, lists of messages, tables, figures, text
as it is. Folded parts (`details`) are taken where they have the class `printed`.
"""

from __future__ import annotations

import re
from html import unescape
from html.parser import HTMLParser
from typing import Any

Block = dict[str, Any]

LINES = {"h1", "h2", "h3", "p", "li", "figcaption", "td", "th", "pre", "summary", "footer"}
"""Elements that are one run of text."""

SKIPPED = {"style", "title", "script"}
NUMBERS = {"number", "value-cell"}
KEPT = {"name", "number", "value-cell", "level", "title"}
"""Classes of cells whose lines do not break."""


def blocks_of(page: str) -> tuple[list[Block], list[str]]:
    """The blocks of a page in their order, and the texts of its figures (SVG), to which blocks refer by their index."""
    svgs: list[str] = []

    def keep(match: re.Match[str]) -> str:
        svgs.append(match[0])
        return f'<img data-svg="{len(svgs) - 1}">'

    reader = _Reader(svgs)
    reader.feed(re.sub(r"<svg\b.*?</svg>", keep, page, flags=re.DOTALL))
    reader.close()
    return reader.blocks, svgs


class _Reader(HTMLParser):
    """Collects blocks; runs of text are lists of [text, style]."""

    def __init__(self, svgs: list[str]) -> None:
        super().__init__()
        self.svgs = svgs
        self.blocks: list[Block] = []
        self.runs: list[list[str]] | None = None
        self.styles: list[str] = []
        self.list: Block | None = None
        self.table: Block | None = None
        self.row: list[Block] = []
        self.box: Block | None = None
        self.figure: Block | None = None
        self.hidden: list[bool] = []
        self.skipped = False
        self.classes = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = {key: value or "" for key, value in attrs}
        classes = attributes.get("class", "")
        if tag in SKIPPED:
            self.skipped = True
        elif tag == "details":
            self.hidden.append("printed" not in classes.split())
        elif tag in ("section", "div") and "answer" in classes.split():
            self.box = {"block": "answer", "status": classes.split()[-1], "lines": []}
            self.blocks.append(self.box)
        elif tag == "table":
            self.table = {"block": "table", "class": classes, "head": [], "rows": []}
        elif tag == "ul":
            self.list = {"block": "messages", "class": classes, "items": []}
        elif tag == "figure":
            self.figure = {"block": "figure", "svg": -1, "alt": "", "caption": []}
        elif tag == "img" and "data-svg" in attributes and self.figure is not None:
            number = int(attributes["data-svg"])
            words = re.search(r'aria-label="([^"]*)"', self.svgs[number])  # for screen readers
            self.figure |= {"svg": number, "alt": unescape(words[1]) if words else "figure"}
        elif tag in LINES:
            self.runs, self.classes, self.styles = [], classes, []
        elif tag in ("b", "strong", "code", "sub", "span"):
            style = {"b": "bold", "strong": "bold"}.get(tag, tag)
            self.styles.append("code" if tag == "span" and "key" in classes.split() else style)

    def handle_data(self, data: str) -> None:
        if self.runs is not None and not self.skipped and data:
            text = data if self.classes == "pre" else re.sub(r"[ \t\r\n]+", " ", data)
            self.runs.append([text, self.styles[-1] if self.styles else ""])

    def handle_endtag(self, tag: str) -> None:
        if tag in SKIPPED:
            self.skipped = False
        elif tag == "details":
            self.hidden.pop()
        elif tag in LINES:
            self._line(tag)
        elif tag == "tr" and self.table is not None:
            self.table["rows" if any(not cell["head"] for cell in self.row) else "head"].append(self.row)
            self.row = []
        elif tag == "table" and self.table is not None:
            self._add(self.table)
            self.table = None
        elif tag == "ul" and self.list is not None:
            self._add(self.list)
            self.list = None
        elif tag == "figure" and self.figure is not None:
            self._add(self.figure)
            self.figure = None
        elif tag in ("section", "div") and self.box is not None and self.box["lines"]:
            self.box = None
        elif tag in ("b", "strong", "code", "sub", "span") and self.styles:
            self.styles.pop()

    def _line(self, tag: str) -> None:
        """A finished run of text to where it belongs."""
        runs, self.runs = _trimmed(self.runs or []), None
        if tag in ("td", "th") and self.table is not None:
            names = set(self.classes.split())
            self.row.append({"runs": runs, "head": tag == "th", "right": bool(names & NUMBERS),
                             "whole": bool(names & KEPT), "class": self.classes})  # fmt: skip
        elif tag == "li" and self.list is not None:
            self.list["items"].append(runs)
        elif tag == "figcaption" and self.figure is not None:
            self.figure["caption"] = runs
        elif self.box is not None:
            self.box["lines"].append({"class": self.classes, "runs": runs})
        elif runs:
            name = {"summary": "h3"}.get(tag, tag)
            self._add({"block": "kind" if self.classes == "kind" else name, "runs": runs})

    def _add(self, block: Block) -> None:
        if not any(self.hidden):
            self.blocks.append(block)


def _trimmed(runs: list[list[str]]) -> list[list[str]]:
    """Runs without the space at their ends."""
    kept = [run for run in runs if run[0]]
    if kept:
        kept[0] = [kept[0][0].lstrip(" "), kept[0][1]]
        kept[-1] = [kept[-1][0].rstrip(" "), kept[-1][1]]
    return [run for run in kept if run[0]]
