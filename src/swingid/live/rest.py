"""The body at rest before a run: whether it hangs still, and where, over a full period of its own swing.

At a turning point a swinging body stands still for a moment, so a look that is shorter than a period may find it
hanging beside its zero. A constant and a swing at the body's frequency are fitted to the counts of both encoders.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import DeviceError
from swingid.live.guard import Board
from swingid.live.machine import EMULATED
from swingid.numerics.regression import fit_linear
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.live.frames import Frame
    from swingid.live.session import Session
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

PERIODS, SHORTEST, UNKNOWN, LONGEST = 1.25, 1.0, 5.0, 60.0
"""Periods that are listened to, a quarter more for a rig file that is that wrong; bounds of the time (s), and the time
where the rig file does not state a period: swings of 0.2 Hz and more show in it.
"""

SWING, STILLER, TURN, STEPS = 0.01, 0.005, 0.035, 3
"""Motion (rad, peak to peak) of the body that counts as hanging still before a run and before tiny pulses, that of the
wheel, and counts that any encoder may jitter. The zero of a swing of 10 mrad is known to 0.5 mrad, see `OFF`.
"""

WAIT, BACKLOG = 30.0, 0.2
"""Seconds for which a body is waited for until it hangs still; in which older samples are read and left aside."""

OWN_RATE, HOST_RATE = 0.005, 0.1
"""Relative deviations of the rate of the samples by the device's own clock and by the host's, see `require_rate`."""

OFF = 0.1
"""Share of a swing's amplitude by which its mean may be wrong: the period of the rig file is not that of the body."""

SMOOTH = 0.04
"""Seconds over which counts are averaged before their range counts as motion, which noise is not."""


@dataclass(frozen=True)
class Channel:
    """An encoder while the body hangs.

    counts: per turn; zero: counts of the mean; noise (rad): without that of rounding; spread: standard uncertainty of
    the zero (rad).
    """

    counts: int
    zero: float
    noise: float
    spread: float = 0.0

    @property
    def step(self) -> float:
        """Angle (rad) of a count."""
        return 2 * math.pi / self.counts


def period_of(rig: Rig) -> float | None:
    """Period (s) of small swings by the rig file; None where it does not state inertia and gravity torque."""
    inertia, gravity = rig.axis.inertia, rig.axis.gravity_torque
    if not isinstance(inertia, Quantity) or not isinstance(gravity, Quantity) or not gravity.value > 0:
        return None
    drive = rig.drive
    with_drive = inertia.value + (drive.carried if drive.wheel is not None else drive.reflected)
    return 2 * math.pi * math.sqrt(with_drive / gravity.value)


def listening_time(rig: Rig) -> float:
    """Seconds for which a body is listened to before its zero counts."""
    period = period_of(rig)
    return UNKNOWN if period is None else min(max(PERIODS * period, SHORTEST), LONGEST)


def friction_band(rig: Rig) -> float:
    """Standard uncertainty (rad) of where dry friction lets the body rest: anywhere within Fs/b of its zero.

    0 where the rig file states no dry friction; then what the run shows of it counts.
    """
    gravity, friction = rig.axis.gravity_torque, rig.axis.friction
    if friction is None or not isinstance(gravity, Quantity) or not gravity.value > 0:
        return 0.0
    held = [getattr(friction, key, None) for key in ("coulomb", "static", "coulomb_positive", "coulomb_negative")]
    return (
        max((quantity.value for quantity in held if isinstance(quantity, Quantity)), default=0.0)
        / gravity.value
        / math.sqrt(3.0)
    )


def counts_of(frames: list[Frame]) -> tuple[Array, Array, Array, Array]:
    """Device time (s), counts of axis and wheel without their wraps, voltage (V) of Sample frames."""
    whole = np.array([(f.time, f.axis, f.wheel) for f in frames], np.int64)
    time, axis, wheel = (np.unwrap(column, period=2**32) for column in whole.T)
    return (time - time[0]) * 1e-6, axis.astype(float), wheel.astype(float), np.array([f.voltage for f in frames])


