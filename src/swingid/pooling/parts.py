"""The results of the parts of a large log, pooled as those of several logs are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.errors import SwingidError
from swingid.format import percent
from swingid.pooling.joint import PAIR, Common, Pairs, estimates_of, outlying_pair
from swingid.pooling.pooling import outliers, pool
from swingid.pooling.several import SHARED_STAY, SINGLE, conditioning, scatter_of
from swingid.result.result import Details, Message, Result, SwingSeries
from swingid.uncertainty.budget import Evaluated, systematic
from swingid.uncertainty.uncertain import Uncertain, weighted_sum

BETWEEN_PARTS = "scatter between the parts"

AVERAGED = "averaging of rows"

AVERAGE_OUT = ("momentum",)
"""Methods whose scatter averages out over the parts. The errors of energy's smoothed speeds are alike in all parts, at
the level of one part's scatter, so there its scatter counts as shared."""

OFTEN = 0.1
"""Share of the parts from which on their warning is a warning of the whole; below it becomes a note."""

GROUPS = 48
"""Groups of successive parts, at most, of which each is compared with the others."""

OF_A_PART = ("segment", "friction-per-log")
"""Notes that hold for a part only."""

DRAWN = 2000
"""Swings, at most, that the result keeps for drawing."""


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
    """The common result of the parts of one log, by one method; inertia, gravity torque and friction are pooled.

    Friction is that of the parts that chose the commonest law. A warning of few parts is a note. Raises the error of
    the first part where none has a number, UnanswerableError where all together do not distinguish inertia from gravity
    torque.
    """
    answered = [(part, part.result) for part in parts if isinstance(part.result, Result)]
    certain = [(part, result) for part, result in answered if result.inertia.standard_uncertainty is not None]
    if not answered:
        raise next(part.result for part in parts if isinstance(part.result, SwingidError))
    kept = certain or answered[:1]
    results = [result for _, result in kept]
    joined, common = None, results[0]
    if certain:
        shared = results[0].method not in AVERAGE_OUT
        joined = Common.of(results, _of_one_law(results), between=BETWEEN_PARTS, scatter_is_shared=shared)
        common = _with_averaging(joined.result(), max(part.smear for part, _ in kept))
    pairs = None if joined is None else joined.pairs
    settled = pairs is not None and len(results) > 1
    warnings = conditioning(common.inertia, common.budget) if settled else []
    of_parts, notes = _messages(results, len(parts), settled=settled)
    warnings += [*of_parts, *_inconsistent(kept, pairs)]
    return replace(
        common,
        status="warning" if warnings else "ok",
        warnings=tuple(warnings),
        notes=(_note(parts, kept, joined), *notes, *_without(parts)),
        provenance=_provenance(parts, results),
        details=_details(kept),
    )


def _of_one_law(results: Sequence[Result]) -> list[int]:
    """The parts that chose the commonest friction law."""
    laws = [tuple(name for name in result.parameters if name not in PAIR) for result in results]
    law = Counter(laws).most_common(1)[0][0]
    return [k for k, law_of_part in enumerate(laws) if law_of_part == law]


def _with_averaging(common: Result, smear: float) -> Result:
    """Add the effect of averaging rows on the inertia: anywhere within ± smear (GUM 4.3.7)."""
    more = float(abs(common.inertia.value) * smear / 3**0.5)
    evaluated = Evaluated(common.parameters, list(common.budget), common.correlation)
    evaluated = evaluated.widened(systematic(AVERAGED, "rectangular"), "inertia", more)
    return replace(
        common, budget=tuple(evaluated.budget), parameters=evaluated.parameters, correlation=evaluated.correlation
    )


def _messages(results: Sequence[Result], count: int, *, settled: bool) -> tuple[list[Message], list[Message]]:
    """Warnings and notes of the parts, each code once: as a warning where many parts have it, else as a note."""
    left_out = SINGLE if settled else set()
    warnings: list[Message] = []
    notes: list[Message] = []
    for code, texts in _by_code([[m for m in result.warnings if m.kind not in left_out] for result in results]).items():
        message = Message(code, f"in {len(texts)} of {count} parts of the log, such as: {texts[0]}")
        (warnings if len(texts) >= OFTEN * count else notes).append(message)
    for code, texts in _by_code([result.notes for result in results]).items():
        if code not in OF_A_PART:
            alike = len(texts) == len(results) and len(set(texts)) == 1
            text = texts[0] if alike else f"in {len(texts)} of {count} parts of the log, such as: {texts[0]}"
            notes.append(Message(code, text))
    return warnings, notes


def _by_code(messages: Sequence[Sequence[Message]]) -> dict[str, list[str]]:
    """Return by its code the first message of each part that has one."""
    by_code: dict[str, list[str]] = {}
    for of_part in messages:
        first = {message.code: message.message for message in reversed(of_part)}
        for code in dict.fromkeys(message.code for message in of_part):
            by_code.setdefault(code, []).append(first[code])
    return by_code


