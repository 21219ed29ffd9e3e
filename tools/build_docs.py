"""Builds the documentation site into docs/_build/html: `make docs`.

The pages of docs/ and examples/ are written for a code host. Here they are laid out for Sphinx: links to other pages
stay, links to scripts of the gallery go to their executed pages, those to other files of the repository to copies;
the table of contents is that of docs/index.md. A page that index.md does not list, a link that does not resolve and
any other warning is an error. Prints why and ends well where the packages of the extra `docs` cannot be installed.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
BUILD = DOCS / "_build"
SOURCE, SCRIPTS, HTML = BUILD / "source", BUILD / "scripts", BUILD / "html"
NEEDED = ("sphinx", "myst_parser", "furo", "sphinx_gallery", "sphinx_copybutton")
AT_TOP = {
    "README.md": "start.md",
    "CHANGELOG.md": "changes.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
}
"""Pages at the top of the repository, and what they are called on the site."""

API = "src/swingid/__init__.py"
"""Links to this file go to the reference of the API."""

BLOCK = re.compile(r"(^[ ]*```.*?^[ ]*```[ ]*$|^(?:    [^\n]*\n)+)", re.M | re.S)
"""A block of code, fenced or indented."""

WITH_UNIT = re.compile(r"(?<=\d) (?=(?:[mµkM]?[smNgVAWB]|m?rad|k?Hz|bit|min|kHz|1/s)\b|[%±°])|(?<=±) (?=\d)")
"""The space between a number and its unit, or its uncertainty: no line of a table's cell ends there."""

LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\[\]]*\])*\])\(([^)\s]+)\)")


def main() -> int:
    """Lay out, build; the exit code of Sphinx."""
    missing = _missing()
    if missing:
        subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", *_requirements()], check=False)
        missing = _missing()
    if missing:
        print(f"docs: skipped, {', '.join(missing)} cannot be installed (pip install 'swingid[docs]')")
        return 0
    start = time.monotonic()
    for folder in (SOURCE, SCRIPTS, HTML):
        shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(DOCS / "gallery", SCRIPTS)
    for page in pages():
        target = SOURCE / place(page)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(laid_out(page), encoding="utf-8")
    shutil.copytree(DOCS / "images", SOURCE / "images")
    subprocess.run([sys.executable, str(DOCS / "figures" / "theory.py"), str(SOURCE / "images")], check=True)
    (SOURCE / "api.rst").write_text(api_page(), encoding="utf-8")
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-q", "-W", "--keep-going", "-j", "2", "-c", str(DOCS)]
    code = subprocess.run([*command, str(SOURCE), str(HTML)], env=os.environ | {"MPLBACKEND": "agg"}, check=False)
    if code.returncode == 0:
        print(f"docs: {HTML.relative_to(ROOT)}/index.html in {time.monotonic() - start:.0f} s")
    return code.returncode


def _missing() -> list[str]:
    importlib.invalidate_caches()
    return [name for name in NEEDED if importlib.util.find_spec(name) is None]


def _requirements() -> list[str]:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return list(project["optional-dependencies"]["docs"])


def pages() -> list[Path]:
    """The pages of the site, as they stand in the repository."""
    return [
        *sorted(DOCS.glob("*.md")),
        *sorted((ROOT / "examples").glob("*.md")),
        *(ROOT / name for name in AT_TOP),
    ]


def place(page: Path) -> Path:
    """Where a page is in the site's source: those of docs/ at its top, as those of `AT_TOP`."""
    if page.parent == DOCS:
        return Path(page.name)
    if page.parent == ROOT:
        return Path(AT_TOP[page.name])
    return page.relative_to(ROOT)


def laid_out(page: Path) -> str:
    """A page for Sphinx: its links, its blocks of code, on index.md the table of contents."""
    own = place(page).parent
    blocks = BLOCK.split(page.read_text(encoding="utf-8"))
    for k, block in enumerate(blocks):
        if block.lstrip(" ").startswith("```"):
            blocks[k] = block.replace("```python run", "```python")
        elif not block.startswith("    "):
            blocks[k] = LINK.sub(lambda match: _linked(match[1], match[2], page, own), _kept_together(block))
    text = "".join(blocks)
    return text + contents(text) if page == DOCS / "index.md" else text


