"""How a run ends, in a word and in a sentence, and what a device's answers mean in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from swingid.live.codes import FaultCode, State, Status
from swingid.live.frames import Frame


class Reason(StrEnum):
    """Why a run ended. ENDLESS: the device went on after the planned end; PROTOCOL: it contradicted the protocol."""

    FINISHED = "finished"
    STOPPED = "stopped"
    HALTED = "halted"
    GUARD = "guard"
    FAULT = "fault"
    STARVED = "starved"
    LOST = "lost"
    RESET = "reset"
    TAKEN = "taken"
    ENDLESS = "endless"
    PROTOCOL = "protocol"


@dataclass(frozen=True)
class End:
    """Why a run ended, in a word and in a sentence; fault: of the device's guard; seen: whether a sample with 0 V came
    after it, else the device's own guard gives it unseen.
    """

    reason: Reason
    sentence: str
    fault: FaultCode = FaultCode.NONE
    seen: bool = True

    @property
    def usable(self) -> bool:
        """Return whether the samples up to the end are a planned experiment, or a part of one."""
        return self.reason in (Reason.FINISHED, Reason.STOPPED)

    @property
    def zero(self) -> str:
        """What is known of 0 V, in words."""
        if self.seen:
            return "0 V"
        guarded = self.reason not in (Reason.ENDLESS, Reason.PROTOCOL)
        return "0 V was not seen, the firmware's guard gives it" if guarded else "0 V was not seen"


@dataclass(frozen=True)
class Run:
    """What a run left: all its Sample frames from reference 0 on, the sequence of that one, its end, how many samples
    got lost on the way, and whether a sample was in a state in which a motor moves.
    """

    samples: list[Frame]
    start: int
    end: End
    lost: int = 0
    moved: bool = True


def state_words(state: int) -> str:
    """A device's state for people."""
    return State(state).name.lower() if state in set(State) else f"in state {state}"


def unknown_state(name: str, state: int) -> str:
    """The sentence on a state that is none of this host's."""
    text = f"{name} reports state {state}, which this host does not know: firmware and host are of different versions, "
    return text + "or the device is faulty; build firmware and host from one version"


def fault_words(code: int, value: float = 0.0) -> str:
    """A fault of the guard for people, with what passed its limit (0: not known); also numbers that no guard gives."""
    if code == FaultCode.NONE:
        return "it names no cause (fault 0), so its firmware is faulty; build it anew"
    if code not in set(FaultCode):
        return f"code {code}, which this host does not know"
    words, unit, factor = FAULTS[FaultCode(code)]
    return f"{words} ({factor * value:.4g} {unit})" if value and unit else words


def refusal_words(status: int) -> str:
    """Why a device does not take a message, for people."""
    return REFUSALS.get(Status(status), f"status {status}") if status in set(Status) else f"status {status}"


RESET = "{} has started again in the middle of the run (its supply, or its watchdog); look after its supply, run again"

FAULTS = {
    FaultCode.HEARTBEAT: (
        "no heartbeat of the host came through for 100 ms: the host was late, or something floods the link",
        "ms",
        1e-3,
    ),
    FaultCode.ANGLE: ("the angle passed its limit", "rad", 1.0),
    FaultCode.SPEED: ("the speed of the axis passed its limit", "rad/s", 1.0),
    FaultCode.WHEEL_SPEED: ("the speed of the wheel passed its limit", "rad/s", 1.0),
    FaultCode.VOLTAGE: ("the voltage stayed at its limit for too long", "V", 1.0),
    FaultCode.CURRENT: ("the current passed its limit", "A", 1.0),
    FaultCode.AXIS_FROZEN: (
        "the encoder of the axis did not move under voltage: cable, or a held axis",
        "samples",
        1.0,
    ),
    FaultCode.WHEEL_FROZEN: (
        "the encoder of the wheel did not move under voltage: cable, motor or amplifier",
        "samples",
        1.0,
    ),
    FaultCode.AXIS_JUMP: ("the encoder of the axis jumped", "counts", 1.0),
    FaultCode.WHEEL_JUMP: ("the encoder of the wheel jumped", "counts", 1.0),
    FaultCode.OVERRUN: ("a sample came late in the firmware", "", 1.0),
    FaultCode.ENCODER: ("an encoder gave no reading", "samples", 1.0),
}
"""Faults in words, the unit of what passed its limit, and the factor from that of the link to it."""

REFUSALS = {
    Status.WRONG_STATE: "it is not idle; stop it, or clear its fault, first",
    Status.BAD_VALUE: "a value is out of its range",
    Status.BAD_PARAMETERS: "its guard can't work with these parameters; check limits and counts of the rig file",
    Status.NO_PARAMETERS: "it has lost its parameters; connect again",
    Status.WRONG_SESSION: "another host has armed it; stop that one first",
    Status.GAP: "it misses parts, which the link or its firmware loses",
    Status.NO_REFERENCE: "it has no reference",
    Status.OVER_LIMIT: "the voltage limit is above that of its amplifier; lower drive.motor.voltage_limit",
    Status.TOO_FAST: "it can't count the wheel's edges up to device.wheel_speed_limit; lower that, or counts per turn",
}
