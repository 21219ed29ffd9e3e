"""The documentation site: its layout from the pages of docs/ and examples/; built by the long test."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


def module(path: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def tool(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    found = module("tools/build_docs.py")
    found.SOURCE = tmp_path_factory.mktemp("source")
    return found


def test_the_index_lists_each_page_once(tool):
    text = tool.laid_out(ROOT / "docs" / "index.md")
    listed = [line.split("<")[1].rstrip(">") for line in re.findall(r"^.+ <[\w/.-]+>$", text, re.M)]
    pages = {str(tool.place(page).with_suffix("")) for page in tool.pages()} - {"index"}
    assert sorted(listed) == sorted(pages | {"api", "gallery/index"})
    scripts = {path.name for path in (ROOT / "docs" / "gallery").glob("*.py")}
    assert set(re.findall(r"\(gallery/(\w+\.py)\)", (ROOT / "docs" / "index.md").read_text("utf-8"))) == scripts
    assert {f"plot_{name}.py" for name in module_order()} == scripts


def module_order() -> tuple[str, ...]:
    text = (ROOT / "docs" / "conf.py").read_text("utf-8")
    return tuple(re.findall(r'"(\w+)"', re.search(r"^ORDER = \((.*?)\)$", text, re.M | re.S)[1]))


@pytest.mark.parametrize(
    ("page", "link", "expected"),
    [
        ("docs/rig.md", "cli.md#without", "cli.md#without"),
        ("docs/rig.md", "../examples/emps.md", "examples/emps.md"),
        ("examples/emps.md", "../docs/rig.md#rates", "../rig.md#rates"),
        ("README.md", "docs/images/swings.png", "images/swings.png"),
        ("README.md", "CHANGELOG.md", "changes.md"),
        ("docs/index.md", "gallery/plot_design.py", "gallery/plot_design.rst"),
        ("docs/index.md", "../src/swingid/__init__.py", "api.rst"),
        (
            "docs/rig.md",
            "../src/swingid/model/rig/builtin/paper.toml",
            "files/src/swingid/model/rig/builtin/paper.toml",
        ),
        ("README.md", "CONTRIBUTING.md", "contributing.md"),
        ("docs/live.md", "../firmware/README.md", "files/firmware/README.md.txt"),
        ("docs/rig.md", "https://example.org/a.md", "https://example.org/a.md"),
    ],
)
def test_links_lead_to_the_same_page_on_the_site(tool, page, link, expected):
    path = ROOT / page
    assert tool._linked("[x]", link, path, tool.place(path).parent) == f"[x]({expected})"
    if expected.startswith("files/"):
        assert (tool.SOURCE / expected).read_bytes() == (path.parent / link).read_bytes()


def test_a_link_to_nothing_stops_the_build_and_folders_are_no_links(tool):
    page = ROOT / "docs" / "rig.md"
    with pytest.raises(SystemExit, match=r"docs/rig.md links to nowhere.md, which is not there"):
        tool._linked("[x]", "nowhere.md", page, Path())
    assert tool._linked("[rigs]", "../examples/rigs", page, Path()) == "rigs"


def test_code_is_not_taken_for_links(tool, tmp_path, monkeypatch):
    page = ROOT / "docs" / "formats.md"
    text = "a [b](rig.md)\n\n    c[0](nowhere.md)\n\n```python run\nd[0](nowhere.md)\n```\n[e](cli.md)\n"
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: text)
    assert tool.laid_out(page) == text.replace("python run", "python")


def test_numbers_of_a_table_stay_with_their_unit(tool):
    text = "5 % of 3 m\n| 0.017 s | 1 ± 2 kg | `1 s` | 3 sets, 5 % |\n"
    assert tool._kept_together(text) == "5 % of 3 m\n| 0.017\xa0s | 1\xa0±\xa02\xa0kg | `1 s` | 3 sets, 5\xa0% |\n"


def test_docstrings_are_plain_text_that_sphinx_reads_as_it_stands():
    pytest.importorskip("docutils")
    from docutils.core import publish_doctree

    source = (ROOT / "docs" / "conf.py").read_text("utf-8")
    names: dict[str, object] = {"re": re}
    exec(source[source.index("def plain_to_rest") : source.index("def on_docstring")], names)
    lines = ["Value of `a*b_` in |v| and x_ * 2, q1'.", "", "    import swingid as sw", "    a * b", "", "More ``c``."]
    names["plain_to_rest"](lines)  # type: ignore[operator]
    tree = publish_doctree("\n".join(lines), settings_overrides={"report_level": 1, "halt_level": 1})
    first, block, last = tree.children
    assert first.astext() == "Value of a*b_ in |v| and x_ * 2, q1'."
    assert block.astext() == "import swingid as sw\na * b"
    assert last.astext() == "More c."


@pytest.mark.long
def test_the_site_builds_without_a_warning():
    tool = module("tools/build_docs.py")
    missing = [name for name in tool.NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: pip install 'swingid[docs]'")
    html, scripts = tool.HTML, [*(ROOT / "docs" / "gallery").iterdir(), *(ROOT / "tools").glob("*.py")]
    newest = max(path.stat().st_mtime for path in (*tool.pages(), *scripts, ROOT / "docs" / "conf.py"))
    built = html / "index.html"
    if not built.exists() or built.stat().st_mtime < newest:  # `make docs` may have built it just before
        command = [sys.executable, "tools/build_docs.py"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    page = (html / "gallery" / "plot_own_rig.html").read_text("utf-8")
    assert "inertia: (1.89" in page
    assert re.search(r"_images/sphx_glr_plot_own_rig_\d+\.png", page)
    (notebook,) = html.glob("_downloads/*/plot_class_exercise.ipynb")
    assert json.loads(notebook.read_text("utf-8"))["nbformat"] == 4
    assert "swingid.identify" in (html / "api.html").read_text("utf-8")


def test_equations_become_mathml_with_the_papers_numbers():
    math = pytest.importorskip("docutils.utils.math.latex2mathml")
    source = (ROOT / "docs" / "conf.py").read_text("utf-8")
    names = {"re": re, "latex2mathml": math}
    exec(source[source.index("TAG =") : source.index("def inline_equation")], names)
    found = re.sub(r"\s*\n\s*", "", names["mathml"](r"\ddot q_1 = b\sin q"))
    assert "<msub><mrow><mover" in found  # the index beside the accented letter, not below it
    assert names["TAG"].findall(r"x \tag{6}") == ["6"]
    for page in (ROOT / "docs").glob("*.md"):
        text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
        for block, line in re.findall(r"\$\$(.*?)\$\$|(?<![\w\\])\$([^$\n`]+)\$(?!\w)", text, re.S):
            names["mathml"](names["TAG"].sub("", block or line), block=bool(block))


def test_the_pictures_of_the_pages_are_those_that_the_script_draws():
    names = re.findall(r'^    "([\w-]+)": \w+,$', (ROOT / "docs" / "figures" / "theory.py").read_text("utf-8"), re.M)
    pages = "".join(page.read_text("utf-8") for page in (ROOT / "docs").glob("*.md"))
    assert set(re.findall(r"\(images/(theory-[\w-]+)\.svg\)", pages)) == set(names)
    assert all((ROOT / "docs" / "images" / f"{name}.svg").is_file() for name in names)
