"""What the samples of a run have shown, and where they contradict the protocol."""

from __future__ import annotations

from dataclasses import dataclass, field

from swingid.live.codes import Flag, State, apart
from swingid.live.ends import fault_words, state_words, unknown_state
from swingid.live.frames import Frame

SILENT = 0.5
"""Seconds without a sample until the link is lost."""

ENERGISED = (State.RUNNING, State.STOPPING)


@dataclass
class Seen:
    """The samples so far. name: of the device; rate: samples per second; planned: samples of the reference.

    when: the last new sample came, stale: whether samples came that were not new since then; lost: samples of the run,
    missed: all that did not come; damaged: samples that report a bad frame from the host; flags: all of this run;
    states: all since Arm.
    """

    name: str
    rate: float
    planned: int
    when: float
    samples: list[Frame] = field(default_factory=list)
    last: Frame | None = None
    stale: bool = False
    lost: int = 0
    missed: int = 0
    damaged: int = 0
    flags: int = 0
    states: set[int] = field(default_factory=set)
    restarted: bool = False

    @property
    def near(self) -> int:
        """Samples within which numbers of one instant may differ: what a link may hold back, 0.1 s."""
        return max(round(0.1 * self.rate), 20)

    def take(self, frame: Frame, now: float, start: int | None) -> tuple[bool, str]:
        """A Sample frame; whether it is a new one, and what is wrong with it in a sentence ("" for nothing).

        start: sequence of reference 0, where it is known.
        """
        wrong = ""
        if self.last is not None:
            gap = apart(frame.sequence, self.last.sequence)
            if gap <= 0:
                self.restarted = gap < -int(self.rate)
                self.stale = True
                if not self.restarted:
                    return False, ""
            elif gap > (now - self.when + SILENT) * 2 * self.rate:
                wrong = f"{self.name}: the number of its samples jumps by {gap}; its firmware is faulty: build it anew"
            else:
                self.missed += gap - 1
                self.lost += (gap - 1) if start is not None else 0
        self.last, self.when, self.stale = frame, now, self.stale and self.restarted
        self.samples.append(frame)
        self.states.add(frame.state)
        self.damaged += bool(frame.flags & Flag.BAD_FRAME)
        if start is not None and apart(frame.sequence, start) >= 0:
            self.flags |= frame.flags
        return True, wrong or self._wrong(frame, start)

    def _wrong(self, frame: Frame, start: int | None) -> str:
        """What a sample says that cannot be."""
        if frame.state not in set(State):
            return unknown_state(self.name, frame.state)
        if frame.state in ENERGISED and frame.fault:
            return f"{self.name} reports a fault and goes on: {fault_words(frame.fault)}"
        if frame.state == State.ARMED and frame.voltage:
            return f"{self.name} is armed and applies {frame.voltage:.3g} V; its firmware is faulty: build it anew"
        if start is None:
            return ""
        number = apart(frame.sequence, start)
        if frame.state == State.ARMED and number > self.near:
            return f"{self.name} answered Run, and is still armed {number} samples after its start"
        if frame.state in ENERGISED and number < -self.near:
            return f"{self.name} moves {-number} samples before the start that its answer to Run states"
        if frame.flags & Flag.FINISHED and 0 <= number < self.planned:
            return f"{self.name} says that the reference is at its end after {number} of {self.planned} samples"
        return ""

    def number(self, start: int) -> int:
        """How many samples of the reference the device has used, as far as its samples have come."""
        return 0 if self.last is None else max(apart(self.last.sequence, start) + 1, 0)

    def still(self) -> str:
        """Why no new sample comes, in a sentence."""
        if self.stale and self.last is not None:
            text = f"the number of its samples stands still at {self.last.sequence}, so its firmware hangs"
            return f"{self.name}: {text}; look after its supply, connect again"
        text = f"{self.name} has sent no sample for {SILENT:g} s: it hangs, or the link is cut; its guard gives 0 V"
        return f"{text}; look after cable and supply, connect again"

    def running_words(self) -> str:
        """What the device does now, in words."""
        if self.last is None:
            return "silent"
        return state_words(self.last.state) + (f" with {self.last.voltage:.3g} V" if self.last.voltage else "")
