"""Checks of each channel: its steps, noise, limits, whether it is constant; and what was repaired on reading."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from swingid.format import noise_of, number
from swingid.preparation.motion import sample_noise
from swingid.preparation.noise import EVEN, uneven_noise
from swingid.recording.findings import OFF
from swingid.recording.grid import is_decimal
from swingid.recording.inspect import Check, Column, Level
from swingid.recording.recording import Recording

COARSE = 0.2
"""Steps of an encoder per typical change between rows above which it is called coarse."""

CLIPPED = 0.01
"""Share of rows at the limits from which on a command counts as saturated."""

MOSTLY = 0.5
USER: dict[str, tuple[Level, str]] = {
    "jumps": ("advice", "use the part of the log on one side of the jump (--part FROM:TO)"),
    "lost-rows": ("advice", "log the time of each row"),
    "wheel-still": ("advice", "check the wheel's encoder"),
    "ambiguous-turns": ("advice", "log the angles faster, or continuous over turns"),
    "slow-rows": ("repair", 'set time_unit = "ms" under [log] if the clock counts ms'),
}
"""What only the user can do, by the code of what was found on reading."""

OWN = {
    "blanks": "rows without usable numbers",
    "sort": "rows in the wrong place",
    "repeats": "repeated rows",
    "clock": "stamps that scatter",
    "unwrap": "angles within one turn",
    "spikes": "spikes",
    "lost-rows": "rows lost where the time is made of the row number",
    "limit": "commands beyond the voltage limit",
    "zero": "the zero of a free decay",
    "push": "external disturbance torques (pushes)",
}
"""What swingid itself repairs on reading, by the name of the repair."""

ELSEWHERE = ("gaps", "repeated-rows", "no-reference", "encoder-grid")
"""What other checks report with more numbers, or what is no matter here."""

ONE_TURN = 2 * np.pi


@dataclass(frozen=True)
class Channel:
    """A column in its role, and the factor from its units to SI."""

    role: str
    column: Column
    factor: float
    unit: str

    @property
    def word(self) -> str:
        """The role in words."""
        return self.role.replace("_", " ")

    @property
    def rotary(self) -> bool:
        """Return whether it is an angle."""
        return self.unit == "rad"

    @property
    def step(self) -> float:
        """The column's step in SI units."""
        return abs(self.factor) * self.column.step


def check_channels(channels: list[Channel], log: Recording | None, declared: Mapping[str, float]) -> list[Check]:
    """The checks of every channel. declared: step in SI units by channel, as the rig file states it."""
    checks: list[Check] = []
    for channel in channels:
        values = getattr(log, channel.role, None) if log is not None else None
        checks += _one(channel, log, values, declared.get(channel.role, 0.0))
    if log is not None:
        checks += _on_reading(log)
    return checks


def _one(channel: Channel, log: Recording | None, values: np.ndarray | None, declared: float) -> Iterator[Check]:
    column, code, word = channel.column, channel.role, channel.word
    if column.constant:
        dead: Level = "note" if channel.role in ("reference", "voltage", "bridge", "supply") else "fault"
        text = (
            f"{word} (column {column.name!r}) is {column.low + 0.0:g} in all {len(column.values)} rows: a dead channel."
        )
        yield Check(f"{code}-dead", word, dead, text, f"log the {word}" if dead == "fault" else "")
        return
    unit, step = channel.unit, channel.step
    values_of: dict[str, object] = {"low": column.low, "high": column.high, "step": step}
    text = f"column {column.name!r} from {column.low:.4g} to {column.high:.4g} {column.unit or ''}".rstrip()
    if column.missing:
        text += f", no number in {column.missing} of {len(column.values)} rows"
    if column.outliers:
        text += f", and {column.outliers} {'number' if column.outliers == 1 else 'numbers'} far outside"
    level: Level = "ok"
    remedy = ""
    if channel.role in ("angle", "wheel_angle", "wheel_speed"):
        text += f"; {_steps(channel, values_of)}"
        if declared > 0 and column.step > 0 and not 0.95 < step / declared < 1.05 and not is_decimal(column.step):
            key = "sensors" if channel.role == "angle" else "sensors.wheel"
            text += f"; the rig file states {number(declared, unit, 3)}"
            stated = f"counts_per_turn = {ONE_TURN / step:.0f}" if channel.rotary else f"resolution = {step:.3g}"
            if step > declared:
                level, remedy = "repair", f"state {stated} under [{key}]"
    elif column.step:
        text += f"; steps of {number(step, unit, 3)}"
    if values is not None and log is not None and channel.role != "reference":
        even = bool(np.ptp(np.diff(log.time)) <= EVEN * (log.time[1] - log.time[0]))
        noise = sample_noise(values) if even else uneven_noise(log.time, np.ascontiguousarray(values))
        values_of["noise"] = noise
        if channel.role in ("angle", "wheel_angle"):
            text += f"; noise {noise_of(noise, float(np.ptp(values)), unit)} per sample"
    yield Check(code, word, level, f"{text}.", remedy, values_of)
    if channel.role in ("voltage", "torque"):
        yield from _saturation(channel)


def _steps(channel: Channel, values: dict[str, object]) -> str:
    column, step = channel.column, channel.step
    if column.step == 0:
        return "no steps to be seen"
    if is_decimal(column.step) and column.kind != "whole numbers":
        return f"written in steps of {column.step:.3g}, which may be its digits and no encoder's"
    if channel.rotary:
        counts = ONE_TURN / step
        values["counts_per_turn"] = counts
        bits = np.log2(counts)
        exact = f", {round(bits)} bit" if abs(bits - round(bits)) < 1e-3 else ""
        return f"steps of {number(step, 'rad', 3)}, {counts:.6g} per turn{exact}"
    return f"steps of {number(step, channel.unit, 3)}"


def _saturation(channel: Channel) -> Iterator[Check]:
    column, word = channel.column, channel.word
    share = column.at_low + column.at_high
    if share < CLIPPED or column.low >= column.high:
        return
    ends = [f"{end:.4g} in {part:.1%}" for end, part in ((column.low, column.at_low), (column.high, column.at_high))]
    text = f"{word} stands at its limits in {share:.1%} of the rows ({' and '.join(ends)})"
    text += "; methods take what is logged as applied, so it has to be what the limiter let through."
    level: Level = "advice" if share > MOSTLY else "note"
    remedy = "record a smaller or slower motion, which the drive can follow" if level == "advice" else ""
    yield Check(f"{channel.role}-saturated", "saturation", level, text, remedy, {"share": share})


def _on_reading(log: Recording) -> Iterator[Check]:
    """What was found and mended when the file was read."""
    for finding in log.findings:
        if finding.code in ELSEWHERE:
            continue
        level, remedy = USER.get(finding.code, ("note", "")) if finding.level == "warning" else ("note", "")
        if finding.code == "wheel-still" and log.wheel_angle is not None and np.ptp(log.wheel_angle) == 0:
            continue
        repair = OWN.get(finding.repair or "") if finding.code != OFF else None
        yield Check(finding.code, "on reading", level, finding.message, remedy, own=repair)
