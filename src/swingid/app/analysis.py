"""What the page computes, as plain data: in a process of its own, so that the page never waits for a method."""

from __future__ import annotations

import asyncio
import multiprocessing
import signal
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from swingid.errors import SwingidError, UnanswerableError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.model.rig.fields import SECONDS
from swingid.numerics.arrays import Array
from swingid.pooling.selected import in_parts, releases
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.processes import end_with_parent, end_workers, interruption_waits
from swingid.recording.formats import read_table
from swingid.recording.formats.csv import without_lines
from swingid.recording.inspect import describe, guess_roles
from swingid.recording.inspect.candidates import counts_ticks
from swingid.recording.large import first_rows, is_large
from swingid.recording.load import read_bytes
from swingid.recording.recording import Recording
from swingid.report.style import envelope
from swingid.result.result import Result, refusal
from swingid.study.changes import Times, changed
from swingid.study.inspect.inspection import range_of

Factors = Mapping[str, float]
"""Multiples of constants by their dotted keys."""

RIG = "rig.toml"
"""What sentences call the rig file that grows on the page."""

STOPPED = "stopped"
"""Code of what a person has ended."""

BINS = 2500
"""Parts of a log whose smallest and largest values are drawn: more than a screen has columns."""

COARSE = 700
"""The same for a first look at a column."""

PLAYED, MOST_PLAYED = 60.0, 12_000
"""Rows per second of a track, as a screen draws them, and rows at most: of a longer log its first 200 s."""

DIGITS = 4
"""Decimals (s) of the ends of a part, as they are shown and written."""

DECAY = """
name = "twin"
[axis]
gravity_torque = 78e-3
inertia = 302.2e-5
friction = {viscous = 2e-4, coulomb = 4e-4}
[drive]
kind = "none"
[sensors]
counts_per_turn = 16384
"""
"""The rig of the example of a free decay."""


@dataclass(frozen=True, slots=True)
class Case:
    """What is to be identified: (name, path) of each log, the text of rig.toml, parts (s) of a single log.

    added: inertia of the known body on the axis in each log, () for none.
    """

    logs: tuple[tuple[str, str], ...]
    rig: str
    parts: tuple[tuple[float, float], ...] = ()
    added: tuple[str, ...] = ()
    source: str = RIG


