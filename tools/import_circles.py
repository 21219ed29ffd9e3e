"""Circles of imports between files of src, also those through imports inside functions and for types only.

    python tools/import_circles.py        prints each circle with its imports; exit 1 if there is one

import-linter keeps the order of folders; inside a folder it sees nothing. A file's imports are read from its syntax
tree, so nothing is run. The module of a package (its __init__.py) is a file like any other.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"
Graph = dict[str, dict[str, int]]
"""Of each module the modules that it imports, with the line of the first import."""


def imports_of(source: Path) -> Graph:
    """The imports between the modules below a folder, lazy ones and those under TYPE_CHECKING included."""
    paths = {_name(path.relative_to(source)): path for path in sorted(source.rglob("*.py"))}
    graph: Graph = {}
    for name, path in paths.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        package = name if path.stem == "__init__" else name.rpartition(".")[0]
        found = graph.setdefault(name, {})
        for node in ast.walk(tree):
            for imported in _imported(node, package, paths):
                if imported != name:
                    found.setdefault(imported, getattr(node, "lineno", 0))
    return graph


def _name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported(node: ast.AST, package: str, known: dict[str, Path]) -> Iterator[str]:
    """Modules of the project that a statement imports: of ``from a.b import c`` it is a.b.c if that is a module."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in known)
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*above, base] if base else above)
        for alias in node.names:
            full = f"{base}.{alias.name}"
            if full in known or base in known:
                yield full if full in known else base


def circles(graph: Graph) -> list[list[str]]:
    """Groups of two modules or more each of which imports, over others perhaps, every other (Tarjan, 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in graph[name]:
            if other not in index:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            start = stack.index(name)
            if len(stack) - start > 1:
                found.append(sorted(stack[start:]))
            del stack[start:]

    for name in graph:
        if name not in index:
            visit(name)
    return sorted(found)


def main() -> int:
    """Print the circles; 1 if there are any."""
    graph = imports_of(SOURCE)
    found = circles(graph)
    for circle in found:
        print(f"{len(circle)} files import one another:")
        for name in circle:
            for other in sorted(set(graph[name]) & set(circle)):
                print(f"    {name}:{graph[name][other]} imports {other}")
    print(f"{len(graph)} files, {len(found)} circles")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
