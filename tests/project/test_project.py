"""The project's own manners: documented, free of leftovers, and of paths that exist on one machine only."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from import_circles import circles, imports_of  # noqa: E402

LEFTOVERS = re.compile(r"\b(TO" r"DO|FIX" r"ME|XX" r"X|HA" r"CK)\b")
MACHINE = re.compile(r"(?<![\w.$}/])/(?:work|home|Users|root|opt|srv)/\w")
INDEX = re.compile(r"index-" r"url|find-" r"links|py" r"pi\.org", re.IGNORECASE)


def tracked() -> list[Path]:
    """Files of the project that hold text: those known to git, else (no git) all of its source folders."""
    try:
        done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True)
        paths = [ROOT / name for name in done.stdout.split("\0") if name]
    except (OSError, subprocess.CalledProcessError):
        paths = [path for folder in ("src", "tests", "docs", "examples") for path in (ROOT / folder).rglob("*")]
    endings = {".py", ".toml", ".md", ".sh", ".cff", ".html", ".css", ".yml", ""}
    return [path for path in paths if path.is_file() and path.suffix in endings]


FILES = tracked()


@pytest.mark.parametrize("pattern", [LEFTOVERS, MACHINE, INDEX], ids=["leftovers", "machine paths", "package index"])
def test_no_line_matches(pattern: re.Pattern[str]) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in FILES
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if pattern.search(line)
    ]
    assert found == []


def undocumented(path: Path) -> list[str]:
    """Public modules, classes, functions and methods of a file that have no docstring."""
    missing = []

    def visit(node: ast.Module | ast.ClassDef, inside: str) -> None:
        for child in node.body:
            if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                continue
            overload = any("overload" in ast.unparse(decorator) for decorator in child.decorator_list)
            setter = any(ast.unparse(decorator).endswith(".setter") for decorator in child.decorator_list)
            if child.name.startswith("_") or overload or setter:
                continue
            if ast.get_docstring(child) is None:
                missing.append(f"{inside}.{child.name}")
            if isinstance(child, ast.ClassDef):
                visit(child, f"{inside}.{child.name}")

    tree = ast.parse(path.read_text(encoding="utf-8"))
    name = str(path.relative_to(ROOT))
    if ast.get_docstring(tree) is None:
        missing.append(name)
    visit(tree, name)
    return missing


def test_everything_public_has_a_docstring() -> None:
    sources = [path for folder in ("src", "examples") for path in (ROOT / folder).rglob("*.py")]
    assert [name for path in sources for name in undocumented(path)] == []


NO_SENTENCE = re.compile(r"(?:Whether|As|Of|By|With|For|At|In|That|Those)\b|From \S+ .*\bto\b")
"""How no docstring of a class or a function begins: a verb or a noun says what it does or is."""

EMPTY = frozenset({"found", "left", "one", "own", "told", "way"})
"""Names that say nothing of what a variable or a parameter holds; "left" may be a side where there is a "right"."""


def test_docstrings_begin_with_a_verb_or_a_noun() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {text.splitlines()[0]}"
        for path in (ROOT / "src").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        and (text := ast.get_docstring(node))
        and NO_SENTENCE.match(text)
    ]
    assert found == []


def bound_names(tree: ast.AST) -> list[tuple[int, str]]:
    """Line and name of every variable and parameter that a piece of source binds; fields of classes apart."""
    nodes = list(ast.walk(tree))
    members = [member for node in nodes if isinstance(node, ast.ClassDef) for member in node.body]
    fields = {member.target for member in members if isinstance(member, ast.AnnAssign)}
    names = [node for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    variables = [(node.lineno, node.id) for node in names if node not in fields]
    return variables + [(node.lineno, node.arg) for node in nodes if isinstance(node, ast.arg)]


def test_variables_and_parameters_have_names_of_things() -> None:
    empty = []
    for path in (ROOT / "src").rglob("*.py"):
        names = bound_names(ast.parse(path.read_text(encoding="utf-8")))
        sides = {"left"} if "right" in {name for _, name in names} else set()
        empty += [f"{path.relative_to(ROOT)}:{line}: {name}" for line, name in names if name in EMPTY - sides]
    assert empty == []


def test_every_package_folder_is_a_layer() -> None:
    """No folder escapes the contract of the layers."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract, independent = config["tool"]["importlinter"]["contracts"]
    layers = {name.strip() for line in contract["layers"] for name in line.split("|")}
    package = ROOT / "src" / "swingid"
    folders = {f"swingid.{path.parent.name}" for path in package.glob("*/__init__.py")}
    modules = {f"swingid.{path.stem}" for path in package.glob("*.py")} - {"swingid.__init__", "swingid.__main__"}
    assert folders | modules == layers
    assert set(independent["modules"]) == {
        f"swingid.methods.{path.parent.name}" for path in (package / "methods").glob("*/__init__.py")
    }


def test_every_dependency_has_its_reason() -> None:
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    text = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    names = [re.split(r"[<>=~!\[ ]", line)[0] for line in config["project"]["dependencies"]]
    assert [name for name in names if f"| {name} |" not in text] == []


def test_a_circle_is_seen_through_functions_types_and_relative_imports(tmp_path: Path) -> None:
    files = {
        "p/__init__.py": "",
        "p/a.py": "def f():\n    from p.b import g",
        "p/b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from p.q import c",
        "p/q/__init__.py": "",
        "p/q/c.py": "from ..a import f\nimport numpy",
        "p/d.py": "from p import a, e\nfrom . import q",
        "p/e.py": "import p.a",
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    graph = imports_of(tmp_path)
    assert circles(graph) == [["p.a", "p.b", "p.q.c"]]
    assert set(graph["p.d"]) == {"p.a", "p.e", "p.q"}


def test_scripts_import_names_that_exist() -> None:
    missing = []
    for path in [path for folder in ("benchmarks", "examples", "tools") for path in (ROOT / folder).rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "swingid":
                names = [name.name for name in node.names if not exists(node.module or "", name.name)]
                missing += [f"{path.relative_to(ROOT)}: {node.module}.{name}" for name in names]
    assert missing == []


def exists(module: str, name: str) -> bool:
    """Whether a module of the package binds a name, or the package holds a module of that name."""
    place = ROOT / "src" / Path(*module.split("."))
    if (place / f"{name}.py").exists() or (place / name).is_dir():
        return True
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if not file.exists():
        return False
    text = file.read_text(encoding="utf-8")
    bound = {bound for _, bound in bound_names(ast.parse(text))}
    imported = {
        alias.asname or alias.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    defined = {node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return name in bound | imported | defined or f'"{name}"' in text
