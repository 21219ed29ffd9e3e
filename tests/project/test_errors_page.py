"""Every code of an error is explained on docs/errors.md, and a terminal is told where."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path

import pytest

from loaded_tool import tool
from swingid.cli.app import run
from swingid.cli.failure import EXPLAINED

ROOT = Path(__file__).resolve().parents[2]


def headings(text: str) -> set[str]:
    return set(re.findall(r"^## (\S+)$", text, re.M))


def test_every_code_has_its_place() -> None:
    """Sentences may be older than the code; `python tools/list_errors.py` renews them and adds what lacks."""
    there = headings((ROOT / EXPLAINED).read_text(encoding="utf-8"))
    assert headings(tool("list_errors").page()) - there == set()
    assert len(there) > 200


def test_a_sentence_shows_what_is_written_in_place(tmp_path: Path) -> None:
    path = tmp_path / "a.py"
    path.write_text(
        'raise InputError(f"{name} is no {kind}; give a log", code="no-log")\nrefuse("bad", "is bad", "key")\n'
    )
    assert list(tool("list_errors").raised(path)) == [("no-log", 3, "… is no …; give a log"), ("bad", 3, "is bad")]


class Terminal(io.StringIO):
    """Standard error that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_is_told_where_and_a_script_is_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["identify", "missing.csv", "--rig", "paper"]
    assert run(arguments) == 3
    assert EXPLAINED not in capsys.readouterr().err
    seen = Terminal()
    monkeypatch.setattr(sys, "stderr", seen)
    assert run(arguments) == 3
    lines = seen.getvalue().splitlines()
    assert len(lines) == 2
    place = re.search(rf"{re.escape(EXPLAINED)}#(\S+)$", lines[1])
    assert place is not None
    assert place[1] in headings((ROOT / EXPLAINED).read_text(encoding="utf-8"))
