"""What docs/protocol.md and the two pages beside it hold, read for its tests.

Running this file renews the blocks between the pages' marks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from live_host import BOARD, LIMITS, RIG, arm_frame, parameter_frames, reference_frames
from swingid.control import law
from swingid.control.compensator import Compensator
from swingid.live.codes import State, StopMode
from swingid.live.frames import Decoder, checksum, encode, wrap
from swingid.live.guard import CONTROLLER, Readings, parameters_of
from swingid.live.machine import OUTPUT_ROOM, Machine, single
from swingid.live.schema import schema

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = tuple(DOCS / name for name in ("protocol.md", "protocol-device.md", "protocol-session.md"))
MARKS = re.compile(r"(?<=^<!-- protocol: )(\w+)( -->\n).*?(?=^<!-- end -->)", re.M | re.S)
TYPES = {"B": "u8", "H": "u16", "I": "u32", "i": "i32", "f": "f32", "d": "f64"}
HEX_PER_LINE = 32

LAW = Compensator.paper(RIG)
SESSION_PARAMETERS = parameters_of(Compensator(**{**vars(LAW), "k_tilde0": 1.0}), BOARD, LIMITS)


def page() -> str:
    """The pages as they are, one after the other."""
    return "\n".join(path.read_text(encoding="utf-8") for path in PAGES)


def tables(heading: str) -> list[list[list[str]]]:
    """The tables below a heading up to the next one: rows of cells, the first row the names of the columns."""
    below = re.split(rf"^#+ {re.escape(heading)}$", page(), flags=re.M)[1]
    below = re.sub(
        r"^```.*?^```$", "", re.split(r"^#+ ", re.sub(r"^( *)# ", r"\1", below), flags=re.M)[0], flags=re.M | re.S
    )
    found = []
    for block in re.findall(r"(?:^\|.*\|$\n?)+", below, flags=re.M):
        rows = [re.split(r"(?<!\\)\|", line)[1:-1] for line in block.splitlines()]
        found.append([[cell.strip() for cell in row] for i, row in enumerate(rows) if i != 1])
    return found


def table(heading: str, *columns: str) -> list[dict[str, str]]:
    """The one table below a heading that has these columns, row by row."""
    (found,) = [rows for rows in tables(heading) if set(columns) <= set(rows[0])]
    return [dict(zip(found[0], row, strict=True)) for row in found[1:]]


def sections() -> str:
    """The page's code, all blocks of Python in their order."""
    return "\n\n".join(re.findall(r"^```python\n(.*?)^```$", page(), flags=re.M | re.S))


def namespace() -> dict[str, Any]:
    """The page's code, run with the places and flags of its tables, and with what it names in prose."""
    names: dict[str, Any] = {row["name"]: int(row["place"]) for row in table("Parameters", "place")}
    names |= {row["flag"]: 1 << int(row["bit"]) for row in table("Flags", "bit")}
    names |= {"RATE": BOARD.rate, "PERIOD": 1e6 / BOARD.rate, "BOARD_LIMIT": BOARD.voltage_limit}
    names |= {"f32": single, "send": _send, "trip": _trip}
    exec(compile(sections(), str(PAGES[0]), "exec"), names)
    return names


def numbers() -> dict[str, dict[str, int]]:
    """Number of each word of the table of codes, by column."""
    rows = table("Messages", "number")
    return {kind: {row[kind]: int(row["number"]) for row in rows if row[kind]} for kind in rows[0] if kind != "number"}


def _send(d: SimpleNamespace, name: str, **values: Any) -> None:
    words = numbers_of_the_page
    values |= {key: words[kind][values[key]] for key, kind in WORDS.items() if key in values}
    sent = encode(name, **values)
    if len(d.output) + len(sent) > OUTPUT_ROOM:
        d.once |= 1 << 6
    else:
        d.output += sent


def _trip(d: SimpleNamespace, fault: str, value: float) -> None:
    d.state, d.fault = "fault", fault
    _send(d, "Fault", sequence=d.sequence, time=d.time, code=fault, state=d.state, value=single(value))


WORDS = {"state": "state", "fault": "fault", "code": "fault"}
numbers_of_the_page = numbers()


