"""What the processes of a run do: ``python -m swingid.live.worker ROLE RING``; the ring's first record is the `Job`.

The link: the session alone, into the ring. The recorder: from the ring into the journal. Neither waits for the other.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import SwingidError
from swingid.live.codes import StopMode
from swingid.live.devices.stream import gone
from swingid.live.experiment import TOO_FAST, Conductor, Done, Order, opened
from swingid.live.interrupt import stopping
from swingid.live.journal import Journal, Plan
from swingid.live.pace import Pace, alone
from swingid.live.ring import Kind, Reader, Record, Ring, Role, job_in
from swingid.processes import END_SIGNALS
from swingid.system import keep_traceback

if TYPE_CHECKING:
    from swingid.model.rig import Rig

POLL, DEAD, HUNG = 0.05, 1.5, 3.0
"""Seconds between two looks at the ring; without a sign of life after which its writer counts as dead, and after which
it is ended: the firmware has given 0 V for want of a heartbeat long before.
"""


@dataclass(frozen=True)
class Job:
    """What is to be run. began: time of the first byte, ns since 1970."""

    rig: Rig
    address: str
    out: str
    order: Order
    began: int


class RingRecorder:
    """The recorder's interface towards the ring."""

    def __init__(self, ring: Ring) -> None:
        self._ring, self.error, self._now, self.planned = ring, "", 0.0, False

    def take(self, came: bool, now: float, data: bytes) -> None:
        """Bytes of the link."""
        self._now = now
        self._ring.write(Kind(came), now, data)

    def plan(self, plan: Plan, **facts: object) -> None:
        """What is about to be run."""
        self.planned = True
        self._ring.write(Kind.PLAN, self._now, pickle.dumps((plan, facts)))

    def event(self, event: str, text: str, now: float | None = None) -> None:
        """Something that a reader of the journal wants to know."""
        self._ring.write(Kind.EVENT, self._now if now is None else now, json.dumps([event, text]).encode())

    def close(self) -> None:
        """The journal ends with the process of the link."""


class BeatingPace(Pace):
    """Turns that are a sign of life in the ring."""

    def __init__(self, ring: Ring) -> None:
        super().__init__()
        self._ring = ring

    def wait(self) -> None:
        """Sleep until the next deadline."""
        super().wait()
        self._ring.beat()


def link(job: Job, ring: Ring) -> None:
    """The session with the device, alone in its process; how it ended goes into the ring, an error too."""
    ring.hold(Role.LINK)
    try:
        ring.write(Kind.DONE, 0.0, pickle.dumps(_linked(job, ring)))
    except SwingidError as error:
        ring.write(Kind.FAILED, 0.0, pickle.dumps(error))
    except OSError as error:
        ring.write(Kind.FAILED, 0.0, pickle.dumps(gone(job.address, error.strerror or error)))
    except Exception as error:
        ring.write(Kind.FAILED, 0.0, pickle.dumps(bug(error, f"the link to {job.address}")))


def _linked(job: Job, ring: Ring) -> Done:
    def say(text: str) -> None:
        ring.write(Kind.SAY, 0.0, text.encode())
        ring.rest()  # the end comes next

    pace, recorder = BeatingPace(ring), RingRecorder(ring)
    look = Watched(ring, recorder)
    conductor = Conductor(
        job.rig,
        opened(job.address, job.rig),
        say=say,
        recorder=lambda _: recorder,
        follow=False,
        asked=look,
        rest=ring.rest,
        pace=pace,
    )
    with alone() as first, stopping(conductor.stop):
        done = conductor.run(replace(job.order, until=0.0), Path(job.out))
    how = "SCHED_FIFO" if first else "without SCHED_FIFO, which this user may not set"
    say(f"host's loop: {pace.words()} ({how})")
    return done


