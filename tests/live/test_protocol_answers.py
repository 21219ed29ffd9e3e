"""docs/protocol.md against the machine and the C core: the answer to each message in each state, refusals, flags."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from firmware_build import CoreDevice
from live_host import BOARD, PARAMETERS, Driver, arm_frame, parameter_frames, reference_frames
from protocol_page import page, table
from swingid.live import codes, frames, guard
from swingid.live.codes import Mode, State, StopMode
from swingid.live.frames import encode
from swingid.live.guard import Board, Readings
from swingid.live.machine import Machine
from swingid.live.schema import schema

SLOW = replace(BOARD, most_edges=1.0)
"""A board that counts one edge per second, so no wheel that turns."""

DEVICES = pytest.mark.parametrize("kind", [Machine, CoreDevice], ids=["python", "c"])


class Bench(Driver):
    """A device in a wanted state, and what the page's words say of it: held, CRC, taken, room, free, begin."""

    def __init__(self, kind: Any, board: Board = BOARD) -> None:
        super().__init__(kind(board))
        self.held, self.taken, self.used, self.begin = 0, 0, 0, 0
        self.parameters = PARAMETERS

    def bring(self, state: str) -> None:
        """A run has been before every state, so that what stays of it is seen."""
        self.tick()
        self.tick()
        self.tell(parameter_frames() + arm_frame())
        self.tell(reference_frames([0.1] * 28, last=False))
        self.held, self.taken = len(PARAMETERS), 28
        if state == "armed":
            return
        self.begin = 2
        self.tell(encode("Run", session=7))
        for _ in range(3):
            self.tick()
        self.used = 3
        if state == "idle":
            self.tell(encode("Stop", mode=StopMode.HARD))
        elif state == "stopping":
            self.tell(encode("Stop", mode=StopMode.SOFT))
        elif state == "fault":
            self.tick(step=5000)

    def words(self) -> dict[str, int]:
        crc = frames.checksum(self.parameters[: self.held].astype("<f8").tobytes())
        free = 1024 - (self.taken - self.used)
        return {
            "0": 0,
            "held": self.held,
            "CRC": crc,
            "taken": self.taken,
            "room": 1024,
            "free": free,
            "begin": self.begin,
        }

    def answer(self, data: bytes) -> Any:
        before = len(self.frames)
        self.tell(data)
        (ack,) = self.frames[before:]
        assert ack.name == "Ack"
        return ack


STATES = ("idle", "armed", "running", "stopping", "fault")
GOOD = {
    "Stop, hard": lambda b: encode("Stop", session=999, mode=2),
    "Stop, soft": lambda b: encode("Stop", session=999, mode=1),
    "Clear": lambda b: encode("Clear", session=999),
    "Parameters": lambda b: parameter_frames()[:70],
    "Arm": lambda b: arm_frame(session=7),
    "Reference": lambda b: reference_frames([0.1] * 2, start=b.taken, last=False),
    "Run": lambda b: encode("Run", session=7),
}


def done(bench: Bench, message: str, state: str) -> None:
    """What DONE changes in the words."""
    if message == "Parameters":
        bench.held = 7
    if message == "Arm":
        bench.taken = bench.used = 0
    if message == "Reference":
        bench.taken += 2
    if message == "Run" and state == "armed":
        bench.begin = 2


@DEVICES
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("row", table("Answers", "idle"), ids=lambda row: row["message"])
def test_the_answer_to_each_message_in_each_state(kind: Any, state: str, row: dict[str, str]) -> None:
    bench = Bench(kind)
    bench.bring(state)
    ack = bench.answer(GOOD[row["message"]](bench))
    status, _, after = row[state].partition(" → ")
    assert codes.Status(ack.status).name == status
    assert State(ack.state).name.lower() == (after or state)
    if status == "DONE":
        done(bench, row["message"], state)
    assert (ack.next, ack.value) == (bench.words()[row["next"]], bench.words()[row["value"]])
    assert schema().by_id[ack.message].name == row["message"].split(",")[0]
    sequence = bench.last("Sample").sequence + 1
    bench.tick()
    assert bench.last("Sample").sequence == sequence