# ---- the blocks that are written by this file ----


def schema_block() -> str:
    """The hash, and how its text begins."""
    meaning = [(m.id, m.name, m.from_host, m.fields, sorted(m.choices.items())) for m in schema().by_id.values()]
    text = repr(meaning)
    said = (
        f"`schema` is {schema().hash:#010x} ({schema().hash}), the CRC-32 of {len(text)} characters that begin so:\n\n"
    )
    return f"{said}    {text[: text.index('(17')]}…\n"


EXAMPLES: dict[str, dict[str, Any]] = {
    "Who": {"schema": schema().hash},
    "Hello": {
        "schema": schema().hash,
        "version": 1,
        "rate": 1000.0,
        "axis_counts": 16384,
        "wheel_counts": 16384,
        "voltage_limit": 10.0,
        "parameter_room": 41,
        "reference_room": 1024,
    },
    "Heartbeat": {"session": 7, "count": 258},
    "Arm": {"session": 7, "mode": 0, "parameters": checksum(SESSION_PARAMETERS.tobytes()), "fade": 500},
    "Run": {"session": 7},
    "Stop": {"session": 7, "mode": 1},
    "Sample": {
        "sequence": 70000,
        "time": 4294967000,
        "axis": -3,
        "wheel": 123456,
        "voltage": -1.5,
        "gain": 0.25,
        "current": math.nan,
        "flags": 4,
        "state": 0,
    },
    "Ack": {"message": 0x51, "status": 6, "state": 2, "next": 28, "value": 996},
}


def hexes(data: bytes) -> str:
    """Bytes as they stand on the page."""
    return data.hex(" ")


def frames_block() -> str:
    """A frame of each kind, and how the first is made."""
    message = schema().by_name["Who"]
    payload = message.pack(**EXAMPLES["Who"])
    body = message.id.to_bytes(2, "little") + payload
    crc = checksum(body)
    lines = [
        "Who, step by step:",
        "",
        "| | bytes |",
        "|---|---|",
        f"| identifier {message.id:#05x} and payload | `{hexes(body)}` |",
        f"| with the CRC {crc:#06x} | `{hexes(body + crc.to_bytes(2, 'little'))}` |",
        f"| COBS, and the zero | `{hexes(wrap(message.id, payload))}` |",
        "",
        "What is not named is 0. A current that is not measured is the quiet NaN 0x7fc00000.",
        "",
        "| frame | fields | bytes on a serial line |",
        "|---|---|---|",
    ]
    for name, values in EXAMPLES.items():
        shown = ", ".join(f"{field} {value}" for field, value in values.items())
        lines.append(f"| {name} | {shown} | `{hexes(encode(name, **values))}` |")
    return "\n".join(lines) + "\n"


TRIED = [
    (0.3, 0.0, 0.0),
    (0.3, 0.01, -0.02),
    (0.3, 0.02, -0.05),
    (-0.2, 0.01, -0.04),
    (-0.2, 0.0, -0.01),
    (0.0, 0.0, -0.01),
]
"""Reference, angle and wheel angle (rad) of the samples of the tables of the control law."""


def control_cases() -> dict[str, Compensator]:
    """The controllers of the tables."""
    base = vars(LAW) | {"k_tilde0": 1.0, "filter_time": 0.002, "sigma0": 10.0}
    return {
        "n = 1": Compensator(**base),
        "n = 2": Compensator(**base | {"alpha": (0.01, 0.3, 2.0), "k": (2.0, 3.0), "wheel_filter_time": 0.001}),
    }


def control_block() -> str:
    """Numbers of a few samples of the control law."""
    lines = ["`control` in numbers, in the state after Arm with START_GAIN 1:"]
    for title, controller in control_cases().items():
        p, x = controller.parameters(1e-3), controller.initial_state()
        lines += [
            "",
            f"{title}, places 17 to {CONTROLLER + len(p) - 1}: `{', '.join(repr(float(one)) for one in p)}`",
            "",
        ]
        names = [
            "reference",
            "angle",
            "wheel angle",
            "voltage",
            "k̃",
            "f",
            *(f"ξ{i + 1}" for i in range(len(x) - law.XI)),
        ]
        lines += [f"| {' | '.join(names)} |", "|" + "---|" * len(names)]
        for tried in TRIED:
            u = law.compensator_step(*tried, x, p)
            cells = [*tried, u, x[law.K_TILDE], x[law.FILTERED_ERROR], *x[law.XI :]]
            lines.append(f"| {' | '.join(repr(float(cell)) for cell in cells)} |")
    return "\n".join(lines) + "\n"


