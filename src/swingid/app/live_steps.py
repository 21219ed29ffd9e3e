"""The steps of the live page as one table, and what each does in ``python -m swingid.app.live_steps RING``.

A new step is an entry of `STEPS` with its function; what it asks for and draws is in `app/live_page.py`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.app.task import Halt, StoppedError, Task, View
from swingid.errors import SwingidError
from swingid.live.codes import apart
from swingid.live.ring import Ring, job_in

if TYPE_CHECKING:
    from swingid.live.guard import Board
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

TOGETHER, APART = 500, 0.005
"""Rows that are drawn at once; seconds between two samples that are drawn of a check: a pulse has 16 of them."""


class Samples:
    """Draws what a device sends while nothing runs, from the bytes on its link: see `runner.Seen.rows`.

    most: seconds that it takes at most.
    """

    def __init__(self, view: View, most: float) -> None:
        from swingid.live.frames import Decoder

        self.view, self.most = view, most
        self.board: Board | None = None
        self.signs = (1, 1, 1)
        self._decoder = Decoder()
        self._first: tuple[int, int, int] | None = None
        self._next = 0.0

    def tap(self, came: bool, _: float, data: bytes) -> None:
        """Bytes of the link; came: from the device."""
        board = self.board
        if not came or board is None:
            return
        rows = []
        for frame in self._decoder.feed(data):
            if frame.name != "Sample":
                continue
            now = frame.time, frame.axis, frame.wheel
            self._first = self._first or now
            time, axis, wheel = (apart(a, b) for a, b in zip(now, self._first, strict=True))
            if (t := 1e-6 * time) >= self._next:
                self._next = t + APART
                angle = 2 * math.pi * self.signs[0] * axis / board.axis_counts
                turned = 2 * math.pi * self.signs[1] * wheel / board.wheel_counts if board.wheel_counts else None
                rows.append([t, angle, None, None, self.signs[2] * frame.voltage, turned])
        if rows:
            t = rows[-1][0]
            self.view.draw(rows, {"time": t, "left": max(self.most - t, 0.0)})


def _connect(task: Task, rig: Rig, view: View) -> None:
    """Who is there, and whether it is the rig of the rig file."""
    from swingid.live.experiment import opened
    from swingid.live.preflight import require_same_rig
    from swingid.live.session import Session

    with Session(opened(task.address, rig)) as session:
        board = session.connect()
        wheel = f", {board.wheel_counts} of the wheel" if board.wheel_counts else ""
        view.say(f"{session.link.name}: firmware {board.firmware:08x}, {board.rate:g} samples per second")
        view.say(f"{board.axis_counts} counts per turn of the axis{wheel}; {board.voltage_limit:g} V at most")
        require_same_rig(rig, board, session.link.name)


def _check(task: Task, rig: Rig, view: View) -> None:
    """Return whether it hangs still and its signs hold, by the pulses of `swingid commission`; nothing is written."""
    from swingid.errors import InputError
    from swingid.live.commission import commission
    from swingid.live.experiment import opened
    from swingid.live.pulses import LEAD, PULSE, SHARES, TAIL_TIME
    from swingid.live.rest import listening_time
    from swingid.live.session import Session

    pulses = len(SHARES) + 1  # with that of the guard
    samples = Samples(view, listening_time(rig) + pulses * (LEAD + 2 * PULSE + TAIL_TIME))
    with Session(opened(task.address, rig), tap=samples.tap) as session:
        session.link.each_turn = view.require_wanted
        try:
            samples.board = session.connect()
            device = rig.device
            samples.signs = device.axis_sign, device.wheel_sign, device.voltage_sign
            if task.clear:
                session.clear()
            if rig.drive.wheel is None:
                session.require_ready()
                view.say("signs are not checked: that needs a reaction wheel")
                return
            commissioning = commission(session, rig, progress=view.say)
        except StoppedError:
            if session.hello is not None:
                session.stop()  # until the device answers; the end of the session sends it again
            view.say("stopped: 0 V")
            raise
    for line in commissioning.lines():
        view.say(line)
    wrong = [
        name for name in ("wheel_sign", "voltage_sign") if getattr(commissioning, name) != getattr(rig.device, name)
    ]
    if wrong:
        text = f"{task.rig}: device.{' and device.'.join(wrong)} must be the other sign; swingid commission writes it"
        raise InputError(text, code="wrong-sign")
    view.say("it hangs still, and its signs are those of the rig file")


def _rehearse(task: Task, rig: Rig, view: View) -> None:
    from swingid.app.order import order_of
    from swingid.live.guard import Limits
    from swingid.live.preflight import rehearsed

    order, limits = order_of(task.motion, task.duration, task.until, rig), Limits.of(rig)
    view.say("the twin runs it …")
    rate = 1000.0

    def seen(log: Recording) -> None:
        for rows in _in_pieces(log, every=max(1, round(rate * APART))):
            view.draw(rows, {})

    span = {"duration": order.duration, "rate": rate, "fade": order.fade}
    rehearsal = rehearsed(rig, order.motion, order.controller, limits, seen, **span)
    view.say(rehearsal.words())
    view.say("within the limits of the guard")


def _in_pieces(log: Recording, every: int) -> Iterator[list[list[Any]]]:
    """Every n-th row of a log of the twin, some of them together."""
    import numpy as np

    columns = [log.time, log.angle, log.reference, None, log.voltage, log.wheel_angle]
    count = len(log.time)
    thin = [[None] * count if column is None else np.round(column, 5).tolist() for column in columns]
    rows = [list(row) for row in zip(*thin, strict=True)][::every]
    for start in range(0, len(rows), TOGETHER):
        yield rows[start : start + TOGETHER]


def _run(task: Task, rig: Rig, view: View) -> None:
    from swingid.app.order import order_of
    from swingid.live.experiment import require_usable
    from swingid.live.interrupt import stopping
    from swingid.live.processes import conductor_of

    order = order_of(task.motion, task.duration, task.until, rig, clear=task.clear)
    view.require_wanted()
    conductor = conductor_of(rig, task.address, say=view.say, show=view.show)
    view.pass_stops_to(conductor.stop)
    with stopping(conductor.stop):
        done = conductor.run(order, Path(task.out))
    view.say(f"{done.end.sentence}: {done.end.zero}; wrote {task.out}")
    view.found = {"journal": task.out, "seen": done.end.seen}
    require_usable(done, task.out)


@dataclass(frozen=True, slots=True)
class Step:
    """A step of the live page: name, title, what its process does (None: the page alone shows it), how STOP ends it.

    waits: what for, while it can't be begun; after: steps that must have passed. button: its word; text, note: what
    stands above that, of `{device}` and `{rig}`. doing: a sentence while it goes on, state: the same in the bar;
    passed: a sentence once it has.
    """

    name: str
    title: str
    do: Callable[[Task, Rig, View], None] | None = None
    halt: Halt = Halt.ENDS
    waits: str = ""
    after: tuple[str, ...] = ()
    button: str = ""
    text: str = ""
    note: str = ""
    doing: str = ""
    state: str = ""
    passed: str = ""

    @property
    def moves(self) -> bool:
        """Return whether a motor can move in it."""
        return self.halt is not Halt.ENDS


STEPS = (
    Step(
        "connect",
        "Connect",
        _connect,
        button="Connect",
        text="Device: {device}. Rig file: {rig}.",
        note="Who the device is, and whether it is the rig of the rig file.",
        doing="Asking the device who it is.",
        state="connecting …",
        passed="Connected. Next: check that it hangs still.",
    ),
    Step(
        "check",
        "Check",
        _check,
        Halt.AT_ONCE,
        waits="waits for the connection",
        after=("connect",),
        button="Check",
        text="The body must hang still. Small pulses turn the wheel, to find signs and delay.",
        doing="Listening to the hanging body, then turning its wheel by small pulses.",
        state="checking …",
        passed="It hangs still, and its signs are right. Next: rehearse the motion on the twin.",
    ),
    Step(
        "rehearse",
        "Rehearse",
        _rehearse,
        waits="waits for the check",
        after=("check",),
        button="Rehearse on the twin",
        doing="The twin runs the motion, held against the limits.",
        state="rehearsing …",
        passed="The motion is rehearsed: it stays within the limits. Next: run it.",
    ),
    Step(
        "run",
        "Run",
        _run,
        Halt.FADES,
        waits="waits for the rehearsal of this motion",
        after=("check", "rehearse"),
        button="Run",
        doing="Running. STOP, or Escape, ends it softly; a second time gives 0 V at once.",
        state="getting ready …",
    ),
    Step("result", "Result", waits="waits for a run"),
    Step("report", "Keep", waits="waits for a run"),
)
"""The steps of the live page in order; those that a process does come first."""

ON_RIG = {step.name: step for step in STEPS if step.do is not None}
"""Steps that a process does, by name."""


def perform(task: Task, view: View) -> None:
    """Do a task; errors are lines, and the end "failed", or "stopped"."""
    from swingid.model.rig import Rig

    how = "failed"
    try:
        do = ON_RIG[task.kind].do
        assert do is not None
        do(task, Rig.load(task.rig), view)
        how = "ok"
    except StoppedError:
        how = "stopped"
    except SwingidError as error:
        view.say(error.message)
    except MemoryError:
        view.say("there is not enough memory for this; choose a shorter duration, or close other programs")
    except Exception as error:
        view.say(f"this is a bug of swingid, {type(error).__name__} ({error}); please report it")
    view.finish(how)


def main() -> None:
    """Do the task that the ring holds."""
    ring = Ring(sys.argv[1])
    task: Task = job_in(ring)
    view = View(ring)
    view.watch(ON_RIG[task.kind].halt)
    perform(task, view)


if __name__ == "__main__":
    main()
