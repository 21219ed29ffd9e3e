"""`swingid weigh`: with the body, without it, and the difference."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import live_host
import swingid as sw
from swingid.cli.app import run as swingid

REFERENCE = "sine 0.8 rad 8.5 rad/s"
assert live_host.RIG.axis.inertia is not None


@pytest.mark.long
def test_the_papers_body_on_the_emulator(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inertias = [sw.Rig.load(name).axis.inertia.value for name in ("paper", "paper-body")]
    command = ["weigh", "--rig", "paper", "--loaded", "paper-body", "--reference", REFERENCE]
    assert swingid([*command, "--out", str(tmp_path / "new" / "folder"), "--duration", "15"]) == 0
    folder = tmp_path / "new" / "folder"
    assert sorted(path.name for path in folder.iterdir()) == [
        *("body.json", "loaded.json", "loaded.mcap", "tare.json", "tare.mcap")
    ]
    inertia = json.loads((folder / "body.json").read_text())["parameters"]["inertia"]
    true = inertias[1] - inertias[0]
    assert abs(inertia["value"] / true - 1) < 2e-4
    assert inertia["interval95"][0] <= true <= inertia["interval95"][1]
    said = capsys.readouterr().err
    assert said.index("with the body") < said.index("without the body")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--loaded", "paper"], "are the same"),
        (["--loaded", "paper-body", "--device", "twin://paper"], "leave --device out"),
        (["--loaded", "paper-body", "--duration", "0"], "duration"),
    ],
)
def test_what_is_refused(options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["weigh", "--rig", "paper", "--reference", REFERENCE, "--out", str(tmp_path / "x"), *options]
    assert swingid(command) == 2
    assert words in capsys.readouterr().err


def test_a_real_device_waits_for_a_person(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def closed(*_: object) -> str:
        raise EOFError

    monkeypatch.setattr("builtins.input", closed)
    command = ["weigh", "--rig", "paper", "--loaded", "paper-body", "--reference", REFERENCE, "--out", str(tmp_path)]
    assert swingid([*command, "--device", "tcp://127.0.0.1:1"]) == 2
    said = capsys.readouterr().err
    assert "mount the body" in said
    assert "in a terminal" in said