class Analyst:
    """Two worker processes, so that a slow method does not hold up a slider; they end with this process."""

    def __init__(self) -> None:
        self._pool = _pool()

    async def do(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The value of function(*arguments), computed in a worker; raises what it raises.

        Raises UnanswerableError where `stop`, or something else, has ended the worker.
        """
        pool = self._pool
        try:
            with interruption_waits():  # this starts the workers
                future = asyncio.get_running_loop().run_in_executor(pool, function, *arguments)
            return await future
        except BrokenExecutor:
            if pool is not self._pool:
                raise UnanswerableError("stopped from the page", code=STOPPED) from None
            self.stop()
            text = "a worker process was ended, perhaps for want of memory; free some, or use a shorter part of the log"
            raise UnanswerableError(text, code="lost-workers") from None

    def stop(self) -> None:
        """End all that is being computed."""
        before, self._pool = self._pool, _pool()
        _end(before)

    def close(self) -> None:
        """End the workers without waiting for them."""
        _end(self._pool)


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)


def _end(pool: ProcessPoolExecutor) -> None:
    end_workers(pool)
    pool.shutdown(wait=False)


def _begin() -> None:
    """End this worker where its parent dies, and not by a Ctrl-C in the terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


@np.errstate(over="ignore", invalid="ignore")  # absurd numbers are drawn as they are, and no cause to print
def looked(path: str, skip: int = 0) -> dict[str, Any]:
    """Columns of a file as they stand there, thinned for drawing, and the guess of their roles; skip: lines of a text
    above its table.

    Raises InputError where it is no table.
    """
    table = first_rows(path) if is_large(path) else read_table(without_lines(read_bytes(path), skip, None, path), path)
    columns = describe(table)
    roles = guess_roles(columns)
    clock = roles.found.get("time")
    named = {column.name: column for column in columns}
    stamps = np.arange(float(max((len(column.values) for column in columns), default=0)))
    if clock is not None:
        stamps = named[clock.column].values * SECONDS[clock.unit]
    timed = clock is not None and not counts_ticks(clock.column)
    drawn = {}
    for column in columns:
        numbers = column.kind in ("numbers", "whole numbers") and len(column.values) == len(stamps)
        drawn[column.name] = {
            "unit": column.unit,
            "what": roles.others.get(column.name, ""),
            "range": range_of(column),
            "drawn": envelope(stamps, column.values, COARSE) if numbers and not column.constant else None,
        }
    moving = next((roles.found[role] for role in ("angle", "angle_speed") if role in roles.found), None)
    return {
        "columns": drawn,
        "roles": {
            name: vars(role) if hasattr(role, "__dict__") else asdict(role) for name, role in roles.found.items()
        },
        "skip": skip,
        "ticks": clock is not None and not timed,
        "is_named": any(column.name != f"column{k}" for k, column in enumerate(columns, start=1)),
        "zero_up": roles.zero_up,
        "linear": roles.linear,
        "rows": len(stamps),
        "duration": float(np.nanmax(stamps) - np.nanmin(stamps)) if len(stamps) and timed else 0.0,
        "returns": moving is None or _returns(named[moving.column].values, moving.role),
    }


def _returns(values: Array, role: str) -> bool:
    """Return whether an angle goes back and forth, or a rate changes its sign."""
    good = values[np.isfinite(values)]
    if len(good) < 3:
        return True
    if role == "angle_speed":
        low, high = np.quantile(good, (0.05, 0.95))
        return bool(low < -0.1 * high and high > -0.1 * low)
    return float(np.ptp(good)) > 1.05 * abs(float(good[-1] - good[0])) or float(np.ptp(good)) == 0.0


def sketched(case: Case) -> dict[str, Any]:
    """What the page draws of the first log, thinned: (name, unit, times (n,), values (n,)) of each channel, the angle
    first; first and last time (s), turning points, and the free decays where a body is released several times.
    """
    plant, recordings = _loaded(case, _changed_at(case))
    recording = recordings[case.logs[0][0]]
    linear = plant.axis.kind == "linear"
    channels = [
        ("position", "m", recording.angle) if linear else ("angle", "rad", recording.angle),
        ("wheel", "rad", recording.wheel_angle),
        ("voltage", "V", recording.voltage),
        ("force", "N", recording.torque) if linear else ("torque", "N m", recording.torque),
    ]
    t = recording.time
    drawn = [(name, unit, *envelope(t, values, BINS)) for name, unit, values in channels if values is not None]
    motion = find_motion(t, recording.angle, channel_noise(recording, plant).angle)
    return {
        "channels": drawn,
        "first": float(t[0]),
        "last": float(t[-1]),
        "track": track_of(t, recording.angle, recording.wheel_angle),
        "turning": (motion.turning_times, motion.turning_angles),
        "releases": [(round(a, DIGITS), round(b, DIGITS)) for a, b in releases(recording, plant)],
    }


def track_of(time: Array, angle: Array, wheel: Array | None = None) -> dict[str, Any]:
    """Angle (rad or m) and wheel (rad), each (n,) over time (n,), evenly spaced for playing; scale: largest reach."""
    count = int(min(max((time[-1] - time[0]) * PLAYED, 2), MOST_PLAYED))
    even = time[0] + np.arange(count) / PLAYED
    good = np.isfinite(angle)
    if not good.any():
        time, angle, good = time[:1], np.zeros(1), np.ones(1, bool)
    middle = float(np.mean(angle[good]))
    track = {
        "first": float(time[0]),
        "step": 1 / PLAYED,
        "angles": np.round(np.interp(even, time[good], angle[good]), 4).tolist(),
        "scale": float(np.abs(angle[good] - middle).max(initial=0.0)) or 1.0,
    }
    if wheel is not None and (known := np.isfinite(wheel)).any():
        track["wheel"] = np.round(np.interp(even, time[known], wheel[known]), 3).tolist()
    return track


def inspected(case: Case) -> dict[str, Any]:
    """Findings of `swingid inspect` on the first log, as its JSON."""
    from swingid.study.inspect import inspect_log

    inspection = inspect_log(case.logs[0][1], Rig.from_text(case.rig, case.source))
    plain: dict[str, Any] = named({**inspection.to_dict(), "verdict": vars(inspection.verdict)}, case)
    return plain


def answered(case: Case, method: str, factors: Factors) -> Result:
    """A result; a refusal has the status "refused" and its reason in `error`."""
    result: Result = named(_answer(case, method, factors), case)
    return result


def reported(case: Case, method: str, factors: Factors, ending: str) -> bytes:
    """The report of a result, the content of a file of this ending (".html", ".pdf")."""
    from swingid.report import write_report

    plant, logs = _given(case, factors)
    result = answered(case, method, factors)
    drawn = in_parts(logs, case.parts) if len(case.parts) == 1 else logs
    if isinstance(drawn, Recording):
        drawn = replace(drawn, source=named(drawn.source, case))
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"report{ending}"
        write_report(result, drawn if isinstance(drawn, Recording) else None, plant, path)
        return path.read_bytes()


def example(name: str, path: str) -> None:
    """Write the log of an example of the page, made by the twin, as CSV with the angle in degrees."""
    from swingid.control.references import parse_reference
    from swingid.simulation import simulate

    rows: dict[str, Array | None]
    if name == "wheel":
        log = simulate(Rig.load("paper"), parse_reference("sine 0.8 rad 8.5 rad/s"), duration=20.0, seed=1)
        rows = {
            "t_s": log.time,
            "pendulum_deg": np.degrees(log.angle),
            "wheel_rad": log.wheel_angle,
            "volts": log.voltage,
        }
    else:
        log = simulate(Rig.from_text(DECAY), duration=40.0, initial_angle=1.2, rate=200.0, seed=2)
        rows = {}
    rows = {"t_s": log.time, "pendulum_deg": np.degrees(log.angle), **rows}
    columns = [np.asarray(values) for values in rows.values()]
    np.savetxt(path, np.column_stack(columns), fmt="%.7g", delimiter=",", header=",".join(rows), comments="")


def named(value: Any, case: Case) -> Any:
    """The same with the names of the logs in the place of their paths."""
    if isinstance(value, str):
        for name, path in case.logs:
            value = value.replace(path, name)
        return value
    if isinstance(value, dict):
        return {key: named(inner, case) for key, inner in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{field.name: named(getattr(value, field.name), case) for field in fields(value)})
    return type(value)(named(entry, case) for entry in value) if isinstance(value, list | tuple) else value


def _answer(case: Case, method: str, factors: Factors) -> Result:
    try:
        plant, logs = _given(case, factors)
        more = {"added": list(case.added)} if any(case.added) else {}
        return identify(logs, plant, method, part=case.parts, **more)
    except SwingidError as error:
        return refusal(method, error)


def _given(case: Case, factors: Factors) -> tuple[Rig, Recording | dict[str, Recording]]:
    plant, recordings = _loaded(case, _changed_at(case))
    other = {key: Times(factor) for key, factor in factors.items() if factor != 1.0}
    if other:
        plant = changed(plant, other)
        recordings = {name: Recording.load(path, plant) for name, path in case.logs}
    return plant, recordings if len(recordings) > 1 else recordings[case.logs[0][0]]


def _changed_at(case: Case) -> tuple[int, ...]:
    """When the files were changed, ns; 0 for a file that is gone, which its reader refuses."""

    def at(path: str) -> int:
        try:
            return Path(path).stat().st_mtime_ns
        except OSError:
            return 0

    return tuple(at(path) for _, path in case.logs)


def _loaded(case: Case, changed: tuple[int, ...]) -> tuple[Rig, dict[str, Recording]]:
    return _read(case.logs, case.rig, case.source, changed)


@lru_cache(4)
def _read(
    logs: tuple[tuple[str, str], ...], rig: str, source: str, _changed: tuple[int, ...]
) -> tuple[Rig, dict[str, Recording]]:
    plant = Rig.from_text(rig, source)
    return plant, {name: Recording.load(path, plant) for name, path in logs}
