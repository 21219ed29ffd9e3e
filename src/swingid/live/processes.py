"""A run on a real device in three processes: the link alone, the recorder, and the view, which is the caller's.

They are joined by a ring in memory (`live/ring.py`), so none waits for another: a view or a recorder that is slow or
dead does not stop the loop, and where the link's process dies the firmware gives 0 V for want of its heartbeat.
"""

from __future__ import annotations

import math
import pickle
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import DeviceError, InputError, SwingidError
from swingid.live.codes import StopMode
from swingid.live.experiment import Conductor, Done, Order, opened, required
from swingid.live.frames import Decoder
from swingid.live.guard import Limits
from swingid.live.journal import new_file, require_new
from swingid.live.progress import Follower, Progress
from swingid.live.ring import Kind, Reader, Record, Ring, Role, started
from swingid.live.running import OVERTIME, SLOW
from swingid.live.worker import DEAD, HUNG, POLL, Job

if TYPE_CHECKING:
    from swingid.model.rig import Rig

WORKER = "swingid.live.worker"

ENDING = 10.0
"""Seconds that the recorder has for the end of its file."""

OBEYS, SPARE = 5.0, 15.0
"""Seconds in which the link's process obeys a hard stop (its own patience with the device is 1 s), and after the
planned end in which it has ended: what it allows the device before and after the run, and its ends.
"""


class ProcessConductor:
    """Conducts as `experiment.Conductor`, for a device in real time. address: of the device. pids: of link and
    recorder.
    """

    def __init__(
        self,
        rig: Rig,
        address: str,
        *,
        say: Callable[[str], None] | None = None,
        show: Callable[[Progress], None] | None = None,
    ) -> None:
        self.rig, self.address = rig, address
        self._say = say or (lambda _: None)
        self._show = show or (lambda _: None)
        self._ring: Ring | None = None
        self._asked: tuple[StopMode, str] | None = None
        self._follower: Follower | None = None
        self._decoder = Decoder()
        self.pids: dict[str, int] = {}

    def stop(self, mode: StopMode, why: str) -> None:
        """Stop the run; from a signal handler or another thread."""
        if self._ring is not None:
            self._ring.ask(mode, why)
        elif self._asked is None or mode is StopMode.HARD:
            self._asked = mode, why

    def run(self, order: Order, out: Path) -> Done:
        """Do it all; raises as `experiment.Conductor.run`, and DeviceError where the process of the link dies."""
        required(order)
        Limits.of(self.rig)
        require_new(out)
        new = not out.exists()
        new_file(out).close()
        if new:  # the recorder makes it again
            out.unlink()
        ring = self._ring = Ring()
        ring.hold(Role.VIEW)
        if self._asked is not None:  # before there was a ring
            ring.ask(*self._asked)
        job = Job(self.rig, self.address, str(out), order, time.time_ns())
        ring.write(Kind.JOB, 0.0, pickle.dumps(job))
        ring.rest()  # no sign of the link yet
        workers: dict[str, subprocess.Popen[bytes]] = {}
        try:
            for role in ("recorder", "link"):
                workers[role] = started(ring, WORKER, role, stderr=subprocess.PIPE)
                self.pids[role] = workers[role].pid
            done = self._follow(order, ring, workers)
            done.journal_error = done.journal_error or _ended(workers["recorder"])
            return done
        except BaseException:
            ring.ask(StopMode.HARD, "the command has ended")
            for worker in workers.values():
                _ended(worker)
            raise
        finally:
            self._ring = self._asked = None
            ring.close()

    def _follow(self, order: Order, ring: Ring, workers: dict[str, subprocess.Popen[bytes]]) -> Done:
        """Show what the ring brings until the link has ended; one that hangs is ended."""
        reader, link, patience = Reader(ring), workers["link"], Patience(ring, order)
        while True:
            dead = link.poll() is not None
            unrecorded = self._follower is None and workers["recorder"].poll() is not None
            for record in reader.read():
                if record.kind is Kind.DONE:
                    done: Done = pickle.loads(record.data)
                    done.notes += self._follower.notes if self._follower is not None else []
                    return done
                if record.kind is Kind.FAILED:
                    raise pickle.loads(record.data)
                self._see(record, order, ring, patience)
            if dead:
                ring.over = True
                raise self._dead(f"has died (exit code {link.returncode})", "host-died")
            hangs = patience.hangs()
            if hangs:
                link.kill()
                _ended(link)
                ring.over = True
                raise self._dead(f"{hangs}, so it was killed", "host-hung")
            if unrecorded and self._follower is None:
                why = _ended(workers["recorder"])
                text = f"the journal's process has ended ({why}), and nothing has moved; run again"
                raise InputError(text, code="cannot-write")
            time.sleep(POLL)

    def _see(self, record: Record, order: Order, ring: Ring, patience: Patience) -> None:
        if record.kind is Kind.SAY:
            self._say(record.data.decode())
        elif record.kind is Kind.PLAN:
            plan, facts = pickle.loads(record.data)
            rate = float(facts["rate"])
            patience.begin(len(plan.reference) / rate)
            planned = plan.parameters.tolist(), plan.reference.tolist()
            self._follower = Follower(self.rig, *planned, order.until, rate, self._show)
        elif record.kind is Kind.DEVICE and self._follower is not None:
            reached = self._follower.look(self._decoder.feed(record.data))
            if reached:
                ring.ask(StopMode.SOFT, reached)

    def _dead(self, how: str, code: str) -> SwingidError:
        text = f"the process of the link to {self.address} {how}; without its heartbeat "
        if self._follower is None:
            return DeviceError(f"{text}the firmware gives 0 V, and the run had not begun: run again", code=code)
        text += "the firmware gives 0 V within 100 ms, and the journal holds the run up to there; "
        return DeviceError(f"{text}clear the fault (--clear)", code=code)


