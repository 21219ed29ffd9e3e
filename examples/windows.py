"""The inertia against the length of the modulating functions, with and without exact integration at their ends.

    python examples/windows.py LOG RIG [HALF-LENGTH ...]

For every half-length (s) the "law" windows of the used part are fitted once with the integrals of the package,
and once with the plain sum over the quadrature nodes that lie inside each window, which cuts the intervals at the
window's ends off at a node.
"""

from __future__ import annotations

import sys

import numpy as np

import swingid as sw
from swingid.balance.fits import BASIS, Noise, WindowFit, fit_rows
from swingid.balance.rows import Signals, Windows, rows_of
from swingid.balance.windows import law_windows
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion, sample_noise
from swingid.preparation.scale import equation_of
from swingid.preparation.segment import usable_part

HALVES = (0.0183, 0.0303, 0.0305, 0.0507, 0.1007, 0.2007, 0.3007)


def plain_sum(signals: Signals, windows: Windows) -> np.ndarray:
    """∫φ'' q1 of each window (rad/s or m/s) as the plain sum over the nodes inside it."""
    instants, weights = signals.nodes.flat
    angle = signals.angle.ravel()
    sums = []
    for centre, half in zip(windows.centres, windows.half, strict=True):
        inside = slice(*np.searchsorted(instants, [centre - half, centre + half]))
        s = (instants[inside] - centre) / half
        curvature = -6 * (1 - s**2) * (1 - 5 * s**2) / half**2
        sums.append(float((weights[inside] * curvature * angle[inside]).sum()))
    return np.array(sums)


def fits(log: sw.Recording, rig: sw.Rig, half: float) -> tuple[WindowFit, WindowFit] | None:
    """The fit with exact ends and the one with plain sums; None where the log is too short for the windows."""
    noise = Noise(sample_noise(log.angle), 0.0, 1 / log.rate)
    whole = find_motion(log.time, log.angle, noise.angle)
    start, stop, _ = usable_part(whole, rig.drive.channel, float(log.time[0]), float(log.time[-1]))
    used = log.segment(start, stop)
    motion = whole.within(float(used.time[0]), float(used.time[-1]))
    signals = Signals.of(used, rig, motion, Encoders.of(rig), longest=0.0)  # blocks of one interval: plain sums
    rows = rows_of(signals, law_windows(signals, half))
    exact = fit_rows(rows, equation_of(rig), noise, BASIS)
    plain_rows = rows.beside({"inertia": plain_sum(signals, rows.windows)})
    plain = fit_rows(plain_rows, equation_of(rig), noise, BASIS)
    return None if exact is None or plain is None else (exact, plain)


def main(arguments: list[str]) -> None:
    """Print one line per half-length: the inertia of the axis with exact ends ± type A, and with plain sums."""
    path, rig_name, *halves = arguments
    rig = sw.Rig.load(rig_name)
    log = sw.Recording.load(path, rig)
    carried = equation_of(rig).carried
    print(f"{'half-length, s':>14} {'inertia':>12} {'± type A':>9} {'plain sums':>12}")
    for half in [float(text) for text in halves] or HALVES:
        pair = fits(log, rig, half)
        if pair is not None:
            exact, plain = pair
            print(f"{half:14g} {exact.a11 - carried:12.6g} {exact.u:9.2g} {plain.a11 - carried:12.6g}")


if __name__ == "__main__":
    main(sys.argv[1:])
