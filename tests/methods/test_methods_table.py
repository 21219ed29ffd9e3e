"""The table of methods: what it says is so, and a method is its folder and one entry."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import pytest

import swingid as sw
from factories import clean_result, rotary_log, rotary_rig
from refusals import coded
from swingid.checks.momentum import MomentumCheck
from swingid.cli import main
from swingid.cli.options import method_name
from swingid.errors import UsageError
from swingid.methods.table import METHODS, Method, method_of
from swingid.recursive.stream import MAKERS
from swingid.study.compare.comparison import assumptions
from swingid.study.inspect.motion import services

SOURCE = Path(sw.__file__).parent


@pytest.mark.parametrize("name", METHODS)
def test_every_entry_has_its_function_and_its_folder(name: str) -> None:
    method = method_of(name)
    assert method.name == name
    assert (SOURCE / "methods" / name.replace("-", "_")).is_dir()
    function = method.load()
    assert function.__name__ == name.replace("-", "_")
    assert function.__module__.startswith(f"swingid.methods.{name.replace('-', '_')}.")
    assert "alone" not in method.options()


def test_folders_and_entries_are_the_same() -> None:
    folders = {path.parent.name for path in (SOURCE / "methods").glob("*/__init__.py")}
    assert folders == {name.replace("-", "_") for name in METHODS}


def test_those_that_are_online_have_their_blocks() -> None:
    assert {name for name, method in METHODS.items() if method.online} == set(MAKERS)


def test_what_is_set_for_several_logs_is_no_option(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(UsageError, check=coded("unknown-option", "momentum", "'alone'", "memory")):
        sw.identify(rotary_log(), rotary_rig(), alone=False)
    with pytest.raises(UsageError, check=coded("unknown-option", "'alone'")):
        sw.identify([rotary_log(), rotary_log()], rotary_rig(), alone=False)
    path = tmp_path / "log.csv"
    rotary_log().save(path)
    assert main(["identify", str(path), "--rig", "paper", "--option", "alone=false"]) == 2
    assert "has no option 'alone'; its options: memory" in capsys.readouterr().err


def test_a_method_is_an_entry_and_a_function(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a new entry reaches: identify, the command, the options, the comparison, what inspect says of a log."""

    def toy(check: MomentumCheck, *, size: float = 1.0, wide: bool = False) -> sw.Result:
        assert check.prepared.rig is rig
        return replace(clean_result(), method="toy")

    entry = Method("toy", lambda: toy, motor="needed", friction="law", speeds="filtered")
    monkeypatch.setitem(METHODS, "toy", entry)
    log, rig = rotary_log(), rotary_rig()
    assert sw.identify(log, rig, "toy", size=2.0).method == "toy"
    assert method_name("toy") == "toy"
    assert list(entry.options()) == ["size", "wide"]
    with pytest.raises(UsageError, check=coded("bad-option", "wide")):
        sw.identify(log, rig, "toy", wide=3)
    with pytest.raises(UsageError, check=coded("unknown-option", "'widr'", "'wide'")):
        sw.identify(log, rig, "toy", widr=True)
    assert assumptions("toy", rig, clean_result()).motor
    assert [one.why for one in services(replace(log, voltage=None), None, "wheel_angle", rig)][-1] == "no voltage"


def test_no_method_is_named_by_a_string_of_code() -> None:
    """No text "module:function" stands in the place of a function."""
    found = [
        f"{path.relative_to(SOURCE)}: {node.value}"
        for path in SOURCE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("swingid.")
        if ":" in node.value and " " not in node.value
    ]
    assert found == []
