"""The Butterworth low-pass forward and backward (zero phase), computed only in the rows that are kept.

The filter is a recursion of four states, x' = A x + B u, y = C x + D u. Over a block of L samples it is a matrix: the
states after the block, and the outputs in it, are linear in the states before it and the L inputs. So a column is one
matrix product, and the recursion runs from block to block only. Rows lie at the same places of every block. Both ends
are extended by point reflection, and the filter starts in its steady state, as in `scipy.signal.sosfiltfilt`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from swingid.numerics.arrays import Array

ORDER = 4

STATES = 4

BLOCK = 96
"""Least samples of a block."""

NEGLIGIBLE = 1e-20
"""Size of a power of A at which states before it no longer count."""

System = tuple[Array, Array, Array, float]
"""A (4, 4), B (4,), C (4,) and D of the recursion."""


@dataclass(frozen=True)
class _Blocks:
    """Matrices of a block of L samples with R rows in it: from inputs, and from the states before it on either way.

    power: A^L. steady (4,): states under a constant input 1. Inputs: forward (4, L) to the states after the block,
    backward (4, L) to those before it on the way back, inner (L, L) to the outputs. States before the block: last (4,)
    and last_inputs (L,) to its last output on the way there, turned (4, 4) to those on the way back, ahead (L, 4) to
    the outputs; behind (L, 4): from the states on the way back to the outputs.
    """

    power: Array
    steady: Array
    forward: Array
    backward: Array
    inner: Array
    last: Array
    last_inputs: Array
    turned: Array
    ahead: Array
    behind: Array


@dataclass(frozen=True)
class ZeroPhase:
    """The low-pass at `frequency` (Hz) of samples `step` (s) apart; kept is every `every`-th from `first` on."""

    frequency: float
    step: float
    every: int = 1
    first: int = 0

    @property
    def padding(self) -> int:
        """Samples by which both ends are extended: two periods of the cut-off."""
        return int(2 / (self.frequency * self.step))

    def rows(self, columns: Sequence[Array] | Array, count: int) -> Array:
        """The first `count` kept rows of filtered columns, c of (n,) each, shape (c, count)."""
        length = len(columns[0])
        pad, matrices, phases, front, size = self._layout(length)
        begin, extended = np.empty((len(columns), 1)), np.empty((len(columns), size))
        extended[:, :front] = 0.0
        for k, column in enumerate(columns):
            # less `first` the filter starts at rest
            first = begin[k, 0] = 2 * column[0] - column[pad]
            np.subtract(2 * column[0] - first, column[pad:0:-1], out=extended[k, front : front + pad])
            np.subtract(column, first, out=extended[k, front + pad : front + pad + length])
            np.subtract(2 * column[-1] - first, column[-2 : -pad - 2 : -1], out=extended[k, front + pad + length :])
        blocks = extended.reshape(len(columns), -1, len(matrices.behind))
        outputs = _outputs(matrices, blocks, np.s_[:], phases)
        skipped = (front + pad + self.first) // self.every
        return outputs[:, skipped : skipped + count] + begin

    def spread(self, weights: Array, length: int) -> Array:
        """Columns (c, length) of zeros but for `weights` (c, rows) in the kept rows, filtered.

        The weights of rows within `padding` of either end must be 0.
        """
        pad, matrices, phases, front, size = self._layout(length)
        kept = np.zeros((len(weights), size // self.every))
        skipped = (front + pad + self.first) // self.every
        kept[:, skipped : skipped + weights.shape[1]] = weights
        places = kept.reshape(len(weights), -1, len(matrices.behind) // self.every)
        return _outputs(matrices, places, phases, np.s_[:])[:, front + pad : front + pad + length]

    def _layout(self, length: int) -> tuple[int, _Blocks, slice, int, int]:
        """Padding, matrices, places of the rows in a block, samples before the padding, and samples of all blocks."""
        pad = min(length - 1, self.padding)
        matrices = _blocks(self.frequency * self.step, self.every * -(-BLOCK // self.every))
        size = -(-(length + 2 * pad) // len(matrices.behind)) * len(matrices.behind)
        front = size - length - 2 * pad
        return pad, matrices, slice((front + pad + self.first) % self.every, None, self.every), front, size


def _outputs(block: _Blocks, inputs: Array, given: slice, wanted: slice) -> Array:
    """Outputs at the places `wanted` of every block, (c, …), of inputs (c, blocks, places) at the places `given`.

    The way back begins in the steady state of the last output on the way there.
    """
    count, blocks, places = inputs.shape
    matrix = np.vstack([block.forward[:, given], block.backward[:, given], block.inner[wanted, given]])
    products = (inputs.reshape(-1, places) @ matrix.T).reshape(count, blocks, -1)
    ways = products[:, :, : 2 * STATES].transpose(1, 0, 2).copy()
    states = _carried(block.power, ways[:-1, :, :STATES], np.zeros((count, STATES)))
    end = states[-1] @ block.last + inputs[:, -1] @ block.last_inputs[given]
    turned = ways[:, :, STATES:] + (states.reshape(-1, STATES) @ block.turned.T).reshape(blocks, count, STATES)
    back = _carried(block.power, turned[:0:-1], np.outer(end, block.steady))[::-1]
    both = np.empty((count, blocks, 2 * STATES))
    both[:, :, :STATES], both[:, :, STATES:] = states.transpose(1, 0, 2), back.transpose(1, 0, 2)
    outputs = both.reshape(-1, 2 * STATES) @ np.hstack([block.ahead[wanted], block.behind[wanted]]).T
    result: Array = (outputs.reshape(count, blocks, -1) + products[:, :, 2 * STATES :]).reshape(count, -1)
    return result


def _carried(power: Array, inputs: Array, begin: Array) -> Array:
    """States (blocks, c, 4) before each block: s_0 = begin (c, 4), s_(k+1) = power s_k + inputs_k; by doubling."""
    states = np.empty((len(inputs) + 1, len(begin), STATES))
    states[0], states[1:] = begin, inputs
    flat = states.reshape(-1, STATES)
    reach = len(begin)
    while reach < len(flat) and np.abs(power).max() > NEGLIGIBLE:
        flat[reach:] += flat[:-reach] @ power.T
        power, reach = power @ power, 2 * reach
    return states


@cache
def _blocks(share: float, length: int) -> _Blocks:
    """Matrices of blocks of `length` samples; share: cut-off as a share of the sampling rate."""
    a, b, c, d = _system(share)
    powers = np.empty((length + 1, STATES, STATES))
    powers[0] = np.eye(STATES)
    for k in range(length):
        powers[k + 1] = a @ powers[k]
    ahead = c @ powers[:-1]  # C A^i
    driven = (powers[:-1] @ b).T  # A^i B
    impulse = np.concatenate([[d], driven.T[:-1] @ c])
    lags = np.subtract.outer(np.arange(length), np.arange(length))
    there = np.where(lags >= 0, impulse[np.abs(lags)], 0.0)  # outputs of a block on the way there
    steady: Array = np.asarray(np.linalg.solve(np.eye(STATES) - a, b), dtype=np.float64)
    return _Blocks(
        power=powers[length],
        steady=steady,
        forward=driven[:, ::-1],
        backward=driven @ there,
        inner=there.T @ there,
        last=ahead[-1],
        last_inputs=there[-1],
        turned=driven @ ahead,
        ahead=there.T @ ahead,
        behind=ahead[::-1],
    )


def _system(share: float) -> System:
    """The recursion of the Butterworth low-pass, by the bilinear transform; two sections of order 2 in series."""
    a, b, c, d = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    warped = np.tan(np.pi * share)
    for angle in np.pi * np.array([1, 3]) / (2 * ORDER):
        size = 1 + 2 * np.cos(angle) * warped + warped**2
        gain, first = warped**2 / size, 2 * (warped**2 - 1) / size
        second = (1 - 2 * np.cos(angle) * warped + warped**2) / size
        section, enters = np.array([[-first, 1.0], [-second, 0.0]]), gain * np.array([2.0 - first, 1.0 - second])
        a = np.block([[a, np.zeros((len(a), 2))], [np.outer(enters, c), section]])
        b, c, d = np.concatenate([b, enters * d]), np.concatenate([gain * c, [1.0, 0.0]]), gain * d
    return a, b, c, d
