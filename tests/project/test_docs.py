"""The documentation says what is there: files, links, keys, tests and functions it names; its code runs."""

from __future__ import annotations

import ast
import contextlib
import io
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from loaded_tool import tool
from long_cases import quick_if
from swingid.model.rig import Rig
from swingid.model.rig.errors import known_keys

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "swingid"
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted((ROOT / "examples").glob("*.md"))]
FENCE = re.compile(r"^```python run\n(.*?)^```\n(?:\s*^```text\n(.*?)^```$)?", re.M | re.S)


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def prose(page: Path) -> str:
    """The page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def test_the_list_of_modules_is_up_to_date() -> None:
    """`python tools/list_modules.py` writes it; a module without a docstring is an error there."""
    assert (DOCS / "modules.md").read_text(encoding="utf-8") == tool("list_modules").page()


def test_layers_in_architecture_are_those_of_the_contract() -> None:
    import tomllib

    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract, _ = config["tool"]["importlinter"]["contracts"]
    line = "  →  ".join(layer.replace("swingid.", "") for layer in contract["layers"])
    assert f"    {line}\n" in (DOCS / "architecture.md").read_text(encoding="utf-8")


@cache
def folders() -> tuple[Path, ...]:
    """Where a page's names of files may begin."""
    return (PACKAGE, PACKAGE.parent, ROOT, *PACKAGE.rglob("*/"))


