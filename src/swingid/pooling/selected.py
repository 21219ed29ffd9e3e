"""Parts of a log: those that a user selects, and the free decays of a log in which a body is released several times."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from swingid.errors import SwingidError, UnanswerableError, UsageError
from swingid.model.rig import Rig
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.preparation.reference import turns_freely
from swingid.preparation.segment import free_decays
from swingid.recording.large import LargeLog
from swingid.recording.recording import Recording
from swingid.result.data import PartValue
from swingid.result.result import Message, Result

Log = Recording | LargeLog
Logs = Log | Sequence[Log] | Mapping[str, Log | SwingidError]
Span = tuple[float, float]
"""Start and stop (s) of a part; infinite where it is open."""

WORTH = 0.1
"""Share of the motion of the largest decay, as the sum of its swings, below which another adds nothing: its weight is
below 1 %."""


RELEASED = 1.2
"""Times the last swing of a decay that the first of the next one has after a release; less is a touch or noise, and the
one with more motion is used."""


def parts_of(part: object) -> list[Span]:
    """The parts to use: none for None, of one as (3, 20) or "3:20", of several as [(3, 20), (40, 61)]; in that order.

    Raises UsageError for what is no part, ends before it begins, or shares rows with another.
    """
    if part is None:
        return []
    single = isinstance(part, str) or (
        isinstance(part, Sequence) and len(part) == 2 and not any(isinstance(edge, str | Sequence) for edge in part)
    )
    if not isinstance(part, Sequence):
        raise _no_part(part)
    spans = [_span(single_part) for single_part in ([part] if single else part)]
    for (start, stop), (begin, end) in pairwise(sorted(spans)):
        if begin < stop:
            text = f"the parts {_text(start, stop)} and {_text(begin, end)} overlap, and a row counts once; part them."
            raise UsageError(text, code="bad-part")
    return spans


def _span(part: object) -> Span:
    ends = list(part.split(":") if isinstance(part, str) else part) if isinstance(part, Sequence) else []
    if len(ends) != 2:
        raise _no_part(part)
    try:
        start, stop = (float(end) if end != "" else sign * math.inf for end, sign in zip(ends, (-1, 1), strict=True))
    except (TypeError, ValueError):
        raise _no_part(part) from None
    if start >= stop:
        raise UsageError(
            f"the part {_text(start, stop)} ends before it begins; write FROM:TO in seconds, the earlier time first.",
            code="bad-part",
        )
    if not start < stop:  # not a number
        raise _no_part(part)
    return start, stop


def _no_part(part: object) -> UsageError:
    shown = part if isinstance(part, str) else repr(part)
    return UsageError(f"{shown} is no part: write FROM:TO in seconds, such as 0:4.5.", code="bad-part")


def _text(start: float, stop: float) -> str:
    """Write the part as it is given to --part."""
    return ":".join("" if math.isinf(end) else f"{end:g}" for end in (start, stop))


def selected(log: Log, span: Span) -> Log:
    """The rows of a part, all of which are to be used; of a LargeLog that with this part where it is large as well.

    Raises UnanswerableError where there are none.
    """
    if isinstance(log, Recording):
        return replace(log.segment(*span), selected=True)
    part = replace(log, span=span)
    small = part.small()
    return part if small is None else replace(small, selected=True)


def decays_of(log: Recording, spans: Sequence[Span]) -> dict[str, Recording]:
    """The parts of a log that were found, by name; their ends are still to be chosen."""
    return {name: replace(part, selected=False) for name, part in _by_part(log, spans).items()}


def _by_part(log: Log, spans: Sequence[Span]) -> dict[str, Recording]:
    return {_text(*span): part for span, part in zip(spans, each_part([log], spans), strict=True)}


def in_parts(log: Logs, spans: Sequence[Span]) -> Log | dict[str, Log | SwingidError]:
    """The parts of a log, or of each of several: one log, or several by name; errors in the place of logs stay.

    Raises UnanswerableError for a part without rows, UsageError for several of a log that is read in parts itself.
    """
    from swingid.pooling.several import logs_by_name

    if isinstance(log, Recording | LargeLog):
        return selected(log, spans[0]) if len(spans) == 1 else dict(_by_part(log, spans))
    by_name: dict[str, Log | SwingidError] = {}
    for name, each in logs_by_name(log).items():
        if isinstance(each, SwingidError):
            by_name[name] = each
        elif len(spans) == 1:
            by_name[name] = selected(each, spans[0])
        else:
            by_name |= {f"{name} {part}": rows for part, rows in _by_part(each, spans).items()}
    return by_name


def each_part(logs: Sequence[Log], spans: Sequence[Span]) -> list[Recording]:
    """Every part of every log, with the part beside its path where there are several.

    Raises UsageError for one that is too large to be read whole.
    """
    parts = []
    for log in logs:
        for span in spans:
            part = selected(log, span)
            if not isinstance(part, Recording):
                text = f"the part {_text(*span)} is too large to be one of several; identify it by itself."
                raise UsageError(text, code="too-large")
            path = part.source.path if len(spans) == 1 else f"{part.source.path or 'log'} {_text(*span)}"
            parts.append(replace(part, source=replace(part.source, path=path)))
    return parts


def releases(log: Recording, rig: Rig) -> list[Span]:
    """The free decays of a log in which a body is released several times, with `WORTH` of the motion of the largest.

    None where there is one, where a part was selected, where something drives the axis or no swings are expected.
    """
    if log.selected or rig.drive.channel is not None or turns_freely(rig):
        return []
    try:
        motion = find_motion(log.time, log.angle, channel_noise(log, rig).angle)
        spans = free_decays(motion, float(log.time[0]), float(log.time[-1]))
    except UnanswerableError:
        return []  # the method says why
    sizes = {span: motion.within(*span).swing_sizes for span in spans}
    kept_spans: list[Span] = []
    for span in spans:
        again = not kept_spans or sizes[span][0] > RELEASED * sizes[kept_spans[-1]][-1]
        if again or sizes[span].sum() > sizes[kept_spans[-1]].sum():
            kept_spans = [*(kept_spans if again else kept_spans[:-1]), span]
    largest = max(sizes[span].sum() for span in kept_spans)
    kept = [span for span in kept_spans if sizes[span].sum() > WORTH * largest]
    return kept if len(kept) > 1 else []


def with_parts(result: Result, spans: Sequence[Span], each: Sequence[Result]) -> Result:
    """The result with the values of its parts in `per_part`; each: the results of the parts alone."""
    rows = []
    for (start, stop), result_of_part in zip(spans, each, strict=True):
        leading = result_of_part.parameters.get(result.leading)
        value, u = (None, None) if leading is None else (leading.value, leading.standard_uncertainty)
        rows.append(PartValue(start, stop, value, u, result_of_part.status))
    return replace(result, per_part=tuple(rows))


def of_releases(result: Result, spans: Sequence[Span], refused: int) -> Result:
    """The result of the free decays of one log, with a note that names them."""
    listed = ", ".join(f"{start:.4g} to {stop:.4g} s" for start, stop in spans)
    text = f"{len(spans)} free decays were found in the log and used as parts: {listed}"
    text += f"; {refused} more gave no number." if refused else "."
    return replace(result, notes=(Message("releases", text), *result.notes))
