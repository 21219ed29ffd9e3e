"""The schema, its C, and frames: against cantools, PyPI's COBS and CRC, and bytes that are no frames."""

from __future__ import annotations

import ctypes
import math
import re
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

cantools = pytest.importorskip("cantools", reason="cantools is not installed: pip install 'swingid[live]'")
cobs = pytest.importorskip("cobs.cobs", reason="cobs is not installed: pip install 'swingid[live]'")
crc16 = pytest.importorskip("fastcrc", reason="fastcrc is not installed: pip install 'swingid[live]'").crc16

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import generate_frames  # noqa: E402

from firmware_build import CORE, FIRMWARE, SIM, build, library  # noqa: E402
from live_host import arm_frame, parameter_frames, reference_frames  # noqa: E402
from refusals import coded  # noqa: E402
from swingid.errors import InputError, UsageError  # noqa: E402
from swingid.live import codes, frames, guard  # noqa: E402
from swingid.live.machine import Machine  # noqa: E402
from swingid.live.schema import Message, database_text, read, schema  # noqa: E402

DATABASE = cantools.database.load_string(database_text(), "dbc")
NUMBERS = {"B": (0, 255), "H": (0, 65535), "I": (0, 2**32 - 1), "i": (-(2**31), 2**31 - 1)}
CAN_FD_LENGTHS = {*range(9), 12, 16, 20, 24, 32, 48, 64}


def random_values(message: Message, rng: np.random.Generator) -> dict[str, Any]:
    """A value of each field, at its bounds in a third of the cases."""

    def one(code: str) -> Any:
        if code in "fd":
            return float(np.float32(rng.normal() * 10.0 ** rng.integers(-5, 6)))
        low, high = NUMBERS[code]
        return int(rng.choice([low, high, rng.integers(low, high, endpoint=True)]))

    fields = [field for field in message.fields if field[0] != "reserved"]
    return {name: tuple(one(code) for _ in range(count)) if count else one(code) for name, count, code in fields}


@pytest.mark.parametrize("name", schema().by_name)
def test_a_payload_is_that_of_cantools_and_comes_back(name: str) -> None:
    message, rng = schema().by_name[name], np.random.default_rng(len(name))
    for _ in range(20):
        values = random_values(message, rng)
        payload = message.pack(**values)
        flat: dict[str, Any] = {signal.name: 0 for signal in DATABASE.get_message_by_name(name).signals}
        for field, value in values.items():
            flat |= {f"{field}_{i}": x for i, x in enumerate(value)} if isinstance(value, tuple) else {field: value}
        assert payload == DATABASE.encode_message(name, flat, strict=False)
        found = message.unpack(payload)
        assert {field: found[field] for field in values} == values


@pytest.mark.parametrize("name", schema().by_name)
def test_c_puts_every_field_where_python_does(name: str) -> None:
    message, rng = schema().by_name[name], np.random.default_rng(len(name))
    core = library(SIM)
    unpack, pack = getattr(core, f"swingid_unpack_{name.lower()}"), getattr(core, f"swingid_pack_{name.lower()}")
    for _ in range(20):
        payload = message.pack(**random_values(message, rng))
        struct_bytes, again = ctypes.create_string_buffer(256), ctypes.create_string_buffer(b"\xff" * 64, 64)
        unpack(struct_bytes, payload)
        pack(again, struct_bytes)
        assert again.raw[: message.length] == payload


def test_generated_c_is_that_of_the_schema() -> None:
    assert (CORE / "frames.h").read_text() == generate_frames.header(schema())
    assert (CORE / "frames.c").read_text() == generate_frames.source(schema())


def test_the_numbers_of_the_dbc_file_are_those_of_the_code() -> None:
    pairs = [
        (codes.State, [("Hello", "state"), ("Sample", "state"), ("Ack", "state"), ("Fault", "state")]),
        (codes.FaultCode, [("Hello", "fault"), ("Sample", "fault"), ("Fault", "code")]),
        (codes.Status, [("Ack", "status")]),
        (codes.StopMode, [("Stop", "mode")]),
        (codes.Mode, [("Arm", "mode")]),
    ]
    for kind, places in pairs:
        for message, field in places:
            expected = {one.value: one.name.lower() for one in kind}
            assert schema().by_name[message].choices[field] == expected, (message, field)


