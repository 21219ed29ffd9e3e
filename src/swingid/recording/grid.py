"""The grid that the values of a channel lie on, and whether the rig file's statement of encoder and unit fits it.

The grid shows steps of an encoder or a converter, or digits that were written. An encoder makes a whole number of
counts of a turn, most often a power of two, so its steps can show the unit of an angle (`unit_of_step`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.recording.findings import Finding

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.conventions import Conventions
    from swingid.recording.formats.table import Table


FEWEST_CHANGES = 10
MOST_CHANGES = 20_000
OFF = 0.02
"""Distance from a multiple of the step, in steps, within which a change is one."""

SURE = 0.99
"""Share of the changes that have to be multiples of the step."""


def grid_of(values: Array) -> float:
    """The step of which all changes between rows are multiples, 0 where there is none; values (n,) finite.

    Found from the changes between rows, the small ones first: the step is refined on ever larger changes, so that it is
    known to a fraction of a step over the whole range.
    """
    stride = max(1, len(values) // MOST_CHANGES)
    changes = np.abs(np.diff(values)) if stride == 1 else np.abs(values[1::stride] - values[:-1:stride])
    largest = float(np.abs(values).max(initial=0.0))
    rounding = 4e-16 * largest
    changes = np.sort(changes[changes > 8 * rounding])
    if len(changes) < FEWEST_CHANGES:
        return 0.0
    for start in (changes[0], changes[len(changes) // 200], changes[len(changes) // 20]):
        step = _refined(changes, float(start))
        off = np.abs(changes / step - np.round(changes / step))
        if np.mean(off < OFF + 2 * rounding / step) > SURE and changes[-1] > 1.5 * step:
            return step
    return 0.0


def _refined(changes: Array, step: float) -> float:
    """Least-squares step on the changes up to 3, 30, 300 … steps; changes sorted."""
    reach = 3.0
    for _ in range(8):
        near = changes[: np.searchsorted(changes, reach * step)]
        counts = np.round(near / step)
        good = np.abs(near / step - counts) < 0.2
        counts, near = counts[good & (counts > 0)], near[good & (counts > 0)]
        if not len(near):
            break
        step = float((near * counts).sum() / (counts**2).sum())
        if near[-1] == changes[-1]:
            break
        reach *= 10
    return step


def step_of(values: Array) -> float:
    """Find the step as `grid_of` does, also of a slow motion or one of single steps: between rows farther apart."""
    return next((step for rows in STRIDES if (step := grid_of(values[::rows]))), 0.0)


def is_decimal(step: float) -> bool:
    """Return whether a step is 1, 2 or 5 times a power of ten, as of written digits rather than of an encoder."""
    if step < np.finfo(np.float64).tiny:  # below, a double has fewer digits, and its power of ten may be 0
        return False
    mantissa = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
    return bool(min(abs(mantissa - m) for m in (1.0, 2.0, 5.0, 10.0)) < 1e-6 * mantissa)


TURN = {"rad": 2 * np.pi, "deg": 360.0, "turns": 1.0}
"""One turn in each unit of an angle."""

FEWEST_COUNTS, MOST_COUNTS, MOST_ROUND = 64, 2**26, 40_000
"""Counts per turn of the coarsest encoder, of the finest, and of the finest whose counts are no power of two."""

CLOSE = 3e-4
"""How exactly (share) a step is known."""


def unit_of_step(step: float) -> tuple[str, int]:
    """The one unit of an angle in which a step is an encoder's, and its counts per turn; ("", 0) if none or several.

    Counts are a power of two, or else a multiple of 100.
    """
    counts = {unit: turn / step for unit, turn in TURN.items()}
    counts = {unit: count for unit, count in counts.items() if FEWEST_COUNTS < count <= MOST_COUNTS}
    for fits in (_is_power_of_two, _is_round):
        units = [(unit, round(count)) for unit, count in counts.items() if fits(count)]
        if len(units) == 1:
            return units[0]
    return "", 0


def _is_power_of_two(count: float) -> bool:
    return bool(abs(count / 2.0 ** np.round(np.log2(count)) - 1) < CLOSE)


def _is_round(count: float) -> bool:
    return 100 < count < MOST_ROUND and abs(count / (100 * round(count / 100)) - 1) < CLOSE / 10


UNITS = {unit: 2 * np.pi / turn for unit, turn in TURN.items()} | {"m": 1.0, "mm": 1e-3}
"""rad or m in each unit."""

SAME_COUNTS, SAME_RESOLUTION = 1e-3, 0.05
"""Relative difference up to which a step is the stated one: counts per turn are whole (4096 and 4100 differ by this),
a resolution is often written with two digits."""

STRIDES = (1, 7, 63)
"""Rows between the values that are compared: where each row is at most a step from the next, no multiple shows. Odd,
for where each row is one step (a log of the encoder's edges) an even number of rows is an even number of steps."""

GRID = "encoder-grid"


def check_grids(table: Table, conventions: Conventions, rig: Rig) -> list[Finding]:
    """A warning for each angle whose steps contradict the stated encoder, or are an encoder's in another unit only.

    The statement of a unit or of counts per turn sets the scale of the angle, so an error of it is one of the result.
    Not of an angle in counts, whose steps do not depend on the statement.
    """
    findings = []
    channels: tuple[tuple[Literal["angle", "wheel_angle"], Literal["angle", "wheel"], str], ...] = (
        ("angle", "angle", "sensors"),
        ("wheel_angle", "wheel", "sensors.wheel"),
    )
    for channel, which, key in channels:
        column = table.find(conventions.columns[channel]) if channel in conventions.channels else None
        used = str(conventions.keys.get(f"{channel}_unit", ""))
        if column is None or used not in UNITS:
            continue
        values = table.numbers(column)[0]
        values = values[np.isfinite(values)]
        step = step_of(values)
        if step == 0.0 or is_decimal(step):
            continue
        encoder = rig.sensors.of(which)
        text = _contradiction(
            step, used, f"{channel}_unit", encoder.resolution, key, rounded=rig.sensors.rounded(which)
        )
        if text:
            where = f"column {column!r} ({channel.replace('_', ' ')})"
            findings.append(Finding(GRID, f"{where} moves in steps of {text}.", "warning"))
    return findings


def _contradiction(step: float, used: str, unit_key: str, declared: float, key: str, *, rounded: bool) -> str:
    """What is wrong about steps (in the unit used), and which key to change; empty where nothing is."""
    here = step * UNITS[used]
    if used in TURN:
        counts = {unit: turn / step for unit, turn in TURN.items()}
        seen = f"{here:.4g} rad, {counts[used]:.6g} in a turn"
    else:
        counts, seen = {}, f"{here:.4g} m"
    if not declared:
        unit, count = unit_of_step(step)
        if unit in ("", used) or not _is_power_of_two(count):
            return ""
        return (
            f"{seen} as {used}, but in {unit} they are {count} in a turn, a power of two, as encoders have; set "
            f'{unit_key} = "{unit}" under [log]'
        )
    same = SAME_RESOLUTION if rounded else SAME_COUNTS
    ratio = here / declared
    if abs(ratio - 1) < same:
        return ""
    stated = f"{2 * np.pi / declared:.6g} in a turn" if used in TURN else f"{declared:.4g} m"
    others = [unit for unit in (TURN if used in TURN else ("m", "mm")) if unit != used]
    fitting = [unit for unit in others if abs(step * UNITS[unit] / declared - 1) < same]
    text = f"{seen}, but [{key}] states {stated}"
    if fitting:
        return f'{text}, which they are in {fitting[0]}; set {unit_key} = "{fitting[0]}" under [log]'
    if rounded and ratio < 1:  # stated coarser than it is, which costs nothing but caution
        return ""
    change = f"counts_per_turn = {counts[used]:.0f}" if counts and not rounded else f"resolution = {here:.4g}"
    return f"{text}; state {change} there, or correct {unit_key}: the values would be {ratio:.4g} times too large"
