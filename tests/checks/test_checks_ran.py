"""A result lists the consistency checks that were carried out on it, and only these."""

from __future__ import annotations

from pathlib import Path

import pytest

import swingid as sw
from swingid.checks.table import CHECKS, in_order
from swingid.methods.table import METHODS
from swingid.result.checked import noted, warned
from swingid.result.data import Message

SOURCES = [path.read_text(encoding="utf-8") for path in Path(sw.__file__).parent.rglob("*.py")]


def test_checks_add_up_in_the_order_of_the_table() -> None:
    both = warned(Message("a", "x."), ran="closure") + noted(Message("b", "y."), ran="signs")
    assert [message.code for message in (*both.warnings, *both.notes)] == ["a", "b"]
    assert in_order(both.ran) == ("signs", "closure")


@pytest.mark.parametrize("name", CHECKS)
def test_the_codes_of_every_check_exist(name: str) -> None:
    for code in CHECKS[name].codes:
        assert any(f'"{code}"' in text for text in SOURCES), code


@pytest.fixture(scope="module")
def log() -> sw.Recording:
    rig = sw.Rig.load("paper")
    motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    return sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=12.0, rate=1000.0, seed=1)


@pytest.mark.parametrize("method", METHODS)
def test_a_driven_log_is_checked_by_every_method(log: sw.Recording, method: str) -> None:
    result = sw.identify(log, sw.Rig.load("paper"), method=method)
    assert result.details is not None
    names = set(result.details.checks)
    assert names >= {"identifiability", "motor", "angle-zero", "closure", "parts", "stability"}
    assert ("momentum" in names) == (method != "momentum")
    assert result.to_dict()["details"]["checks"] == list(result.details.checks)  # type: ignore[index]


def test_a_free_decay_has_no_motor_to_check() -> None:
    rig = sw.Rig.from_text('name = "arm"\n[axis]\ngravity_torque = 0.2\ninertia = 3e-3\n[drive]\nkind = "none"\n')
    log = sw.simulate(rig, duration=12.0, rate=500.0, initial_angle=0.8)
    result = sw.identify(log, rig)
    assert result.details is not None
    assert "signs" in result.details.checks
    assert not {"motor", "gravity-torque", "latency", "encoders"} & set(result.details.checks)