def test_c_and_python_name_the_same_places() -> None:
    """The enumerations of guard.h and compensator.h count as the constants of guard.py and law.py."""
    from swingid.control import law

    for header, module, skipped in (("guard.h", guard, set()), ("compensator.h", law, set())):
        text = re.sub(r"/\*.*?\*/", "", (CORE / header).read_text(), flags=re.S)
        for body in re.findall(r"enum \{(.*?)\}", text, flags=re.S):
            names = [name.strip().removeprefix("SWINGID_") for name in body.split(",")]
            assert [getattr(module, name) for name in names if name not in skipped] == list(range(len(names)))


def test_every_message_fits_a_can_fd_frame() -> None:
    assert {message.length for message in schema().by_id.values()} <= CAN_FD_LENGTHS
    assert max(schema().by_id) < 0x800
    for message in DATABASE.messages:
        assert message.is_fd == (message.length > 8)


def test_the_hash_follows_the_meaning_not_the_layout_of_the_file() -> None:
    text = database_text()
    assert read(text.replace("\n\n", "\n\n\n")).hash == schema().hash
    assert read(text.replace('"counts"', '"count"')).hash == schema().hash
    assert read(text.replace("SG_ current", "SG_ ampere").replace("96 current", "96 ampere")).hash != schema().hash
    assert read(text.replace('6 "current"', '6 "ampere"')).hash != schema().hash


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("axis : 64|32@1- (1,", "axis : 64|32@1- (0.1,"),
        ("axis : 64|32@1-", "axis : 64|31@1-"),
        ("32|32@1+", "39|32@0+"),
    ],
)
def test_a_schema_of_another_layout_is_refused(old: str, new: str) -> None:
    text = database_text()
    assert old in text
    with pytest.raises(InputError) as caught:
        read(text.replace(old, new))
    assert caught.value.code == "bad-schema"


def test_values_that_a_message_cannot_hold_are_refused() -> None:
    with pytest.raises(UsageError, check=coded("bad-frame", "volts")):
        frames.encode("Sample", volts=1.0)
    with pytest.raises(UsageError, check=coded("bad-frame")):
        frames.encode("Ack", status=256)
    with pytest.raises(UsageError, check=coded("bad-frame")):
        frames.encode("Reference", value=(1e300,))


def test_cobs_and_crc_of_c_are_those_of_the_libraries() -> None:
    core, rng = library(SIM), np.random.default_rng(0)
    core.swingid_crc.argtypes, core.swingid_crc.restype = (
        [ctypes.c_uint16, ctypes.c_char_p, ctypes.c_int],
        ctypes.c_uint16,
    )
    assert core.swingid_crc(0xFFFF, b"123456789", 9) == 0x29B1  # the check value of the CRC catalogue
    for _ in range(500):
        payload = bytes(rng.choice([0, 1, 255, rng.integers(256)], size=rng.integers(0, 65)).astype(np.uint8))
        identifier = int(rng.integers(0, 2048))
        encoded = ctypes.create_string_buffer(128)
        size = core.swingid_encode(encoded, ctypes.c_uint16(identifier), payload, len(payload))
        body = struct.pack("<H", identifier) + payload
        assert encoded.raw[:size] == cobs.encode(body + struct.pack("<H", crc16.ibm_3740(body))) + b"\0"
        found, back, length = ctypes.c_uint16(), ctypes.create_string_buffer(64), ctypes.c_int()
        assert core.swingid_decode(encoded, size - 1, ctypes.byref(found), back, ctypes.byref(length)) == 1
        assert (found.value, back.raw[: length.value]) == (identifier, payload)
        assert frames.unwrap(encoded.raw[: size - 1]) == (identifier, payload)


SAMPLE = {"sequence": 5, "time": 1000, "axis": -3, "voltage": 1.5, "gain": 0.25}


def test_frames_split_and_joined_anyhow_arrive() -> None:
    stream = b"".join(frames.encode("Sample", **(SAMPLE | {"sequence": i})) for i in range(50))
    rng = np.random.default_rng(1)
    cuts = np.unique(rng.integers(0, len(stream), 200))
    decoder = frames.Decoder()
    found = [
        frame for part in np.split(np.frombuffer(stream, np.uint8), cuts) for frame in decoder.feed(part.tobytes())
    ]
    assert [frame.sequence for frame in found] == list(range(50))
    assert (found[0].axis, found[0].voltage, decoder.bad) == (-3, 1.5, 0)


