"""Differences from files: what can be read, what is refused, the command line, and bodies on the twin."""

from __future__ import annotations

import json
import re
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import swingid as sw
from factories import clean_result, doubtful_result, linear_result, refused_result
from swingid.cli import main
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.errors import InputError, SwingidError
from swingid.result.file import load_result
from swingid.units import Quantity

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "balanced_pendulum.py"
TARE, BODY = sw.Rig.builtin("paper"), sw.Rig.builtin("paper-body")
TRUE_BODY, TRUE_TARE = 96.1e-5, 302.2e-5
STATED = {
    "drive.wheel.inertia": "113.4 ± 0.3 kg*mm^2",
    "drive.motor.torque_per_volt": "52.04e-4 ± 0.3 % N*m/V",
}


def identified(rig: sw.Rig, speed: float, method: str = "momentum", **changes: object) -> sw.Result:
    """A run of the twin, identified with the rig as stated and with `changes`."""
    log = sw.simulate(rig, Sine(0.8, speed), Compensator.paper(rig, sample_time=1e-3), duration=15.0, rate=1000.0)
    hidden = {"axis.inertia": None, "axis.friction": None}
    return sw.identify(log, rig.changed(STATED | hidden | changes), method)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("results")
    for name, rig in (("tare", TARE), ("loaded", BODY)):
        (folder / f"{name}.json").write_text(identified(rig, 8.5).to_json(), encoding="utf-8")
    return folder / "tare.json", folder / "loaded.json"


# on the twin


def test_the_papers_body(files: tuple[Path, Path]) -> None:
    """The paper is 7 % off."""
    body = sw.difference(*files)
    assert body.inertia.value == pytest.approx(TRUE_BODY, rel=1e-4)
    assert abs(body.inertia.value - TRUE_BODY) < 3 * body.inertia.standard_uncertainty
    assert body.inertia.standard_uncertainty < 1e-3 * TRUE_BODY
    assert body.status == "ok"


@pytest.mark.parametrize(("key", "value"), [("drive.wheel.inertia", 11.34e-5), ("axis.gravity_torque", None)])
def test_sensitivities_are_those_of_a_second_identification(key: str, value: float | None) -> None:
    """The signed difference of the budget is what both results do when the constant is changed."""

    def found(step: float) -> sw.Result:
        results = []
        for rig in (TARE, BODY):
            plain = rig.axis.gravity_torque.value if value is None else value
            change = {key: {"value": plain * (1 + step), "std": 1e-3 * plain}}
            results.append(identified(rig, 8.5, **change))
        return sw.difference(*results)

    plain = found(0.0)
    moved = (found(1e-3).inertia.value - found(-1e-3).inertia.value) / 2e-3
    entries = [e for e in plain.budget if e.parameter == "inertia" and e.source.startswith(key)]
    if value is None:  # two constants, both moved
        tare, loaded = (rig.axis.gravity_torque.value for rig in (TARE, BODY))
        slopes = {e.source: e.sensitivity for e in entries}
        assert moved == pytest.approx(slopes[f"{key} (loaded)"] * loaded + slopes[f"{key} (tare)"] * tare, rel=0.02)
    else:
        (entry,) = entries
        assert moved == pytest.approx(entry.sensitivity * value, rel=0.02)


@pytest.mark.parametrize(
    ("method", "key", "wrong", "true", "tolerance"),
    [
        ("momentum", "drive.wheel.inertia", "114.5 ± 0.3 kg*mm^2", 113.4e-6, 2e-4),
        ("energy", "drive.motor.torque_per_volt", "52.3e-4 ± 0.3 % N*m/V", 52.04e-4, 2e-3),
    ],
)
def test_a_known_body_finds_the_constant_that_is_off(
    method: str, key: str, wrong: str, true: float, tolerance: float
) -> None:
    """The balanced pendulum leans on the scale, as in the paper's check."""
    balanced = BODY.changed({"axis.gravity_torque": 0.0})
    runs = [identified(TARE, 8.5, method, **{key: wrong}), identified(balanced, 6.0, method, **{key: wrong})]
    found = sw.difference(*runs, known="961 ± 0.5 kg*mm^2")
    name = {"momentum": "wheel_inertia", "energy": "torque_per_volt"}[method]
    assert found.parameters[name].value == pytest.approx(true, rel=tolerance)
    assert found.parameters["tare_inertia"].value == pytest.approx(TRUE_TARE, rel=10 * tolerance)
    loaded, tare = (found.parameters[f"{which}_inertia"].value for which in ("loaded", "tare"))
    assert loaded - tare == pytest.approx(TRUE_BODY)
    assert abs(runs[0].inertia.value / TRUE_TARE - 1) > 4e-3


def test_the_balanced_pendulum_of_the_examples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), str(tmp_path)])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    printed = capsys.readouterr().out
    assert "(961.0 ± 4.8)e-6 kg m²" in printed
    wheel, spread = map(float, re.findall(r"wheel_inertia: +\(([\d.]+) ± ([\d.]+)\)e-6 kg", printed)[0])
    assert abs(wheel - 113.4) < spread < 0.1
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "balanced.json",
        "balanced.parquet",
        "plain.json",
        "plain.parquet",
    ]


# the command