class Trace:
    """A session with a `Machine`, written down."""

    def __init__(self) -> None:
        self.machine, self.decoder = Machine(BOARD), Decoder()
        self.lines: list[str] = []
        self.time = 5000

    def _bytes(self, data: bytes) -> None:
        for start in range(0, len(data), HEX_PER_LINE):
            self.lines.append("  " + hexes(data[start : start + HEX_PER_LINE]))

    def _answers(self) -> None:
        out = self.machine.output()
        for encoded, frame in zip(out.split(b"\0")[:-1], self.decoder.feed(out), strict=True):
            self.lines.append(f"< {frame.name}{self._words(frame.values)}")
            self._bytes(encoded + b"\0")

    @staticmethod
    def _words(values: dict[str, Any]) -> str:
        shown = {"message", "status", "sequence", "flags", "state", "next", "value", "voltage"} & set(values)
        found = []
        for name in values:
            if name in shown:
                value = values[name]
                if name == "message":
                    value = f"{value:#05x}"
                found.append(f"{name} {State(value).name.lower() if name == 'state' else value}")
        return ": " + ", ".join(found)

    def host(self, what: str, data: bytes) -> None:
        """Frames of the host, one by one."""
        for i, encoded in enumerate(data.split(b"\0")[:-1]):
            self.lines.append(f"> {what}" + (f" {i + 1}" if data.count(b"\0") > 1 else ""))
            self._bytes(encoded + b"\0")
            self.machine.receive(encoded + b"\0")
            self._answers()

    def sample(self, axis: int, wheel: int) -> None:
        """A sample of the device."""
        self.time += 1000
        volts = self.machine.tick(self.time, Readings(axis, wheel))
        self.lines.append(f"= time {self.time}, axis {axis}, wheel {wheel}: {volts!r} V")
        self._answers()


SESSION_REFERENCE = [0.05, 0.1, 0.15, 0.2]


def session_block() -> str:
    """A session from Who to the last Stop."""
    t = Trace()
    t.sample(-2, 100)
    t.host("Who", encode("Who", schema=schema().hash))
    t.sample(-2, 100)
    t.host("Parameters", parameter_frames(SESSION_PARAMETERS))
    t.host("Arm: session 7, closed_loop, fade 2", arm_frame(SESSION_PARAMETERS, fade=2))
    t.sample(-2, 100)
    t.host("Reference: start 0, count 4, last 1; 0.05, 0.1, 0.15, 0.2 rad", reference_frames(SESSION_REFERENCE))
    t.host("Run", encode("Run", session=7))
    for axis, wheel in ((-2, 100), (-1, 97), (1, 90)):
        t.sample(axis, wheel)
    t.host("Heartbeat", encode("Heartbeat", session=7, count=1))
    for axis, wheel in ((4, 78), (8, 61), (13, 40), (18, 16), (23, -10)):
        t.sample(axis, wheel)
    t.host("Stop, hard", encode("Stop", session=7, mode=StopMode.HARD))
    return "```text\n" + "\n".join(t.lines) + "\n```\n"


BLOCKS: dict[str, Callable[[], str]] = {
    "schema": schema_block,
    "frames": frames_block,
    "control": control_block,
    "session": session_block,
}


def renewed(text: str) -> str:
    """The page with the blocks between its marks made anew."""
    return MARKS.sub(lambda found: found[1] + found[2] + BLOCKS[found[1]](), text)


def shown(name: str) -> str:
    """A block as it stands on the page."""
    return next(found[0] for found in MARKS.finditer(page()) if found[1] == name)


if __name__ == "__main__":
    np.seterr(all="raise")
    for path in PAGES:
        path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")