@DEVICES
@pytest.mark.parametrize("state", STATES)
def test_who_is_answered_in_every_state_and_a_heartbeat_is_not(kind: Any, state: str) -> None:
    bench = Bench(kind)
    bench.bring(state)
    before = len(bench.frames)
    bench.tell(encode("Heartbeat", session=7) + encode("Heartbeat", session=8) + encode("Who"))
    (hello,) = bench.frames[before:]
    assert (hello.name, State(hello.state).name.lower()) == ("Hello", state)


def prepared(name: str) -> Any:
    """A device in the situation of a row of the table of refusals, or in the one in which its message is good."""

    def make(kind: Any) -> Bench:
        bench = Bench(kind, SLOW if name == "fast" else BOARD)
        bench.tick()
        if name == "half":
            bench.tell(parameter_frames()[:140])
        elif name == "none":
            pass
        elif name == "over":
            bench.parameters = PARAMETERS.copy()
            bench.parameters[guard.VOLTAGE_LIMIT] = 10.5
            bench.tell(parameter_frames(bench.parameters))
        elif name == "bad":
            bench.parameters = PARAMETERS.copy()
            bench.parameters[0] = 0.0
            bench.tell(parameter_frames(bench.parameters))
        else:
            bench.tell(parameter_frames())
        if name in ("armed", "complete", "full", "empty"):
            bench.tell(arm_frame())
        if name == "complete":
            bench.tell(reference_frames([0.1] * 14))
        if name == "full":
            bench.tell(reference_frames([0.1] * 1020, last=False))
        if name == "armed":
            bench.tell(reference_frames([0.1] * 14, last=False))
        return bench

    return make


def before_a_sample(kind: Any) -> Bench:
    bench = Bench(kind)
    bench.tell(parameter_frames())
    return bench


Rule = tuple[list[Any], list[dict[str, Any]]]
BROKEN: dict[str, Rule] = {
    # situations in which a row applies (none: any), and fields with which it does
    "P1": ([prepared("armed")], []),
    "P2": ([], [{"count": 0}, {"count": 8}, {"total": 42}, {"index": 65535, "count": 7}, {"index": 30, "count": 6}]),
    "P3": ([], [{"index": 21}, {"index": 14, "total": 37}]),
    "A1": ([before_a_sample], []),
    "A2": ([], [{"mode": 2}, {"mode": 255}]),
    "A3": ([prepared("half"), prepared("none")], []),
    "A4": ([prepared("bad")], [{"parameters": 1}]),
    "A5": ([prepared("over")], []),
    "A6": ([prepared("fast")], []),
    "F1": ([prepared("")], []),
    "F2": ([], [{"session": 8}]),
    "F3": ([], [{"count": 15}, {"count": 255}]),
    "F4": ([], [{"start": 13}, {"start": 2**32 - 1}]),
    "F5": ([prepared("complete")], []),
    "F6": ([prepared("full")], []),
    "F7": ([], [{"value": (math.nan,)}, {"value": (0.0, math.inf)}]),
    "R1": ([prepared("")], []),
    "R2": ([], [{"session": 8}]),
    "R3": ([prepared("empty")], []),
}
USUAL = {"P": prepared("half"), "A": prepared(""), "F": prepared("armed"), "R": prepared("armed")}
NAMES = {"P": "Parameters", "A": "Arm", "F": "Reference", "R": "Run"}


def message_of(letter: str, bench: Bench, changed: dict[str, Any]) -> bytes:
    """A message that is good in its usual situation, with some fields changed."""
    taken = bench.last("Ack").next if letter == "F" and bench.frames else 0
    fields: dict[str, Any] = {
        "P": {"index": 14, "count": 7, "total": 35, "value": tuple(PARAMETERS[14:21])},
        "A": {"session": 7, "parameters": frames.checksum(bench.parameters.astype("<f8").tobytes()), "fade": 5},
        "F": {"start": taken, "count": 14, "session": 7, "value": (0.1,) * 14},
        "R": {"session": 7},
    }[letter]
    return encode(NAMES[letter], **fields | changed)


REFUSALS = table("Answers", "row")


def test_every_row_of_the_refusals_is_tried() -> None:
    assert [row["row"] for row in REFUSALS] == list(BROKEN)
    assert [row["message"] for row in REFUSALS if row["message"]] == list(NAMES.values())


