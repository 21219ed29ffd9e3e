"""A result lists the consistency checks that were carried out on it, and only these."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import swingid as sw
from swingid.checks.ran import ran, recorded
from swingid.checks.table import CHECKS, TABLE, in_order
from swingid.methods.table import METHODS

SOURCES = [path.read_text(encoding="utf-8") for path in Path(sw.__file__).parent.rglob("*.py")]


def test_checks_are_recorded_inside_the_block_alone() -> None:
    ran("signs")
    with recorded() as outer:
        ran("closure")
        with recorded() as inner:
            ran("signs")
    assert inner == {"signs"}
    assert outer == {"closure"}
    assert in_order({"closure", "signs"}) == ("signs", "closure")


@pytest.mark.parametrize("name", CHECKS)
def test_every_check_is_marked_and_its_codes_exist(name: str) -> None:
    in_table = any(one.check == name for one in TABLE)
    assert sum(len(re.findall(rf'\bran\("{name}"\)', text)) for text in SOURCES) == (0 if in_table else 1)
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