def _inconsistent(kept: Sequence[tuple[Part, Result]], pairs: Pairs | None) -> list[Message]:
    """A warning that names the parts that are inconsistent with the rest in the inertia (in the pair, if estimated)."""
    advice = "look at the log there, or exclude it with --part; the uncertainty contains the scatter"
    if pairs is not None:
        pair = outlying_pair(pairs)
        if pair is None:
            return []
        name = kept[pair[0]][0].name
        text = f"the part from {name} is inconsistent with the others in inertia and gravity torque; {advice}."
        return [Message("parts-disagree", text)]
    if any(result.inertia.standard_uncertainty is None for _, result in kept):
        return []
    size = -(-len(kept) // GROUPS)
    each = estimates_of([result for _, result in kept], "inertia")
    estimates = [_mean(each[k : k + size]) for k in range(0, len(kept), size)]
    named = outliers(estimates)
    if not named:
        return []
    listed = ", ".join(
        f"{kept[d.index * size][0].start:.6g} s to {kept[: (d.index + 1) * size][-1][0].stop:.6g} s "
        f"({percent(d.value / (estimates[d.index].value - d.value), sign=True)})"
        for d in named[:5]
    )
    more = f" and {len(named) - 5} more" if len(named) > 5 else ""
    text = f"the inertia is inconsistent with the other parts from {listed}{more}; {advice}."
    return [Message("parts-disagree", text)]


def _mean(estimates: Sequence[Uncertain]) -> Uncertain:
    return estimates[0] if len(estimates) == 1 else weighted_sum(estimates, pool(estimates).weights)


def _note(parts: Sequence[Part], kept: Sequence[tuple[Part, Result]], joined: Common | None) -> Message:
    """How the log was read, and the scatter of its parts."""
    blocks = sorted({part.averaged for part in parts})
    text = f"the log was read in {len(parts)} parts, {len(kept)} of which have a number"
    if blocks != [1]:
        lengths = f"{blocks[0]}" if len(blocks) == 1 else f"{blocks[0]} to {blocks[-1]}"
        text += f"; {lengths} rows were averaged into one, which shortens no swing to less than 300 of them"
    if joined is not None and len(kept) > 1:
        text += f"; {scatter_of(joined.pooled['inertia'], 'parts')}"
    return Message("read-in-parts", f"{text}; {SHARED_STAY.format('parts')}")


def _without(parts: Sequence[Part]) -> list[Message]:
    """One note for each reason why parts have no number."""
    errors = [(part, part.result) for part in parts if isinstance(part.result, SwingidError)]
    reasons: dict[str, list[tuple[Part, SwingidError]]] = {}
    for part, error in errors:
        reasons.setdefault(error.code, []).append((part, error))
    texts = [
        f"{len(alike)} of {len(parts)} parts have no number, such as that from {alike[0][0].name}: "
        f"{alike[0][1].message}"
        for alike in reasons.values()
    ]
    return [Message("parts-without-number", text) for text in texts]


def _provenance(parts: Sequence[Part], results: Sequence[Result]) -> dict[str, object]:
    """Return the provenance of the first part, with the rows and the repairs of all and a line for each."""
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
    by_repair: dict[tuple[object, object], list[object]] = {}
    for result in results:
        repairs = result.provenance.get("repairs")
        done_in_part = (
            {(repair["repair"], repair["done"]): repair["what"] for repair in repairs}
            if isinstance(repairs, list)
            else {}
        )
        for key, what in done_in_part.items():
            by_repair.setdefault(key, []).append(what)
    return [
        {"repair": name, "done": done, "what": f"in {len(whats)} of {len(results)} parts, such as: {whats[0]}"}
        for (name, done), whats in by_repair.items()
    ]


def _details(kept: Sequence[tuple[Part, Result]]) -> Details | None:
    """Turning points and swings of all parts, the friction of the one in the middle of their inertias."""
    each = [result.details for _, result in kept if result.details is not None]
    if not each:
        return None
    values = [result.inertia.value for _, result in kept if result.details is not None]
    middle = each[int(np.argsort(values)[len(values) // 2])]
    swings = [details.swings for details in each if details.swings is not None]
    series = None
    if swings:
        every = -(-sum(len(of_part.times) for of_part in swings) // DRAWN)
        names = ("times", "sides", "values", "uncertainties")
        series = SwingSeries(
            *(np.concatenate([getattr(of_part, name) for of_part in swings])[::every] for name in names)
        )
    return Details(
        start=each[0].start,
        stop=each[-1].stop,
        turning_times=np.concatenate([details.turning_times for details in each]),
        turning_angles=np.concatenate([details.turning_angles for details in each]),
        window=middle.window,
        swings=series,
        friction=middle.friction,
    )
