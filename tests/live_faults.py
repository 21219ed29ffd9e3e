"""Faults of a live rig on the twin: of the link, the device, sensors, actuator, host and user; each with its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from live_host import RIG
from swingid.errors import DeviceError
from swingid.live.codes import FaultCode, Mode, StopMode
from swingid.live.devices.twin import TwinDevice
from swingid.live.frames import Decoder, encode
from swingid.live.guard import Readings
from swingid.live.machine import Machine, most_taken
from swingid.live.plant import Plant, board_of
from swingid.model.rig import Rig

AT = 3800
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


def time_back() -> Rule:
    """From sample `AT` on the device states a time of ten samples ago, as after a fault of its timer."""

    def rule(_number: int, frame: bytes) -> bytes:
        found = Decoder().feed(frame)
        if not found or found[0].name != "Sample" or found[0].sequence < AT:
            return frame
        return encode("Sample", **{**found[0].values, "time": found[0].time - 10_000})

    return rule


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


def flooded(data: bytes) -> Callable[[FaultyDevice], None]:
    """Somebody else who writes on the same line and never stops: as much of it as a sample takes, and more waits."""

    def each(device: FaultyDevice) -> None:
        if device.row >= AT:
            most = most_taken(device.board)
            device.machine.receive((data * most)[:most])
            device.machine.busy = True

    return each


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


def at_a_turning_point() -> Plant:
    """A body that swings by 12 mrad from its largest angle, where it stands still for a moment."""
    return Plant(RIG, initial_angle=0.012)


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
    Fault(
        "link: flooded with garbage", lambda: Rules(each=flooded(b"U\0")), "fault", 5, FaultCode.HEARTBEAT, 100, log=1.0
    ),
    Fault(
        "link: flooded with Who",
        lambda: Rules(each=flooded(encode("Who"))),
        "fault",
        5,
        FaultCode.HEARTBEAT,
        100,
        log=1.0,
    ),
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
    Fault("device: clock 0.4 % fast", lambda: Rules(time=lambda row, t: t * 1.004)),
    Fault("device: clock 0.4 % slow", lambda: Rules(time=lambda row, t: t * 0.996)),
    Fault("device: samples 1010 us apart by its clock", lambda: Rules(time=lambda row, t: t * 1.01), "other-rate", 5),
    Fault("device: its clock stands still", lambda: Rules(time=lambda row, t: 0.0), "other-rate", 5),
    Fault("device: its clock goes back", lambda: Rules(up=time_back()), "guard", 5, dead_by=60, log=1.0),
    Fault("device: one sample of ten is flagged", lambda: Rules(read=lambda row, r: r._replace(valid=row % 10 != 0))),
    Fault(
        "device: most samples are flagged",
        lambda: Rules(read=lambda row, r: r._replace(valid=row % 4 == 0)),
        "no-readings",
        5,
    ),
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
    Fault(
        "user: body at a turning point of a small swing",
        device={"plant": at_a_turning_point},
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

FAULTS = [*LINK, *DEVICE, *SENSORS, *ACTUATOR, *HOST, *USER]
