"""The device's state machine and guard: known decisions, and the C core against them, byte by byte."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_build import CoreDevice
from live_host import (
    BOARD,
    LIMITS,
    PARAMETERS,
    PERIOD,
    RIG,
    STILL,
    Driver,
    arm_frame,
    parameter_frames,
    reference_frames,
)
from swingid.control.compensator import Compensator
from swingid.live.codes import FaultCode, Flag, Mode, State, Status, StopMode
from swingid.live.ends import refusal_words
from swingid.live.frames import encode, unwrap
from swingid.live.guard import VOLTAGE_LIMIT, WHEEL_SPEED_LIMIT, WHEEL_STEP, Readings, parameters_of
from swingid.live.machine import Machine
from swingid.live.schema import schema


@pytest.fixture(params=[Machine, CoreDevice], ids=["python", "c"])
def driver(request: pytest.FixtureRequest) -> Driver:
    return Driver(request.param(BOARD))


def test_hello_says_what_the_device_is(driver: Driver) -> None:
    driver.tell(encode("Who", schema=schema().hash))
    hello = driver.last("Hello")
    assert (hello.schema, hello.version, hello.state, hello.rate) == (schema().hash, 1, State.IDLE, 1000.0)
    assert (hello.axis_counts, hello.wheel_counts, hello.voltage_limit) == (16384, 16384, 10.0)
    assert (hello.parameter_room, hello.reference_room) == (41, 1024)


def test_a_device_to_which_nobody_talks_is_silent(driver: Driver) -> None:
    for _ in range(10):
        driver.tick(heartbeat=False)
    assert driver.frames == []
    driver.tell(encode("Who"))
    for _ in range(1500):
        driver.tick(heartbeat=False)
    assert sum(frame.name == "Sample" for frame in driver.frames) == 1001


def test_open_loop_gives_the_voltages_then_fades_and_ends_at_zero(driver: Driver) -> None:
    driver.start([1.0, 2.0, 4.0], mode=Mode.OPEN_LOOP, fade=4)
    start = driver.last("Ack").value
    assert [driver.tick() for _ in range(9)] == [1.0, 2.0, 4.0, 3.0, 2.0, 1.0, 0.0, 0.0, 0.0]
    samples = {frame.sequence: frame for frame in driver.frames if frame.name == "Sample"}
    assert [samples[start + i].voltage for i in range(3)] == [1.0, 2.0, 4.0]
    states = [samples[start + i].state for i in range(9)]
    assert states == [State.RUNNING] * 3 + [State.STOPPING] * 4 + [State.IDLE] * 2
    assert driver.last("Sample").flags & Flag.FINISHED
    assert not driver.last("Sample").flags & Flag.STARVED


def test_a_run_whose_reference_is_missing_stops_softly(driver: Driver) -> None:
    driver.tick()
    driver.tell(parameter_frames() + arm_frame(mode=Mode.OPEN_LOOP, fade=2) + reference_frames([3.0], last=False))
    driver.tell(encode("Run", session=7))
    assert [driver.tick() for _ in range(4)] == [3.0, 1.5, 0.0, 0.0]
    assert driver.last("Sample").state == State.IDLE
    assert driver.last("Sample").flags & Flag.STARVED


def test_soft_stop_fades_and_hard_stop_does_not(driver: Driver) -> None:
    driver.start([4.0] * 100, mode=Mode.OPEN_LOOP, fade=4)
    driver.tick()
    driver.tell(encode("Stop", mode=StopMode.SOFT))
    assert [driver.tick() for _ in range(2)] == [3.0, 2.0]
    driver.tell(encode("Stop", mode=StopMode.HARD))
    assert driver.tick() == 0.0
    assert driver.last("Sample").state == State.IDLE


def test_0_volts_within_100_ms_of_the_last_heartbeat(driver: Driver) -> None:
    driver.start([1.0] * 1000, mode=Mode.OPEN_LOOP)
    driver.tick()
    voltages = [driver.tick(heartbeat=False) for _ in range(150)]
    assert voltages.index(0.0) + 1 == 99
    assert not any(voltages[98:])
    assert driver.last("Fault").code == FaultCode.HEARTBEAT
    assert driver.last("Sample").state == State.FAULT
    driver.tell(encode("Run", session=7))
    assert driver.last("Ack").status == Status.WRONG_STATE
    assert driver.tick() == 0.0
    driver.tell(encode("Clear"))
    driver.tick()
    assert (driver.last("Sample").state, driver.last("Sample").fault) == (State.IDLE, FaultCode.NONE)


def test_a_heartbeat_of_another_session_keeps_nothing_alive(driver: Driver) -> None:
    driver.start([1.0] * 1000, mode=Mode.OPEN_LOOP)
    for _ in range(150):
        driver.tell(encode("Heartbeat", session=8))
        driver.tick(heartbeat=False)
    assert driver.last("Sample").fault == FaultCode.HEARTBEAT


def test_a_heartbeat_that_waited_counts_from_when_the_link_was_last_empty(driver: Driver) -> None:
    driver.start([1.0] * 1000, mode=Mode.OPEN_LOOP)
    driver.tick()
    driver.device.busy = True
    voltages = [driver.tick() for _ in range(150)]
    assert voltages.index(0.0) + 1 == 99
    assert driver.last("Fault").code == FaultCode.HEARTBEAT


def test_answers_leave_room_for_a_sample_and_a_fault(driver: Driver) -> None:
    driver.start([1.0] * 1000, mode=Mode.OPEN_LOOP)
    driver.device.receive(encode("Who") * 100)
    driver.tick(heartbeat=False)
    assert [frame.name for frame in driver.frames[-2:]] == ["Hello", "Sample"]
    driver.device.receive(encode("Who") * 100)
    driver.tick(step=5000, heartbeat=False)
    assert [frame.name for frame in driver.frames[-3:]] == ["Hello", "Fault", "Sample"]
    assert driver.last("Sample").flags & Flag.DROPPED
    assert driver.decoder.bad == 0


STEP = 2 * math.pi / 16384
FAULTS: dict[str, tuple[FaultCode, list[Readings]]] = {
    "angle": (FaultCode.ANGLE, [Readings(round(i * 0.015 / STEP), 0) for i in range(120)]),
    "angle, negative": (FaultCode.ANGLE, [Readings(-round(i * 0.015 / STEP), 0) for i in range(120)]),
    "speed": (FaultCode.SPEED, [Readings(round(i * 0.021 / STEP), 0) for i in range(60)]),
    "wheel speed": (FaultCode.WHEEL_SPEED, [Readings(i % 2, round(i * 0.51 / STEP)) for i in range(60)]),
    "current": (FaultCode.CURRENT, [Readings(0, 0, 1.0), Readings(0, 0, 2.5)]),
    "axis frozen": (FaultCode.AXIS_FROZEN, [Readings(0, i) for i in range(300)]),
    "wheel frozen": (FaultCode.WHEEL_FROZEN, [Readings(i, 0) for i in range(300)]),
    "axis jump": (FaultCode.AXIS_JUMP, [Readings(1, 1), Readings(500, 2)]),
    "wheel jump": (FaultCode.WHEEL_JUMP, [Readings(1, 1), Readings(2, 9000)]),
    "encoder": (FaultCode.ENCODER, [Readings(i, 2 * i, valid=i < 3) for i in range(10)]),
    "voltage": (FaultCode.VOLTAGE, [Readings(i % 7, i) for i in range(1100)]),
}


@pytest.mark.parametrize("name", FAULTS)
def test_the_guard_trips(driver: Driver, name: str) -> None:
    code, readings = FAULTS[name]
    volts = 10.0 if name == "voltage" else 5.0
    parameters = parameters_of(Compensator.paper(RIG), BOARD, replace(LIMITS, current=2.0))
    driver.start([volts] * 1022, parameters, mode=Mode.OPEN_LOOP)
    driver.tick()
    tripped = [i for i, one in enumerate(readings) if driver.tick(one) == 0.0]
    assert tripped, "the guard has not tripped"
    assert tripped == list(range(tripped[0], len(readings))), "a voltage after the fault"
    assert (driver.last("Fault").code, driver.last("Sample").state) == (code, State.FAULT)


def test_a_late_sample_is_an_overrun(driver: Driver) -> None:
    driver.start([1.0] * 100, mode=Mode.OPEN_LOOP)
    assert driver.tick(step=1499) == 1.0
    assert driver.tick(step=1501) == 0.0
    assert driver.last("Fault").code == FaultCode.OVERRUN
    assert driver.last("Sample").flags & Flag.LATE


def test_wraps_of_time_and_counts_are_no_faults(driver: Driver) -> None:
    driver.time = 2**32 - 20 * PERIOD
    counts = np.arange(100) + 2**31 - 50
    wrapped = [int(count) for count in (counts + 2**31) % 2**32 - 2**31]
    zero = 2**31 - 50
    driver.tick(Readings(zero, wrapped[0]))
    parameters = parameters_of(Compensator.paper(RIG), BOARD, replace(LIMITS, axis_zero=zero))
    driver.tell(parameter_frames(parameters) + arm_frame(parameters, mode=Mode.OPEN_LOOP))
    driver.tell(reference_frames([1.0] * 200) + encode("Run", session=7))
    assert {driver.tick(Readings(count, count)) for count in wrapped} == {1.0}


@pytest.mark.parametrize(
    ("place", "value", "status"),
    [
        (VOLTAGE_LIMIT, 10.5, Status.OVER_LIMIT),
        (VOLTAGE_LIMIT, math.inf, Status.BAD_PARAMETERS),
        (VOLTAGE_LIMIT, 0.0, Status.BAD_PARAMETERS),
        (0, 0.0, Status.BAD_PARAMETERS),
        (3, 0.5, Status.BAD_PARAMETERS),
        (5, math.nan, Status.BAD_PARAMETERS),
        (16, 32.0, Status.BAD_PARAMETERS),
        (17, 2.0, Status.BAD_PARAMETERS),  # order, which does not go with the number of parameters
        (17, 1e300, Status.BAD_PARAMETERS),
        (18, 0.002, Status.BAD_PARAMETERS),  # another sample time than the device's
    ],
)
def test_parameters_that_a_device_does_not_run_with(driver: Driver, place: int, value: float, status: Status) -> None:
    parameters = PARAMETERS.copy()
    parameters[place] = value
    driver.tick()
    driver.tell(parameter_frames(parameters) + arm_frame(parameters))
    assert driver.last("Ack").status == status
    assert driver.last("Ack").state == State.IDLE


@pytest.mark.parametrize("device", [Machine, CoreDevice], ids=["python", "c"])
@pytest.mark.parametrize("share", [0.5, 1.0, 1.001, math.inf])
def test_a_wheel_that_turns_faster_than_the_board_counts_is_refused_by_name(device: Any, share: float) -> None:
    """A Teensy 4 follows 880 000 edges a second (firmware/README.md), a Uno 29 000 if it had doubles."""
    driver = Driver(device(replace(BOARD, most_edges=8e5)))
    parameters = PARAMETERS.copy()
    parameters[WHEEL_SPEED_LIMIT] = share * 8e5 * abs(parameters[WHEEL_STEP])
    driver.tick()
    driver.tell(parameter_frames(parameters) + arm_frame(parameters))
    assert driver.last("Ack").status == (Status.DONE if share <= 1.0 else Status.TOO_FAST)
    assert "wheel_speed_limit" in refusal_words(Status.TOO_FAST)


def test_parameters_of_somebody_else_are_refused(driver: Driver) -> None:
    driver.tick()
    driver.tell(arm_frame())
    assert driver.last("Ack").status == Status.NO_PARAMETERS
    driver.tell(parameter_frames() + arm_frame(parameters=1))
    assert driver.last("Ack").status == Status.BAD_PARAMETERS


def test_reference_blocks_lost_doubled_and_too_many(driver: Driver) -> None:
    driver.tick()
    driver.tell(parameter_frames() + arm_frame())
    driver.tell(reference_frames([0.1] * 14, start=14))
    assert (driver.last("Ack").status, driver.last("Ack").next) == (Status.GAP, 0)
    driver.tell(reference_frames([0.1] * 14, last=False))
    driver.tell(reference_frames([0.1] * 14, last=False))
    assert (driver.last("Ack").status, driver.last("Ack").next) == (Status.GAP, 14)
    driver.tell(reference_frames([0.1], start=14, session=8))
    assert driver.last("Ack").status == Status.WRONG_SESSION
    driver.tell(reference_frames([math.inf], start=14))
    assert driver.last("Ack").status == Status.BAD_VALUE
    for start in range(14, 1022, 14):
        driver.tell(reference_frames([0.1] * 14, start=start, last=False))
    assert driver.last("Ack").status == Status.DONE
    driver.tell(reference_frames([0.1] * 3, start=1022, last=False))
    assert (driver.last("Ack").status, driver.last("Ack").value) == (Status.FULL, 2)


def test_on_a_can_bus_the_core_takes_and_gives_the_same_payloads() -> None:
    """`swingid_message` and `swingid_output_message` in the place of bytes; a frame of CAN-FD may not be longer."""
    core = CoreDevice(BOARD)
    core.tick(1000, STILL)
    stream = parameter_frames() + arm_frame(mode=Mode.OPEN_LOOP) + reference_frames([1.0, 2.0])
    for encoded in (stream + encode("Run", session=7) + encode("Who")).split(b"\0")[:-1]:
        found = unwrap(encoded)
        assert found is not None
        core.message(*found)
    assert core.tick(2000, STILL) == 1.0
    names = []
    while (message := core.output_message()) is not None:
        kind = schema().by_id[message[0]]
        values = kind.unpack(message[1])
        names.append(kind.name)
        assert values.get("status", Status.DONE) == Status.DONE
    assert names == ["Ack"] * (-(-len(PARAMETERS) // 7) + 3) + ["Hello", "Sample"]
    assert values["voltage"] == 1.0
    assert core.output() == b""
    core.message(0x7FF, b"")  # somebody else's
    core.tick(3000, STILL)
    sample = core.output_message()
    assert sample is not None
    assert schema().by_id[sample[0]].unpack(sample[1])["flags"] == Flag.BAD_FRAME


# ---- the C core against the machine above ----

COUNTS = st.integers(-3, 3) | st.sampled_from([0, 0, 40, -40, 4000, 2**31 - 1, -(2**31)])
VALUES = st.floats(-12, 12, width=32) | st.sampled_from([0.0, 1e30, math.inf, math.nan])
SESSIONS = st.sampled_from([7, 7, 7, 7, 0, 8])
TICKS = st.tuples(
    st.just("tick"),
    st.integers(1, 120),
    COUNTS,
    COUNTS,
    st.sampled_from([1000] * 8 + [1400, 1600, 0]),
    st.booleans() | st.just(True),
    st.sampled_from([math.nan, 0.5, 3.0]),
)
MESSAGES = st.one_of(
    st.builds(lambda **v: encode("Stop", **v), session=SESSIONS, mode=st.integers(0, 2)),
    st.builds(lambda **v: encode("Heartbeat", **v), session=SESSIONS),
    st.just(encode("Clear")),
    st.just(encode("Who")),
    st.just(parameter_frames()),
    st.builds(
        lambda i, x: parameter_frames(np.where(np.arange(len(PARAMETERS)) == i, x, PARAMETERS)),
        st.integers(0, len(PARAMETERS) - 1),
        st.floats(),
    ),
    st.builds(
        lambda **v: encode("Parameters", **v),
        index=st.integers(0, 50),
        count=st.integers(0, 9),
        total=st.integers(0, 50),
    ),
    st.builds(lambda **v: arm_frame(**v), session=SESSIONS, mode=st.integers(0, 2), fade=st.integers(0, 20)),
    st.builds(
        lambda s, n, last, session, x: reference_frames([x] * n, start=s, last=last, session=session),
        st.sampled_from([0, 0, 0, 14, 28]),
        st.integers(1, 60),
        st.booleans(),
        SESSIONS,
        VALUES,
    ),
    st.builds(lambda **v: encode("Run", **v), session=SESSIONS),
    st.just(parameter_frames() + arm_frame(fade=5) + reference_frames([0.1] * 90) + encode("Run", session=7)),
    st.just(
        parameter_frames() + arm_frame(mode=Mode.OPEN_LOOP) + reference_frames([9.0] * 500) + encode("Run", session=7)
    ),
    st.binary(max_size=80),
)


def same_bytes(actions: list[Any]) -> None:
    python, core = Machine(BOARD), CoreDevice(BOARD)
    time, axis, wheel = 2**32 - 50_000, 0, 2**31 - 100
    for action in actions:
        if isinstance(action, bytes):
            for device in (python, core):
                device.receive(action)
        else:
            _, count, axis_step, wheel_step, step, valid, current = action
            beating = count % 2 == 0
            python.busy = core.busy = count % 5 == 0
            for _ in range(count):
                time = (time + step) % 2**32
                axis = (axis + axis_step + 2**31) % 2**32 - 2**31
                wheel = (wheel + wheel_step + 2**31) % 2**32 - 2**31
                readings = Readings(axis, wheel, current, valid)
                voltages = []
                for device in (python, core):
                    if beating:
                        device.receive(encode("Heartbeat", session=7))
                    voltages.append(device.tick(time, readings))
                assert voltages[0] == voltages[1]
                assert abs(voltages[0]) <= BOARD.voltage_limit
                assert python.output() == core.output()
        assert python.output() == core.output()


@settings(max_examples=60, deadline=None)
@given(st.lists(TICKS | MESSAGES, max_size=25))
def test_random_messages_and_samples_give_the_same_bytes(actions: list[Any]) -> None:
    same_bytes([("tick", 2, 0, 0, 1000, True, math.nan), *actions, ("tick", 1, 0, 0, 1000, True, math.nan)])


@pytest.mark.long
@settings(max_examples=5000, deadline=None)
@given(st.lists(TICKS | MESSAGES, max_size=40))
def test_many_random_messages_and_samples_give_the_same_bytes(actions: list[Any]) -> None:
    same_bytes([("tick", 2, 0, 0, 1000, True, math.nan), *actions, ("tick", 1, 0, 0, 1000, True, math.nan)])
