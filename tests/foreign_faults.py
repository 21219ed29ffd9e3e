"""Ways in which the device of foreign_device.py misbehaves, by name: each is a `Flaw`, functions and figures."""

from collections.abc import Callable
from math import inf, nan
from random import Random
from typing import Any

from foreign_board import (
    ARMED,
    FINISHED,
    IDENTIFIERS,
    IDLE,
    LATE,
    RUNNING,
    STOPPING,
    Board,
    Fields,
    Flaw,
    Reading,
)
from foreign_law import FULL

Change = Callable[[Board, Fields], Fields | None]
AFTER = 2000  # samples of a run after which a misbehaviour in it begins


def since(board: Board) -> int:
    """Samples since the run began; -1 where none is on."""
    return board.sequence - board.begin if board.state in (RUNNING, STOPPING) else -1


def over(board: Board) -> bool:
    """Whether a run has been, and has ended."""
    return board.state == IDLE and board.used > 0


def once_in(board: Board, begins: bool, what: str) -> bool:
    """Whether `begins` was ever true: what has begun goes on."""
    board.marks[what] = board.marks.get(what, False) or begins
    return bool(board.marks[what])


def on(name: str, change: Change) -> Flaw:
    """Frames of one name are changed."""
    return Flaw(frame=lambda board, sent, fields: change(board, fields) if sent == name else fields)


def hello(**fields: Any) -> Flaw:
    return on("Hello", lambda board, old: old | fields)


def answer(message: str, change: Change) -> Flaw:
    """Acks of one message are changed."""
    number = IDENTIFIERS[message]
    return on("Ack", lambda board, fields: change(board, fields) if fields["message"] == number else fields)


def unanswered(message: str) -> Flaw:
    return answer(message, lambda board, fields: None)


def sample(change: Callable[[Board, Fields], Fields]) -> Flaw:
    """Fields of every Sample are changed: `change` gives those that are."""
    return on("Sample", lambda board, fields: fields | change(board, fields))


def held(field: str, begins: Callable[[Board], bool]) -> Flaw:
    """A field of the Samples that keeps its value once `begins`."""

    def change(board: Board, fields: Fields) -> Fields:
        if not once_in(board, begins(board), "holds") or "value" not in board.marks:
            board.marks["value"] = fields[field]
        return {field: board.marks["value"]}

    return sample(change)


def in_state(number: int, when: Callable[[Board], bool]) -> Flaw:
    return sample(lambda board, fields: {"state": number} if when(board) else {})


def _frozen(place: int) -> Flaw:
    def reading(board: Board, now: Reading) -> Reading:
        if not once_in(board, since(board) >= AFTER, "frozen"):
            board.marks["reading"] = now
        frozen = list(now)
        frozen[place] = board.marks["reading"][place]
        return frozen[0], frozen[1], frozen[2], now[3]

    return Flaw(reading=reading)


def _invalid(board: Board, now: Reading) -> Reading:
    if board.sequence % 5 == 0:
        board.marks["reading"] = now
        return now
    _, axis, wheel, _ = board.marks["reading"]
    return now[0], axis, wheel, False


def _finished_once(board: Board, fields: Fields) -> Fields:
    if not fields["flags"] & FINISHED:
        return {}
    if board.marks.get("finished") is None:
        board.marks["finished"] = True
        return {}
    return {"flags": fields["flags"] & ~FINISHED}


def _falling(board: Board, fields: Fields) -> Fields:
    board.marks["next"] = board.marks.get("next", 560) - 14
    return fields | {"next": max(board.marks["next"], 0)}


def _full(board: Board, name: str) -> bool:
    if name == "Reference":
        board._answer(name, FULL, 0, 0)
    return name != "Reference"


def _silent(board: Board, name: str, fields: Fields) -> Fields | None:
    return None if once_in(board, board.state == RUNNING, "silent") else fields


def _silent_late(board: Board, name: str, fields: Fields) -> Fields | None:
    return None if once_in(board, since(board) >= AFTER, "silent") else fields


def _unknown_fault(board: Board) -> None:
    if since(board) == AFTER:
        board._trip(99, nan)


def _endless(board: Board) -> None:
    """The last half second of the reference comes again and again."""
    if board.state == STOPPING:
        board.state, board.ended = RUNNING, 0
        board.used = board.taken - 500


def _restart(board: Board) -> None:
    if since(board) == AFTER and not board.marks.get("restarted"):
        board.marks["restarted"] = True
        board.reset()


def _garbage(board: Board, frame: bytes) -> bytes:
    random = board.marks.setdefault("random", Random(1))
    return frame if random.random() < 0.7 else frame + random.randbytes(random.randrange(1, 40)) + b"\0"


def _bits(board: Board, frame: bytes) -> bytes:
    """One frame in fifty has a wrong byte."""
    random = board.marks.setdefault("random", Random(2))
    if random.random() > 0.02:
        return frame
    at = random.randrange(len(frame) - 1)
    return frame[:at] + bytes((frame[at] ^ 1 << random.randrange(8),)) + frame[at + 1 :]


