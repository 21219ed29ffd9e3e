"""Words of the documentation, per page: `python tools/count_words.py [page …]`.

A word holds a letter or a digit; targets of links are none. Pages are README.md, CONTRIBUTING.md, SECURITY.md,
docs/*.md and examples/*.md, but not errors.md, messages.md and modules.md there, which programs write whole.

*Plain* is what a page holds but the blocks from `<!-- name: part -->` to `<!-- end -->`, which programs write: this is
the number that is held. *By hand* leaves out the blocks of ```text too, which are what the command or the code above
them prints. *Prose* is what of it stands outside tables, code and equations. A sentence is a run of prose up to its
stop; items of a list and headings end one too. A span of code or a formula counts as one word of a sentence.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
GENERATED = ("docs/errors.md", "docs/messages.md", "docs/modules.md")
REFERENCES = {
    "docs/rig.md": "every key of a rig file, looked up by its table",
    "docs/paper.md": "the paper section by section",
}
"""Pages that are looked up and not read from top to end, and why: they may be longer than others."""

MADE = re.compile(r"^<!-- [\w]+: .*?^<!-- end -->", re.M | re.S)
PRINTED = re.compile(r"^```text\n.*?^```$", re.M | re.S)
CODE = re.compile(r"^([ ]*)```.*?^\1```[ ]*$|^\n(?:    (?![-*] |\d+\. )[^\n]*\n)+", re.M | re.S)
EQUATION = re.compile(r"\$\$.*?\$\$", re.S)
TABLE = re.compile(r"^[ ]*\|.*$", re.M)
HEADING = re.compile(r"^#+ .*$", re.M)
SPAN = re.compile(r"`[^`\n]+`|\$[^$\n]+\$")
TARGET = re.compile(r"(?<=\])\([^)\s]+\)|<!--.*?-->")
STOP = re.compile(r"[.?!](?:[)\"”’*_`]*)\s+|\n\s*\n|\n\s*(?:[-*]|\d+\.) ")


class Page(NamedTuple):
    """Counts of one page: plain words, words by hand, words of prose, words of each sentence of the prose."""

    plain: int
    written: int
    prose: int
    sentences: list[tuple[int, str]]


def pages() -> list[Path]:
    """The pages that people write."""
    top = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")]
    found = [*top, *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "examples").glob("*.md"))]
    return [page for page in found if str(page.relative_to(ROOT)) not in GENERATED]


def words(text: str) -> int:
    """Words of a text; targets of links are none."""
    return sum(any(sign.isalnum() for sign in word) for word in TARGET.sub("", text).split())


def count(text: str) -> Page:
    """The counts of a page's text."""
    plain = MADE.sub("", text)
    written = PRINTED.sub("", plain)
    prose = written
    for other in (CODE, EQUATION, TABLE):
        prose = other.sub("\n", prose)
    parts = STOP.split(HEADING.sub("\n\n", prose))
    sentences = [(words(SPAN.sub("x", part)), " ".join(part.split())) for part in parts if words(part)]
    return Page(words(plain), words(written), words(prose), sentences)


def main(names: list[str]) -> None:
    """One line per page; with names of pages, their sentences above 25 words too."""
    chosen = [ROOT / name for name in names] or pages()
    counted = {page: count(page.read_text(encoding="utf-8")) for page in chosen}
    for page, found in counted.items():
        lengths = [length for length, _ in found.sentences] or [0]
        print(
            f"{found.plain:6d} {found.written:6d} {found.prose:6d} {sum(lengths) / len(lengths):5.1f} "
            f"{max(lengths):4d} {sum(length > 25 for length in lengths):4d}  {page.relative_to(ROOT)}"
        )
        if names:
            for length, sentence in found.sentences:
                if length > 25:
                    print(f"    {length}: {sentence}")
    sums = [sum(getattr(page, name) for page in counted.values()) for name in ("plain", "written", "prose")]
    print(" ".join(f"{number:6d}" for number in sums), end=" ")
    print(" plain, by hand, prose; words a sentence, longest, sentences above 25 words")


if __name__ == "__main__":
    main(sys.argv[1:])
