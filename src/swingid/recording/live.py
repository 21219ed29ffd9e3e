"""What the journal of a live run holds beside its channels: arrivals by the computer's clock, flags, the zero at rest.

The device states its time, its readings and where the body hung before the run; none of the three is taken unseen.

A sample arrives late by the line, an adapter and the operating system, and never early. So the least delays of blocks
of a run lie on a straight line, whose slope is the relative deviation of the device's clock from the computer's (Moon,
Skelly and Towsley, Estimation and removal of clock skew from network delay measurements, IEEE INFOCOM 1999).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from swingid.format import number
from swingid.recording.rows import MANY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from swingid.numerics.arrays import Array
    from swingid.recording.conventions import Reading
    from swingid.recording.formats.table import Table
    from swingid.units import Quantity

ARRIVAL, FLAGS = "host", "flags"
"""Columns of a journal: when a sample arrived (s, by the computer's clock); bits of a sample that is not to be used."""

RUN = "run"
"""Key of what a journal's metadata state of its run."""

REPAIR = "device-clock"

HOST = 1e-4
"""Relative standard uncertainty of a computer's clock: the tolerance of a quartz, as `log.clock` by default."""

DIFFERS, UNSTEADY = 2.0, 5.0
"""Standard deviations from which a device's clock is corrected, and where the clocks do not run evenly, of which a line
is a poor model. 5e-2 and 6e-7 for one test of a log; but all parts are bounds rather than spreads, and a correction in
vain leaves its uncertainty in the interval."""

SMALL = 2e-3
"""Relative deviation up to which it is written in ppm."""


def is_live(table: Table) -> bool:
    """Return whether a table is the journal of a live run."""
    return bool(table.metadata.get("live"))


def live(table: Table, reading: Reading) -> tuple[Table, Reading]:
    """The samples of a journal that are to be used, and how they are to be read; `reading` gets the findings."""
    time = reading.conventions.columns["time"]
    table = without_flagged(table, reading)
    if time in table.columns:
        table = up_to_a_step_back(table, time, reading)
    zero_at_rest(table, reading)
    return table, with_own_time(table, time, reading)


def without_flagged(table: Table, reading: Reading) -> Table:
    """The table without the samples that the device flagged as without a reading, or late; with a finding."""
    if FLAGS not in table.columns:
        return table
    flags, _ = table.numbers(FLAGS)
    good = ~(np.nan_to_num(flags) > 0)
    rows, out = len(good), int(np.count_nonzero(~good))
    if not out or not good.any():
        return table
    text = f"{out} of {rows} samples left out: the device flagged them as without a reading of an encoder, or as late"
    if out > MANY * rows:
        text += "; look after the encoder's cable and magnet, and lower the device's rate"
    reading.found("flagged-samples", f"{text}.", "warning" if out > MANY * rows else "note")
    return replace(table, columns={name: values[good] for name, values in table.columns.items()})


def up_to_a_step_back(table: Table, time: str, reading: Reading) -> Table:
    """The table up to where the device's clock (column `time`) does not go on, with a finding."""
    stamps, _ = table.numbers(time)
    back = np.flatnonzero(np.diff(stamps) <= 0)
    if not len(back):
        return table
    rows, kept = len(stamps), int(back[0]) + 1
    text = (
        f"the device's clock did not go on after {stamps[back[0]]:.6g} s, so the last {rows - kept} of {rows} samples "
    )
    reading.found("device-clock-back", f"{text}were left out; correct its firmware.", "warning")
    return replace(table, columns={name: values[:kept] for name, values in table.columns.items()})


def zero_at_rest(table: Table, reading: Reading) -> None:
    """Add the note of how well the zero of the angle is known: by the body that hung still before the run."""
    spread = _about(table).get("zero_spread", "")
    try:
        of_zero = float(spread)
    except ValueError:
        return
    if of_zero > 0.0 and math.isfinite(of_zero):
        text = f"0 of the angle is where the body hung before the run, to {number(of_zero, 'rad', 2)}"
        reading.found("zero-at-rest", f"{text}.", "note", of_zero=of_zero)


def with_own_time(table: Table, time: str, reading: Reading) -> Reading:
    """How the journal is to be read, its times (s, of this column) as the computer's clock has them.

    They are corrected where the device's clock deviates from the computer's by more than `log.clock` states, with a
    warning; else a note states the deviation. Not for an emulated rig, which moves by its own clock.
    """
    if _about(table).get("emulated"):
        return reading
    stated = reading.rig.log.clock
    compared = _compared(table, time)
    taken = stated.value if compared is None else _decided(compared, stated, reading)
    scale = replace(reading.conventions.scale("time"), factor=1.0 / (1.0 + taken))
    conventions = replace(reading.conventions, scales=reading.conventions.scales | {"time": scale})
    return replace(reading, conventions=conventions)


def _about(table: Table) -> Mapping[str, str]:
    about = table.metadata.get(RUN)
    return about if isinstance(about, dict) else {}


def _compared(table: Table, time: str) -> Comparison | None:
    """The device's clock against the computer's; None where the journal has no arrivals, or is too short."""
    if ARRIVAL not in table.columns or time not in table.columns:
        return None
    device, host = (table.numbers(column)[0] for column in (time, ARRIVAL))
    known = np.isfinite(device) & np.isfinite(host)
    return compare(device[known], host[known])


def _decided(comparison: Comparison, stated: Quantity, reading: Reading) -> float:
    """The deviation of the device's clock that is taken off its times; `reading` gets the finding."""
    u = math.hypot(comparison.spread, HOST)
    side = "fast" if comparison.deviation > 0 else "slow"
    words = f"the device's clock is {_share(abs(comparison.deviation), u)} {side} against the computer's"
    level = UNSTEADY if comparison.is_unsteady else DIFFERS
    if abs(comparison.deviation - stated.value) <= level * math.hypot(u, stated.std or 0.0):
        # no clock is exact: where nothing is stated of its uncertainty the comparison is the evidence
        extra = 0.0 if stated.std else u
        if comparison.is_unsteady:
            extra = math.hypot(extra, comparison.spread)
            words += f"; their difference jumps by {number(comparison.scatter, 's', 2)}, which the interval contains"
        reading.found("device-clock", f"{words}.", "note", of_time=extra)
        return stated.value
    words += f", and log.clock states {_signed(stated.value)} ± {1e6 * (stated.std or 0.0):.0f} ppm"
    if REPAIR in reading.off:
        reading.found("device-clock", f"{words}; it was left so.", "warning")
        return stated.value
    words += (
        f'; the times were corrected. Run the board from a crystal, or state clock = "{_signed(comparison.deviation)}'
    )
    reading.found("device-clock", f'{words} ± {1e6 * u:.0f} ppm" under [log].', "warning", REPAIR, of_time=u)
    return comparison.deviation


def _signed(share: float) -> str:
    return f"{1e6 * share:.0f}"


def _share(size: float, u: float) -> str:
    """A relative deviation with its standard uncertainty, in ppm or %."""
    if max(size, u) < SMALL:
        return f"{1e6 * size:.0f} ± {1e6 * u:.0f} ppm"
    return f"{100 * size:.3g} ± {100 * u:.1g} %"


BLOCKS, FEWEST, SHORTEST = 24, 8, 0.25
"""Blocks of a run, least number of them, and their least duration (s): fifty turns of the host's loop, of which one at
least is prompt."""

TURN = 0.005
"""Period of the host's loop (s): arrivals are seen at its turns."""

ROUNDS = 3
"""In which the least delays are found again, the slope of the round before removed."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """A device's clock against the computer's.

    deviation: relative, positive where the device's is fast; spread: its standard uncertainty by the delays; scatter:
    root of the mean square of the least delays about their line (s).
    """

    deviation: float
    spread: float
    scatter: float

    @property
    def is_unsteady(self) -> bool:
        """Return whether the least delays scatter by more than a turn: a clock has jumped, or the host stood still."""
        return self.scatter > TURN


def compare(device: Array, host: Array) -> Comparison | None:
    """Compare the clocks by the times of samples (s) and of their arrival (s), both (n,), rising.

    None for a run shorter than `FEWEST` blocks, for time that goes back, and for a block without samples.
    """
    span = float(device[-1] - device[0]) if len(device) > 1 else 0.0
    blocks = min(BLOCKS, int(span / SHORTEST)) if math.isfinite(span) else 0
    if blocks < FEWEST or (np.diff(device) < 0).any():
        return None
    edges = np.searchsorted(device, device[0] + span * np.arange(blocks) / blocks)
    edges = np.append(edges, len(device))
    if (np.diff(edges) == 0).any():
        return None
    late, slope = host - device, 0.0
    for _ in range(ROUNDS):
        residuals = late - slope * device
        least = np.array([a + int(np.argmin(residuals[a:b])) for a, b in pairwise(edges)])
        x, y = device[least] - device[least].mean(), late[least] - late[least].mean()
        slope = float(x @ y / (x @ x))
    scatter = math.sqrt(float(np.sum((y - slope * x) ** 2)) / (blocks - 2))
    # neighbouring delays may be alike, so their scatter counts once and not once per block
    by_scatter = math.sqrt(12.0) * scatter / span
    # an arrival is seen at the next turn, at both ends of the run
    by_turns = min(TURN, span / (len(device) - 1)) / (math.sqrt(6.0) * span)
    return Comparison(-slope / (1.0 + slope), math.hypot(by_scatter, by_turns), scatter)