class Patience:
    """How long the view waits for the process of the link."""

    def __init__(self, ring: Ring, order: Order) -> None:
        self._ring, self._order = ring, order
        self._until = math.inf
        self._stopped = math.inf

    def begin(self, planned: float) -> None:
        """The run is about to begin and takes so long (s)."""
        self._until = time.monotonic() + planned * (1 + SLOW) + self._order.fade + OVERTIME + SPARE

    def hangs(self) -> str:
        """How the process of the link shows that it hangs, "" where it does not."""
        now = time.monotonic()
        self._stopped = min(self._stopped, now) if self._ring.stop == 2 else math.inf
        if self._ring.silence > HUNG:
            return f"hangs, without a sign of life for {HUNG:g} s"
        if now - self._stopped > OBEYS:
            return f"hangs, and has not obeyed a hard stop for {OBEYS:g} s"
        if now > self._until:
            return "hangs, and has not ended at the planned end"
        return ""


def _ended(worker: subprocess.Popen[bytes]) -> str:
    """Why a process did not end well, after a time for its end; "" where it did."""
    try:
        _, said = worker.communicate(timeout=DEAD + ENDING)
    except subprocess.TimeoutExpired:
        worker.kill()
        worker.communicate()
        return "its process did not end in time"
    if worker.returncode == 0:
        return ""
    lines = said.decode(errors="replace").strip().splitlines() if said else []
    if lines:
        return lines[-1]
    code = worker.returncode
    by = f"killed by signal {-code}" if code < 0 else f"ended by exit code {code}"
    return f"the process that writes it was {by}"


def conductor_of(
    rig: Rig,
    address: str,
    *,
    say: Callable[[str], None] | None = None,
    show: Callable[[Progress], None] | None = None,
) -> Conductor | ProcessConductor:
    """Who runs an experiment on the device of an address ("": the emulator): in this process on virtual time, else in
    processes of its own.
    """
    if not address or address.startswith("twin://"):
        return Conductor(rig, opened(address, rig), say=say, show=show)
    return ProcessConductor(rig, address, say=say, show=show)
