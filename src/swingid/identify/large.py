"""A log that is read in parts: each identified by the ordinary method, then one answer."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from swingid.errors import InputError, SwingidError, UsageError
from swingid.identify.combine.parts import Part, combine_parts
from swingid.identify.result import Result
from swingid.recording.large import LARGE, LargeLog
from swingid.recording.recording import Recording

IN_PARTS = ("momentum", "energy")
"""Methods whose answers of parts can be pooled."""


def require_in_parts(log: LargeLog, method: str) -> None:
    """Raise UsageError where a method does not read logs of this size."""
    if method not in IN_PARTS:
        message = f"{log.path} has {log.rows} rows, which {method} does not read in parts; take a part of it with "
        message += f"--part FROM:TO (up to {LARGE} rows), or the method {' or '.join(IN_PARTS)}."
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
        return Part(start, stop, rows, recording.averaged, identify_one(recording))
    except UsageError:
        raise
    except SwingidError as error:
        return Part(start, stop, rows, recording.averaged, error)
