"""What is done because of a finding hangs on its kind: neither on its code nor on its words."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from factories import clean_result, rotary_log, rotary_rig
from swingid.calibration.encoders import EncoderCalibration, undeclared
from swingid.errors import NotIdentifiableError, UnanswerableError
from swingid.pooling.several import of_logs, undetermined
from swingid.recording.findings import Finding, Kind
from swingid.result.provenance import add_findings
from swingid.result.result import Message, Parameter, Result
from swingid.units import Quantity


def warned(*warnings: Message) -> Result:
    return replace(clean_result(), warnings=warnings, status="warning" if warnings else "ok")


@pytest.mark.parametrize("kind", [*sorted(undeclared.CAUSES, key=str), Kind.ANGLE_ZERO, None])
def test_logs_calibrate_their_encoders_by_the_kind_of_a_warning(kind: Kind | None, monkeypatch) -> None:
    log, rig = rotary_log(), rotary_rig()
    monkeypatch.setattr(undeclared, "_encoders", lambda logs, rig: (rig, "bent."))
    monkeypatch.setattr(undeclared, "_latency", lambda rig: (rig, "late."))
    asked: list[tuple[Finding, ...]] = []

    def ask(rig, more):
        asked.append(more)
        return warned(Message(more[0].code, more[0].message, more[0].kind))

    # neither code nor words are those of the library
    found = undeclared.calibrated_by_itself(warned(Message("any-code", "any words.", kind)), ask, [log], rig)
    assert len(asked) == (kind in undeclared.CAUSES)
    assert (found.warnings[0].kind is Kind.CALIBRATED) == (kind in undeclared.CAUSES)
    # the codes without a kind lead nowhere
    for code in ("encoder-nonlinearity", "late-channel", "large-nonlinearity"):
        plain = warned(Message(code, "any words."))
        assert undeclared.calibrated_by_itself(plain, ask, [log], rig) is plain


@pytest.mark.parametrize(
    ("after", "settled"),
    [
        (Message("as-before", "x."), True),
        (Message("new", "x."), False),
        (Message("as-before", "x.", Kind.GRAVITY_TORQUE), False),
        (Message("as-before", "x.", Kind.LATE_CHANNEL), False),
    ],
)
def test_what_was_found_counts_only_where_nothing_like_it_is_left(after: Message, settled: bool, monkeypatch) -> None:
    monkeypatch.setattr(undeclared, "_encoders", lambda logs, rig: (rig, "bent."))
    first = warned(Message("a", "x.", Kind.ENCODER_NONLINEARITY), Message("as-before", "x."))
    again = warned(Message("b", "x.", Kind.CALIBRATED), after)
    found = undeclared.calibrated_by_itself(first, lambda rig, more: again, [rotary_log()], rotary_rig())
    assert (found.warnings == again.warnings) == settled


@pytest.mark.parametrize("off", [False, True])
def test_a_latency_that_is_not_corrected_counts_in_neither_step(off: bool, monkeypatch) -> None:
    rig = rotary_rig().changed({"sensors.latency": "2 ± 0.2 ms"})
    log = replace(rotary_log(), repairs_off=frozenset(["latency"] if off else []))
    key, bend = "sensors.wheel.latency", "sensors.nonlinearity_cosine"
    steps: list[float] = []

    def calibrate(logs, given):
        steps.append(given.sensors.latency.value)
        found = {key: Parameter.of(3e-3, 1e-4, "s"), bend: Parameter.of(1e-3, 1e-5, "rad")}
        better = given.changed({key: Quantity(3e-3, 1e-4), bend: Quantity(1e-3, 1e-5)})
        return EncoderCalibration(replace(clean_result(), parameters=found), better, (key, bend))

    def ask(better, more):
        steps.append(better.sensors.of("wheel").latency.value)
        assert (better.sensors.of("wheel").latency.std > 2.9e-3) == off
        return clean_result()

    monkeypatch.setattr(undeclared, "calibrate_encoders", calibrate)
    undeclared.calibrated_by_itself(warned(Message("a", "x.", Kind.ENCODER_NONLINEARITY)), ask, [log], rig)
    assert steps == ([0.0, 0.0] if off else [2e-3, 3e-3])


def test_several_logs_settle_warnings_by_their_kind() -> None:
    one = warned(Message("any", "x.", Kind.NOT_IDENTIFIABLE), Message("other", "y.", Kind.GRAVITY_AND_INERTIA))
    assert of_logs([one], ["a"], settled=True) == []
    assert [(m.code, m.kind) for m in of_logs([one], ["a"], settled=False)] == [
        ("any", Kind.NOT_IDENTIFIABLE),
        ("other", Kind.GRAVITY_AND_INERTIA),
    ]
    assert [m.code for m in of_logs([warned(Message("not-identifiable", "x."))], ["a"], settled=True)]
    with pytest.raises(NotIdentifiableError, match=r"^x\.$") as caught:
        undetermined(one)
    assert isinstance(caught.value, UnanswerableError)
    assert caught.value.code == "not-identifiable"
    undetermined(warned(Message("not-identifiable", "x.")))


def test_a_finding_hands_its_kind_to_the_message_and_no_file_holds_it() -> None:
    log = replace(rotary_log(), findings=(Finding("c", "t.", "warning", kind=Kind.ENCODER_NONLINEARITY),))
    warnings: list[Message] = []
    add_findings(log, warnings, [])
    assert warnings == [Message("c", "t.", Kind.ENCODER_NONLINEARITY)]
    written = json.loads(warned(*warnings).to_json())
    assert written["warnings"] == [{"code": "c", "message": "t."}]
    assert np.isfinite(written["parameters"]["inertia"]["value"])
