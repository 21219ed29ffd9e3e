"""Every code of a warning or a note has a meaning, which `swingid help` prints and a page lists."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from loaded_tool import tool
from swingid.cli.app import run
from swingid.result.codes import MEANINGS, meaning

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "swingid"

PLACE = {"Message": 0, "Finding": 0, "found": 0, "Hypothesis": 1}
"""Which argument the code is, by what makes a warning or a note."""

ELSEWHERE = {"study/faults/registry.py", "cli/doctor.py"}
"""Files whose findings are of no log."""

COMPUTED = {
    "scale-from-gravity",
    "scale-from-spring",
    "no-uncertainty-inertia",
    "no-uncertainty-viscous",
    "not-identifiable",
}
"""Codes that are no constant where the message is made."""


def codes() -> Iterator[str]:
    """The codes that the package writes in place, or by a constant of the module."""
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).as_posix() in ELSEWHERE:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        constants = {}
        for node in tree.body:
            if isinstance(node, ast.Assign):
                target = node.targets[0]
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
                constants |= {ast.unparse(name): value for name, value in zip(names, values, strict=False)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                place = PLACE.get(ast.unparse(node.func).rpartition(".")[2])
                code = node.args[place] if place is not None and len(node.args) > place else None
                code = constants.get(ast.unparse(code), code) if code is not None else None
                if isinstance(code, ast.Constant) and isinstance(code.value, str):
                    yield code.value


def test_every_code_has_a_meaning_and_every_meaning_a_code() -> None:
    """What lacks belongs into `result/codes.py`."""
    written = [code for group in MEANINGS.values() for code in group]
    assert len(set(written)) == len(written)
    assert set(codes()) | COMPUTED == set(written)


def test_the_page_has_them() -> None:
    """`python tools/list_messages.py` renews it."""
    assert (ROOT / "docs" / "messages.md").read_text(encoding="utf-8") == tool("list_messages").page()


def test_help_prints_a_meaning_and_refuses_what_is_no_code(capsys) -> None:
    assert run(["help", "push-left"]) == 0
    assert capsys.readouterr().out.strip() == meaning("push-left")
    assert run(["help", "push-right"]) == 2
    assert "push-right" in capsys.readouterr().err