class Watched:
    """The stops that the view asks for; before the run its death is one, later the run goes on without it."""

    def __init__(self, ring: Ring, recorder: RingRecorder) -> None:
        self._ring, self._recorder, self._looked = ring, recorder, 0.0

    def __call__(self) -> tuple[StopMode, str] | None:
        """What is asked for now."""
        now = time.monotonic()
        if not self._recorder.planned and now - self._looked > POLL:
            self._looked = now
            if not self._ring.held(Role.VIEW):
                return StopMode.HARD, "the command that wanted the run has died"
        return self._ring.asked


def recorder(job: Job, ring: Ring) -> None:
    """The journal, until the process of the link has ended, or died; why it is not whole goes to standard error."""
    for number in END_SIGNALS:  # its end is that of the link
        signal.signal(number, signal.SIG_IGN)
    ring.hold(Role.RECORDER)
    try:
        said = _recorded(job, ring)
    except SwingidError as error:
        said = error.message
    except OSError as error:
        said = error.strerror or str(error)
    except Exception as error:
        said = bug(error, "the journal").message
    if said:
        sys.exit(said)


def _recorded(job: Job, ring: Ring) -> str:
    """Keep a run; why the journal is not whole, "" where it is."""
    journal = Journal(job.out, job.rig, began=job.began)
    reader, last = Reader(ring), LastSigns(ring)
    over, lost = False, 0
    while not over:
        dead = last.dead()
        records = reader.read()
        for record in records:
            over = record.kind in (Kind.DONE, Kind.FAILED) or over
            keep(journal, record)
        if reader.lost > lost:
            lost = reader.lost
            journal.event("lost", f"{lost} {TOO_FAST}")
        if not records:
            journal.tick(time.monotonic())
            time.sleep(POLL)
        if dead and not over:
            over = True
            journal.event("dead", "the process of the link has died; the firmware gives 0 V without its heartbeat")
    journal.close()
    last.end_orphan()
    return journal.error or (f"{lost} {TOO_FAST}" if lost else "")


class LastSigns:
    """Watches whether the process of the link lives, as the recorder sees it."""

    def __init__(self, ring: Ring) -> None:
        self._ring, self._begun = ring, False

    def dead(self) -> bool:
        """Return whether nothing can come from it any more."""
        held = self._ring.held(Role.LINK)
        self._begun = self._begun or held
        gone = not held and (self._begun or not self._ring.held(Role.VIEW))
        return gone or self._ring.over or self._ring.silence > DEAD

    def end_orphan(self) -> None:
        """End a link's process that hangs and that no view looks after."""
        while self._ring.silence > DEAD and self._ring.held(Role.LINK) and not self._ring.held(Role.VIEW):
            if self._ring.silence > HUNG:
                end_process(self._ring.pid)
                return
            time.sleep(POLL)


def keep(journal: Journal, record: Record) -> None:
    """A record of the ring into the journal."""
    if record.kind in (Kind.HOST, Kind.DEVICE):
        journal.take(record.kind is Kind.DEVICE, record.time, record.data)
    elif record.kind is Kind.PLAN:
        plan, facts = pickle.loads(record.data)
        journal.plan(plan, **facts)
    elif record.kind is Kind.EVENT:
        event, text = json.loads(record.data)
        journal.event(event, text, record.time)


def end_process(pid: int) -> None:
    """End a process at once; without effect where there is none."""
    if hasattr(os, "kill"):
        with suppress(OSError):
            os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))


def bug(error: Exception, where: str) -> SwingidError:
    """The error of an exception that swingid did not expect in a process of a run."""
    path = keep_traceback(error, ["run", f"({where})"])
    said = f"{type(error).__name__}" + (f" ({error})" if str(error) else "")
    what = f"please report it with the file {path}" if path else "please report it with the command you gave"
    return SwingidError(f"this is a bug of swingid in the process of {where}, {said}; {what}", code="bug")


def main() -> None:
    """Read the job, do it."""
    role, handle = sys.argv[1:]
    ring = Ring(handle)
    {"link": link, "recorder": recorder}[role](job_in(ring), ring)


if __name__ == "__main__":
    main()