def test_the_command_writes_an_ordinary_result(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "body.json"
    options = ["--mass", "68.0 ± 0.1 g", "--distance", "117 ± 0.1 mm", "--json", str(target)]
    assert main(["difference", *map(str, files), *options]) == 0
    assert "inertia_about_axis" in capsys.readouterr().out
    read = load_result(target)
    assert read.inertia.value == pytest.approx(TRUE_BODY - 0.068 * 0.117**2, rel=5e-3)
    parts = [entry.standard_uncertainty for entry in read.budget if entry.parameter == "inertia"]
    assert np.sqrt(np.sum(np.square(parts))) == pytest.approx(read.inertia.standard_uncertainty)
    assert read.provenance["tare"]["result"] == str(files[0])  # type: ignore[index]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["{loaded}", "{tare}"], 3),
        (["{tare}", "{tare}"], 3),
        (["{tare}", "none.json"], 3),
        (["{tare}", "{loaded}", "--mass", "1 g"], 2),
        (["{tare}", "{loaded}", "--known", "1 s"], 2),
        (["{tare}"], 2),
        (["{tare}", "{loaded}", "--json", "{tare}"], 2),
        (["{tare}", "{loaded}", "--known", "961 kg*mm^2", "--json", "no/folder.json"], 3),
    ],
)
def test_one_sentence_for_what_cannot_be(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], arguments: list[str], code: int
) -> None:
    given_files = {"tare": str(files[0]), "loaded": str(files[1])}
    assert main(["difference", *(argument.format(**given_files) for argument in arguments)]) == code
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("swingid: ")


def test_a_refusal_is_written_too(files: tuple[Path, Path], tmp_path: Path) -> None:
    target = tmp_path / "r.json"
    assert main(["difference", str(files[1]), str(files[0]), "--json", str(target)]) == 3
    data = json.loads(target.read_text(encoding="utf-8"))
    assert (data["status"], data["error"]["code"]) == ("refused", "swapped")


# result files


@pytest.mark.parametrize("make", [clean_result, doubtful_result, refused_result, linear_result])
def test_a_result_survives_its_file(make: Callable[[], sw.Result], tmp_path: Path) -> None:
    result, path = make(), tmp_path / "r.json"
    path.write_text(result.to_json(), encoding="utf-8")
    read = load_result(path)
    for name in ("method", "status", "parameters", "warnings", "notes", "budget", "error", "sensitivities"):
        assert getattr(read, name) == getattr(result, name)
    assert read.provenance == json.loads(result.to_json())["provenance"]


def data() -> dict[str, Any]:
    return json.loads(clean_result().to_json())


def changed(**keys: object) -> bytes:
    return json.dumps(data() | keys).encode()


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (None, "missing-file"),
        (b"", "not-json"),
        (b"t,q1\n0,0\n", "not-json"),
        (b"PAR1\x00\xff\xfe", "not-a-result"),
        (b"[" * 100_000, "not-json"),
        (b"[1, 2]", "not-a-result"),
        (b"{}", "not-a-result"),
        (b'{"schema": "swingid.compare/1", "results": []}', "not-a-result"),
        (b'{"schema": "swingid.result/2"}', "not-a-result"),
        (b'{"schema": "swingid.result/1", "method": "calibrate", "status": "ok"}', "not-a-result"),
        (b'{"schema": "swingid.result/1"}', "damaged-result"),
        (changed(status="fine"), "damaged-result"),
        (changed(parameters={}), "damaged-result"),
        (changed(parameters={"inertia": {"value": "much", "unit": "kg m^2"}}), "damaged-result"),
        (changed(parameters={"inertia": {"value": 1e999, "unit": "kg m^2"}}), "damaged-result"),
        (changed(parameters={"inertia": {"value": 1.0, "standard_uncertainty": -1, "unit": ""}}), "damaged-result"),
        (changed(budget=[{"source": "a", "type": "C"}]), "damaged-result"),
        (changed(budget=7), "damaged-result"),
        (changed(warnings=["beware"]), "damaged-result"),
        (changed(method=None), "damaged-result"),
    ],
)
def test_wrong_files_are_named_in_one_sentence(tmp_path: Path, content: bytes | None, code: str) -> None:
    path = tmp_path / "r.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_result(path)
    assert caught.value.code == code
    assert str(path) in caught.value.message
    assert "\n" not in caught.value.message


def test_what_is_no_number_of_the_provenance_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    constants = {"g": {"value": 10**400}, "l": {"value": True}, "m": {"value": 2.0, "std": 10**400}}
    notes = [{"code": "segment", "message": "Used from 1 s.", "kind": 3}]
    path.write_bytes(changed(provenance={"constants": constants, "constants_found": {"g": 10**400}}, notes=notes))
    read = load_result(path)
    assert read.origin.constants == {"m": Quantity(2.0, None)}
    assert read.origin.found == {}
    assert read.notes[0].kind is None


def test_a_folder_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="folder"):
        load_result(tmp_path)


PLAIN = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
KEYS = ("parameters", "budget", "warnings", "notes", "provenance", "error", "method", "status", "sensitivities")


@given(key=st.sampled_from(KEYS), value=PLAIN)
@settings(max_examples=150, deadline=None)
def test_no_damage_gets_through_as_another_error(
    tmp_path_factory: pytest.TempPathFactory, key: str, value: Any
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "r.json"
    path.write_text(json.dumps(data() | {key: value}), encoding="utf-8")
    try:
        loaded = load_result(path)
        sw.difference(clean_result(), loaded)
    except SwingidError as error:
        assert error.message.endswith(".")
