"""The published schemas fit every example that we ship, and refuse what the program refuses."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

import factories
import swingid as sw
from swingid.cli.app import run
from swingid.exchange.schemas import SCHEMAS, schema
from swingid.result.result import refusal

jsonschema = pytest.importorskip("jsonschema", reason="needs jsonschema")

ROOT = Path(__file__).resolve().parents[2]
RIGS = [
    *ROOT.glob("examples/rigs/*.toml"),
    *ROOT.glob("benchmarks/strangers/rigs/*.toml"),
    *ROOT.glob("src/swingid/model/rig/builtin/*.toml"),
]
PLANS = [*ROOT.glob("src/swingid/study/campaign/plans/*.toml")]


def check(name: str, document: Any) -> None:
    jsonschema.Draft202012Validator(schema(name)).validate(document)


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_schema_is_one(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(schema(name))
    assert run(["schema", name]) == 0
    assert json.loads(capsys.readouterr().out) == schema(name)


def test_every_rig_and_every_plan_fits() -> None:
    assert len(RIGS) > 40
    assert len(PLANS) >= 8
    for name, paths in (("rig", RIGS), ("plan", PLANS)):
        validator = jsonschema.Draft202012Validator(schema(name))
        for path in paths:
            validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    "text",
    [
        factories.ROTARY,
        factories.LINEAR,
        factories.FREE,
        factories.FREE.replace('name = "arm"', ""),
        factories.FREE.replace("gravity_torque = 0.204", 'gravity_torque = "unknown"\nstiffness = "0 ± 0.01 N*m/rad"'),
        factories.FREE + "[axis.cogging]\namplitude = 1e-3\norder = 6\nphase = 0\n",
    ],
)
def test_further_terms_and_unknown_constants_fit(text: str) -> None:
    sw.Rig.from_text(text)
    check("rig", tomllib.loads(text))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[axis]", "[axis]\ngravity_tork = 1"),
        ("[axis]", "[axes]"),
        ('kind = "none"', 'kind = "nothing"'),
        ("gravity_torque = 0.204", "gravity_torque = true"),
        ("[drive]", "[axis.friction]\nviskous = 1\n[drive]"),
    ],
)
def test_what_the_program_refuses_the_schema_refuses(old: str, new: str) -> None:
    text = factories.FREE.replace(old, new)
    with pytest.raises(sw.errors.InputError):
        sw.Rig.from_text(text)
    with pytest.raises(jsonschema.ValidationError):
        check("rig", tomllib.loads(text))


def test_results_fit() -> None:
    made = [factories.clean_result(), factories.doubtful_result(), factories.refused_result()]
    made += [factories.linear_result(), factories.free_result()]
    made.append(refusal("momentum", sw.errors.InputError("x", code="y"), {"log": "a"}))
    for result in made:
        check("result", json.loads(result.to_json()))
    document = json.loads(made[0].to_json())
    for broken in (document | {"schema": "swingid.result/2"}, document | {"status": "fine"}, {"method": "momentum"}):
        with pytest.raises(jsonschema.ValidationError):
            check("result", broken)
    del document["parameters"]["inertia"]["unit"]
    with pytest.raises(jsonschema.ValidationError):
        check("result", document)


def test_keys_say_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    found = schema("rig")["$defs"]
    assert found["Motor"]["properties"]["gear_ratio"]["description"] == "rotor turns per wheel turn N"
    assert run(["schema", "log"]) == 2
    assert "result" in capsys.readouterr().err
