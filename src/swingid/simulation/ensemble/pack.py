"""From runs to blocks of lanes, and back to their logs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.model.motion import LONGEST
from swingid.model.parameters import STRIBECK_SPEED
from swingid.numerics.arrays import Array, Ints
from swingid.simulation.ensemble import lanes
from swingid.simulation.ensemble.block import run_block
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.runs import Run
from swingid.simulation.twin import loop_inputs, own_limit


@dataclass(frozen=True)
class Block:
    """Up to LANES runs that go together, by their places `members` in the ensemble; p (members, SIZE): their constants.

    inputs (rows, references), which (members,): references or commands, and each run's column of them.
    """

    members: list[int]
    runs: list[Run]
    p: Array
    inputs: Array
    which: Ints
    closed: bool
    rate: float


def blocks_of(runs: list[Run], time: Array, rate: float) -> tuple[list[Block], list[int]]:
    """Blocks of the runs that the lanes can take, and the places of those they can't. Errors as `simulate`."""
    constants = [run.constants() for run in runs]
    kinds: dict[tuple[bool, bool], list[int]] = {}
    left: list[int] = []
    for k, run in enumerate(runs):
        if run.fits_lanes(constants[k]):
            peaked = bool(constants[k][STRIBECK_SPEED] > 0.0)
            kinds.setdefault((run.controller is not None, peaked), []).append(k)
        else:
            left.append(k)
    blocks = []
    for (closed, _), members in kinds.items():
        inputs, which = _inputs([runs[k] for k in members], time)
        for first in range(0, len(members), LANES):
            own = members[first : first + LANES]
            part = which[first : first + LANES]
            p = np.array([constants[k] for k in own])
            blocks.append(Block(own, [runs[k] for k in own], p, inputs, part, closed, rate))
    return blocks, left


def _inputs(runs: list[Run], time: Array) -> tuple[Array, Ints]:
    """Distinct references or commands (rows, m), and each run's column; a reference is computed once."""
    columns: dict[tuple[int, int], int] = {}
    found: list[Array] = []
    which = np.empty(len(runs), np.int64)
    for k, run in enumerate(runs):
        key = (id(run.reference), id(run.drive))
        if key not in columns:
            columns[key] = len(found)
            found.append(loop_inputs(run.rig, run.reference, run.controller, run.drive, time, len(time))[0])
        which[k] = columns[key]
    return np.ascontiguousarray(np.array(found).T), which


def run_packed(block: Block, log: Array) -> Array:
    """Run a block, its log into `log` (channels, members, rows); returns the last states (members, 4) (rad, rad/s).

    Lanes without a run do the last member's once more.
    """
    rows, count = len(block.inputs), len(block.members)
    sample = 1.0 / block.rate
    steps = int(np.ceil(sample / LONGEST * (1.0 - 1e-9)))
    h = sample / steps
    lane = np.zeros((lanes.ROWS, LANES))
    filled = np.minimum(np.arange(LANES), count - 1)
    p = block.p[filled]
    lanes.pack_motion(lane, p, h)
    lanes.pack_encoders(lane, np.array([run.encoders() for run in block.runs])[filled])
    lane[lanes.RIG_LIMIT] = np.array([own_limit(run.rig) for run in block.runs])[filled]
    lane[lanes.Q1] = np.array([run.initial_angle for run in block.runs])[filled]
    lane[lanes.U] = np.array([run.initial_speed for run in block.runs])[filled] * h
    if block.closed:
        gains, states = _controllers(block.runs, sample)
        lanes.pack_controller(lane, gains[filled], sample)
        lane[lanes.K_TILDE : lanes.XI + 1] = states[filled].T
    noise = np.zeros((2, 1, LANES))
    if any(s.noise for run in block.runs for s in (run.rig.sensors.of("angle"), run.rig.sensors.of("wheel"))):
        noise = np.zeros((2, rows, LANES))
        for i, run in enumerate(block.runs):
            draws = run.noise(rows)
            if draws is not None:
                noise[:, :, i] = draws
    flat = lane.ravel()
    peaked = int(bool(np.any(lane[lanes.PEAK] > 0.0)))
    bends = lane[[lanes.ANGLE_COSINE, lanes.ANGLE_SINE, lanes.WHEEL_COSINE, lanes.WHEEL_SINE]]
    kinds = int(block.closed), peaked, int(bool(np.any(bends)))
    run_block(flat, p, block.inputs, block.which[filled], kinds, steps, h, noise, log)
    end = lane[[lanes.Q1, lanes.U, lanes.Q2, lanes.Y], :count].T
    result: Array = end * np.array([1.0, 1.0 / h, 1.0, 1.0 / h])
    return result


def _controllers(runs: list[Run], sample: float) -> tuple[Array, Array]:
    """Gains (runs, 18) and first states (runs, 5) of the compensators; equal ones are asked once."""
    gains: dict[int, Array] = {}
    states: dict[int, Array] = {}
    for run in runs:
        assert run.controller is not None
        key = id(run.controller)
        if key not in gains:
            gains[key] = run.controller.parameters(sample)
            states[key] = run.controller.initial_state(run.initial_angle)
    return np.array([gains[id(run.controller)] for run in runs]), np.array([states[id(run.controller)] for run in runs])
