"""The host against a device that was written from docs/protocol.md alone: runs, signs, and every misbehaviour."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from foreign_board import FAULT, Board, Build, Flaw
from foreign_device import ForeignDevice
from foreign_faults import FLAWS
from foreign_rig import Figures, Mounting
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import SwingidError
from swingid.identification import identify
from swingid.live.commission import commission
from swingid.live.experiment import Conductor, Order, require_usable
from swingid.live.session import Session
from swingid.model.rig import Rig
from swingid.recording.recording import Recording

for package in ("cantools", "cobs", "fastcrc"):
    pytest.importorskip(package, reason=f"{package} is not installed: pip install 'swingid[live]'")

ROOT = Path(__file__).parents[2]
RIG = Rig.load("paper")
TRUTH = Figures().body  # kg m^2
MOTION = "sine 0.8 rad 8.5 rad/s"
SECONDS, FADE = 6.0, 0.1
LISTENS = 2.5  # s that the host looks at the hanging body before a run: what waited, a quarter more than its period
GRACE = 3.0  # s after the planned end and its fade within which the host has stopped a run and has seen 0 V
SILENCE = 0.15  # s without a host after which every motor is at 0 V: 100 ms of the guard, and some


class EndlessRunError(AssertionError):
    """The host still reads when it should long have ended the run."""


class Watched(ForeignDevice):
    """A device that notes what its motor got last, and fails a host that never comes to an end.

    deaf (s of its time): nothing of the host comes from then on; None: never.
    """

    def __init__(self, flaw: Flaw | None = None, mounting: Mounting | None = None, most: float = 60.0) -> None:
        super().__init__(flaw, mounting)
        self.most, self.deaf = self.clock() + most, float("inf")
        self.last_driven = 0.0
        self.unread = b""

    def tick(self) -> None:
        if self.clock() > self.most:
            raise EndlessRunError(f"after {self.samples * self.period:.1f} s of the device the host still goes on")
        super().tick()
        if self.output != 0.0:
            self.last_driven = self.clock()

    def write(self, data: bytes) -> None:
        if self.clock() < self.deaf:
            super().write(data)

    def read(self, timeout: float) -> bytes:
        data, self.unread = self.unread, b""
        return data + super().read(timeout)

    def while_the_host_is_busy(self, seconds: float) -> None:
        """Time in which nobody reads: a socket or a serial port of a computer keeps what comes."""
        for _ in range(round(seconds / self.period)):
            self.tick()
            self.unread += self.board.take()

    def alone(self, seconds: float) -> None:
        """Time without a host."""
        for _ in range(round(seconds / self.period)):
            super().tick()


@dataclass
class Outcome:
    """code: reason of the run's end or code of the error; exit: exit code of the command; status: of the answer."""

    code: str
    exit: int
    said: str = ""
    status: str = ""
    value: float = 0.0
    half: float = 0.0


def run(device: ForeignDevice, out: Path, seconds: float = SECONDS) -> Outcome:
    order = Order(parse_reference(MOTION), Compensator.paper(RIG), seconds, fade=FADE, rehearse=False)
    try:
        done = Conductor(RIG, device).run(order, out)
        require_usable(done, out)
        found = identify(Recording.load(out, RIG), RIG)
    except SwingidError as error:
        return Outcome(error.code, error.exit_code, error.message)
    low, high = found.inertia.interval95
    half = 0.5 * (high - low)
    return Outcome(done.end.reason.value, 0, done.end.sentence, found.status, found.inertia.value, half)


# ---- the device itself: what the page says


def session_of_the_page() -> Iterator[tuple[str, str]]:
    page = (ROOT / "docs" / "protocol-session.md").read_text(encoding="utf-8")
    text = page.split("<!-- protocol: session -->")[1].split("```")[1].split("\n", 1)[1]
    for part in re.split(r"^(?=[=><] )", text, flags=re.MULTILINE):
        if part:
            head, _, rest = part.partition("\n")
            yield head, rest