@DEVICES
@pytest.mark.parametrize("row", REFUSALS, ids=lambda row: row["row"])
def test_a_refusal_comes_before_those_below_it_and_changes_nothing(kind: Any, row: dict[str, str]) -> None:
    letter = row["row"][0]
    places, changes = BROKEN[row["row"]]
    below = [name for name in BROKEN if name[0] == letter and name > row["row"]]
    for change in changes or [{}]:
        worse = [change | more for name in below for more in BROKEN[name][1] if not set(more) & set(change)]
        for fields in (change, *worse):
            for make in places or [USUAL[letter]]:
                bench = make(kind)
                ack = bench.answer(message_of(letter, bench, fields))
                assert codes.Status(ack.status).name == row["status"], fields
                if not places:
                    assert bench.answer(message_of(letter, bench, {})).status == codes.Status.DONE
        for name in below if not places else ():
            for make in BROKEN[name][0]:
                bench = make(kind)
                ack = bench.answer(message_of(letter, bench, change))
                assert codes.Status(ack.status).name == row["status"], name


@DEVICES
@pytest.mark.parametrize("letter", USUAL)
def test_the_message_is_good_where_no_row_applies(kind: Any, letter: str) -> None:
    bench = USUAL[letter](kind)
    assert bench.answer(message_of(letter, bench, {})).status == codes.Status.DONE


# ---- flags ----


def carried(kind: Any, flag: str) -> tuple[Driver, list[int]]:
    """A device in which this flag is set, and the flags of its next eight samples."""
    driver = Driver(kind(BOARD))
    reading, step = Readings(0, 0), 1000
    volts = [1.0] * (2 if flag in ("FINISHED", "STARVED") else 40)
    parameters = PARAMETERS.copy()
    if flag == "CLAMPED":
        volts = [0.0, 99.0, *volts]
    driver.tick()
    last = flag == "FINISHED"
    driver.tell(parameter_frames(parameters) + arm_frame(parameters, mode=Mode.OPEN_LOOP, fade=3))
    driver.tell(reference_frames(volts, last=last) + encode("Run", session=7))
    driver.tick()
    if flag in ("FINISHED", "STARVED"):
        driver.tick()
    if flag == "FADING":
        driver.tell(encode("Stop", mode=StopMode.SOFT))
    if flag == "LATE":
        step = 1501
    if flag == "INVALID":
        reading = Readings(0, 0, valid=False)
    if flag == "BAD_FRAME":
        driver.tell(b"\x05abc\0")
    if flag == "DROPPED":
        for _ in range(60):
            driver.device.receive(encode("Clear"))
        driver.frames += driver.decoder.feed(driver.device.output())
    before = len(driver.frames)
    for _ in range(8):
        driver.tick(reading, step=step)
        reading, step = Readings(0, 0), 1000
    return driver, [frame.flags for frame in driver.frames[before:] if frame.name == "Sample"]


@DEVICES
@pytest.mark.parametrize("row", table("Flags", "bit"), ids=lambda row: row["flag"])
def test_how_long_a_flag_is_reported(kind: Any, row: dict[str, str]) -> None:
    driver, flags = carried(kind, row["flag"])
    bit = 1 << int(row["bit"])
    has = [bool(one & bit) for one in flags]
    expected = {
        "once": [True] + [False] * 7,
        "until the next Arm": [True] * 8,
        "in each such sample": [True] * 3 + [False] * 5,
    }[row["reported"]]
    assert has == expected
    if row["reported"] == "until the next Arm":
        driver.tell(arm_frame(parameters=1))
        driver.tick()
        assert driver.last("Sample").flags & bit, "a refused Arm has cleared it"
        driver.tell(arm_frame())
        driver.tick()
        assert not driver.last("Sample").flags & bit


def test_the_buffer_holds_the_answers_that_the_page_says() -> None:
    driver = Driver(Machine(BOARD))
    driver.tick()
    driver.device.receive(encode("Clear") * 40)
    for i in range(7):
        driver.device.tick(1000 * i + 2000, Readings(0, 0))
    found = driver.decoder.feed(driver.device.output())
    assert [frame.name for frame in found] == ["Ack"] * 40 + ["Sample"] * 7
    assert not any(frame.flags for frame in found[40:])
    assert "720 bytes of Acks" in page()
    assert 40 * len(encode("Ack")) == 720
