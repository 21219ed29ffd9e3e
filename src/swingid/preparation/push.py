"""External disturbance torques (pushes) on the axis, as of a hand: found in the balance of a driven log and excluded.

Equation (I) holds for any motion, so the transient after a push is as good as the rest; only while the torque acts is
it violated. A push is a residual of the balance that occurs once: those by friction, wrong constants, latency or
encoders repeat with every swing. See `quick_balance` for the regressors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.format import number, percent
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.preparation.encoders import Correction, Origin
from swingid.recording.recording import CHANNELS, Finding, Recording

if TYPE_CHECKING:
    from swingid.preparation.quick_balance import QuickBalance


REPAIR = "push"
LEFT_IN = "push-left"

SCATTERS = 8.0
"""Robust standard deviations of the windows that a push exceeds."""

NOISES = 4.0
"""Times the noise of the sensors that it exceeds, for windows so short span few steps of a coarse encoder."""

SHARE = 0.01
"""Of the largest drive or gravity that it exceeds: the error of constants and laws."""

SWINGS = 4.0
"""Times the worst window of a swing, on two thirds of the swings, that it exceeds: that repeats with every swing."""

FRICTION, AT_REST = 0.4, 1.5
"""Of the friction that it exceeds, in motion and near a reversal: lack of fit of the friction may be as large once."""

MOST = 6
"""Number of pushes above which the residuals have another cause."""

MOST_TIME = 0.25
"""Share of the log that pushes may take."""

BLUNT = 0.05
"""Share of the largest drive or gravity: a push of that size is not detected, and there may be more of them."""

BLIND = 0.15
"""The same, from which on the pushes found are a small part of all, and are not excluded."""

LEAST = 0.25
"""Of the time of a swing that is excluded at least, so that methods do not interpolate over the gap."""

OTHER = ("jumps", "spikes-left")
"""Findings of a log that is not searched: wrong readings are not distinguishable from pushes."""


@dataclass(frozen=True)
class Push:
    """Start and stop (s) of a disturbance torque, and its largest mean over a window (N m or N, signed).

    unseen: the largest push, as a share of the largest drive or gravity, that is not detected at that place.
    """

    start: float
    stop: float
    torque: float
    unseen: float


def without_pushes(log: Recording, rig: Rig) -> Recording:
    """The log of `push_decided`."""
    return push_decided(log, rig)[0]


def push_decided(log: Recording, rig: Rig) -> tuple[Recording, tuple[Correction, ...]]:
    """The log without the rows while a push acts, with a note among its findings, and the decision on each push.

    Where the repair "push" is switched off, where most pushes are not detectable, and where there are too many to be
    pushes, the rows stay, with a warning. Unchanged where there is none and where it was done before.
    """
    if REPAIR in log.done or any(finding.code in OTHER for finding in log.findings):
        return log, tuple(Correction("rows", "push", None, None, unit(rig), "found", *span) for span in log.left_out)
    pushes = find_pushes(log, rig)
    if not pushes:
        return log, ()
    reason = _reason_to_leave(pushes, log)
    if reason:
        finding = Finding(LEFT_IN, f"{_listed(pushes, rig)}{reason}", "warning", spans=_spans(pushes))
        log = replace(log, findings=(*log.findings, finding), done=log.done | {REPAIR})
        return log, _corrections(pushes, rig, "switched off")
    acts = np.zeros(len(log), dtype=bool)
    for push in pushes:
        acts |= (log.time >= push.start) & (log.time <= push.stop)
    unseen = max(push.unseen for push in pushes)
    message = f"{_listed(pushes, rig)}; {np.count_nonzero(acts)} of {len(log)} rows were excluded, those after it "
    message += "were used"
    if unseen > BLUNT:
        message += f"; {_smaller(unseen)}, so rather use a part without pushes (--part FROM:TO)"
    level: Literal["note", "warning"] = "warning" if unseen > BLUNT else "note"
    finding = Finding(REPAIR, f"{message}.", level, REPAIR, spans=_spans(pushes))
    kept = {name: values[~acts] for name in CHANNELS if (values := getattr(log, name)) is not None}
    findings, done, spans = (*log.findings, finding), log.done | {REPAIR}, np.array(finding.spans)
    log = replace(log, findings=findings, done=done, left_out=spans, **kept)
    return log, _corrections(pushes, rig, "found")


def _spans(pushes: list[Push]) -> tuple[tuple[float, float], ...]:
    return tuple((push.start, push.stop) for push in pushes)


def _reason_to_leave(pushes: list[Push], log: Recording) -> str:
    """Why the rows stay, as a clause after the list of pushes; empty where they are excluded."""
    unseen = max(push.unseen for push in pushes)
    lost = sum(push.stop - push.start for push in pushes)
    if REPAIR in log.repairs_off:
        return "; these rows were used, as this repair is switched off, and bias the balance."
    if len(pushes) > MOST or lost > MOST_TIME * log.duration:
        return (
            f"; {len(pushes)} times, {percent(lost / log.duration)} of the log, is more than is excluded (at most "
            f"{MOST} times and {percent(MOST_TIME)}), so nothing was: use a part without "
            "pushes (--part FROM:TO), and check the constants and channels of the rig."
        )
    if unseen > BLIND:
        return f"; {_smaller(unseen)}, so nothing was excluded: use a part without pushes (--part FROM:TO)."
    return ""


def _smaller(unseen: float) -> str:
    return f"pushes of less than {percent(unseen)} of the largest torque are not detectable"


def _corrections(pushes: list[Push], rig: Rig, origin: Origin) -> tuple[Correction, ...]:
    of = unit(rig)
    return tuple(Correction("rows", "push", push.torque, None, of, origin, push.start, push.stop) for push in pushes)


def unit(rig: Rig) -> str:
    """Unit of a torque or force."""
    return "N" if rig.axis.kind == "linear" else "N m"


def _listed(pushes: list[Push], rig: Rig) -> str:
    """Times and torques of the pushes."""
    of = Equation.of(rig).shown(unit(rig))
    parts = [f"{push.start:.4g} to {push.stop:.4g} s ({number(push.torque, of, digits=2)})" for push in pushes[:MOST]]
    if len(pushes) > MOST:
        parts.append(f"{len(pushes) - MOST} times more")
    listed = parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
    return f"an external torque (push) acts on the axis from {listed}"


def find_pushes(log: Recording, rig: Rig) -> list[Push]:
    """Pushes in a driven log, in the order of time, however many; none where the balance does not show any."""
    from swingid.preparation.quick_balance import quick_balance

    balance = quick_balance(log, rig)
    if balance is None:
        return []
    size, usual, expected = _sizes(balance)
    windows = np.flatnonzero(size > expected)
    if len(windows) == 0:
        return []
    quiet = _quiet(balance, max(usual, 3 * balance.scatter))
    around = [_around(k, balance, quiet, float(expected[k]), log) for k in _peaks(windows, size, quiet)]
    return _merged(around, balance.half)


def _quiet(balance: QuickBalance, least: float) -> Bools:
    """Windows at which a push ends: with a residual below this (N m or N), or beside a change of sign."""
    quiet: Bools = np.abs(balance.torque) < least
    turns = np.signbit(balance.torque[1:]) != np.signbit(balance.torque[:-1])
    quiet[1:] |= turns
    quiet[:-1] |= turns
    return quiet


def _sizes(balance: QuickBalance) -> tuple[Array, float, Array]:
    """Residual of each window in motion, its worst value in most swings, and the threshold of a push."""
    moving = balance.usable & ~balance.rests
    size = np.where(moving, np.abs(balance.torque), 0.0)
    usual = _worst_of_swings(balance, size, moving)
    chance = max(SCATTERS * balance.scatter, NOISES * balance.noise, SWINGS * usual)
    law = balance.friction * np.where(balance.slow, AT_REST, FRICTION)
    return size, usual, chance + np.maximum(law, SHARE * balance.largest)


def _worst_of_swings(balance: QuickBalance, size: Array, moving: Bools) -> float:
    """The largest value of a swing that two thirds of the swings do not exceed."""
    width = balance.times[1] - balance.times[0]
    bins = max(round(np.pi * balance.turn / width), 1)
    swings = len(size) // bins
    if swings == 0:
        return 0.0
    worst = size[: swings * bins].reshape(swings, bins).max(axis=1)
    worst = worst[moving[: swings * bins].reshape(swings, bins).any(axis=1)]
    return float(np.sort(worst)[2 * len(worst) // 3]) if len(worst) else 0.0


def _peaks(candidates: Ints, size: Array, quiet: Bools) -> list[int]:
    """The largest window of every run of candidates without a quiet one between."""
    runs = np.cumsum(quiet)[candidates]
    return [int(places[np.argmax(size[places])]) for places in (candidates[runs == run] for run in np.unique(runs))]


def _around(k: int, balance: QuickBalance, quiet: Bools, unseen: float, log: Recording) -> Push:
    """The push whose largest window is the k-th: to the first quiet window on each side, or the end of the log."""
    before, after = np.flatnonzero(quiet[:k]), np.flatnonzero(quiet[k:])
    start = float(balance.times[before[-1]]) if len(before) else float(log.time[0])
    stop = float(balance.times[k + after[0]]) if len(after) else float(log.time[-1])
    short = LEAST * np.pi * balance.turn - (stop - start)
    if short > 0:
        start, stop = start - short / 2, stop + short / 2
    return Push(start, stop, float(balance.torque[k]), unseen / balance.largest)


def _merged(pushes: list[Push], apart: float) -> list[Push]:
    """Pushes in order; those less than `apart` (s) apart, which windows do not resolve, as one."""
    result: list[Push] = []
    for push in sorted(pushes, key=lambda push: push.start):
        if not result or push.start > result[-1].stop + apart:
            result.append(push)
            continue
        last = result[-1]
        torque, unseen = max(last.torque, push.torque, key=abs), max(last.unseen, push.unseen)
        result[-1] = Push(last.start, max(last.stop, push.stop), torque, unseen)
    return result
