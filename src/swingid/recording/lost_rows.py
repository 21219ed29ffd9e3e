"""Rows that are missing where the time was made from the row number: found by the motion, which goes on meanwhile.

A row that was never written moves every later row back by a step of time. Where it is missing, all angles jump along
their motion, by what they move in a whole number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.continuity import ROBUST
from swingid.recording.grid import step_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swingid.numerics.arrays import Array, Bools, Ints


NORMAL = NormalDist()

FALSE_ALARM = 1e-4
"""Probability that a log without lost rows has one found in it, shared out over its steps and the widths below."""

WIDTHS = ((0, 0), (5, 3), (12, 3), (30, 3))
"""Rows on either side of a step from which its excess is estimated, and the degree of the polynomial through them: wide
ones for slow motion, where one row counts little; a polynomial that is too stiff shows as spread. 0: the step alone,
against those around it, for rows that are lost a few apart."""

MOST = 10
"""Rows that one step may lack; across more the motion does not go on evenly, and a jump is reported."""

SIDE = 8
"""Rows on either side of a step within which its speed is taken."""

ROUNDS = 2
"""Searches by the odds: the second has a better rate."""

PASSES = 10
"""Times that the log is searched at each width: a row shows better once its neighbours are back."""

NEAR = 0.2
"""Relative error of the excess by the change of the speed while rows are missing."""

APART = 4.0
"""Standard deviations by which each channel's excess may differ from a whole number of steps."""

AGAINST = 0.25
"""Steps that show as well that a row is one too many, over those that lack one: beyond, what jumps is not the time but
the readings, as of an encoder that is read late or twice."""

FEWEST = 2
"""Steps at which rows are missing: one alone may be an encoder that slipped, and is no matter."""

HARD = 4.0
"""Standard deviations (one-sided 3e-5) by which steps may be found too often where they are hard to see: rows are lost
at any speed, and faults of the readings that look alike are not."""

TRUSTED = 0.1
"""Of the rows lost: how wrong the number is beyond what chance makes it, by `benchmarks/lost_rows.py`."""

SHAPE = 4.0
"""Standard deviations of noise by which the mean square of what is left around a step, once its rows are back, may be
beyond the usual (as the cube root of χ²): a kink of the speed leaves more."""

SLOWEST = 1.5
"""Steps of a channel's grid that it has to move in one row: where it is slower, rounding, which moves a step by one, is
no noise but follows the motion."""

BINS, ALIKE, BLOCK = 12, 400, 64
"""Parts of the log of like speed, steps of each that are looked at, and rows of a stretch, from which the spread of the
excess is taken: the larger."""

TAIL = 3e-3
"""Share of the steps, on the side on which no row can be lost, from which heavy tails of the spread are estimated."""

ROUNDING = 1e-9
"""Of the range of the speeds: spreads below are the computer's."""

NOWHERE = 1e9
"""Standard deviation, in steps, where nothing is known."""


@dataclass(frozen=True, slots=True)
class Lost:
    """Rows lost before each row (n,); expected number (n,) of those that the motion is too slow to show.

    spread: standard uncertainty of the number that were lost over the whole log.
    """

    before: Ints
    hidden: Array
    spread: float


@dataclass(frozen=True, slots=True)
class _Excess:
    """How much farther than the motion each channel goes at each step (c, m), in steps of time; standard deviations.

    fits (m,): steps around which nothing else is left. kinks (m,): squares, over those of the noise, that a kink of the
    speed near by explains.
    """

    steps: Array
    stds: Array
    fits: Bools
    kinks: Array

    def joint(self, sure: float = 0.0) -> tuple[Array, Array]:
        """Mean over the channels, its standard deviation, larger where the side without lost rows has a heavy tail.

        Which is not looked at where no mean is beyond `sure` standard deviations.
        """
        weights = self.stds**-2.0
        std = weights.sum(axis=0) ** -0.5
        mean = (weights * self.steps).sum(axis=0) * std**2
        if not (np.abs(mean) > sure * std).any():
            return mean, std
        tail = float(np.quantile(-(mean / std)[self.fits], 1 - TAIL)) if self.fits.any() else 0.0
        return mean, std * max(1.0, tail / NORMAL.inv_cdf(1 - TAIL))


