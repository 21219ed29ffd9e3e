"""A log that is read in parts: each identified by the ordinary method, then one answer."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from swingid.errors import InputError, SwingidError, UsageError
from swingid.pooling.parts import Part, combine_parts
from swingid.recording.large import LARGE, LargeLog
from swingid.recording.recording import Recording
from swingid.result.result import Result

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
