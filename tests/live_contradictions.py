"""A device on the twin that contradicts the protocol, or states in Hello what cannot be: rows as of `live_faults`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from live_faults import AT, Fault, FaultyDevice, Rule, Rules, latched, once
from swingid.live.codes import FaultCode, Flag, State, Status
from swingid.live.frames import Decoder, encode
from swingid.live.schema import schema


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


def cleared() -> Rule:
    """An answer to Clear in the place of one to the first message that is answered."""
    return lambda number, frame: frame + encode("Ack", message=schema().by_name["Clear"].id)


def other_hello() -> Rule:
    rates = [1000.0, 500.0]
    return told("Hello", lambda values: values | {"rate": rates.pop(0) if len(rates) > 1 else rates[0]})


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
    Fault(
        "protocol: Arm answered, and idle",
        lambda: Rules(up=sampled(lambda values: True, state=State.IDLE, voltage=0.0, flags=0), down=without("Run")),
        "protocol",
        5,
        says="answers Arm and stays idle",
    ),
    Fault(
        "protocol: Run answered, and idle",
        lambda: Rules(up=sampled(energised, state=State.IDLE, voltage=0.0, flags=0)),
        "protocol",
        5,
        says="answers Run and stays idle",
    ),
    Fault(
        "protocol: a soft stop by the host's guard that it does not obey",
        lambda: Rules(
            read=lambda row, r: r._replace(axis=-r.axis),
            down=without("Stop"),
            up=sampled(Runs().since, state=State.RUNNING),
        ),
        "lost",
        5,
        says="does not answer to Stop: switch the supply",
    ),
    Fault(
        "protocol: a voltage after Stop",
        lambda: Rules(read=lambda row, r: r._replace(axis=-r.axis), up=sampled(Runs().after, voltage=4.0)),
        "lost",
        5,
        says="is idle with 4 V after Stop: switch the supply",
    ),
    Fault(
        "protocol: a fault that Clear does not end",
        lambda: Rules(before=latched, down=without("Clear"), up=cleared()),
        "latched-fault",
        5,
        order={"clear": True},
        says="after Clear, too",
    ),
    Fault(
        "protocol: Hello not answered, samples come",
        lambda: Rules(
            up=told("Hello", lambda values: None), before=lambda device: device.machine.receive(encode("Who"))
        ),
        "no-answer",
        5,
        says="does not answer Who",
    ),
    Fault(
        "protocol: two Hellos that differ", lambda: Rules(up=other_hello()), "bad-hello", 5, says="than a moment ago"
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

CONTRADICTIONS = [*PROTOCOL, *HELLO]