def _kept_together(text: str) -> str:
    """A text whose tables have their numbers on one line with the unit; code in them stays as it is."""
    lines = text.split("\n")
    for k, line in enumerate(lines):
        if line.startswith("|"):
            parts = line.split("`")
            parts[::2] = [WITH_UNIT.sub("\N{NO-BREAK SPACE}", part) for part in parts[::2]]
            lines[k] = "`".join(parts)
    return "\n".join(lines)


def _linked(words: str, target: str, page: Path, own: Path) -> str:
    """A link of a page as one of the site."""
    path, _, anchor = target.partition("#")
    if re.match(r"[a-z]+:", target) or not path:
        return f"{words}({target})"
    there = (page.parent / path).resolve()
    mark = f"#{anchor}" if anchor else ""
    inside = there.relative_to(ROOT) if there.is_relative_to(ROOT) else None
    if inside is None or not there.exists():
        raise SystemExit(f"docs: {page.relative_to(ROOT)} links to {target}, which is not there")
    if inside.parts[:2] == ("docs", "gallery") and there.suffix == ".py":
        return f"{words}({_relative(Path('gallery') / f'{there.stem}.rst', own)})"
    if there in pages():
        return f"{words}({_relative(place(there), own)}{mark})"
    if str(inside) == API:
        return f"{words}({_relative(Path('api.rst'), own)})"
    if there.is_dir():
        return words[1:-1]
    if there.is_relative_to(DOCS / "images"):
        return f"{words}({_relative(there.relative_to(DOCS), own)})"
    if there.suffix == ".md":  # not a page of the site, which Sphinx would take it for
        inside = inside.with_name(f"{inside.name}.txt")
    copy = SOURCE / "files" / inside
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(there, copy)
    return f"{words}({_relative(Path('files') / inside, own)})"


def _relative(target: Path, own: Path) -> str:
    return Path(os.path.relpath(target, own)).as_posix()


def contents(text: str) -> str:
    """Hidden tables of contents, one for each list of links in index.md, which has each page once."""
    found = []
    for section in re.split(r"^## ", text, flags=re.M)[1:]:
        title, _, body = section.partition("\n")
        listed = re.findall(r"^- \[([^\]]+)\]\(([^)#]+)\)", body, re.M)
        entries = "\n".join(f"{words} <{target.rsplit('.', 1)[0]}>" for words, target in listed)
        if title == "Tutorials":
            entries = "Start <start>\nGallery <gallery/index>"
        found.append(f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n{entries}\n```\n")
    return "\n" + "\n".join(found)


def api_page() -> str:
    """The reference of the Python interface: everything in `swingid.__all__`, the results, the errors."""
    import swingid

    names = {name: getattr(swingid, name) for name in swingid.__all__}
    classes = [name for name, one in names.items() if inspect.isclass(one)]
    modules = [name for name, one in names.items() if inspect.ismodule(one) and name != "errors"]
    functions = [name for name in names if name not in (*classes, *modules, "errors")]
    lines = [
        "Python",
        "======",
        "",
        "``import swingid as sw`` gives the following. Angles are in rad, everything else in SI units.",
        "",
        *_section("Functions"),
        *(f".. autofunction:: swingid.{name}\n" for name in functions),
        *_section("Classes"),
        *(f".. autoclass:: swingid.{name}\n   :members:\n" for name in classes),
        *(line for name in modules for line in _module(name)),
        *_section("Parameters, budget, messages"),
        ".. autoclass:: swingid.uncertainty.budget.Parameter\n   :members:\n",
        ".. autoclass:: swingid.uncertainty.budget.BudgetEntry\n   :members:\n",
        ".. autoclass:: swingid.result.result.Message\n   :members:\n",
        *_section("Errors"),
        ".. automodule:: swingid.errors\n   :members:\n   :show-inheritance:\n",
    ]
    return "\n".join(lines)


def _module(name: str) -> list[str]:
    """The section of a module: what it says of itself, and what its `__all__` names."""
    module = importlib.import_module(f"swingid.{name}")
    own = [(each, inspect.isclass(getattr(module, each))) for each in module.__all__]
    parts = [f".. auto{'class' if is_class else 'function'}:: swingid.{name}.{each}\n" for each, is_class in own]
    parts = [part + "   :members:\n" if part.startswith(".. autoclass") else part for part in parts]
    return [*_section(f"swingid.{name}"), f".. automodule:: swingid.{name}\n", *parts]


def _section(title: str) -> list[str]:
    return [title, "-" * len(title), ""]


if __name__ == "__main__":
    raise SystemExit(main())
