"""Write docs/modules.md: every module of the package with the first sentence of its docstring."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "swingid"
PAGE = ROOT / "docs" / "modules.md"

HEAD = """# Modules

Every file below `src/swingid/`, with the first line of its docstring; [architecture](architecture.md) says where to
look for what. `python tools/list_modules.py` writes this page.
"""


def first_line(path: Path) -> str:
    """First line of a module's docstring. Raises ValueError where there is none."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    if not text:
        raise ValueError(f"{path} has no docstring")
    return text.splitlines()[0]


def page() -> str:
    """The page as text."""
    lines = [HEAD]
    for folder in sorted({path.parent for path in PACKAGE.rglob("*.py")}):
        name = folder.relative_to(PACKAGE.parent)
        lines += [f"## {name}/", "", first_line(folder / "__init__.py"), ""]
        rows = [f"| `{path.name}` | {first_line(path)} |" for path in sorted(folder.glob("*.py"))]
        lines += ["| file | what it holds |", "|---|---|", *(row for row in rows if "__init__" not in row), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
