"""A large log read in parts: each identified by the ordinary method, then pooled as several logs are."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from swingid.errors import InputError, SwingidError, UsageError
from swingid.format import percent
from swingid.methods.table import METHODS, Method
from swingid.pooling.consistency import outliers
from swingid.pooling.joint import PAIR, Pairs, is_joint, outlying_pair, pool_pair
from swingid.pooling.pooling import BETWEEN, Pooled, pool
from swingid.pooling.several import SINGLE, conditioning, estimates_of
from swingid.pooling.shares import Estimate, sum_of
from swingid.recording.large import LARGE, LargeLog
from swingid.recording.recording import Recording
from swingid.result.result import Details, Message, Result, SwingSeries
from swingid.uncertainty.budget import BudgetEntry, Parameter, systematic
from swingid.uncertainty.freedom import effective_freedom

BETWEEN_PARTS = "scatter between the parts"

AVERAGED = "averaging of rows"

AVERAGE_OUT = ("momentum",)
"""Methods whose scatter falls with the number of parts. Energy's smoothed speeds err alike in all of them, at the level
of one part's scatter, so there its scatter counts as shared."""

OFTEN = 0.1
"""Share of the parts from which on their warning is a warning of the whole; below it becomes a note."""

JUDGED = 48
"""Groups of successive parts, at most, of which each is held against the others."""

OF_A_PART = ("segment", "friction-per-log")
"""Notes that say nothing of the whole."""

DRAWN = 2000
"""Swings, at most, that the result keeps for drawing."""


def require_in_parts(log: LargeLog, method: Method) -> None:
    """Raise UsageError where a method does not read logs of this size."""
    if not method.in_parts:
        able = [one.name for one in METHODS.values() if one.in_parts]
        message = f"{log.path} has {log.rows} rows, which {method.name} does not read in parts; take a part of it with "
        message += f"--part FROM:TO (up to {LARGE} rows), or the method {' or '.join(able)}."
        raise UsageError(message, code="too-large")


def identify_large(log: LargeLog, identify_one: Callable[[Recording], Result]) -> Result:
    """Identify a large log part by part in bounded memory; the parts are pooled as several logs are.

    identify_one: from a recording to its result. Raises InputError where the file cannot be used; where no part has a
    number, the error of the first.
    """
    found: list[Part] = []
    with ThreadPoolExecutor(2) as pool:
        digest = pool.submit(log.sha256)
        iterator = log.parts()
        ahead = pool.submit(next, iterator, None)
        before = 0
        while (read := ahead.result()) is not None:
            ahead = pool.submit(next, iterator, None)  # the next part is read while this one is identified
            rows, recording = read
            found.append(_part(recording, rows - before, identify_one))
            before = rows
            if log.progress is not None:
                log.progress(rows, log.rows)
        sha256 = digest.result()
    if not found:
        raise InputError(f"{log.path} has no rows of numbers in the part that is to be used.", code="empty-file")
    result = combine_parts(found)
    return replace(result, provenance=result.provenance | {"log": log.path, "log_sha256": sha256})


def _part(recording: Recording | SwingidError, rows: int, identify_one: Callable[[Recording], Result]) -> Part:
    if not isinstance(recording, Recording):
        return Part(float("nan"), float("nan"), rows, 1, recording)
    start, stop = float(recording.time[0]), float(recording.time[-1])
    try:
        result = identify_one(recording)
        return Part(start, stop, rows, recording.averaged, result, _smear(recording, result))
    except UsageError:
        raise
    except SwingidError as error:
        return Part(start, stop, rows, recording.averaged, error)


def _smear(log: Recording, result: Result) -> float:
    """Relative error of the inertia, at most, by averaging rows: of the terms that are not linear in the angles.

    The mean of sin q1 (and of friction) over a block of width w is that of the mean angle less (q1' w)²/24 of it
    (Taylor); the gravity is b/(J ω²) times the inertia's term.
    """
    if log.averaged == 1:
        return 0.0
    steps = np.diff(log.time)
    peak = float(np.quantile(np.abs(np.diff(log.angle) / steps), 0.99))
    frequency = 2 * peak / max(float(np.ptp(log.angle)), 1e-300)
    width = float(np.median(steps))
    gravity = result.parameters.get("gravity_torque")
    stated = result.provenance.get("constants", {})
    b = gravity.value if gravity is not None else _value(stated, "axis.gravity_torque")
    size = peak if b else frequency  # without gravity the motion's size is none in angles
    share = abs(b) / max(abs(result.inertia.value) * frequency**2, 1e-300)
    return (size * width) ** 2 / 24 * max(1.0, share)


