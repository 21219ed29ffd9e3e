"""The compiled closed loop: encoders are read, the controller steps, its command is held, the rig moves."""

from __future__ import annotations

import numpy as np

from swingid.control.backstepping import backstepping_step
from swingid.control.law import compensator_step
from swingid.model.integrator import NOW, Q1, Q2, ROWS, STATES, V1, V2, Step
from swingid.model.motion import COUNTS, FIELDS, LONGEST, PROBES, Advance
from swingid.model.parameters import OFFSET
from swingid.model.sensors import encoder_reading
from swingid.model.sticking import Begin
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import FLOAT, VECTOR, KernelPointer, njit, njit_called, njit_nogil


@njit
def given_command(command: float, angle: float, wheel_angle: float, state: Array, parameters: Array) -> float:
    """The open loop as a controller: its input is the command."""
    return command


_CONTROLLER = FLOAT(FLOAT, FLOAT, FLOAT, VECTOR, VECTOR)
OPEN_LOOP = KernelPointer(given_command, _CONTROLLER)
COMPENSATOR = KernelPointer(compensator_step, _CONTROLLER)
BACKSTEPPING = KernelPointer(backstepping_step, _CONTROLLER)


@njit_called
def before_start(
    start: float,
    work: Array,
    instants: Array,
    seen: Array,
    counts: Ints,
) -> None:
    """State at the instants before the start (s), needed by early readings: uniform motion up to it."""
    i = 0
    while i < len(instants) and instants[i] < start:
        for state in range(STATES):
            seen[i, state] = work[NOW, state]
        seen[i, Q1] += work[NOW, V1] * (instants[i] - start)
        seen[i, Q2] += work[NOW, V2] * (instants[i] - start)
        i += 1
    counts[PROBES] = i


@njit_nogil
def closed_loop(
    step: Step,
    begin: Begin,
    move: Advance,
    control: KernelPointer,
    times: Array,
    inputs: Array,
    pushes: Array,
    state: Array,
    parameters: Array,
    limit: float,
    y: Array,
    p: Array,
    encoders: Array,
    noise: Array,
    instants: Array,
    reads: Ints,
    seen: Array,
    log: Array,
) -> Ints:
    """Run the loop over the sample instants `times` (n + 1,) (s); returns the counts of `advance`.

    step, begin, move: `STEP_KERNEL`, `BEGIN_KERNEL`, `ADVANCE_KERNEL`; control: `OPEN_LOOP`, `COMPENSATOR` or
    `BACKSTEPPING`. They are called by their addresses, so that each is compiled once, apart from this loop, and what a
    run does not use is not compiled.

    inputs (n,): reference (rad), or the command where the loop is open. pushes (n,): torque on the axis from outside
    (N m), held from sample to sample, or empty. y (5,): initial state. encoders (2, 4):
    arrays of angle and wheel for `encoder_reading`; noise (2, n) (rad). instants (m,): sorted times at which the
    motion is wanted; its state goes to seen (m, 5). log (rows <= n, 4) receives angle, wheel angle, command and the
    controller's state[0]; reads (2, rows): which instant is row k's reading. A reading that is later than its sample
    is logged late; the controller, which can't wait for it, is given that of the sample's own instant.
    """
    rows = len(log)
    counts, work, tried = np.zeros(COUNTS, np.int64), np.zeros((ROWS, STATES)), LONGEST
    nodes = np.zeros((0, FIELDS))
    for i in range(STATES):
        work[NOW, i] = y[i]
    angle_encoder, wheel_encoder = encoders[0], encoders[1]
    before_start(times[0], work, instants, seen, counts)
    offset = p[OFFSET]
    for k in range(len(inputs)):
        t = times[k]
        if len(pushes):
            p[OFFSET] = offset - pushes[k]  # a constant friction torque is an external one of opposite sign
        q1, q2 = work[NOW, Q1], work[NOW, Q2]
        if k < rows and instants[reads[0, k]] < t:
            q1 = seen[reads[0, k], Q1]
        if k < rows and instants[reads[1, k]] < t:
            q2 = seen[reads[1, k], Q2]
        angle = encoder_reading(q1, angle_encoder, noise[0, k])
        wheel_angle = encoder_reading(q2, wheel_encoder, noise[1, k])
        u = min(max(control(inputs[k], angle, wheel_angle, state, parameters), -limit), limit)
        if k < rows:
            log[k, 2] = u
            log[k, 3] = state[0]
        tried = move(step, begin, t, times[k + 1], u, work, tried, p, instants, seen, nodes, counts)
    for k in range(rows):
        log[k, 0] = encoder_reading(seen[reads[0, k], Q1], angle_encoder, noise[0, k])
        log[k, 1] = encoder_reading(seen[reads[1, k], Q2], wheel_encoder, noise[1, k])
    p[OFFSET] = offset
    return counts