@dataclass(frozen=True, slots=True)
class _Best:
    """Excess at each step of the clock (m,), its standard deviation, how many lost rows it is like (0: none).

    apart (m,): steps to which it reaches. places (n,): of the rows.
    """

    mean: Array
    std: Array
    whole: Array
    apart: Array
    places: Ints


@dataclass(frozen=True)
class _Log:
    """Angles (c, n) of rows at places (n,) of an even clock; steps of their grids (c,); widths that fit into it."""

    places: Ints
    values: Array
    quanta: Array
    widths: list[tuple[int, int]]

    def excess(self, before: Ints, sure: float) -> _Best:
        """Return the excess at each step, with so many rows lost before each row, of the width with the least
        deviation.

        sure: standard deviations beyond which it matters; 0 where rows are lost for certain, of which one at a step is
        no kink of the motion.
        """
        places = self.places + np.cumsum(before)
        grid = self.values
        if places[-1] >= grid.shape[1]:
            everywhere = np.arange(places[-1] + 1)
            grid = np.array([np.interp(everywhere, places, channel) for channel in grid])
        count, each = grid.shape[1] - 1, []
        best = _Best(np.zeros(count), np.full(count, NOWHERE), np.zeros(count), np.zeros(count), places)
        for width, degree in self.widths:
            excess = _of_windows(grid, self.quanta, width, degree, sure) if width else _of_steps(grid, self.quanta)
            each.append((width, excess, *excess.joint(sure)))
        if not any((np.abs(mean) > sure * std).any() for _, _, mean, std in each):
            return best
        for width, excess, mean, std in each:
            whole = np.clip(np.round(mean), -MOST, MOST)
            off = np.maximum(np.abs(excess.steps - whole) - NEAR * np.abs(whole), 0.0) / excess.stds
            like = excess.fits & (np.abs(mean) < MOST + 0.5) & (off < APART).all(axis=0)
            like &= ((sure == 0) & (whole <= 1)) | (excess.kinks < (mean / std) ** 2)
            better = excess.fits & (std < best.std)
            for old, new in ((best.mean, mean), (best.std, std), (best.whole, whole * like)):
                old[better] = new[better]
            best.apart[better] = 2 * max(width, 2)
        return best

    def search(self, before: Ints, odds: float, sure: float) -> tuple[Ints, int]:
        """`before` with the lost rows that are found; steps that show as well that a row is one too many.

        odds: logarithm of how much likelier than by the log a step is to lack none. sure: least standard deviations.
        """
        before, against = before.copy(), 0
        for again in range(PASSES):
            best = self.excess(before, sure)
            gain = (best.mean - best.whole / 2) * best.whole / best.std**2
            good = (gain > odds * np.abs(best.whole)) & (np.abs(best.mean) > sure * best.std)
            if again == 0:
                against += len(_strongest(np.flatnonzero(good & (best.whole < 0)), gain, best.apart))
            steps = _strongest(np.flatnonzero(good & (best.whole > 0)), gain, best.apart)
            if not len(steps):
                break
            np.add.at(before, np.searchsorted(best.places, steps, side="right"), best.whole[steps].astype(np.int64))
        return before, against


def find_lost(places: Ints, angles: Sequence[Array]) -> Lost | None:
    """Rows lost from a log of angles (n,), taken at rising places of an even clock as it seems; None where none are.

    That any are is decided at `FALSE_ALARM`; where each is then by the odds, from how often rows are lost in this log.
    """
    rows = len(places)
    widths = [(width, degree) for width, degree in WIDTHS if rows >= max(8 * width, 2 * BLOCK)]
    if not widths:
        return None
    log = _Log(places - places[0], np.array(angles), np.array([step_of(channel) for channel in angles]), widths)
    sure = NORMAL.inv_cdf(1 - FALSE_ALARM / (rows * len(widths)))
    before, against = log.search(np.zeros(rows, dtype=np.int64), 0.0, sure)
    if np.count_nonzero(before) < FEWEST or against > AGAINST * np.count_nonzero(before):
        return None
    odds = float(np.log(rows / before.sum()))
    for _ in range(ROUNDS):
        before, against = log.search(before, odds, 0.0)
        if against > AGAINST * np.count_nonzero(before):
            return None
        best = log.excess(before, 0.0)
        std = best.std[best.places[:-1]]
        power = np.array([NORMAL.cdf(x) for x in np.clip((0.5 - odds * std**2) / std, -9, 9)])
        if _where_hard(std, power, before[1:] > 0) > HARD:
            return None
        rate = float(before.sum() / max(power.sum(), 1.0))
        odds = max(-np.log(rate), 0.0)
    hidden = np.concatenate(([0.0], rate * (1 - power)))
    lost, unseen = float(before.sum()), float(hidden.sum())
    spread = unseen + unseen**2 / lost + against + (TRUSTED * (lost + unseen)) ** 2
    return Lost(before, hidden, float(np.sqrt(spread)))