def _spike(board: Board, fields: Fields) -> Fields:
    return {"axis": fields["axis"] + 3000} if since(board) > 0 and board.sequence % 997 == 0 else {}


def _lost(board: Board, fields: Fields) -> Fields | None:
    return None if board.sequence % 3 == 0 else fields


FLAWS: dict[str, Flaw] = {
    # the crystal: `time` grows by 1000 us a sample, and a sample takes another time
    "clock_fast": Flaw(pace=1.01),
    "clock_slow": Flaw(pace=0.99),
    "clock_fast_little": Flaw(pace=1.001),
    "clock_slow_little": Flaw(pace=0.999),
    "other_rate": Flaw(pace=0.9, label=1.0 / 0.9),
    "other_rate_unsaid": Flaw(pace=0.5),
    "time_stands": held("time", lambda board: since(board) >= AFTER),
    "time_stands_always": held("time", lambda board: True),
    "time_back": sample(lambda board, f: {"time": (f["time"] - 10**6 * (since(board) > AFTER)) % 2**32}),
    "sequence_stands": held("sequence", lambda board: since(board) >= AFTER),
    # states and the end
    "stays_running": in_state(RUNNING, over),
    "stays_stopping": in_state(STOPPING, over),
    "stays_armed": in_state(ARMED, lambda board: board.state == RUNNING),
    "state_77": in_state(77, over),
    "state_77_in_run": in_state(77, lambda board: since(board) >= AFTER),
    "finished_never": sample(lambda board, f: {"flags": f["flags"] & ~FINISHED}),
    "finished_once": sample(_finished_once),
    "finished_early": sample(lambda board, f: {"flags": f["flags"] | FINISHED * (since(board) >= AFTER)}),
    "unknown_fault": Flaw(after=_unknown_fault),
    "restarts": Flaw(after=_restart),
    "stop_ignored": Flaw(hears=lambda board, name: name != "Stop"),
    "endless": Flaw(after=_endless),
    "endless_stop_ignored": Flaw(after=_endless, hears=lambda board, name: name != "Stop"),
    "no_guard": Flaw(guarded=False),
    "voltage_after_end": Flaw(
        output=lambda board, voltage: 2.0 if over(board) else voltage,
        frame=lambda board, name, f: f | {"voltage": 2.0} if name == "Sample" and over(board) else f,
    ),
    # answers
    "run_in_future": answer("Run", lambda board, f: f | {"value": f["value"] + 10**6}),
    "run_soon": answer("Run", lambda board, f: f | {"value": f["value"] + 300}),
    "run_in_past": answer("Run", lambda board, f: f | {"value": (f["value"] - 300) % 2**32}),
    "run_one_late": answer("Run", lambda board, f: f | {"value": f["value"] + 1}),
    "no_ack_reference": unanswered("Reference"),
    "no_ack_run": unanswered("Run"),
    "no_ack_arm": unanswered("Arm"),
    "no_ack_parameters": unanswered("Parameters"),
    "no_ack_stop": unanswered("Stop"),
    "room_zero": Flaw(hears=_full),
    "next_backwards": answer("Reference", _falling),
    "next_ahead": answer("Reference", lambda board, f: f | {"next": f["next"] + 10**6}),
    # Hello
    "hello_rate_nan": hello(rate=nan),
    "hello_rate_inf": hello(rate=inf),
    "hello_rate_1e30": hello(rate=1e30),
    "hello_rate_0": hello(rate=0.0),
    "hello_rate_negative": hello(rate=-1000.0),
    "hello_rate_double": hello(rate=2000.0),
    "hello_axis_counts_0": hello(axis_counts=0),
    "hello_axis_counts_huge": hello(axis_counts=2**32 - 1),
    "hello_wheel_counts_0": hello(wheel_counts=0),
    "hello_limit_nan": hello(voltage_limit=nan),
    "hello_limit_0": hello(voltage_limit=0.0),
    "hello_parameter_room_0": hello(parameter_room=0),
    "hello_reference_room_0": hello(reference_room=0),
    "hello_state_77": hello(state=77),
    "hello_schema": hello(schema=1),
    # Samples
    "invalid": Flaw(reading=_invalid),
    "late_flags": sample(lambda board, f: {"flags": f["flags"] | LATE * (board.sequence % 3 == 0)}),
    "axis_freezes": _frozen(1),
    "wheel_freezes": _frozen(2),
    "axis_spikes": sample(_spike),
    "voltage_nan": sample(lambda board, f: {"voltage": nan} if since(board) >= AFTER else {}),
    "gain_nan": sample(lambda board, f: {"gain": nan} if since(board) >= AFTER else {}),
    "samples_lost": on("Sample", _lost),
    "samples_twice": Flaw(wire=lambda board, frame: frame * 2),
    # the link
    "garbage": Flaw(wire=_garbage),
    "wrong_bytes": Flaw(wire=_bits),
    "silent_after_run": Flaw(frame=_silent),
    "silent_in_run": Flaw(frame=_silent_late),
    "never_says_a_word": Flaw(frame=lambda board, name, f: None),
}
