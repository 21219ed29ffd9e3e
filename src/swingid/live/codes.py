"""Numbers that the link carries in place of words: states, faults, answers, modes and flags.

Those of `State`, `FaultCode`, `Status`, `StopMode` and `Mode` stand in the DBC file too, which a test compares.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag


def apart(first: int, second: int) -> int:
    """Difference of two numbers of 32 bits that wrap: counts, times, sequences. Of a number and 0: as it wraps."""
    return (first - second + 2**31) % 2**32 - 2**31


class State(IntEnum):
    """State of a device; only RUNNING and STOPPING apply a voltage, FAULT is left by Clear alone."""

    IDLE = 0
    ARMED = 1
    RUNNING = 2
    STOPPING = 3
    FAULT = 4


class FaultCode(IntEnum):
    """Why the guard has tripped."""

    NONE = 0
    HEARTBEAT = 1
    ANGLE = 2
    SPEED = 3
    WHEEL_SPEED = 4
    VOLTAGE = 5
    CURRENT = 6
    AXIS_FROZEN = 7
    WHEEL_FROZEN = 8
    AXIS_JUMP = 9
    WHEEL_JUMP = 10
    OVERRUN = 11
    ENCODER = 12


class Status(IntEnum):
    """Answer of a device to a message."""

    DONE = 0
    WRONG_STATE = 1
    BAD_VALUE = 2
    BAD_PARAMETERS = 3
    NO_PARAMETERS = 4
    WRONG_SESSION = 5
    GAP = 6
    FULL = 7
    NO_REFERENCE = 8
    OVER_LIMIT = 9
    TOO_FAST = 10


class StopMode(IntEnum):
    """How Stop ends a run: 0 V at once, or after the reference has faded to its hanging value."""

    HARD = 0
    SOFT = 1


class Mode(IntEnum):
    """What the samples of a run are: a reference (rad) for the controller, or voltages (V)."""

    CLOSED_LOOP = 0
    OPEN_LOOP = 1


class Flag(IntFlag):
    """Bits of `Sample.flags`."""

    CLAMPED = 1
    STARVED = 2
    FINISHED = 4
    FADING = 8
    INVALID = 16
    LATE = 32
    DROPPED = 64
    BAD_FRAME = 128