def test_the_device_answers_the_session_of_the_page_to_the_byte() -> None:
    board, came = Board(Build()), b""
    for head, rest in session_of_the_page():
        if head[0] == "=":
            numbers = [int(x) for x in re.findall(r"-?\d+", head.partition(":")[0])]
            assert board.sample(numbers[0], numbers[1], numbers[2]) == float(head.split()[-2])
            came += board.take()
        elif head[0] == ">":
            board.receive(bytes.fromhex(rest))
            came += board.take()
        else:
            wanted = bytes.fromhex(rest)
            assert came[: len(wanted)] == wanted, head
            came = came[len(wanted) :]
    assert came == b""


def test_its_law_gives_the_numbers_of_the_page() -> None:
    from foreign_law import Law

    page = (ROOT / "docs" / "protocol-device.md").read_text(encoding="utf-8")
    part = page.split("<!-- protocol: control -->")[1].split("<!-- end -->")[0]
    tables = re.findall(r"places 17 to \d+: `(.*?)`(.*?)(?=\nn = |\Z)", part, re.DOTALL)
    assert len(tables) == 2
    for places, table in tables:
        law = Law([0.0] * 5 + [1.0] + [0.0] * 11 + [float(x) for x in places.split(",")])
        for row in re.findall(r"^\| (-?[\d.].*) \|$", table, re.MULTILINE):
            reference, angle, wheel, *wanted = (float(x) for x in row.split("|"))
            voltage = law.voltage(reference, angle, wheel)
            assert [voltage, law.gain, law.filtered, *law.xi] == pytest.approx(wanted, rel=1e-13, abs=1e-15)


# ---- a device that does nothing wrong


def test_a_run_finds_the_inertia(tmp_path: Path) -> None:
    device = Watched()
    found = run(device, tmp_path / "run.mcap", 8.0)
    assert (found.code, found.exit, found.status) == ("finished", 0, "ok")
    assert abs(found.value - TRUTH) <= found.half < 0.001 * TRUTH
    device.alone(SILENCE)
    assert device.output == 0.0


def test_samples_that_came_during_the_rehearsal_are_no_higher_rate(tmp_path: Path) -> None:
    device = Watched()
    order = Order(parse_reference(MOTION), Compensator.paper(RIG), 1.0, fade=FADE)
    done = Conductor(RIG, device, say=lambda line: device.while_the_host_is_busy(0.4)).run(order, tmp_path / "run.mcap")
    assert done.end.reason.value == "finished"


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, 1, -1)])
def test_commissioning_finds_the_signs(signs: tuple[int, int, int]) -> None:
    axis, wheel, motor = signs
    with Session(Watched(mounting=Mounting(*signs))) as session:
        found = commission(session, RIG)
    assert found.axis_sign == 1  # a choice: the rig and its mirror image are the same
    assert (found.wheel_sign, found.voltage_sign) == (wheel * axis, motor * axis)
    assert found.axis.zero == pytest.approx(Mounting().axis_begin, abs=1.0)
    assert found.inertia is not None
    a11 = Figures().body + Figures().wheel + Figures().rotor
    assert found.inertia[0] == pytest.approx(a11, abs=3.0 * found.inertia[1])


@pytest.mark.parametrize("name", ["", "no_guard"])
def test_a_host_that_is_gone_leaves_0_volts(name: str, tmp_path: Path) -> None:
    """The guard sees to it within 100 ms; where there is none, the host says how the run has ended."""
    device = Watched(FLAWS[name] if name else None)
    device.deaf = device.clock() + LISTENS + 2.0
    found = run(device, tmp_path / "run.mcap")
    assert found.exit == 5
    if not name:
        assert (device.board.state, found.code) == (FAULT, "run-fault")
        assert device.last_driven <= device.deaf + 0.1
    device.alone(SILENCE)
    assert device.output == 0.0


# ---- misbehaviours

