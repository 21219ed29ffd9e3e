"""Faults of a live rig on the twin: of the link, the device, sensors, actuator, host and user; each with its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from live_host import RIG
from swingid.errors import DeviceError
from swingid.live.codes import FaultCode, Flag, Mode, State, Status, StopMode
from swingid.live.devices.twin import TwinDevice
from swingid.live.frames import Decoder, encode
from swingid.live.guard import Readings
from swingid.live.machine import Machine
from swingid.live.plant import Plant, board_of
from swingid.live.schema import schema
from swingid.model.rig import Rig

AT = 2500
"""The sample at which a fault begins: in the middle of the run."""

Rule = Callable[[int, Any], Any]


def same(_row: int, value: Any) -> Any:
    return value


@dataclass
class Rules:
    """What a faulty device does to what passes: each called with the sample's number and the value.

    frames: down and up, frame by frame with a running number in place of the sample's. alive: whether firmware runs.
    """

    read: Rule = same
    volts: Rule = same
    time: Rule = same
    down: Rule = same
    up: Rule = same
    bytes_up: Rule = same
    alive: Callable[[int], bool] = lambda row: True
    reading: Callable[[int], None] = lambda row: None
    before: Callable[[FaultyDevice], None] = lambda device: None
    each: Callable[[FaultyDevice], None] = lambda device: None


class FaultyDevice(TwinDevice):
    """A device on the twin with rules; `applied` holds what the motor got at each sample."""

    def __init__(self, rules: Rules, rig: Rig = RIG, clock: int = 0, plant: Plant | None = None) -> None:
        super().__init__(plant or Plant(rig), board_of(rig, firmware=5), clock=clock)
        self.rules, self.applied = rules, []  # type: ignore[var-annotated]
        self.counts = [0, 0]
        rules.before(self)

    @property
    def row(self) -> int:
        return self.plant.row

    def write(self, data: bytes) -> None:
        self.rules.reading(self.row)
        for frame in data.split(b"\0")[:-1]:
            self.counts[0] += 1
            self.machine.receive(self.rules.down(self.counts[0], frame + b"\0"))
            self._pending += self.machine.output()

    def read(self, timeout: float = 0.0) -> bytes:
        self.rules.reading(self.row)
        out = b""
        for frame in super().read(timeout).split(b"\0")[:-1]:
            self.counts[1] += 1
            out += self.rules.up(self.counts[1], frame + b"\0")
        return bytes(self.rules.bytes_up(self.row, out))

    def step(self) -> None:
        row, voltage = self.row, 0.0
        self.rules.each(self)
        if self.rules.alive(row):
            time = round(self.rules.time(row, row * 1e6 / self.board.rate) + self._clock) % 2**32
            voltage = self.machine.tick(time, self.rules.read(row, self.plant.read()))
            self._pending += self.machine.output()
        self.applied.append(voltage)
        self.plant.hold(self.rules.volts(row, voltage))


@dataclass(frozen=True)
class Fault:
    """One fault: its rules, and what is expected: reason of the end or code of the refusal, exit code, fault of the
    guard, how many samples after `AT` the motor gets a voltage at most, seconds of log at least, words of its sentence.
    """

    name: str
    rules: Callable[[], Rules] = Rules
    end: str = "finished"
    exit: int = 0
    guard: FaultCode = FaultCode.NONE
    dead_by: int | None = None
    log: float = 0.0
    device: dict[str, Any] = field(default_factory=dict)
    rig: Callable[[], Rig] = lambda: RIG
    order: dict[str, Any] = field(default_factory=dict)
    says: str = ""


def told(name: str, change: Callable[[dict[str, Any]], dict[str, Any] | None]) -> Rule:
    """A rule for frames up: messages of a name with other values; None: they do not come."""

    def rule(_number: int, frame: bytes) -> bytes:
        found = Decoder().feed(frame)
        if not found or found[0].name != name:
            return frame
        values = change(dict(found[0].values))
        return b"" if values is None else encode(name, **values)

    return rule


def answered(message: str, **other: Any) -> Rule:
    """A rule for frames up: answers to a message with other values, functions of the old one; without any, none."""
    number = schema().by_name[message].id

    def change(values: dict[str, Any]) -> dict[str, Any] | None:
        if values["message"] != number:
            return values
        if not other:
            return None
        return values | {key: new(values[key]) if callable(new) else new for key, new in other.items()}

    return told("Ack", change)


def sampled(when: Callable[[dict[str, Any]], bool], **other: Any) -> Rule:
    """A rule for frames up: samples with other values, where it is time."""

    def change(values: dict[str, Any]) -> dict[str, Any]:
        if not when(values):
            return values
        return values | {key: new(values[key]) if callable(new) else new for key, new in other.items()}

    return told("Sample", change)


def late(values: dict[str, Any]) -> bool:
    return bool(values["sequence"] >= AT)


def energised(values: dict[str, Any]) -> bool:
    return values["state"] in (State.RUNNING, State.STOPPING)


class Runs:
    """When a device has run: from the first sample of a run on, or after its last."""

    def __init__(self) -> None:
        self.ran = False

    def after(self, values: dict[str, Any]) -> bool:
        self.ran = self.ran or energised(values)
        return self.ran and not energised(values)

    def since(self, values: dict[str, Any]) -> bool:
        self.ran = self.ran or energised(values)
        return self.ran


def endless(device: FaultyDevice) -> None:
    """Hold the last reference for ever."""
    machine: Any = device.machine
    if machine.state is State.RUNNING and machine._complete:
        machine._complete = False
    if machine.state is State.RUNNING and machine._next_out == len(machine._reference):
        machine._reference.append(machine._last_reference)


def without(name: str) -> Rule:
    """A rule for frames down: messages of a name do not arrive."""

    def rule(_number: int, frame: bytes) -> bytes:
        found = Decoder(from_host=True).feed(frame)
        return b"" if found and found[0].name == name else frame

    return rule


def finished_once() -> Rule:
    said: list[bool] = []

    def change(values: dict[str, Any]) -> dict[str, Any]:
        if values["flags"] & Flag.FINISHED:
            values["flags"] &= ~(Flag.FINISHED if said else 0)
            said.append(True)
        return values

    return told("Sample", change)


def hello(**other: Any) -> Callable[[], Rules]:
    return lambda: Rules(up=told("Hello", lambda values: values | other))


def moved_start() -> Rule:
    answers: list[int] = []

    def moved(start: int) -> int:
        answers.append(start)
        return start + 40 * (len(answers) - 1)

    return answered("Run", value=moved)


def every(n: int, change: Callable[[bytes], bytes]) -> Rule:
    return lambda number, frame: change(frame) if number % n == 0 else frame


def flip(frame: bytes) -> bytes:
    return bytes([frame[0] ^ 4]) + frame[1:]


def from_row(change: Callable[[Any], Any], rows: int = 10**9) -> Rule:
    return lambda row, value: change(value) if AT <= row < AT + rows else value


def swapped() -> Rule:
    held: list[bytes] = []

    def rule(number: int, frame: bytes) -> bytes:
        if number % 40 == 0:
            held.append(frame)
            return b""
        return frame + (held.pop() if held else b"")

    return rule


def other_schema(_number: int, frame: bytes) -> bytes:
    found = Decoder().feed(frame)
    if not found or found[0].name != "Hello":
        return frame
    return encode("Hello", **{**found[0].values, "schema": 1})


def in_pieces() -> Rule:
    rest: list[bytes] = [b""]

    def rule(_row: int, data: bytes) -> bytes:
        whole = rest[0] + data
        rest[0] = whole[-7:]
        return whole[:-7]

    return rule


def delayed(rows: int) -> Rule:
    waiting: list[tuple[int, bytes]] = []

    def rule(row: int, data: bytes) -> bytes:
        waiting.append((row + rows, data))
        out = b""
        while waiting and waiting[0][0] <= row:
            out += waiting.pop(0)[1]
        return out

    return rule


def stalled(rows: int) -> Rules:
    """Both directions wait for so many samples: as a host that does something else."""

    done: list[bool] = []

    def reading_of(device: list[FaultyDevice]) -> Callable[[int], None]:
        def reading(row: int) -> None:
            if row >= AT and not done:
                done.append(True)
                for _ in range(rows):
                    device[0].step()

        return reading

    known: list[FaultyDevice] = []
    return Rules(reading=reading_of(known), before=known.append)


def unplugged(row: int) -> None:
    if row >= AT:
        raise DeviceError("twin: the device has gone", code="gone")


def os_error(row: int) -> None:
    if row >= AT:
        raise OSError(5, "Input/output error")


def once(act: Callable[[FaultyDevice], None]) -> Callable[[FaultyDevice], None]:
    def each(device: FaultyDevice) -> None:
        if device.row == AT:
            act(device)

    return each


def reboot(device: FaultyDevice) -> None:
    device.machine = Machine(device.board)


def other_host(*frames: bytes) -> Callable[[FaultyDevice], None]:
    def act(device: FaultyDevice) -> None:
        for frame in frames:
            device.machine.receive(frame)

    return act


def latched(device: FaultyDevice) -> None:
    device.machine.trip(FaultCode.ANGLE, 1.0)  # type: ignore[attr-defined]


def running_for_another(device: FaultyDevice) -> None:
    import live_host

    device.step()
    for data in (live_host.parameter_frames(), live_host.arm_frame(session=9), encode("Heartbeat", session=9)):
        device.machine.receive(data)

    def each(it: FaultyDevice) -> None:
        it.machine.receive(encode("Heartbeat", session=9))

    device.rules.each = each


def pushed(device: FaultyDevice) -> None:
    device.plant.push = 1.5 if AT <= device.row < AT + 60 else 0.0


def counts(axis: int = 0, wheel: int = 0) -> Callable[[Readings], Readings]:
    def wrapped(x: int) -> int:
        return (x + 2**31) % 2**32 - 2**31

    return lambda r: r._replace(axis=wrapped(r.axis + axis), wheel=wrapped(r.wheel + wheel))


def frozen(**which: bool) -> Rule:
    last: dict[str, int] = {}

    def rule(row: int, r: Readings) -> Readings:
        if row < AT:
            last.update(axis=r.axis, wheel=r.wheel)
            return r
        return r._replace(**{name: last[name] for name in which})

    return rule


def wrong_sequence(device: FaultyDevice) -> None:
    device.machine.sequence = 2**32 - 2000  # type: ignore[attr-defined]


def at_rest_swinging() -> Plant:
    return Plant(RIG, initial_speed=0.4)


def rig_with(**keys: Any) -> Callable[[], Rig]:
    return lambda: RIG.changed({name.replace("__", "."): value for name, value in keys.items()})


STOP = encode("Stop", session=9, mode=StopMode.HARD)
OLD_BYTES = encode("Sample", sequence=77, time=1, axis=3, state=2) * 40
SECOND = encode("Arm", session=9, mode=Mode.CLOSED_LOOP, parameters=1)

LINK = [
    Fault("link: a bit flips in every 30th frame up", lambda: Rules(up=every(30, flip))),
    Fault("link: a bit flips in every 9th frame down", lambda: Rules(down=every(9, flip))),
    Fault("link: every 20th frame up is lost", lambda: Rules(up=every(20, lambda f: b""))),
    Fault("link: every 5th frame down is lost", lambda: Rules(down=every(5, lambda f: b""))),
    Fault("link: frames up doubled", lambda: Rules(up=every(1, lambda f: f + f))),
    Fault("link: frames down doubled", lambda: Rules(down=every(1, lambda f: f + f))),
    Fault("link: frames in another order", lambda: Rules(up=swapped())),
    Fault("link: frames in pieces", lambda: Rules(bytes_up=in_pieces())),
    Fault(
        "link: garbage first",
        lambda: Rules(bytes_up=lambda row, d: (b"\x07\xff\x00boot v1\r\n" if row < 20 else b"") + d),
    ),
    Fault("link: garbage between frames", lambda: Rules(up=every(25, lambda f: b"noise\x00" + f))),
    Fault(
        "link: frames of an old run in the buffer",
        lambda: Rules(bytes_up=lambda row, d: (OLD_BYTES if row < 2 else b"") + d),
    ),
    Fault("link: 40 ms late upwards", lambda: Rules(bytes_up=delayed(40))),
    Fault("link: unplugged", lambda: Rules(reading=unplugged), "lost", 5, dead_by=100, log=1.0),
    Fault("link: error of the system", lambda: Rules(reading=os_error), "lost", 5, dead_by=100, log=1.0),
    Fault("link: silent upwards", lambda: Rules(bytes_up=from_row(lambda d: b"")), "lost", 5, dead_by=600, log=1.0),
    Fault("link: wrong baud rate", lambda: Rules(bytes_up=lambda row, d: b"\xf8\x81\x80" * 9), "no-frames", 5),
    Fault("link: firmware of another schema", lambda: Rules(up=other_schema), "other-firmware", 5),
    Fault("link: nothing answers", lambda: Rules(bytes_up=lambda row, d: b""), "no-answer", 5),
    Fault("link: stalls for 60 ms", lambda: stalled(60)),
]

DEVICE = [
    Fault(
        "device: hangs, its watchdog lets go", lambda: Rules(alive=lambda row: row < AT), "lost", 5, dead_by=0, log=1.0
    ),
    Fault("device: starts again", lambda: Rules(each=once(reboot)), "reset", 5, dead_by=0, log=1.0),
    Fault("device: clock 200 ppm fast", lambda: Rules(time=lambda row, t: t * 1.0002)),
    Fault("device: clock 200 ppm slow", lambda: Rules(time=lambda row, t: t * 0.9998)),
    Fault("device: clock wraps", device={"clock": 2**32 - 3_000_000}),
    Fault("device: counter of the axis wraps", lambda: Rules(read=lambda row, r: counts(axis=2**31 - 900)(r))),
    Fault("device: counter of the wheel wraps", lambda: Rules(read=lambda row, r: counts(wheel=2**31 - 900)(r))),
    Fault("device: sequence wraps", lambda: Rules(before=wrong_sequence)),
    Fault(
        "device: a sample comes late",
        lambda: Rules(time=from_row(lambda t: t + 900.0)),
        "fault",
        5,
        FaultCode.OVERRUN,
        0,
        1.0,
    ),
    Fault("device: a latched fault of an earlier run", lambda: Rules(before=latched), "latched-fault", 5),
    Fault("device: that fault, cleared by a person", lambda: Rules(before=latched), order={"clear": True}),
]

SENSORS = [
    Fault("sensor: axis frozen", lambda: Rules(read=frozen(axis=True)), "fault", 5, FaultCode.AXIS_FROZEN, 1500, 1.0),
    Fault(
        "sensor: wheel frozen", lambda: Rules(read=frozen(wheel=True)), "fault", 5, FaultCode.WHEEL_FROZEN, 1500, 1.0
    ),
    Fault(
        "sensor: axis jumps", lambda: Rules(read=from_row(counts(axis=5000))), "fault", 5, FaultCode.AXIS_JUMP, 0, 1.0
    ),
    Fault(
        "sensor: wheel jumps",
        lambda: Rules(read=from_row(counts(wheel=9000))),
        "fault",
        5,
        FaultCode.WHEEL_JUMP,
        0,
        1.0,
    ),
    Fault(
        "sensor: single turn of the axis wraps",
        lambda: Rules(read=lambda row, r: r._replace(axis=(r.axis + 16000) % 16384)),
        "fault",
        5,
        FaultCode.AXIS_JUMP,
        log=0.0,
    ),
    Fault("sensor: four samples without a reading", lambda: Rules(read=from_row(lambda r: r._replace(valid=False), 4))),
    Fault(
        "sensor: no reading any more",
        lambda: Rules(read=from_row(lambda r: r._replace(valid=False))),
        "fault",
        5,
        FaultCode.ENCODER,
        5,
        1.0,
    ),
    Fault("sensor: sign of the axis", lambda: Rules(read=lambda row, r: r._replace(axis=-r.axis)), "guard", 5),
    Fault("sensor: sign of the wheel", lambda: Rules(read=lambda row, r: r._replace(wheel=-r.wheel)), "finished", 3),
    Fault(
        "sensor: current beyond its limit",
        lambda: Rules(read=from_row(lambda r: r._replace(current=9.0))),
        "fault",
        5,
        FaultCode.CURRENT,
        0,
        1.0,
        rig=rig_with(device__current_limit=4.0),
    ),
]

ACTUATOR = [
    Fault(
        "actuator: dead", lambda: Rules(volts=from_row(lambda u: 0.0)), "fault", 5, FaultCode.WHEEL_FROZEN, 2500, 1.0
    ),
    Fault("actuator: gives a tenth, which no angle depends on", lambda: Rules(volts=from_row(lambda u: 0.1 * u))),
    Fault("actuator: sign", lambda: Rules(volts=lambda row, u: -u), "guard", 5),
]

HOST = [
    Fault("host: stalls for 200 ms", lambda: stalled(200), "fault", 5, FaultCode.HEARTBEAT, 100, 1.0),
    Fault(
        "host: another one stops the device", lambda: Rules(each=once(other_host(STOP))), "taken", 5, dead_by=0, log=1.0
    ),
    Fault("host: another one tries to arm it", lambda: Rules(each=once(other_host(SECOND)))),
    Fault("host: another one is already in a run", lambda: Rules(before=running_for_another), "in-use", 5),
    Fault(
        "host: its bytes do not arrive",
        lambda: Rules(down=lambda n, f: f if n < 150 else b""),
        "fault",
        5,
        FaultCode.HEARTBEAT,
    ),
]

USER = [
    Fault(
        "user: body does not hang still",
        device={"plant": at_rest_swinging},
        order={"wait": 0.0},
        end="not-still",
        exit=5,
    ),
    Fault("user: body pushed in the run", lambda: Rules(each=pushed), "guard", 5, dead_by=200, log=1.0),
    Fault("user: zero of the encoder elsewhere", lambda: Rules(read=lambda row, r: counts(axis=5000)(r))),
    Fault("user: body not mounted", rig=lambda: Rig.load("paper-body"), device={"rig": RIG}, exit=4, end="finished"),
    Fault(
        "user: limit of the angle absurdly small", rig=rig_with(device__angle_limit=0.05), end="beyond-limits", exit=2
    ),
    Fault(
        "user: voltage beyond the amplifier",
        rig=rig_with(drive__motor__voltage_limit="48 V"),
        device={"rig": RIG},
        end="other-voltage",
        exit=3,
    ),
    Fault(
        "user: other encoders in the rig file",
        rig=rig_with(sensors__counts_per_turn=4096),
        device={"rig": RIG},
        end="other-counts",
        exit=3,
    ),
    Fault(
        "user: no inertia to rehearse with",
        rig=rig_with(axis__inertia=None),
        device={"rig": RIG},
        end="missing-inertia",
        exit=3,
    ),
]

PROTOCOL = [
    Fault(
        "protocol: a run without end",
        lambda: Rules(each=endless),
        "endless",
        5,
        dead_by=4600,
        log=3.5,
        says="does not end",
    ),
    Fault(
        "protocol: a run without end that no Stop ends",
        lambda: Rules(each=endless, down=without("Stop")),
        "endless",
        5,
        dead_by=5800,
        says="does not answer to Stop",
    ),
    Fault(
        "protocol: says running for ever",
        lambda: Rules(up=sampled(Runs().since, state=State.RUNNING, flags=0)),
        "endless",
        5,
        says="does not end",
    ),
    Fault(
        "protocol: says stopping for ever",
        lambda: Rules(up=sampled(Runs().after, state=State.STOPPING)),
        "endless",
        5,
        says="does not end",
    ),
    Fault(
        "protocol: a state of 77",
        lambda: Rules(up=sampled(late, state=77)),
        "protocol",
        5,
        dead_by=40,
        log=1.0,
        says="state 77, which this host does not know",
    ),
    Fault(
        "protocol: a state of 99 before the run",
        lambda: Rules(up=told("Hello", lambda values: values | {"state": 99})),
        "unknown-state",
        5,
        says="state 99, which this host does not know",
    ),
    Fault(
        "protocol: Run answered with a start in the future",
        lambda: Rules(up=answered("Run", value=lambda start: start + 10**6)),
        "protocol",
        5,
        says="as the start of the run",
    ),
    Fault(
        "protocol: Run answered with a start in the past",
        lambda: Rules(up=answered("Run", value=lambda start: (start - 10**6) % 2**32)),
        "protocol",
        5,
        says="as the start of the run",
    ),
    Fault(
        "protocol: Run answered with a start a little in the future",
        lambda: Rules(up=answered("Run", value=lambda start: start + 300)),
        "protocol",
        5,
        says="samples before the start",
    ),
    Fault(
        "protocol: Run answered twice, otherwise",
        lambda: Rules(up=moved_start()),
        "protocol",
        5,
        says="start of the run",
    ),
    Fault("protocol: Run not answered", lambda: Rules(up=answered("Run")), "protocol", 5, says="no answer to Run"),
    Fault("protocol: Run does not arrive", lambda: Rules(down=without("Run")), "protocol", 5, says="no answer to Run"),
    Fault(
        "protocol: Run answered by another status",
        lambda: Rules(up=answered("Run", status=Status.BAD_VALUE)),
        "protocol",
        5,
        says="it answers Run by: a value is out of its range",
    ),
    Fault(
        "protocol: Run answered by no status",
        lambda: Rules(up=answered("Run", status=200)),
        "protocol",
        5,
        says="it answers Run by: status 200",
    ),
    Fault(
        "protocol: Run acknowledged and not begun",
        lambda: Rules(up=sampled(energised, state=State.ARMED, voltage=0.0)),
        "protocol",
        5,
        says="is still armed",
    ),
    Fault(
        "protocol: Reference not answered",
        lambda: Rules(up=answered("Reference")),
        "protocol",
        5,
        says="no answer to Reference",
    ),
    Fault(
        "protocol: no room for the reference",
        lambda: Rules(up=answered("Reference", status=Status.FULL, next=0, value=0)),
        "protocol",
        5,
        says="no room for the reference (0 of 1024",
    ),
    Fault(
        "protocol: Reference refused",
        lambda: Rules(up=answered("Reference", status=Status.BAD_VALUE)),
        "protocol",
        5,
        says="does not take the reference: a value is out of its range",
    ),
    Fault(
        "protocol: the reference acknowledged beyond what was sent",
        lambda: Rules(up=answered("Reference", next=lambda at: at + 1000)),
        "protocol",
        5,
        says="samples of the reference where",
    ),
    Fault(
        "protocol: the reference asked for again and again",
        lambda: Rules(up=answered("Reference", status=Status.GAP, next=lambda at: min(at, 140))),
        "protocol",
        5,
        says="it wants sample 140",
    ),
    Fault(
        "protocol: the reference no longer acknowledged in the run",
        lambda: Rules(up=answered("Reference", next=lambda at: min(at, 1400))),
        "starved",
        5,
        says="wants sample 1400",
    ),
    Fault(
        "protocol: FINISHED before the end",
        lambda: Rules(up=sampled(late, flags=Flag.FINISHED)),
        "protocol",
        5,
        dead_by=40,
        says="at its end after",
    ),
    Fault("protocol: FINISHED said once", lambda: Rules(up=finished_once())),
    Fault(
        "protocol: FINISHED never said",
        lambda: Rules(up=sampled(lambda values: True, flags=0)),
        "protocol",
        5,
        log=3.5,
        says="has not said that the reference is at its end",
    ),
    Fault(
        "protocol: says idle and drives on",
        lambda: Rules(up=sampled(late, state=State.IDLE)),
        "protocol",
        5,
        dead_by=40,
        says="its samples state",
    ),
    Fault(
        "protocol: a voltage after the end",
        lambda: Rules(up=sampled(Runs().after, voltage=3.0)),
        "protocol",
        5,
        log=3.5,
        says="its samples state 3 V",
    ),
    Fault(
        "protocol: a voltage that is no number after the end",
        lambda: Rules(up=sampled(Runs().after, voltage=float("nan"))),
        "protocol",
        5,
        log=3.5,
        says="its samples state nan V",
    ),
    Fault(
        "protocol: a voltage while it is armed",
        lambda: Rules(up=sampled(lambda values: values["state"] == State.ARMED, voltage=3.0)),
        "protocol",
        5,
        says="is armed and applies 3 V",
    ),
    Fault(
        "protocol: a voltage at rest",
        lambda: Rules(up=sampled(lambda values: True, voltage=2.0)),
        "voltage-at-rest",
        5,
        says="is idle and states 2 V",
    ),
    Fault(
        "protocol: a fault without a cause",
        lambda: Rules(each=once(lambda device: device.machine.trip(FaultCode.NONE, 0.0))),  # type: ignore[attr-defined]
        "fault",
        5,
        dead_by=0,
        says="names no cause",
    ),
    Fault(
        "protocol: a fault of a number that no host knows",
        lambda: Rules(
            each=once(lambda device: device.machine.trip(FaultCode.ANGLE, 1.0)),  # type: ignore[attr-defined]
            up=sampled(lambda values: values["fault"] != 0, fault=201),
        ),
        "fault",
        5,
        dead_by=0,
        says="code 201",
    ),
    Fault(
        "protocol: a fault in the samples, and it goes on",
        lambda: Rules(up=sampled(late, fault=FaultCode.ANGLE)),
        "protocol",
        5,
        dead_by=40,
        says="reports a fault and goes on: the angle passed",
    ),
    Fault(
        "protocol: a message of a fault, and it goes on",
        lambda: Rules(
            each=once(lambda device: device.machine._send("Fault", sequence=AT, code=FaultCode.SPEED))  # type: ignore[attr-defined]
        ),
        "protocol",
        5,
        dead_by=600,
        says="reports a fault and goes on: the speed",
    ),
    Fault(
        "protocol: the number of the samples stands still",
        lambda: Rules(up=sampled(late, sequence=AT)),
        "lost",
        5,
        dead_by=600,
        log=1.0,
        says="stands still",
    ),
    Fault(
        "protocol: the number of the samples jumps",
        lambda: Rules(up=sampled(late, sequence=lambda number: number + 10**6)),
        "protocol",
        5,
        dead_by=40,
        log=1.0,
        says="jumps by 1000001",
    ),
    Fault(
        "protocol: the number of the samples goes back, and it drives on",
        lambda: Rules(up=sampled(late, sequence=lambda number: (number - 2 * AT) % 2**32)),
        "reset",
        5,
        dead_by=40,
        log=1.0,
    ),
    Fault(
        "protocol: parameters acknowledged beyond what was sent",
        lambda: Rules(up=answered("Parameters", next=lambda at: at + 100)),
        "refused-by-device",
        5,
        says="parameters where",
    ),
    Fault(
        "protocol: parameters acknowledged and not taken",
        lambda: Rules(up=answered("Parameters", next=lambda at: min(at, 14))),
        "refused-by-device",
        5,
        says="misses parts",
    ),
    Fault("protocol: Arm not answered", lambda: Rules(up=answered("Arm")), "link-lost", 5, says="no answer to Arm"),
]

FLOAT = {"rate": ("samples per second", 1e30, 0.0, -1000.0, 19.0), "voltage_limit": ("voltage limit", 0.0, -12.0)}
WHOLE = {
    "axis_counts": ("counts per turn of the axis", 0, 2**32 - 1),
    "wheel_counts": ("counts per turn of the wheel", 2**31),
    "parameter_room": ("parameters", 0, 20),
    "reference_room": ("samples of the reference", 0, 20),
}
HELLO = [
    Fault(f"hello: {key} = {value}", hello(**{key: value}), "bad-hello", 5, says=words)
    for key, (words, *values) in (FLOAT | WHOLE).items()
    for value in (*values, *((float("nan"), float("inf"), -float("inf")) if key in FLOAT else ()))
]

FAULTS = [*PROTOCOL, *HELLO, *LINK, *DEVICE, *SENSORS, *ACTUATOR, *HOST, *USER]