def _where_hard(std: Array, power: Array, certain: Bools) -> float:
    """Standard deviations by which what is found is found too often where it is hard to see; all arrays (n,).

    Of the steps in order of their deviations, each counted by its power, rows lost at any time are evenly spread.
    """
    order = np.argsort(std, kind="stable")
    share = np.cumsum(power[order]) / max(power.sum(), np.finfo(float).tiny)
    return float((share[certain[order]].mean() - 0.5) * np.sqrt(12 * np.count_nonzero(certain)))


def _strongest(steps: Ints, gain: Array, apart: Array) -> Ints:
    """Return, of steps that are so few steps apart, the one with the largest gain."""
    taken = np.zeros(len(gain), dtype=bool)
    kept = []
    for step in steps[np.argsort(-gain[steps], kind="stable")]:
        if not taken[step]:
            kept.append(step)
            reach = int(apart[step])
            taken[max(step - reach, 0) : step + reach + 1] = True
    return np.array(sorted(kept), dtype=np.int64)


def _of_steps(grid: Array, quanta: Array) -> _Excess:
    """Each step (c, m) against the median of five means over three steps around it."""
    steps = np.diff(grid, axis=1)
    padded = np.pad(grid, ((0, 0), (SIDE, SIDE)), mode="reflect", reflect_type="odd")
    count = steps.shape[1]
    means = [(padded[:, k + 3 : k + 3 + count] - padded[:, k : k + count]) / 3 for k in range(SIDE - 7, SIDE + 6, 3)]
    speed = np.sort(means, axis=0)[2]
    each = [
        _in_steps(step - usual, usual, np.abs(usual) < SLOWEST * quantum, quantum / np.sqrt(6))
        for step, usual, quantum in zip(steps, speed, quanta, strict=True)
    ]
    excess, stds = np.array([of_channel[0] for of_channel in each]), np.array([of_channel[1] for of_channel in each])
    joint, std = _Excess(excess, stds, np.ones(count, dtype=bool), np.zeros(count)).joint(np.inf)
    back = (joint < -0.5) & (joint < -APART * std)  # a spike goes there and comes back
    fits = np.ones(count, dtype=bool)
    fits[1:] &= ~back[:-1]
    fits[:-1] &= ~back[1:]
    fits[:3] = fits[-3:] = False
    return _Excess(excess, stds, fits, np.zeros(count))


