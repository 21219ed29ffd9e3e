"""`swingid doctor` names what lacks and what to do; completion and the end of the demo work as printed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from swingid.cli import doctor as module
from swingid.cli.app import run
from swingid.cli.doctor import Finding, diagnose

ROOT = Path(__file__).resolve().parents[2]


def found(what: str) -> Finding:
    return next(one for one in diagnose().findings if one.what == what)


def test_it_lists_versions_extras_folders_and_ports(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["schema"] == "swingid.doctor/1"
    groups = [one["group"] for one in data["findings"]]
    assert list(dict.fromkeys(groups)) == ["versions", "extras", "folders", "ports"]
    assert {"swingid", "numpy", "python"} <= {one["what"] for one in data["findings"]}
    assert run(["doctor"]) == 0
    assert "[[versions]]" in capsys.readouterr().out


def test_a_missing_extra_has_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_installed", lambda package: False)
    extra = found("formats")
    assert extra.level == "note"
    assert "h5py" in extra.found
    assert extra.remedy.startswith("pip install 'swingid[formats]'")


def test_a_command_that_is_not_on_path_is_named_with_its_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.shutil, "which", lambda name: None)
    assert str(Path(sys.executable).parent) in found("command").remedy


def test_a_folder_that_takes_no_file_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(tmp_path / "gone"))
    one = found("temporary folder")
    assert one.level == "fault"
    assert one.remedy
    assert "1 fault" in diagnose().summary()


@pytest.mark.skipif(os.name != "posix", reason="permissions of ports are those of POSIX")
def test_a_port_without_permission_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("serialx", reason="needs pip install 'swingid[live]'")
    from swingid.live.devices import serial_port

    port = tmp_path / "ttyACM0"
    port.touch()
    monkeypatch.setattr(serial_port, "ports", lambda: [str(port)])
    assert found(str(port)).level == "ok"
    monkeypatch.setattr(module.os, "access", lambda path, mode: False)
    one = found(str(port))
    assert (one.level, one.found) == ("fault", "permission denied")
    assert "usermod" in one.remedy


def test_a_shell_completes_commands_and_options() -> None:
    code = "import sys; sys.argv = ['swingid']; from swingid.cli import main; main()"
    for words, count, expected in (("swingid ide", 1, "identify"), ("swingid identify --monte", 2, "--monte-carlo")):
        own = os.environ | {"_SWINGID_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(count)}
        done = subprocess.run([sys.executable, "-c", code], env=own, capture_output=True, text=True, check=True)
        assert expected in done.stdout.split()


def test_the_demo_draws_a_curve_and_names_a_command_that_exists(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import demo

    assert demo.picture([0.0, 1.0], width=1, height=1) == ["\u2848"]  # lowest dot at the left, highest at the right
    done = subprocess.run([*demo.program().split(), "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("swingid ")
