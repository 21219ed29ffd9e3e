"""A page of the report as a PDF/A-3 (ISO 19005-3) by typst, without network, with fonts that are installed with us.

The text of a log, a rig file or a laboratory reaches typst as data, never as its markup, so that it cannot be executed.
"""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from swingid.errors import InputError, missing_package
from swingid.report.blocks import blocks_of

STANDARD = "a-3a"

LONGEST = 22
"""Characters of a word beyond which it may break, so that a hash or a path does not leave its column."""


@dataclass(frozen=True)
class Attachment:
    """A file inside a PDF: its name, its media type, what it is, its text."""

    name: str
    media_type: str
    words: str
    text: str


@dataclass(frozen=True)
class Head:
    """What stands on each page of a PDF: the kind of report, its number, who issues it, the date ("": today)."""

    kind: str
    number: str = ""
    issuer: str = ""
    issued: str = ""


def require_typst() -> None:
    """Raise InputError where the extra `pdf` is not installed."""
    try:
        import typst  # noqa: F401
    except ImportError:
        raise missing_package("a report as PDF", "typst", "pdf") from None


def to_pdf(page: str, head: Head, attachments: Sequence[Attachment], issued: datetime.datetime) -> bytes:
    """The PDF of an HTML page of ours; the same arguments give the same bytes.

    Raises InputError without the extra `pdf`, or where typst refuses.
    """
    require_typst()
    import typst

    blocks, svgs = blocks_of(page)
    data = {
        "head": {
            "kind": head.kind,
            "number": head.number,
            "issuer": head.issuer,
            "date": head.issued or issued.date().isoformat(),
        },
        "title": next((_plain(block["runs"]) for block in blocks if block["block"] == "h1"), head.kind),
        "blocks": blocks,
        "attachments": [
            {"name": given.name, "type": given.media_type, "words": given.words, "file": f"attached{k}"}
            for k, given in enumerate(attachments)
        ],
    }
    source: dict[str, bytes] = {
        "main": files("swingid.report").joinpath("templates/report.typ").read_bytes(),
        "data.json": json.dumps(_shown(data), ensure_ascii=True).encode(),
    }
    source |= {f"{k}.svg": _drawable(svg).encode() for k, svg in enumerate(svgs)}
    source |= {f"attached{k}": given.text.encode("utf-8", "backslashreplace") for k, given in enumerate(attachments)}
    try:
        made: bytes = typst.compile(
            source,  # type: ignore[call-overload]  # its hints lack the dictionary of files
            font_paths=[str(_fonts())],
            ignore_system_fonts=True,
            pdf_standards=[STANDARD],
            timestamp=issued,
        )
    except typst.TypstError as error:
        problem = " ".join(str(error).split())[:200]
        raise InputError(f"the PDF cannot be made ({problem}); write the report as .html", code="no-pdf") from None
    return made


def _plain(runs: list[list[str]]) -> str:
    return "".join(text for text, _ in runs)


def _fonts() -> Path:
    """The folder of the DejaVu fonts, in which figures are drawn; matplotlib brings it."""
    import matplotlib

    return Path(matplotlib.get_data_path()) / "fonts" / "ttf"


@cache
def _glyphs() -> frozenset[int]:
    """Code points that DejaVu Sans has."""
    from matplotlib.ft2font import FT2Font

    return frozenset(FT2Font(str(_fonts() / "DejaVuSans.ttf")).get_charmap())


def shown_text(text: str) -> str:
    """Text with only characters that the fonts have: others as their code, <U+4E2D>. PDF/A allows no missing glyph."""
    if text.isascii() and text.isprintable():
        return text
    known = _glyphs()
    return "".join(
        letter
        if letter in "\n\u200b" or (ord(letter) in known and (letter.isprintable() or letter in "\u00a0\u202f"))
        else _code(letter)
        for letter in text
    )


def _code(character: str) -> str:
    return " " if character in "\t\r" else f"<U+{ord(character):04X}>"


def _shown(value: Any, key: str = "") -> Any:
    """Plain data whose texts `shown_text` can show, with places in long words where they may break."""
    if isinstance(value, str):
        text = shown_text(value)
        return text if key in ("title", "alt", "class", "block") else re.sub(rf"\S{{{LONGEST},}}", _breakable, text)
    if isinstance(value, dict):
        return {name: _shown(entry, name) for name, entry in value.items()}
    return [_shown(entry, key) for entry in value] if isinstance(value, list) else value


def _breakable(word: re.Match[str]) -> str:
    """A long word with zero-width spaces after its separators, else after each eight characters."""
    if "\u00a0" in word[0]:  # a number with its unit
        return word[0]
    return re.sub(r"[/\\_.,;:=\-]+(?=[^\s])|[^\s/\\_.,;:=\-]{8}(?=[^\s/\\_.,;:=\-])", "\\g<0>\u200b", word[0])


def _drawable(svg: str) -> str:
    """A figure whose texts the fonts have; its markup is ASCII."""
    from html import escape

    return "".join(
        letter if " " <= letter < "\x7f" or letter in "\n\t" else escape(shown_text(letter)) for letter in svg
    )
