"""The hypotheses that are tested on the momentum balance of a log, in their order, and the consistency checks in words.

All methods run this table, for angles alone determine whether the zero and the scale of the angle, the gravity torque
against the drive's scale, and the timing of the channels are as stated, whatever a method computes of the same log.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from swingid.balance.parts import unexplained
from swingid.balance.systematics import place_torque
from swingid.checks.angle import ZERO, scale_off, zero_entry, zero_off
from swingid.checks.closure import balance_open
from swingid.checks.hypothesis import Evidence, Hypothesis, Judged, of_log
from swingid.checks.jumps import jump_entry
from swingid.checks.latency import channel_late
from swingid.checks.place import PLACE, place_found, spring_not_stated, torque_computed
from swingid.checks.stability import (
    PARTS,
    disagreeing,
    impulse_fitted,
    mirrored_differ,
    not_predicted,
    slow_changes,
    slow_entries,
)
from swingid.checks.stated import CONFLICT, conflict, encoders_bent, gravity_off
from swingid.checks.wheel import SLIP, slip_entry, wheel_slips
from swingid.recording.findings import JUMPS, Kind
from swingid.result.checked import Checked
from swingid.result.result import Message

ANGLE = ("zero-off", "angle-scale")
"""Codes of contradictions of the angle: each changes the gravity torque too."""

ASIDE = ("zero-off", "wheel-slips", "gravity-torque-disagrees", "encoder-nonlinearity")
"""What may seem to be a torque that depends on the angle; an error of its scale is one that is."""

BIASED = ("torque-computed", "angle-scale", *ASIDE, "place-torque")
"""What leaves residuals of the balance."""

UNDETERMINED = ("gravity-and-inertia", "not-identifiable")
"""What makes parts of a log disagree by little."""

TABLE = (
    # a torque that is commanded may be a spring in software: a note
    Hypothesis("torque", "torque-computed", of_log(torque_computed), "the torque is no linear function of the angle",
               limit="alone", note=True, contradicts=True),
    Hypothesis("angle-zero", "zero-off", zero_off, "zero of the angle",
               limit="angle", kind=Kind.ANGLE_ZERO, contradicts=True,
               entries=lambda evidence, u, of_balance: {ZERO: zero_entry(evidence, u)}),
    Hypothesis("wheel", "wheel-slips", of_log(wheel_slips), "the wheel follows its encoder",
               limit="place", note=True, contradicts=True,
               entries=lambda evidence, u, of_balance: {SLIP: slip_entry(evidence, u)}),
    Hypothesis("angle-scale", "angle-scale", scale_off, "scale of the angle",
               limit="angle", unless=("zero-off", "wheel-slips"), contradicts=True),
    # with the disagreement of windows, which a wrong scale causes, the interval would hide it
    Hypothesis("gravity-torque", "gravity-torque-disagrees",
               of_log(lambda evidence: gravity_off(evidence.law, evidence.tried, evidence.signals, evidence.part.rig)),
               "gravity torque as stated against the log",
               limit="gravity", unless=(*ANGLE, "wheel-slips"), kind=Kind.GRAVITY_TORQUE, contradicts=True,
               entries=lambda evidence, u, of_balance: {CONFLICT: conflict(evidence, u)}),
    Hypothesis("encoders", "encoder-nonlinearity", of_log(encoders_bent),
               "encoder nonlinearity as stated against the log",
               limit="balance", own=True, kind=Kind.ENCODER_NONLINEARITY, contradicts=True),
    Hypothesis("place", "place-torque", place_found, "torques that depend on the angle and are not stated",
               limit="place", unless=("torque-computed", *ASIDE), contradicts=True,
               entries=lambda evidence, u, of_balance: {PLACE: place_torque(evidence.place, u)}),
    Hypothesis("closure", "balance-open", of_log(balance_open), "the balance closes: its residuals are small",
               limit="alone", unless=BIASED, contradicts=True),
    Hypothesis("latency", "late-channel", channel_late, "timing of the channels against each other",
               limit="timing", kind=Kind.LATE_CHANNEL, contradicts=True),
    Hypothesis("period", "period-disagrees", disagreeing("amplitude", "speed", "place"),
               "period against amplitude: the inertia is the same at every size, speed and place of the swings",
               limit="alone", note=True, unless=(*BIASED, "balance-open", "late-channel", *UNDETERMINED)),
    Hypothesis("parts", "parts-disagree", disagreeing("time", "direction", "rise"),
               "parts of the log agree with one another", limit="alone", note=True,
               unless=("period-disagrees", *BIASED, "balance-open", "late-channel", *UNDETERMINED),
               entries=lambda evidence, u, of_balance: {PARTS: unexplained(evidence.parts, u)}),
    Hypothesis("", "reversal-impulse", of_log(impulse_fitted), own=True, note=True),
    Hypothesis("stability", "friction-changes", slow_changes("friction"),
               "friction and zero of the angle do not change within the log",
               limit="alone", note=True, entries=slow_entries),
    Hypothesis("stability", "zero-drifts", slow_changes("zero"), limit="alone", note=True),
    Hypothesis("stability", "second-half-not-predicted", of_log(not_predicted), note=True),
    Hypothesis("stability", "mirrored-parts-differ", mirrored_differ, note=True),
    Hypothesis("", "spring-not-stated", spring_not_stated, note=True),
)  # fmt: skip
"""The hypotheses in the order of their tests: what explains a later one comes first."""

CONTRADICTIONS = tuple(hypothesis.code for hypothesis in TABLE if hypothesis.contradicts)
"""Codes of what a log contradicts in its rig file, each with an entry of the budget that holds the disagreement."""

NAMED = (ZERO, SLIP, CONFLICT, PLACE, PARTS, JUMPS)
"""Sources of the budget that are named by messages, and neither make an answer hopeless nor hide its causes."""


def check_hypotheses(evidence: Evidence, judged: Judged, before: Iterable[str] = ()) -> Checked:
    """The hypotheses; before: codes of warnings before. UnanswerableError where the balance does not close."""
    warnings: list[Message] = []
    notes: list[Message] = []
    ran: list[str] = []
    seen = set(before)
    for hypothesis in TABLE:
        if seen.intersection(hypothesis.unless) or (hypothesis.own and not judged.own):
            continue
        findings = hypothesis.test(evidence, judged)
        if findings is None:
            continue
        if hypothesis.check:
            ran.append(hypothesis.check)
        for finding in findings:
            message = Message(hypothesis.code, finding.text, hypothesis.kind)
            if hypothesis.limit and judged.matters(finding.change, hypothesis.limit):
                (notes if finding.contained else warnings).append(message)
                seen.add(hypothesis.code)
            elif hypothesis.note:
                notes.append(message)
    return Checked(tuple(warnings), tuple(notes), tuple(ran))


def entries(evidence: Evidence, u: float, *, of_balance: bool) -> dict[str, float]:
    """Standard uncertainties of the inertia by source, of an estimate whose type A is `u`.

    Of the hypotheses, and of what was found when the log was read. Each source is there for every log. of_balance: see
    `Judged.own`.
    """
    spreads = {
        source: spread for hypothesis in TABLE for source, spread in hypothesis.entries(evidence, u, of_balance).items()
    }
    return spreads | {JUMPS: jump_entry(evidence)}


@dataclass(frozen=True)
class Check:
    """A consistency check in words, and the codes of the messages by which it reports a finding."""

    words: str
    codes: tuple[str, ...]


def _checks(table: Sequence[Hypothesis]) -> dict[str, Check]:
    """The checks of a table by name."""
    names = dict.fromkeys(hypothesis.check for hypothesis in table if hypothesis.check)
    rows = {name: [hypothesis for hypothesis in table if hypothesis.check == name] for name in names}
    return {
        name: Check(hypotheses[0].words, tuple(hypothesis.code for hypothesis in hypotheses))
        for name, hypotheses in rows.items()
    }


CHECKS = {
    "signs": Check("signs of the channels: inertia and gravity torque are positive", ()),
    "identifiability": Check(
        "identifiability: the motion determines the parameters", ("gravity-and-inertia", "near-resonance")
    ),
    "motor": Check(
        "equation (II): wheel angle, sign of the voltage and motor constants",
        ("voltage-sign", "wheel-angle-reading", "motor-balance", "drive-held"),
    ),
    **_checks(TABLE),
    "momentum": Check(
        "agreement with the answer of the momentum method", ("disagrees-with-momentum", "not-compared-with-momentum")
    ),
    "saturation": Check("saturation of the voltage", ("voltage-saturated",)),
}
"""The checks by name, in the order of a report."""


def in_order(names: Collection[str]) -> tuple[str, ...]:
    """Names of checks in the order of `CHECKS`."""
    return tuple(name for name in CHECKS if name in names)
