"""Write docs/errors.md: every code of an error with its sentences, its exit code and the page of its subject."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "swingid"
PAGE = ROOT / "docs" / "errors.md"

HEAD = """# Errors

Every refusal is one sentence with a code, which the JSON of a result has under `error.code`. In a terminal the line
below an error names its place here. `…` stands for names and numbers. The linked page explains the subject.
`python tools/list_errors.py` writes this page.
"""

EXITS = {"UsageError": 2, "InputError": 3, "refuse": 3, "UnanswerableError": 4, "DeviceError": 5}
"""Exit codes by what raises an error; `refuse` is that of the tables of rig.toml."""

SUBJECTS = (
    ("app", "dashboard.md", "the page in a browser"),
    ("body", "tensor.md", "the inertia tensor"),
    ("calibration/encoders", "encoders.md", "encoder calibration"),
    ("calibration", "calibrate.md", "motor calibration"),
    ("cli", "cli.md", "the command line"),
    ("exchange", "exchange.md", "results for other programs"),
    ("live", "live.md", "live rigs"),
    ("model/rig", "rig.md", "rig.toml"),
    ("model", "twin.md", "the digital twin"),
    ("pooling", "methods.md", "the methods"),
    ("recording", "formats.md", "formats and repairs of logs"),
    ("report", "report.md", "the report"),
    ("result", "cli.md", "results"),
    ("simulation/ensemble", "ensemble.md", "ensembles"),
    ("simulation", "twin.md", "the digital twin"),
    ("study/campaign", "campaign.md", "campaigns"),
    ("study/inspect", "inspect.md", "inspecting a log"),
    ("study", "cli.md", "the command line"),
    ("units.py", "rig.md", "rig.toml"),
    ("", "methods.md", "the methods"),
)
"""Page and words by the beginning of a module's path; the first that fits."""


def sentence(node: ast.expr) -> str:
    """The text of a message as far as it is written in place, "…" for what is not."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(sentence(part) if isinstance(part, ast.Constant) else "…" for part in node.values)
    return "…"


def raised(path: Path) -> Iterator[tuple[str, int, str]]:
    """(code, exit code, sentence) of each error that a module makes with a code written in place."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        code = next((one.value for one in node.keywords if one.arg == "code"), None)
        message = node.args[0] if node.args else None
        if name == "refuse" and len(node.args) > 1:
            code, message = node.args[0], node.args[1]
        if name in EXITS and isinstance(code, ast.Constant) and isinstance(code.value, str) and message is not None:
            yield code.value, EXITS[name], " ".join(sentence(message).split())


def page() -> str:
    """The page as text."""
    found: dict[str, dict[str, set[str]]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        own = path.relative_to(PACKAGE).as_posix()
        target, words = next((page, words) for start, page, words in SUBJECTS if own.startswith(start))
        for code, number, text in raised(path):
            shown = re.sub(r"([*_<>|\[\]])", r"\\\1", text)
            told = bool(re.search(r"[a-z]", text))
            own_lines = found.setdefault(code, {}).setdefault(f"Exit code {number}, [{words}]({target})", set())
            own_lines |= {f"- {shown}"} if told else set()
    lines = [HEAD]
    for code in sorted(found):
        lines += [f"## {code}", ""]
        for place, sentences in sorted(found[code].items()):
            lines += [f"{place}{':' if sentences else '.'}", "", *sorted(sentences), *([""] if sentences else [])]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
