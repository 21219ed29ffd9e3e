"""The information of one swing: rows of the balance around one turning point, from a piece of the log.

Both methods give rows that are linear in inertia and friction, so one recursion serves them. momentum: windows of half
a swing every quarter of a window, from the middle of the swing before to that after. energy: nodes mirrored about the
turning point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.energies import of_energy
from swingid.balance.errors import errors_of
from swingid.balance.fits import BASIS, columns_of, known_side
from swingid.balance.perturbations import RowError
from swingid.balance.rows import Signals, Windows, rows_of
from swingid.methods.energy.balance import Course, PassRows
from swingid.methods.energy.effects import pass_errors
from swingid.methods.energy.method import LEVELS
from swingid.methods.energy.passes import mirrored_passes
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders, on_stamps
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.recording.recording import Recording

PLACES = (-0.5, -0.25, 0.0, 0.25)
"""Centres of the windows in swings from the turning point; the next block begins where this one ends."""

INSIDE = (0.44, 0.5, 0.56)
"""Centres of the windows where the axis rests at its turning points: inside the swing that follows."""


@dataclass(frozen=True)
class Block:
    """Rows of the balance around one turning point at `time` (s): columns (n, p), target (n,).

    unknowns: "inertia" first; "memory" is only estimated where `impulse_found` says so. side: +1 upper, −1 lower.
    windows: of momentum, for the noise that neighbours share, and signals, for the impulse at reversals. declared: from
    values of the unknowns to what rig.toml declares as uncertain, as perturbations of the target.
    """

    time: float
    side: float
    unknowns: tuple[str, ...]
    columns: Array
    target: Array
    windows: Windows | None
    signals: Signals | None
    declared: Callable[[Array], list[RowError]]


def momentum_block(
    log: Recording, rig: Rig, equation: Equation, noise: Noise, motion: Motion, encoders: Encoders, at: int
) -> Block | None:
    """Block of windows around turning point `at` of the piece; None where they do not fit in."""
    windows = _windows(motion, at)
    inside = (windows.centres - windows.half >= log.time[0]) & (windows.centres + windows.half <= log.time[-1])
    for begin, end in motion.rests:
        inside &= (windows.centres + windows.half <= begin) | (windows.centres - windows.half >= end)
    if not inside.any():
        return None
    signals = Signals.of(log, rig, motion, encoders)
    rows = rows_of(signals, windows.select(inside))
    unknowns, columns = columns_of(rows, equation, (*BASIS, "memory"))

    def declared(values: Array) -> list[RowError]:
        coefficients = equation.stated | dict(zip(unknowns, values.tolist(), strict=True))
        return errors_of(rows, signals, rig, equation, coefficients)

    turning, side = float(motion.turning_times[at]), float(motion.sides[at])
    return Block(turning, side, unknowns, columns, known_side(rows, equation), rows.windows, signals, declared)


def _windows(motion: Motion, at: int) -> Windows:
    """Windows of half a swing, or inside the next swing where the axis rests."""
    before, turning, after = motion.turning_times[at - 1 : at + 2]
    if len(motion.rests):
        places, half = np.array(INSIDE), 0.4 * (after - turning)
    else:
        places, half = np.array(PLACES), min(turning - before, after - turning) / 2
    spans = np.where(places < 0, turning - before, after - turning)
    return Windows(turning + spans * places, np.full(len(places), half))


def energy_block(
    log: Recording, rig: Rig, equation: Equation, noise: Noise, motion: Motion, encoders: Encoders, at: int
) -> Block | None:
    """Block of mirrored nodes around turning point `at` of the piece; None where there is no whole pass."""
    turning = float(motion.turning_times[at])
    passes = mirrored_passes(motion, LEVELS, log.time, np.inf)
    chosen = np.nonzero(passes.turning == turning)[0]
    if len(chosen) != 1:
        return None
    course = Course.of(on_stamps(log, encoders), rig, motion, noise, encoders.on_time())
    equation = of_energy(rig, equation)
    rows = PassRows.of(course, passes.instants[chosen], equation)
    unknowns, columns = columns_of(rows, equation, BASIS)

    def declared(values: Array) -> list[RowError]:
        """The declared errors, on differences from the block's mean."""
        known = equation.stated | dict(zip(unknowns, values.tolist(), strict=True))
        errors = (item for item in pass_errors(rows, rig, equation, known) if item.std > 0)
        return [replace(item, rows=rows.within(item.rows)) for item in errors]

    columns, target = rows.within(columns.T).T, rows.within(known_side(rows, equation))
    return Block(turning, float(motion.sides[at]), unknowns, columns, target, None, None, declared)
