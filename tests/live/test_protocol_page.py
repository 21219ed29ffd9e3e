"""docs/protocol.md against the code: its tables, parameters, and what it says of the host."""

from __future__ import annotations

import importlib
import math
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import protocol_page as its
from firmware_build import CoreDevice
from live_host import BOARD, PARAMETERS, Driver, arm_frame, parameter_frames
from protocol_page import numbers, page, table
from swingid.control import law
from swingid.live import codes, frames, guard, machine, session
from swingid.live.codes import Flag, Mode, State, StopMode
from swingid.live.devices.can_bus import CanDevice
from swingid.live.frames import encode
from swingid.live.guard import MOST_PARAMETERS
from swingid.live.machine import Machine
from swingid.live.schema import schema

DEVICES = pytest.mark.parametrize("kind", [Machine, CoreDevice], ids=["python", "c"])


def constant(name: str, *modules: str) -> Any:
    """A constant of the first of these modules of the host that has it."""
    for module in modules:
        try:
            return getattr(importlib.import_module(f"swingid.live.{module}"), name)
        except (ImportError, AttributeError):
            continue
    raise LookupError(name)


def test_the_blocks_between_marks_are_what_the_code_makes() -> None:
    """`python tests/protocol_page.py` renews them."""
    assert its.renewed(page()) == page()
    assert set(its.BLOCKS) == {found[1] for found in its.MARKS.finditer(page())}


def test_prose_outside_of_tables_and_code_is_short() -> None:
    text = re.sub(r"^```.*?^```$", "", page(), flags=re.M | re.S)
    text = re.sub(r"^\|.*$|^ {4}.*$|^<!--.*$", "", text, flags=re.M)
    assert len(text.split()) <= 2500


def test_messages_are_those_of_the_schema() -> None:
    rows = table("Messages", "id")
    assert [int(row["id"], 16) for row in rows] == list(schema().by_id)
    for row in rows:
        message = schema().by_id[int(row["id"], 16)]
        assert (message.name, message.length) == (row["message"], int(row["bytes"]))
        assert message.from_host == (row["from"] == "host")
        expected = [f"{name} {its.TYPES[code]}" + (f"[{n}]" if n else "") for name, n, code in message.fields]
        assert row["fields in order"].split(", ") == expected


def test_codes_and_flags_are_those_of_the_code() -> None:
    kinds = {"state": State, "status": codes.Status, "fault": codes.FaultCode}
    kinds |= {"mode of Stop": StopMode, "mode of Arm": Mode}
    found = numbers()
    assert set(found) == set(kinds)
    for kind, words in found.items():
        expected = {one.name if kind == "status" else one.name.lower(): int(one) for one in kinds[kind]}
        assert words == expected, kind
    assert {row["flag"]: 1 << int(row["bit"]) for row in table("Flags", "bit")} == {
        flag.name: flag.value for flag in Flag
    }


def test_places_of_the_parameters_are_those_of_the_code() -> None:
    rows = table("Parameters", "place")
    assert [int(row["place"]) for row in rows] == list(range(guard.CONTROLLER + law.ALPHA + 1))
    for row in rows:
        place, name = int(row["place"]), row["name"]
        expected = getattr(guard, name) if place < guard.CONTROLLER else guard.CONTROLLER + getattr(law, name)
        assert place == expected, name
    assert len(PARAMETERS) == 35
    assert MOST_PARAMETERS == 33 + 2 * guard.MOST_ORDER == 41
    assert "33 + 2n of them: 35" in page()


RANGES: dict[str, tuple[list[float], list[float]]] = {
    "finite": ([0.0, -2.0, 1e300], [math.inf, -math.inf, math.nan]),
    "not 0": ([1e-3, -1e-3], [0.0, math.inf, math.nan]),
    "0 or more": ([0.0, 2.0], [-1e-300, math.inf, math.nan]),
    "above 0": ([1e-9, 3.0], [0.0, -1.0, math.inf, math.nan]),
    "0 to inf": ([0.0, math.inf], [-1e-300, math.nan, -math.inf]),
    "above 0 to inf": ([1e-300, math.inf], [0.0, math.nan]),
    "0 to below 1": ([0.0, 0.999999], [1.0, -1e-9, math.nan]),
    "−1 or 1": ([-1.0, 1.0], [0.0, 0.5, math.nan]),
}