def _of_windows(grid: Array, quanta: Array, width: int, degree: int, sure: float) -> _Excess:
    """Each step (c, m) by least squares on `width` rows on either side: a polynomial, and what lost rows add to it.

    That is a jump by the speed and a kink by the acceleration; both are of the polynomial without the jump. What is
    left around the steps is not looked at where no excess is beyond `sure` standard deviations.
    """
    window = _window(width, degree)
    count = grid.shape[1] - 1
    inner = slice(width - 1, count + 1 - width)
    excess, stds = np.zeros((len(grid), count)), np.full((len(grid), count), NOWHERE)
    fits, kinks = np.zeros(count, dtype=bool), np.zeros(count)
    fits[inner] = True
    jj, jk, kk = window.jump @ window.jump, window.jump @ window.kink, window.kink @ window.kink
    about = grid - grid.mean(axis=1)[:, None]
    rests, noises = [], []
    for c, values in enumerate(about):
        jump, kink, slope, bend = (
            np.correlate(values, kernel) for kernel in (window.jump, window.kink, window.slope, window.bend)
        )
        height = jump / jj
        for _ in range(2):
            speed = slope - height * window.tilt
            size = np.sqrt(np.maximum(speed**2 * jj + 2 * speed * bend * jk + bend**2 * kk, np.finfo(float).tiny))
            rest = (speed * jump + bend * kink) / size
            height = speed * rest / size
        slow = (np.abs(speed) < SLOWEST * quanta[c]) | (np.abs(height * window.tilt) > 0.5 * np.abs(slope))
        excess[c, inner], stds[c, inner] = _in_steps(rest, size, slow, quanta[c] / np.sqrt(12))
        rests.append(rest)
        noises.append((stds[c, inner] * size) ** 2)
        kinks[inner] += kink**2 / (kk * noises[c])
    excess_found = _Excess(excess, stds, fits, kinks)
    mean, std = excess_found.joint(np.inf)
    if not (np.abs(mean) > sure * std).any():
        return excess_found
    spread = 2 / (9 * (2 * width - degree - 2))
    limit = (1 - spread + SHAPE * np.sqrt(spread)) ** 3
    for values, rest, noise in zip(about, rests, noises, strict=True):
        squares = np.correlate(values**2, np.ones(2 * width))
        squares -= sum(np.correlate(values, kernel) ** 2 for kernel in window.basis)
        variance = np.maximum(squares - rest**2, 0.0) / (2 * width - degree - 2)
        fits[inner] &= variance < limit * np.maximum(noise, np.median(variance))
    beside = np.lib.stride_tricks.sliding_window_view(np.pad(kinks, width), 2 * width + 1).max(axis=1)
    return _Excess(excess, stds, fits, beside)


@dataclass(frozen=True, slots=True)
class _Window:
    """Weights of the values around a step (k,): what the polynomial leaves of a jump and of a kink there, its slope and
    second derivative per step of time, and an orthonormal basis of it (degree + 1, k). tilt: slope that a jump makes.
    """

    jump: Array
    kink: Array
    slope: Array
    bend: Array
    basis: Array
    tilt: float


@cache
def _window(width: int, degree: int) -> _Window:
    since = np.arange(2 * width) - width + 0.5
    powers = np.vander(since / width, degree + 1, increasing=True)
    basis = np.linalg.qr(powers)[0]
    jump, kink = (since > 0).astype(float), np.maximum(since, 0.0)
    weights = np.linalg.pinv(powers)
    slope, bend = weights[1] / width, 2 * weights[2] / width**2
    remaining = [np.asarray(column - basis @ (basis.T @ column)) for column in (jump, kink)]
    return _Window(remaining[0], remaining[1], slope, bend, basis.T, float(slope @ jump))


def _in_steps(rest: Array, speed: Array, slow: Bools, floor: float) -> tuple[Array, Array]:
    """Rests (m,) over the speed (m,; per step), and standard deviations; nothing is known where it is slow.

    From the spread of the rests, at least the floor, in parts of like speed and in stretches: whichever is larger.
    """
    off, fast = np.abs(rest), np.abs(speed)
    some = slice(None, None, max(1, len(off) // (BINS * ALIKE)))
    order = np.argsort(fast[some])
    length = len(order) // BINS
    binned = [part[some][order][: len(order) // length * length].reshape(-1, length) for part in (fast, off)]
    alike = np.interp(fast, binned[0].mean(axis=1), np.median(binned[1], axis=1))
    stretches = len(off) // BLOCK
    near = np.repeat(np.median(off[: stretches * BLOCK].reshape(stretches, BLOCK), axis=1), BLOCK)
    near = np.concatenate((near, np.full(len(off) - len(near), near[-1])))
    spread = np.maximum(ROBUST * np.maximum(alike, near), max(floor, ROUNDING * float(fast.max(initial=0.0))))
    known = ~slow & (fast * NOWHERE > spread)
    divisor = np.where(known, speed, 1.0)
    return np.where(known, rest, 0.0) / divisor, np.where(known, spread / np.abs(divisor), NOWHERE)