@cache
def defined(path: Path) -> set[str]:
    """Names of functions and classes that a file defines, at its top level or inside a class."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_functions_and_files_that_a_page_names_exist(page: Path) -> None:
    missing = []
    for file, name in re.findall(r"`((?:tests/)?[\w/]+\.py)(?:::?(\w+))?`", prose(page)):
        places = [base / file for base in folders()]
        found = [place for place in places if place.is_file()]
        if not found or (name and not any(name in defined(place) for place in found)):
            missing.append(f"{file}:{name}")
    assert missing == []


COINED = re.compile(
    r"\b(tells? the truth|holds? the truth|stands? alone|stands? apart|is asked|believe[sd]?|by its own size"
    r"|tells? (?:no|what|how|it|apart)|told apart|feigns?|leans? on|speaks? against|second opinion)\b"
)


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "modules.md"], ids=name_of)
def test_pages_use_terms_of_the_glossary(page: Path) -> None:
    """None of these coined phrases; tables that src writes between marks are not looked at."""
    written = re.sub(r"^<!-- [\w]+: .*?^<!-- end -->", "", prose(page), flags=re.M | re.S)
    assert COINED.findall(written) == []


def test_every_reference_of_the_glossary_is_listed() -> None:
    terms, _, listed = (DOCS / "glossary.md").read_text(encoding="utf-8").partition("## References")
    cited = re.findall(r"([A-ZÅÖŠ][\w-]+)(?: (?:et al\.|and [\w ]*?\w+))? (1[89]\d\d|20\d\d)\b", terms)
    assert len(cited) > 30
    missing = {
        (name, year)
        for name, year in cited
        if not any(name in entry and year in entry for entry in listed.splitlines())
    }
    assert missing == set()


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_relative_links_resolve(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        if not place.exists() or (anchor and anchor not in anchors(place)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("page", [page for page in PAGES if FENCE.search(page.read_text("utf-8"))], ids=name_of)
def test_code_runs_and_prints_what_the_page_says(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All blocks of a page in one namespace; a block of text right below one is what it prints."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    namespace: dict[str, object] = {}
    for code, expected in FENCE.findall(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, name_of(page), "exec"), namespace)
        if expected:
            assert printed.getvalue() == expected


def test_every_key_of_a_rig_file_is_described() -> None:
    text = (DOCS / "rig.md").read_text(encoding="utf-8")
    cells = {cell for row in re.findall(r"^\| (`.*?) \|", text, re.M) for cell in re.findall(r"`([\w.]+)`", row)}
    cells = {cell.rpartition(".")[2] for cell in cells}
    tables = ("axis", "friction", "drive", "motor", "sensors", "log", "lugre", "cogging", "wheel")
    tables += ("bifilar", "trifilar", "suspension", "device")
    keys = {path[-1] for path in known_keys(Rig)} - set(tables)
    assert keys - cells == set()


def run_example(*command: str, folder: Path) -> str:
    environment = os.environ | {"MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_example_goes_from_a_rig_to_a_number(tmp_path: Path) -> None:
    printed = run_example(str(ROOT / "examples" / "paper_rig.py"), "made", folder=tmp_path)
    assert re.search(r"^ +inertia: +\(3\.022\d* ± ", printed, re.M)
    assert (tmp_path / "made" / "run.csv").is_file()
    assert (tmp_path / "made" / "inertia.png").read_bytes().startswith(b"\x89PNG")
    again = run_example(str(ROOT / "examples" / "windows.py"), "made/run.csv", "paper", "0.1", "0.2", folder=tmp_path)
    assert [line.split()[0] for line in again.splitlines()[1:]] == ["0.1", "0.2"]
    for line in again.splitlines()[1:]:
        # the paper's J1; short of the transient, which this example does not drop
        assert float(line.split()[1]) == pytest.approx(3.022e-3, rel=1e-3)


PARAMETER = re.compile(r"^(\w+) +\(([-\d.]+) ± ([\d.]+)\)(?:e(-?\d+))? .*\(95 %", re.M)
OUTPUT = re.compile(r"(?<=^```text\n).*?(?=^```$)", re.M | re.S)
REAL_LOGS = {
    "emps.md": ("emps/DATA_EMPS.mat", "examples/rigs/emps.toml"),
    "free_pendulum.md": ("free_pendulum/free_swing.csv", "examples/rigs/free_pendulum.toml"),
    "bam_xl330.md": ("bam_xl330/2026-01-15_10h28m49.json", "examples/rigs/bam_xl330.toml"),
    "bam_xl330_motor.md": ("bam_xl330/*.json", "examples/rigs/bam_xl330_motor.toml"),
    "dfki_pendulum.md": ("dfki_pendulum/sac.csv", "examples/rigs/dfki_pendulum.toml", "--part", "0:4.4"),
}


def parameters(text: str) -> dict[str, tuple[float, float]]:
    """Value and half the 95 % interval of the parameters in a printed summary."""
    found = PARAMETER.findall(text)
    return {name: (float(f"{value}e{e or 0}"), float(f"{half}e{e or 0}")) for name, value, half, e in found}


def summary_of(log: Path, rig: str, *words: str) -> str:
    logs = sorted(str(one) for one in log.parent.glob(log.name))
    command = ["-m", "swingid", "identify", *logs, "--rig", rig, *words]
    return run_example(*command, folder=ROOT)


@pytest.mark.parametrize("page", quick_if(lambda page: page != "free_pendulum.md", REAL_LOGS))
def test_pages_of_real_logs_show_what_is_found(data_dir: Path, page: str) -> None:
    """The parameters shown are today's, to a tenth of their interval; this file, run by python, renews them."""
    log, rig, *words = REAL_LOGS[page]
    shown = parameters((ROOT / "examples" / page).read_text(encoding="utf-8"))
    found = parameters(summary_of(data_dir / log, rig, *words))
    assert "inertia" in shown
    assert list(shown) == list(found)
    for name, (value, half) in shown.items():
        assert found[name][1] == pytest.approx(half, rel=0.2)
        assert found[name][0] == pytest.approx(value, abs=0.1 * half)


if __name__ == "__main__":
    for page, (log, rig, *words) in REAL_LOGS.items():
        path = ROOT / "examples" / page
        printed = summary_of(Path("../shared/data") / log, rig, *words)
        path.write_text(OUTPUT.sub(lambda _, new=printed: new, path.read_text(encoding="utf-8"), count=1))