DISOBEYS = {"voltage_after_end"}  # the device keeps a voltage at the motor: the host has to say so

# what the page's ranges of Hello exclude, or what can't be a run: an answer would be luck
REFUSED = {name for name in FLAWS if name.startswith("hello_")} | {
    *("other_rate", "other_rate_unsaid", "time_stands", "time_stands_always", "time_back", "sequence_stands"),
    *("stays_running", "stays_stopping", "stays_armed", "state_77", "endless", "endless_stop_ignored"),
    *("unknown_fault", "restarts", "run_in_future", "no_ack_reference", "no_ack_run", "no_ack_arm"),
    *("no_ack_parameters", "room_zero", "next_backwards", "next_ahead", "invalid", "axis_freezes", "wheel_freezes"),
    *("voltage_nan", "silent_after_run", "silent_in_run", "never_says_a_word", "voltage_after_end"),
}

# rows that are near to another, and those that go on for longest: they are run with the long tests
LONG = {
    *("clock_fast_little", "clock_slow_little", "run_one_late", "run_in_past", "no_ack_stop", "gain_nan"),
    *("samples_twice", "wrong_bytes", "stays_stopping", "endless_stop_ignored", "finished_once", "no_ack_run"),
    *("clock_slow", "stop_ignored", "state_77", "samples_lost", "finished_never", "late_flags", "stays_running"),
    *("garbage", "endless", "clock_fast", "voltage_after_end"),
}


def rows() -> list[object]:
    return [pytest.param(name, marks=[pytest.mark.long] if name in LONG else [], id=name) for name in FLAWS]


@pytest.mark.parametrize("name", rows())
def test_whatever_a_device_does_the_host_ends_and_says_so(name: str, tmp_path: Path) -> None:
    """No other exception than ours, an end in time, 0 V, and no wrong answer with status ok."""
    pace = FLAWS[name].pace  # the reference takes longer on a slow device, and so does its end
    device = Watched(FLAWS[name], most=LISTENS + (SECONDS + FADE) / min(pace, 1.0) + GRACE)
    found = run(device, tmp_path / "run.mcap")
    device.alone(SILENCE)
    if name not in DISOBEYS:
        assert device.output == 0.0
    if name in REFUSED:
        assert found.exit in (3, 4, 5), found
        assert found.said.count("\n") == 0
    if found.status == "ok":
        assert abs(found.value - TRUTH) <= 1.5 * found.half


def test_there_are_many_misbehaviours() -> None:
    assert len(FLAWS) >= 60
    assert set(FLAWS) >= REFUSED | LONG | DISOBEYS


# ---- in real time


@pytest.mark.long
@pytest.mark.real_time
def test_a_run_in_real_time_finds_the_inertia(tmp_path: Path) -> None:
    """The commands `commission` and `run` on the program, behind TCP."""
    program = [sys.executable, str(ROOT / "tests" / "foreign_device.py"), "--tcp", "0", "--signs=+--"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as device:
        try:
            assert device.stdout is not None
            address = device.stdout.readline().strip()
            rig, out = tmp_path / "rig.toml", tmp_path / "run.mcap"
            command = [sys.executable, "-m", "swingid"]
            found = subprocess.run(
                [*command, "commission", "--rig", "paper", "--device", address, "--out", str(rig)],
                capture_output=True,
                text=True,
                timeout=120.0,
            )
            assert found.returncode == 0, found.stderr
            assert "wheel -1, voltage -1" in found.stdout
            done = subprocess.run(
                [*command, "run", "--rig", str(rig), "--reference", MOTION, "--duration", "25", "--out", str(out)],
                capture_output=True,
                text=True,
                timeout=240.0,
            )
            assert done.returncode == 0, done.stderr
        finally:
            device.kill()
    result = identify(Recording.load(out, Rig.load(rig)), Rig.load(rig))
    low, high = result.inertia.interval95
    assert low <= TRUTH <= high
    assert result.status == "ok"
