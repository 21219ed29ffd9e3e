"""What is imported when: the package and its help must stay light, and heavy packages wait for their use."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from long_cases import quick_first

LOG = ["--reference", "sine 0.8 rad 8.5 rad/s", "--duration", "12"]
HEAVY = {"numpy", "scipy", "numba", "pint", "matplotlib", "pyarrow", "jinja2", "pydantic"}


def imported(code: str, folder: Path) -> set[str]:
    """Names of all modules that a new process has imported after running `code`."""
    program = f"import sys, json\n{code}\nprint('\\n' + json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=folder)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_import_and_help_are_light(tmp_path: Path) -> None:
    for code in ("import swingid", "from swingid.cli import main; assert main(['--help']) == 0"):
        assert imported(code, tmp_path) & HEAVY == set()


@pytest.mark.parametrize("command", ["identify", "simulate", "init"])
def test_help_of_a_command_is_light(tmp_path: Path, command: str) -> None:
    loaded = imported(f"from swingid.cli import main; assert main([{command!r}, '--help']) == 0", tmp_path)
    assert loaded & HEAVY <= {"pydantic"}  # newer versions of typer check arguments with it


def test_import_alone_does_not_even_import_typer(tmp_path: Path) -> None:
    loaded = imported("import swingid; dir(swingid); swingid.__version__", tmp_path)
    assert loaded & {"typer", "rich"} == set()
    assert {name for name in loaded if name.startswith("swingid")} == {"swingid"}


@pytest.mark.parametrize("method", quick_first(1, ["momentum", "energy"]))
def test_methods_import_only_what_they_need(tmp_path: Path, method: str) -> None:
    """Nothing is compiled for them either, which would take seconds in the first process."""
    from swingid.cli import main

    log = tmp_path / "log.csv"
    assert main(["simulate", "--rig", "paper", *LOG, "--out", str(log)]) == 0
    command = ["identify", str(log), "--rig", "paper", "--method", method]
    loaded = imported(f"from swingid.cli import main; assert main({command!r}) == 0", tmp_path)
    assert f"swingid.methods.{method}" in loaded
    assert loaded & {"numba", "scipy", "pandas", "matplotlib", "jinja2", "pint"} == set()
    assert method == "energy" or "swingid.methods.energy" not in loaded  # which is compared with momentum


def test_verbs_are_functions_in_any_order_of_imports(tmp_path: Path) -> None:
    for first in ("import swingid.identification", "from swingid.simulation import simulate", "pass"):
        code = f"""
{first}
import pickle, inspect
import swingid as sw
import swingid.identification as run, swingid.simulation.twin as twin
assert callable(sw.identify) and callable(sw.simulate)
assert inspect.signature(sw.identify) == inspect.signature(run.identify)
assert inspect.signature(sw.simulate) == inspect.signature(twin.simulate)
assert pickle.loads(pickle.dumps(sw.simulate)) is sw.simulate
assert type(sw.identify).__name__ == type(sw.simulate).__name__ == "function"
try:
    sw.identify(None, None, method="magic")
except sw.errors.UsageError as error:
    assert "magic" in str(error)
else:
    raise AssertionError
"""
        imported(code, tmp_path)


def test_unknown_names_are_attribute_errors_and_all_names_exist() -> None:
    import swingid

    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = swingid.nonsense  # type: ignore[attr-defined]
    for name in swingid.__all__:
        assert getattr(swingid, name) is not None
        assert name in dir(swingid)
