"""Documentation that is read: few words, short pages, short sentences, counted by tools/count_words.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from count_words import REFERENCES, count, pages, words  # noqa: E402

PAGES = {str(page.relative_to(ROOT)): count(page.read_text(encoding="utf-8")) for page in pages()}


def test_all_pages_together_are_no_book() -> None:
    assert sum(page.plain for page in PAGES.values()) <= 45_000
    assert sum(page.prose for page in PAGES.values()) <= 25_000


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_read_at_once_and_so_is_a_sentence(name: str) -> None:
    page = PAGES[name]
    assert name in REFERENCES or page.plain <= 2_500
    assert [sentence for length, sentence in page.sentences if length > 25] == []


def test_readme_is_at_most_120_lines() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_tables_code_and_what_programs_write_are_no_prose() -> None:
    text = (
        "# Two words\n\nOne [link](a.md) here. A `code span` and $a + b$ end; it goes on.\n\n| a cell | b |\n\n"
        "```text\nnot prose\n```\n\n    nor this\n\n$$\nx = y\n$$\n\n- item one\n- item two\n\n"
        "<!-- tool: table -->\nfar too many words\n<!-- end -->\n"
    )
    found = count(text)
    assert found.prose == words("Two words One link here A code span and a b end it goes on item one item two")
    assert found.plain == found.written + words("```text\nnot prose")
    assert found.written == found.prose + words("a cell b nor this x y")
    assert [length for length, _ in found.sentences] == [3, 8, 2, 2]