def _value(constants: object, key: str) -> float:
    found = constants.get(key) if isinstance(constants, dict) else None
    value = found.get("value") if isinstance(found, dict) else None
    return float(value) if value is not None else 0.0


@dataclass(frozen=True)
class Part:
    """A part of a log: begin and end (s), rows of the log, rows averaged into one, its result or why it has none.

    smear: relative error of the inertia, at most, by what does not average exactly (see `smear`).
    """

    start: float
    stop: float
    rows: int
    averaged: int
    result: Result | SwingidError
    smear: float = 0.0

    @property
    def name(self) -> str:
        """'30 s to 60 s'."""
        return f"{self.start:.6g} s to {self.stop:.6g} s"


def combine_parts(parts: Sequence[Part]) -> Result:
    """The common answer of the parts of one log, by one method; inertia, gravity torque and friction are pooled.

    Friction is that of the parts that chose the commonest law. A warning of few parts is a note. Raises the error of
    the first part where none has a number, UnanswerableError where all together do not distinguish inertia from gravity
    torque.
    """
    found = [(part, part.result) for part in parts if isinstance(part.result, Result)]
    certain = [(part, result) for part, result in found if result.inertia.standard_uncertainty is not None]
    if not found:
        raise next(part.result for part in parts if isinstance(part.result, SwingidError))
    kept = certain or found[:1]
    results = [result for _, result in kept]
    if certain:
        pooled = _pooled(results)
        units = {name: parameter.unit for result in results for name, parameter in result.parameters.items()}
        parameters = {name: one.parameter(units[name]) for name, one in pooled.items()}
        budget = tuple(entry for name, one in pooled.items() for entry in _entries(name, one))
        budget, parameters = _with_averaging(budget, parameters, max(part.smear for part, _ in kept))
    else:
        pooled, parameters, budget = {}, results[0].parameters, results[0].budget
    joint = bool(results[0].covariance)
    warnings = conditioning(parameters["inertia"], budget) if joint and len(results) > 1 else []
    said, notes = _said(results, len(parts), settled=joint and len(results) > 1)
    warnings += [*said, *_apart(kept, joint=joint)]
    notes = [_note(parts, kept, pooled), *notes, *_without(parts)]
    return Result(
        method=results[0].method,
        status="warning" if warnings else "ok",
        parameters=parameters,
        warnings=tuple(warnings),
        notes=tuple(notes),
        budget=budget,
        provenance=_provenance(parts, results),
        details=_details(kept),
        sensitivities={} if joint or not pooled else _sensitivities(results, pooled["inertia"]),
        covariance=Pairs.of(results, estimates_of(results, "per-log")).common_covariance() if joint else {},
    )


def _pooled(results: Sequence[Result]) -> dict[str, Pooled]:
    """Inertia and gravity torque of all parts, friction of those with the commonest law."""
    estimates = _estimates(results, "per-log")
    pooled = {name: pool(each) for name, each in estimates.items()}
    if is_joint(results):
        pooled |= pool_pair(Pairs.of(results, estimates))
    laws = Counter(tuple(name for name in result.parameters if name not in PAIR) for result in results)
    law = laws.most_common(1)[0][0]
    alike = [result for result in results if tuple(name for name in result.parameters if name not in PAIR) == law]
    friction = {name: each for name, each in _estimates(alike, "shared").items() if name not in PAIR}
    return pooled | {name: pool(each) for name, each in friction.items()}


def _estimates(results: Sequence[Result], friction: str) -> dict[str, list[Estimate]]:
    return estimates_of(results, friction, scatter_is_shared=results[0].method not in AVERAGE_OUT)


