"""A run on a real device in three processes: the link alone, the recorder, and the view, which is the caller's.

They are joined by a ring in memory (`live/ring.py`), so none waits for another: a view or a recorder that is slow or
dead does not stop the loop, and where the link's process dies the firmware gives 0 V for want of its heartbeat.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import DeviceError, InputError, SwingidError
from swingid.live.codes import StopMode
from swingid.live.experiment import Conductor, Done, Order, opened, required
from swingid.live.frames import Decoder
from swingid.live.guard import Limits
from swingid.live.journal import require_new
from swingid.live.progress import Follower, Progress
from swingid.live.ring import Kind, Reader, Record, Ring
from swingid.live.worker import DEAD, POLL, Job

if TYPE_CHECKING:
    from swingid.model.rig import Rig

ENDING = 10.0
"""Seconds that the recorder has for the end of its file."""


class ProcessConductor:
    """As `experiment.Conductor`, for a device in real time. address: of the device. pids: of link and recorder."""

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
        self._follower: Follower | None = None
        self._decoder = Decoder()
        self._notes: list[str] = []
        self.pids: dict[str, int] = {}

    def stop(self, mode: StopMode, why: str) -> None:
        """Stop the run; from a signal handler or another thread."""
        del why
        if self._ring is not None:
            self._ring.stop = max(self._ring.stop % 3, 1 if mode is StopMode.SOFT else 2)

    def run(self, order: Order, out: Path) -> Done:
        """Do it all; raises as `experiment.Conductor.run`, and DeviceError where the process of the link dies."""
        required(order)
        Limits.of(self.rig)
        require_new(out)
        self._check_out(out)
        ring = self._ring = Ring()
        workers: dict[str, subprocess.Popen[bytes]] = {}
        try:
            for role in ("recorder", "link"):
                workers[role] = self._start(role, order, out, ring)
                self.pids[role] = workers[role].pid
            done = self._follow(order, ring, workers["link"])
            done.journal_error = done.journal_error or _ended(workers["recorder"])
            return done
        except BaseException:
            ring.stop = 2
            for worker in workers.values():
                _ended(worker)
            raise
        finally:
            self._ring = None
            ring.close()

    @staticmethod
    def _check_out(out: Path) -> None:
        try:
            out.open("wb").close()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"cannot write {out}: {reason}; give another --out", code="cannot-write") from None

    def _start(self, role: str, order: Order, out: Path, ring: Ring) -> subprocess.Popen[bytes]:
        """A process of its own, which the terminal's Ctrl-C does not reach."""
        job = Job(role, str(ring.path), self.rig, self.address, str(out), order, time.time_ns())  # type: ignore[arg-type]
        windows = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
        worker = subprocess.Popen(
            [sys.executable, "-m", "swingid.live.worker"],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=os.name != "nt",
            creationflags=windows,
        )
        assert worker.stdin is not None
        worker.stdin.write(pickle.dumps(job))
        worker.stdin.close()
        worker.stdin = None
        return worker

    def _follow(self, order: Order, ring: Ring, link: subprocess.Popen[bytes]) -> Done:
        """Show what the ring brings until the link has ended."""
        reader = Reader(ring)
        while True:
            dead = link.poll() is not None
            for record in reader.read():
                if record.kind is Kind.DONE:
                    done: Done = pickle.loads(record.data)
                    done.notes += self._notes + (self._follower.notes if self._follower is not None else [])
                    return done
                if record.kind is Kind.FAILED:
                    kind, message, code = pickle.loads(record.data)
                    raise kind(message, code=code)
                self._see(record, order, ring)
            if dead:
                ring.over = True
                raise self._dead(link)
            time.sleep(POLL)

    def _see(self, record: Record, order: Order, ring: Ring) -> None:
        if record.kind is Kind.SAY:
            self._say(record.data.decode())
        elif record.kind is Kind.PLAN:
            plan, facts = pickle.loads(record.data)
            rate = float(facts["rate"])
            self._follower = Follower(self.rig, plan.parameters.tolist(), plan.reference.tolist(), order.until, rate)
        elif record.kind is Kind.DEVICE and self._follower is not None:
            progress = self._follower.feed(self._decoder.feed(record.data))
            try:
                self._show(progress)
            except Exception as error:  # whatever a view does, the run goes on
                self._show = lambda _: None
                self._notes.append(f"the view has failed ({type(error).__name__}); the run went on without it")
            if progress.reached and ring.stop == 0:
                ring.stop = 3

    def _dead(self, link: subprocess.Popen[bytes]) -> SwingidError:
        text = (
            f"the process of the link to {self.address} has died (exit code {link.returncode}); without its heartbeat "
        )
        text += (
            "the firmware gives 0 V within 100 ms, and the journal holds the run up to there; clear the fault (--clear)"
        )
        return DeviceError(text, code="host-died")


def _ended(worker: subprocess.Popen[bytes]) -> str:
    """Why a process did not end well, after a time for its end; "" where it did."""
    try:
        _, said = worker.communicate(timeout=DEAD + ENDING)
    except subprocess.TimeoutExpired:
        worker.kill()
        return "its process did not end in time"
    if worker.returncode == 0:
        return ""
    lines = said.decode(errors="replace").strip().splitlines() if said else []
    return lines[-1] if lines else f"its process has died, exit code {worker.returncode}"


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