def hanging(
    frames: list[Frame], rig: Rig, board: Board, name: str, swing: float = SWING
) -> tuple[Channel, Channel | None]:
    """Zero and noise of both encoders (None: no wheel), from samples without a voltage; swing (rad): that is allowed.

    Raises DeviceError (code "not-still") where body or wheel move, (code "no-readings") where too few samples hold one.
    """
    from swingid.live.rows import UNUSED

    used = [frame for frame in frames if not frame.flags & UNUSED]
    if len(used) < max(10, len(frames) // 2):
        text = f"{name}: {len(frames) - len(used)} of {len(frames)} samples at rest are flagged as without a reading, "
        raise DeviceError(f"{text}or late; look after the encoders' cables and magnets", code="no-readings")
    time, axis, wheel, _ = counts_of(used)
    body = _still(time, axis, board.axis_counts, swing, "body", rig, board, name)
    if not board.wheel_counts:
        return body, None
    return body, _still(time, wheel, board.wheel_counts, TURN, "wheel", rig, board, name)


def _still(time: Array, counts: Array, turn: int, most: float, what: str, rig: Rig, board: Board, name: str) -> Channel:
    """One encoder of a body at rest; raises as `hanging`."""
    step = 2 * math.pi / turn
    width = max(1, min(len(counts) // 8, round(SMOOTH * board.rate)))
    mean = np.convolve(counts, np.full(width, 1.0 / width), "valid")
    motion = float(np.ptp(mean)) * step
    if motion > most + STEPS * step:
        text = f"{name}: the {what} moves by {motion:.2g} rad in {time[-1]:.2g} s, and must hang still"
        raise DeviceError(f"{text}; let it come to rest and do not touch it", code="not-still")
    noise = math.sqrt(max(float(np.var(np.diff(counts))) / 2 - 1 / 12, 0.0)) * step
    zero, amplitude = _centre(time, counts, period_of(rig))
    spread = math.hypot(noise / math.sqrt(len(counts)), step / math.sqrt(12), OFF * amplitude * step)
    return Channel(turn, zero, noise, spread)


def _centre(time: Array, counts: Array, period: float | None) -> tuple[float, float]:
    """Mean of the counts beside a swing of this period, and the swing's amplitude (counts)."""
    middle = float(np.mean(counts))
    if period is None or time[-1] < period:
        return middle, float(np.ptp(counts)) / 2 if np.ptp(counts) > STEPS else 0.0
    phase = 2 * math.pi * time / period
    columns = np.column_stack([np.ones_like(time), np.cos(phase), np.sin(phase)])
    values = fit_linear(columns, counts - middle).values
    return middle + float(values[0]), float(np.hypot(values[1], values[2]))


def at_rest(
    session: Session,
    rig: Rig,
    board: Board,
    *,
    wait: float,
    say: Callable[[str], None],
    wanted: Callable[[], None] = lambda: None,
    swing: float = SWING,
) -> tuple[Channel, Channel | None]:
    """Both encoders of a body that hangs still, waited for up to `wait` (s); raises as `hanging`.

    wanted: called before each look; may raise where the run is no longer wanted. swing (rad): that is allowed. Raises
    DeviceError also as `require_rate`.
    """
    until, waits = session.link.clock() + wait, False
    session.listen(BACKLOG)  # what has come while the host did something else, as a rehearsal
    while True:
        wanted()
        began = session.link.clock()
        frames = session.listen(listening_time(rig))
        emulated = board.firmware in EMULATED.values()  # moves by its own clock, on a machine that may be busy
        require_rate(frames, board, 0.0 if emulated else session.link.clock() - began, session.link.name)
        try:
            return hanging(frames, rig, board, session.link.name, swing)
        except DeviceError as error:
            if error.code != "not-still" or session.link.clock() >= until:
                raise
        if not waits:
            say(f"waiting until the body hangs still, up to {wait:g} s")
        waits = True


def require_rate(frames: list[Frame], board: Board, seconds: float, name: str) -> None:
    """Raise DeviceError (code "other-rate") where samples do not come at the rate that Hello states.

    seconds: for which they came, by the host; 0 where that does not count. By the device's own clock they must be as
    far apart as Hello states, to half a per cent, which the gains bear; by the host's to a tenth, beyond which adapters
    and a busy computer explain nothing.
    """
    first, last = frames[0], frames[-1]
    steps = (last.sequence - first.sequence) % 2**32
    device = ((last.time - first.time) % 2**32) * 1e-6
    if steps < 10 or not device > 0.0:
        raise DeviceError(f"{name}: time or number of its samples stand still; correct its firmware", code="other-rate")
    rate = steps / device
    if abs(rate / board.rate - 1) > OWN_RATE:
        text = f"{name}: by its own clock {rate:.6g} samples come per second, and Hello states {board.rate:g}"
        raise DeviceError(f"{text}; correct its clock or its rate", code="other-rate")
    if seconds > 0.0 and abs((steps + 1) / seconds / board.rate - 1) > HOST_RATE:
        text = f"{name}: {(steps + 1) / seconds:.4g} samples come per second of this computer, and Hello states "
        raise DeviceError(f"{text}{board.rate:g}; correct the device's clock or its rate", code="other-rate")
