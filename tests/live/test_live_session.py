"""A session on the twin's device: runs, open-loop pulses, stops, and links that lose frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from live_host import LIMITS, RIG
from long_cases import quick_first
from refusals import coded
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError, InputError, UsageError
from swingid.live.codes import FaultCode, Mode, State, StopMode
from swingid.live.devices.stream import Stream
from swingid.live.devices.twin import twin_of
from swingid.live.frames import Frame, encode
from swingid.live.guard import parameters_of
from swingid.live.link import TURN
from swingid.live.session import End, Reason, Run, Session, wrong_hello

SINE = parse_reference("sine 0.8 rad 8.5 rad/s")(np.arange(3000) / 1000.0)


class Lossy:
    """A link that treats every frame of both directions by a rule: frame and its number in, frames out."""

    virtual = True
    address = "lossy"

    def __init__(self, stream: Stream, down: Callable[[bytes, int], bytes], up: Callable[[bytes, int], bytes]) -> None:
        self._stream, self._rules, self._counts = stream, (down, up), [0, 0]
        self._rest = b""
        self.clock = stream.clock  # type: ignore[attr-defined]

    def _treated(self, data: bytes, way: int) -> bytes:
        out = b""
        for frame in data.split(b"\0")[:-1]:
            self._counts[way] += 1
            out += self._rules[way](frame + b"\0", self._counts[way])
        return out

    def write(self, data: bytes) -> None:
        self._stream.write(self._treated(data, 0))

    def read(self, timeout: float = 0.0) -> bytes:
        return self._treated(self._stream.read(timeout), 1)

    def close(self) -> None:
        self._stream.close()


def session_on(device: Stream, **options: object) -> Session:
    session = Session(device, **options)  # type: ignore[arg-type]
    board = session.connect()
    session.require_ready()
    session.load(parameters_of(Compensator.paper(RIG), board, LIMITS))
    return session


def run(samples: np.ndarray = SINE, **options: object) -> Run:
    return session_on(twin_of(RIG)).run(samples, **options)  # type: ignore[arg-type]


def test_a_run_gives_every_sample_of_its_reference() -> None:
    done = run()
    assert done.end.reason is Reason.FINISHED
    assert done.lost == 0
    sequences = [frame.sequence for frame in done.samples]
    assert sequences[0] == done.start
    assert set(np.diff(sequences)) == {1}
    assert sum(frame.state == State.RUNNING for frame in done.samples) == 3000
    assert (done.samples[-1].state, done.samples[-1].voltage) == (State.IDLE, 0.0)


def test_the_same_run_twice_gives_the_same_bytes() -> None:
    found: list[list[tuple[bool, float, bytes]]] = [[], []]
    for kept in found:
        session = session_on(twin_of(RIG, seed=5), tap=lambda *seen, kept=kept: kept.append(seen))
        session.run(SINE)
    assert found[0] == found[1]
    assert sum(len(data) for came, _, data in found[0] if came) > 3000 * 38


def test_an_open_loop_holds_the_voltages_that_were_sent() -> None:
    pulses = np.repeat([0.0, 1.5, 0.0, -1.5, 0.0], 40)
    done = run(pulses, mode=Mode.OPEN_LOOP, fade=0.0)
    assert [frame.voltage for frame in done.samples[:200]] == pulses.tolist()
    assert done.end.reason is Reason.FINISHED


@pytest.mark.parametrize(("mode", "reason"), [(StopMode.SOFT, Reason.STOPPED), (StopMode.HARD, Reason.HALTED)])
def test_a_stop_from_a_callback(mode: StopMode, reason: Reason) -> None:
    session = session_on(twin_of(RIG))

    def batch(frames: list[Frame]) -> None:
        if frames[-1].sequence > 1500:
            session.ask_stop(mode, "enough")

    done = session.run(SINE, fade=0.25, on_batch=batch)
    assert (done.end.reason, done.end.sentence) == (reason, "enough")
    fading = sum(frame.state == State.STOPPING for frame in done.samples)
    assert fading == (250 if mode is StopMode.SOFT else 0)
    assert done.samples[-1].voltage == 0.0


def test_what_the_watch_says_is_a_hard_stop() -> None:
    done = run(watch=lambda frames: "too warm" if frames[-1].sequence > 1000 else None)
    assert (done.end.reason, done.end.sentence) == (Reason.GUARD, "too warm")
    assert not any(frame.state == State.STOPPING for frame in done.samples)


def test_the_firmwares_guard_is_the_end_and_a_person_clears_it() -> None:
    session = Session(twin_of(RIG))
    session.load(parameters_of(Compensator.paper(RIG), session.connect(), replace(LIMITS, angle=0.5)))
    done = session.run(SINE)
    assert (done.end.reason, done.end.fault) == (Reason.FAULT, FaultCode.ANGLE)
    assert done.samples[-1].voltage == 0.0
    with pytest.raises(DeviceError, check=coded("latched-fault")):
        session.require_ready()
    session.clear()
    session.require_ready()


EVERY = {
    "every ninth frame down is lost": (lambda f, n: b"" if n % 9 == 0 else f, lambda f, n: f),
    "every ninth frame up is lost": (lambda f, n: f, lambda f, n: b"" if n % 9 == 0 else f),
    "every frame down is doubled": (lambda f, n: f + f, lambda f, n: f),
    "every frame up is doubled": (lambda f, n: f, lambda f, n: f + f),
    "a bit of every eighth flips, both ways": (
        lambda f, n: bytes([f[0] ^ 4]) + f[1:] if n % 8 == 0 else f,
        lambda f, n: bytes([f[0] ^ 4]) + f[1:] if n % 8 == 0 else f,
    ),
}


@pytest.mark.parametrize("name", quick_first(2, EVERY))
def test_a_bad_link_loses_samples_but_no_run(name: str) -> None:
    done = session_on(Lossy(twin_of(RIG), *EVERY[name])).run(SINE)
    assert done.end.reason is Reason.FINISHED
    good = run()
    assert {s.sequence - done.start: s.axis for s in done.samples}.items() <= {
        s.sequence - good.start: s.axis for s in good.samples
    }.items() or name.endswith(("down is lost", "ways"))
    running = sum(frame.state == State.RUNNING for frame in done.samples)
    assert running + done.lost >= 3000 - 1
    assert running > 2500


def test_a_device_that_says_nothing_or_something_else() -> None:
    class Silent:
        virtual, address = True, "silent"

        def __init__(self, data: bytes) -> None:
            self.data = data

        def write(self, data: bytes) -> None: ...

        def read(self, timeout: float = 0.0) -> bytes:
            return self.data

        def close(self) -> None: ...

    with pytest.raises(DeviceError, check=coded("no-answer")):
        Session(Silent(b"")).connect()
    with pytest.raises(DeviceError, check=coded("no-frames")):
        Session(Silent(b"0.1, 0.2\r\n")).connect()
    old = {"schema": 1, "firmware": 0xABC, "rate": 1000.0, "axis_counts": 4096, "voltage_limit": 5.0}
    with pytest.raises(DeviceError, check=coded("other-firmware")):
        Session(Silent(encode("Hello", **old))).connect()


def test_a_run_needs_parameters_and_numbers() -> None:
    session = Session(twin_of(RIG))
    with pytest.raises(UsageError, match="load"):
        session.run([0.0])
    with pytest.raises(UsageError, match="finite"):
        session_on(twin_of(RIG)).run([np.nan])


def test_listening_gives_the_body_as_it_hangs() -> None:
    session = Session(twin_of(RIG))
    session.connect()
    frames = session.listen(1.5)
    assert 1450 < len(frames) <= 1500
    assert {frame.axis for frame in frames} == {0}


def test_the_hook_of_a_link_ends_what_goes_on_and_the_device_is_halted() -> None:
    device = twin_of(RIG)
    session = session_on(device)
    turns: list[float] = []

    def hook() -> None:
        turns.append(device.plant.time)
        if len(turns) > 60:
            raise InputError("enough", code="enough")

    session.link.each_turn = hook
    with pytest.raises(InputError, match="enough"):
        session.run(SINE)
    assert device.machine.state is State.IDLE  # type: ignore[attr-defined]
    assert device.plant.time - turns[-1] <= 3 * TURN + 1e-3
    with pytest.raises(InputError, match="enough"):
        session.listen(1.0)
    session.close()


def test_the_smallest_reference_room_is_that_of_a_lost_message() -> None:
    hello = session_on(twin_of(RIG)).hello
    assert hello is not None
    values = hello.values | {"rate": 10_000.0}
    assert wrong_hello(Frame("Hello", values | {"reference_room": 921})) == ""
    assert "samples of the reference" in wrong_hello(Frame("Hello", values | {"reference_room": 900}))
    assert wrong_hello(Frame("Hello", values | {"reference_room": 42}), virtual=True) == ""


@pytest.mark.parametrize(
    ("reason", "seen", "words"),
    [
        (Reason.FINISHED, True, "0 V"),
        (Reason.LOST, False, "0 V was not seen, the firmware's guard gives it"),
        (Reason.ENDLESS, False, "0 V was not seen"),
    ],
)
def test_what_is_known_of_0_volts(reason: Reason, seen: bool, words: str) -> None:
    assert End(reason, "it ended", seen=seen).zero == words
