"""Write docs/messages.md: what the codes of warnings and notes mean."""

from __future__ import annotations

from pathlib import Path

from swingid.result.codes import MEANINGS

PAGE = Path(__file__).resolve().parents[1] / "docs" / "messages.md"

HEAD = """# Warnings and notes

A *warning* says that a number may be wrong, a *note* what was done or assumed. The JSON of a result has their codes
under `warnings` and `notes`. The message has the numbers; `swingid help CODE` prints the line below.
`python tools/list_messages.py` writes this page. Refusals are on [another page](errors.md).
"""


def escaped(words: str) -> str:
    """The words, with no name of a table taken for a link."""
    return words.replace("[", r"\[")


def page() -> str:
    """The page as text."""
    lines = [HEAD]
    for about, codes in MEANINGS.items():
        lines += [f"## {about}", "", "| code | what it means |", "|---|---|"]
        lines += [f"| `{code}` | {escaped(words)} |" for code, words in sorted(codes.items())]
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