@pytest.mark.parametrize("garbage", [b"\x07", b"hello world" * 20, b"\0\0\0", b"\xff" * 300, b"\x01\x02\x00\x03"])
def test_after_garbage_the_second_frame_arrives(garbage: bytes) -> None:
    decoder = frames.Decoder()
    stream = frames.encode("Sample", **SAMPLE)
    found = decoder.feed(garbage + stream + stream)
    assert [frame.sequence for frame in found][-1:] == [5]
    assert len(found) + decoder.bad >= 2


def test_one_flipped_bit_is_never_another_frame() -> None:
    stream = frames.encode("Sample", **SAMPLE)
    for bit in range(8 * len(stream)):
        flipped = bytearray(stream)
        flipped[bit // 8] ^= 1 << bit % 8
        decoder = frames.Decoder()
        assert decoder.feed(bytes(flipped) + b"\0") == []


def test_a_frame_of_the_wrong_direction_is_bad() -> None:
    decoder = frames.Decoder(from_host=True)
    assert decoder.feed(frames.encode("Sample", **SAMPLE)) == []
    assert decoder.bad == 1


# ---- bytes that are no frames ----


def streams(rng: np.random.Generator, count: int) -> list[bytes]:
    """Random bytes, frames with random numbers, and good sessions with bytes changed, lost and put in."""
    session = parameter_frames() + arm_frame(mode=1) + reference_frames(rng.uniform(-15, 15, 70))
    session += frames.encode("Run", session=7)
    pieces = [frame + b"\0" for frame in session.split(b"\0")[:-1]]
    hosts = [message for message in schema().by_id.values() if message.from_host]
    made = []
    for _ in range(count):
        kind = rng.integers(4)
        if kind == 0:
            made.append(rng.bytes(int(rng.integers(1, 200))))
        elif kind == 1:
            message = hosts[rng.integers(len(hosts))]
            made.append(frames.wrap(message.id, rng.bytes(message.length)))
        elif kind == 2:
            changed = bytearray(pieces[rng.integers(len(pieces))])
            for _ in range(int(rng.integers(1, 4))):
                changed[rng.integers(len(changed))] = rng.integers(256)
            made.append(bytes(changed))
        else:
            made.append(pieces[rng.integers(len(pieces))] if rng.random() < 0.9 else session)
    return made


def records(parts: list[bytes], rng: np.random.Generator) -> bytes:
    """What fuzz.c reads: streams with samples and new devices between them."""
    out = bytearray()
    for part in parts:
        out += struct.pack("<BH", 0, len(part)) + part
        if rng.random() < 0.3:
            steps = rng.bytes(int(rng.integers(1, 30)))
            out += struct.pack("<BH", 1, len(steps)) + steps
        if rng.random() < 0.01:
            out += struct.pack("<BH", 2, 0)
    return bytes(out)


def fuzz_c(count: int, seed: int, folder: Path) -> None:
    options = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    program = build((FIRMWARE / "tests" / "fuzz.c",), options)
    rng = np.random.default_rng(seed)
    file = folder / "records"
    file.write_bytes(records(streams(rng, count), rng))
    done = subprocess.run([str(program), str(file)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[4]) > count / 100, f"hardly a voltage was ever applied: {done.stdout}"


def fuzz_python(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    machine = Machine(guard.Board())
    driven = 0
    for i, part in enumerate(streams(rng, count)):
        machine.receive(part)
        may = machine.state in (codes.State.RUNNING, codes.State.STOPPING)
        voltage = machine.tick(1000 * i % 2**32, guard.Readings(i % 3, i % 100))
        driven += voltage != 0.0
        assert math.isfinite(voltage)
        assert abs(voltage) <= 10.0
        assert may or voltage == 0.0
        assert len(machine.output()) <= 1024
    assert driven > 0


def test_ten_thousand_streams_into_the_c_decoder_under_sanitizers(tmp_path: Path) -> None:
    fuzz_c(10_000, 1, tmp_path)


def test_streams_into_the_python_decoder() -> None:
    fuzz_python(3_000, 2)


@pytest.mark.long
def test_a_million_streams_into_the_c_decoder_under_sanitizers(tmp_path: Path) -> None:
    for seed in range(10):
        fuzz_c(100_000, seed, tmp_path)


@pytest.mark.long
def test_a_million_streams_into_the_python_decoder() -> None:
    fuzz_python(1_000_000, 3)


@pytest.mark.parametrize("package", ["cantools", "cobs", "fastcrc"])
def test_a_missing_package_is_named_with_its_extra(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UsageError, match=rf"{package}; run: pip install 'swingid\[live\]'"):
        read(database_text()) if package == "cantools" else frames._codec.__wrapped__()