def values_of(row: dict[str, str]) -> tuple[list[float], list[float]]:
    """Numbers inside and outside of a range of the table."""
    if row["range"].startswith("equal to 1 / rate"):
        return [1.0 / BOARD.rate], [math.nextafter(1.0 / BOARD.rate, 1.0), float(np.float32(1.0 / BOARD.rate))]
    if row["name"] == "ORDER":
        return [1.0], [0.0, 2.0, 5.0, 0.5, math.nan]  # the others need another number of parameters
    whole = re.fullmatch(r"whole, (\S+) to (.+)", row["range"])
    if whole is None:
        return RANGES[row["range"]]
    low, high = (-(2**31), 2**31 - 1) if "³¹" in whole[2] else (int(whole[1]), int(whole[2]))
    return [low, high], [low - 1, high + 1, low + 0.5, math.nan, math.inf]


@DEVICES
@pytest.mark.parametrize("row", table("Parameters", "place"), ids=lambda row: row["name"])
def test_a_parameter_beyond_its_range_is_refused_and_one_inside_is_not(kind: Any, row: dict[str, str]) -> None:
    good, bad = values_of(row)
    for value in (*good, *bad):
        parameters = PARAMETERS.copy()
        parameters[int(row["place"])] = value
        driver = Driver(kind(BOARD))
        driver.tick()
        driver.tell(parameter_frames(parameters) + arm_frame(parameters))
        status = codes.Status(driver.last("Ack").status).name
        assert status == ("DONE" if value in good else "BAD_PARAMETERS"), (row["name"], value)


@DEVICES
@pytest.mark.parametrize("order", range(5))
def test_the_number_of_parameters_goes_with_the_order(kind: Any, order: int) -> None:
    for total in range(31, MOST_PARAMETERS + 1):
        parameters = np.concatenate([PARAMETERS[:33], np.ones(8)])[:total]
        if total > guard.CONTROLLER:
            parameters[guard.CONTROLLER] = order
        driver = Driver(kind(BOARD))
        driver.tick()
        driver.tell(parameter_frames(parameters) + arm_frame(parameters))
        assert (driver.last("Ack").status == codes.Status.DONE) == (total == 33 + 2 * order)


# ---- the host ----


def test_times_and_numbers_of_the_host_are_those_of_the_page() -> None:
    rows = {int(row["step"]): row for row in table("Timing and the host", "step")}
    again = {number: row["again"] for number, row in rows.items()}
    words = {number: row["sends"] for number, row in rows.items()}
    asked, patience = f"{1e3 * session.AGAIN:g} ms", f"{session.PATIENCE:g} s"
    assert {again[i] for i in range(1, 6)} == {asked}
    assert {rows[i]["patience"] for i in (1, 2, 4, 5)} == {patience}
    assert again[6] == f"{1e3 * constant('BEAT', 'running'):g} ms"
    retry = f"{1e3 * constant('RETRY', 'running', 'sending'):g} ms"
    assert {again[i] for i in (7, 8, 9)} == {retry}
    block, window = constant("BLOCK", "running", "sending"), constant("WINDOW", "running", "sending")
    turn = constant("PER_TURN", "running", "sending")
    assert f"{block} samples each, at most {turn} messages in a turn, {window} without" in words[7]
    assert constant("AGAIN", "sending", "running") == 2
    assert "twice" in words[8]
    assert "twice" in words[9]
    assert f"reference_room − {2 * block}" in words[8]
    assert session.PART == 7
    assert f"for {constant('SILENT', 'seen', 'running'):g} s from Arm" in page()


def test_the_bytes_that_a_sample_takes_are_those_of_the_firmware() -> None:
    assert machine.most_taken(guard.Board(rate=1000.0)) == 200
    assert machine.most_taken(guard.Board(rate=100_000.0)) == 70
    assert "takes 200 000 / rate, at least 70" in page()


def test_what_hello_of_the_page_may_be_is_what_the_host_takes() -> None:
    """A device within the page's bounds is not refused."""
    for rate, room in ((20.0, 42), (1000.0, 100), (100_000.0, 10_000)):
        values = its.EXAMPLES["Hello"] | {"rate": rate, "reference_room": room, "parameter_room": 35, "wheel_counts": 0}
        assert session.wrong_hello(frames.Frame("Hello", values)) == ""


def test_a_bus_carries_every_message_as_can_fd() -> None:
    can = pytest.importorskip("can", reason="python-can is not installed: pip install 'swingid[live]'")
    sent: list[Any] = []
    bus = CanDevice(SimpleNamespace(send=lambda message, timeout: sent.append(message)), "can://x")
    for name, values in its.EXAMPLES.items():
        bus.write(encode(name, **values))
    assert len(sent) == len(its.EXAMPLES)
    assert all(isinstance(m, can.Message) and m.is_fd and m.bitrate_switch and not m.is_extended_id for m in sent)
