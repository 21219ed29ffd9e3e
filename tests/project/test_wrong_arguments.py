"""What is no rig, no log, or no choice is refused by a sentence of our own, whatever function it is given to."""

from __future__ import annotations

import pytest

import swingid as sw
from swingid.errors import UsageError
from twin_logs import given, logged, twin

RIG = given(twin("viscous"))


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return logged(twin("viscous"), tmp_path_factory.mktemp("log"), duration=6.0)


CALLS = [
    ("no-rig", lambda log: sw.identify(log, "paper")),
    ("no-rig", lambda log: sw.compare(log, None)),
    ("no-rig", lambda log: sw.calibrate([log], None)),
    ("no-rig", lambda log: sw.calibrate_encoders([log], 5)),
    ("no-rig", lambda log: sw.design(None, 0.01)),
    ("no-rig", lambda log: sw.rehearse(None, duration=5)),
    ("no-rig", lambda log: sw.simulate(None, duration=5)),
    ("no-rig", lambda log: sw.inspect("log.csv", "paper")),
    ("no-rig", lambda log: sw.Recording.load("log.csv", "paper")),
    ("no-rig", lambda log: sw.Recording.from_columns({"t": [0.0]}, None)),
    ("no-rig", lambda log: sw.validate(None, log, None)),
    ("no-log", lambda log: sw.identify([log, None], RIG)),
    ("no-log", lambda log: sw.identify([], RIG)),
    ("no-log", lambda log: sw.compare([], RIG)),
    ("no-log", lambda log: sw.compare("log.csv", RIG)),
    ("no-log", lambda log: sw.calibrate(None, RIG)),
    ("no-log", lambda log: sw.validate(sw.identify(log, RIG), [], RIG)),
    ("unknown-input", lambda log: sw.validate(sw.identify(log, RIG), log, RIG, input="foo")),
    ("bad-reference", lambda log: sw.parse_reference(None)),
]


@pytest.mark.parametrize(("code", "call"), CALLS)
def test_it_is_refused_by_its_code(log, code, call):
    with pytest.raises(UsageError) as caught:
        call(log)
    assert caught.value.code == code