def _with_averaging(
    budget: tuple[BudgetEntry, ...], parameters: dict[str, Parameter], smear: float
) -> tuple[tuple[BudgetEntry, ...], dict[str, Parameter]]:
    """Budget and parameters with what averaging rows does to the inertia: anywhere within ± smear (GUM 4.3.7)."""
    inertia = parameters["inertia"]
    if smear == 0.0 or inertia.standard_uncertainty is None or inertia.interval95 is None:
        return budget, parameters
    entry = BudgetEntry(systematic(AVERAGED, "rectangular"), "inertia", float(abs(inertia.value) * smear / 3**0.5))
    own, more = inertia.standard_uncertainty, entry.standard_uncertainty
    freedom = effective_freedom(((own, inertia.degrees_of_freedom), (more, math.inf)))
    whole = Parameter.of(inertia.value, math.hypot(own, more), inertia.unit, freedom)
    return (*budget, entry), parameters | {"inertia": whole}


def _entries(name: str, pooled: Pooled) -> list[BudgetEntry]:
    """The budget of one parameter, the scatter named for what it is here."""
    share = pooled.estimate.shares.get(BETWEEN)
    if share is None:
        return pooled.estimate.entries(name)
    renamed = replace(share, source=replace(share.source, name=BETWEEN_PARTS))
    return replace(pooled.estimate, shares=pooled.estimate.shares | {BETWEEN: renamed}).entries(name)


def _said(results: Sequence[Result], count: int, *, settled: bool) -> tuple[list[Message], list[Message]]:
    """What the parts say, each kind once: as a warning where many parts warn of it, else as a note."""
    left_out = SINGLE if settled else set()
    warnings: list[Message] = []
    notes: list[Message] = []
    for code, texts in _kinds([[m for m in one.warnings if m.kind not in left_out] for one in results]).items():
        message = Message(code, f"in {len(texts)} of {count} parts of the log, such as: {texts[0]}")
        (warnings if len(texts) >= OFTEN * count else notes).append(message)
    for code, texts in _kinds([result.notes for result in results]).items():
        if code not in OF_A_PART:
            alike = len(texts) == len(results) and len(set(texts)) == 1
            text = texts[0] if alike else f"in {len(texts)} of {count} parts of the log, such as: {texts[0]}"
            notes.append(Message(code, text))
    return warnings, notes


def _kinds(said: Sequence[Sequence[Message]]) -> dict[str, list[str]]:
    """By code: the first message of each part that has one."""
    kinds: dict[str, list[str]] = {}
    for messages in said:
        for code in dict.fromkeys(message.code for message in messages):
            kinds.setdefault(code, []).append(next(m.message for m in messages if m.code == code))
    return kinds


