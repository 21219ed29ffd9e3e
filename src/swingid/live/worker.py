"""What the processes of a run do: ``python -m swingid.live.worker`` with a pickled `Job` on standard input.

The link: the session alone, into the ring. The recorder: from the ring into the journal. Neither waits for the other.
"""

from __future__ import annotations

import json
import pickle
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from swingid.errors import SwingidError
from swingid.live.codes import StopMode
from swingid.live.experiment import Conductor, Order, opened
from swingid.live.journal import Journal, Plan
from swingid.live.pace import Pace, alone
from swingid.live.ring import Kind, Reader, Record, Ring

if TYPE_CHECKING:
    from swingid.model.rig import Rig

POLL, DEAD = 0.05, 1.5
"""Seconds between two looks at the ring, and without a sign of life after which its writer counts as dead."""

STOPS = {
    1: (StopMode.SOFT, "stopped by Ctrl-C, STOP or the system"),
    2: (StopMode.HARD, "stopped at once by Ctrl-C twice or STOP"),
    3: (StopMode.SOFT, "the wanted uncertainty is reached"),
}


@dataclass(frozen=True)
class Job:
    """What a process is to do. began: time of the first byte, ns since 1970."""

    role: Literal["link", "recorder"]
    ring: str
    rig: Rig
    address: str
    out: str
    order: Order
    began: int


class RingRecorder:
    """The recorder's interface towards the ring."""

    def __init__(self, ring: Ring) -> None:
        self._ring, self.error, self._now = ring, "", 0.0

    def take(self, came: bool, now: float, data: bytes) -> None:
        """Bytes of the link."""
        self._now = now
        self._ring.write(Kind(came), now, data)

    def plan(self, plan: Plan, **facts: object) -> None:
        """What is about to be run."""
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
    """The session with the device, alone in its process."""

    def say(text: str) -> None:
        ring.write(Kind.SAY, 0.0, text.encode())
        ring.rest()  # the twin's rehearsal comes next, or the end

    try:
        stream = opened(job.address, job.rig)
        pace = BeatingPace(ring)
        conductor = Conductor(
            job.rig,
            stream,
            say=say,
            recorder=lambda _: RingRecorder(ring),
            follow=False,
            asked=lambda: STOPS.get(ring.stop),
            pace=pace,
        )
        with alone() as first:
            done = conductor.run(replace(job.order, until=0.0), Path(job.out))
        how = "SCHED_FIFO" if first else "without SCHED_FIFO, which this user may not set"
        say(f"host's loop: {pace.words()} ({how})")
        ring.write(Kind.DONE, 0.0, pickle.dumps(done))
    except SwingidError as error:
        ring.write(Kind.FAILED, 0.0, pickle.dumps((type(error), error.message, error.code)))


def recorder(job: Job, ring: Ring) -> None:
    """The journal, until the process of the link has ended, or died."""
    journal = Journal(job.out, job.rig, began=job.began)
    reader = Reader(ring)
    over, lost = False, 0
    while not over:
        records = reader.read()
        for record in records:
            over = record.kind in (Kind.DONE, Kind.FAILED) or over
            keep(journal, record)
        if reader.lost > lost:
            lost = reader.lost
            journal.event("lost", f"{lost} bytes came faster than they could be written")
        if not records:
            journal.tick(time.monotonic())
            time.sleep(POLL)
        if ring.silence > DEAD or (ring.over and not records and not over):
            over = True
            journal.event("dead", "the process of the link has died; the firmware gives 0 V without its heartbeat")
    journal.close()
    ring.forget()
    if journal.error:
        sys.exit(journal.error)


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


def main() -> None:
    """Read the job, do it."""
    job: Any = pickle.loads(sys.stdin.buffer.read())
    ring = Ring(job.ring)
    {"link": link, "recorder": recorder}[job.role](job, ring)


if __name__ == "__main__":
    main()