def _apart(kept: Sequence[tuple[Part, Result]], *, joint: bool) -> list[Message]:
    """A warning that names the parts that disagree with the rest in the inertia (in the pair, where that is sought)."""
    advice = "look at the log there, or leave it out with --part; the uncertainty holds the scatter"
    if joint:
        found = outlying_pair(Pairs.of([r for _, r in kept], estimates_of([r for _, r in kept], "per-log")))
        if found is None:
            return []
        name = kept[found[0]][0].name
        text = f"the part from {name} is inconsistent with the others in inertia and gravity torque; {advice}."
        return [Message("parts-disagree", text)]
    size = -(-len(kept) // JUDGED)
    groups = [kept[k : k + size] for k in range(0, len(kept), size)]
    if any(result.inertia.standard_uncertainty is None for _, result in kept):
        return []
    all_of_them = estimates_of([result for _, result in kept], "per-log")["inertia"]
    estimates = [_mean(all_of_them[k : k + size]) for k in range(0, len(kept), size)]
    named = outliers(estimates)
    if not named:
        return []
    listed = ", ".join(
        f"{groups[d.log][0][0].start:.6g} s to {groups[d.log][-1][0].stop:.6g} s "
        f"({percent(d.value / (estimates[d.log].value - d.value), sign=True)})"
        for d in named[:5]
    )
    more = f" and {len(named) - 5} more" if len(named) > 5 else ""
    return [
        Message("parts-disagree", f"the inertia is inconsistent with the other parts from {listed}{more}; {advice}.")
    ]


def _mean(estimates: Sequence[Estimate]) -> Estimate:
    return estimates[0] if len(estimates) == 1 else sum_of(estimates, pool(estimates).weights)


def _note(parts: Sequence[Part], kept: Sequence[tuple[Part, Result]], pooled: dict[str, Pooled]) -> Message:
    """How the log was read, and how its parts scatter."""
    blocks = sorted({part.averaged for part in parts})
    text = f"the log was read in {len(parts)} parts, {len(kept)} of which have a number"
    if blocks != [1]:
        lengths = f"{blocks[0]}" if len(blocks) == 1 else f"{blocks[0]} to {blocks[-1]}"
        text += f"; {lengths} rows were averaged into one, which shortens no swing to less than 300 of them"
    inertia = pooled.get("inertia")
    if inertia is not None and len(kept) > 1:
        scatter = "no scatter between the parts beyond that within them"
        if inertia.between > 0:
            scatter = f"scatter between the parts {percent(inertia.between / abs(inertia.estimate.value))}"
        text += f"; {scatter}"
    return Message("read-in-parts", f"{text}; what the parts share does not average out.")


def _without(parts: Sequence[Part]) -> list[Message]:
    """One note for each reason why parts have no number."""
    reasons: dict[str, list[Part]] = {}
    for part in parts:
        if isinstance(part.result, SwingidError):
            reasons.setdefault(part.result.code, []).append(part)
    return [
        Message(
            "parts-without-number",
            f"{len(alike)} of {len(parts)} parts have no number, such as that from {alike[0].name}: "
            f"{alike[0].result.message if isinstance(alike[0].result, SwingidError) else ''}",
        )
        for alike in reasons.values()
    ]


def _provenance(parts: Sequence[Part], results: Sequence[Result]) -> dict[str, object]:
    """That of the first part, with the rows and the repairs of all and a line for each."""
    lines = []
    for part in parts:
        line: dict[str, object] = {"start": part.start, "stop": part.stop, "rows": part.rows, "averaged": part.averaged}
        if isinstance(part.result, Result):
            inertia = part.result.inertia
            line |= {"inertia": inertia.value, "standard_uncertainty": inertia.standard_uncertainty}
        else:
            line |= {"refused": part.result.code}
        lines.append(line)
    whole: dict[str, object] = {"rows": sum(part.rows for part in parts), "repairs": _repairs(results), "parts": lines}
    return results[0].provenance | whole


def _repairs(results: Sequence[Result]) -> list[dict[str, object]]:
    """Every repair once, with the number of parts in which it was made."""
    found: dict[tuple[object, object], list[object]] = {}
    for result in results:
        repairs = result.provenance.get("repairs")
        own = {(one["repair"], one["done"]): one["what"] for one in repairs} if isinstance(repairs, list) else {}
        for key, what in own.items():
            found.setdefault(key, []).append(what)
    return [
        {"repair": name, "done": done, "what": f"in {len(whats)} of {len(results)} parts, such as: {whats[0]}"}
        for (name, done), whats in found.items()
    ]


def _details(kept: Sequence[tuple[Part, Result]]) -> Details | None:
    """Turning points and swings of all parts, the friction of the one in the middle of their inertias."""
    found = [result.details for _, result in kept if result.details is not None]
    if not found:
        return None
    values = [result.inertia.value for _, result in kept if result.details is not None]
    middle = found[int(np.argsort(values)[len(values) // 2])]
    swings = [details.swings for details in found if details.swings is not None]
    series = None
    if swings:
        every = -(-sum(len(one.times) for one in swings) // DRAWN)
        names = ("times", "sides", "values", "uncertainties")
        series = SwingSeries(*(np.concatenate([getattr(one, name) for one in swings])[::every] for name in names))
    return Details(
        start=found[0].start,
        stop=found[-1].stop,
        turning_times=np.concatenate([details.turning_times for details in found]),
        turning_angles=np.concatenate([details.turning_angles for details in found]),
        window=middle.window,
        swings=series,
        friction=middle.friction,
    )


def _sensitivities(results: Sequence[Result], inertia: Pooled) -> dict[str, float]:
    keys = [key for key in results[0].sensitivities if all(key in result.sensitivities for result in results)]
    return {
        key: float(sum(w * r.sensitivities[key] for w, r in zip(inertia.weights, results, strict=True))) for key in keys
    }
