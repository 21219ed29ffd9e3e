"""Addresses of devices: the right device, and one sentence with the remedy where there is none."""

from __future__ import annotations

import errno
import os
import socket
import struct
import sys
import threading
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from live_host import BOARD, encode, parameter_frames
from refusals import coded
from swingid.cli import main
from swingid.errors import DeviceError, SwingidError, UsageError
from swingid.live.devices import table
from swingid.live.devices.can_bus import CanDevice
from swingid.live.devices.table import open_device
from swingid.live.frames import Decoder, wrap
from swingid.live.machine import Machine

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")


def hello_of(address: str) -> Any:
    """Hello of the device at an address, which a `Machine` on the other side answers."""
    device = open_device(address)
    decoder, frames = Decoder(), []
    device.write(encode("Who"))
    for _ in range(200):
        frames += decoder.feed(device.read(0.05))
        if frames:
            break
    device.close()
    with pytest.raises(UsageError, match="closed"):
        device.read()
    return frames[0]


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("paper", "no address of a device, which is SCHEME"),
        ("seriel:///dev/ttyACM0", "did you mean serial://"),
        ("rtde://robot", "schemes are can://.*csv://.*moteus://.*serial://.*tcp://.*twin://"),
        ("tcp://localhost", "tcp://HOST:PORT"),
        ("tcp://localhost:http", "tcp://HOST:PORT"),
        ("tcp://localhost:99999", "tcp://HOST:PORT"),
        ("tcp://localhost:1?speed=3", "speed is not offered; options are none"),
        ("serial://", "must be serial://PORT"),
        ("serial:///dev/ttyACM0?baud=fast", "baud must be a number, not 'fast'"),
        ("serial:///dev/ttyACM0?baud=9600.5", "baud must be a whole number"),
        ("serial:///dev/ttyACM0?baud=nan", "baud must be a whole number"),
        ("serial:///dev/ttyACM0?speed=9600", "speed is not offered; options are baud"),
        ("csv://", "must be csv://PATH"),
        ("csv:///tmp/log.csv?baud=9600", "a file has no baud"),
        ("can://", "must be can://CHANNEL"),
        ("can://can0?interface=canopener", "python-can has no interface canopener; it has .*socketcan"),
    ],
)
def test_addresses_that_are_none(address: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        open_device(address)


def test_a_twin_is_the_one_device_in_virtual_time() -> None:
    device = open_device("twin://paper?seed=2")
    assert (device.virtual, device.address) == (True, "twin://paper?seed=2")
    assert hello_of("TWIN://paper").rate == 1000.0


def test_another_package_adds_a_scheme(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint("lab", "swingid.live.devices.twin:twin_of", table.GROUP),
        EntryPoint("old", "no_such_module_of_a_lab:open", table.GROUP),
    ]

    def found(group: str, name: str | None = None) -> list[EntryPoint]:
        return [point for point in points if group == table.GROUP and name in (None, point.name)]

    monkeypatch.setattr(table, "entry_points", found)
    assert table.schemes() == sorted([*table.SCHEMES, "lab", "old"])
    with pytest.raises(AttributeError):  # twin_of takes a rig: it was called with the address
        open_device("lab://bench")
    with pytest.raises(UsageError, check=coded("bad-plugin", "old://", "no_such_module_of_a_lab:open")):
        open_device("old://bench")


# ---- tcp


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def answer(server: socket.socket) -> None:
    """A device that answers one host until that leaves."""
    machine = Machine(BOARD)
    connection, _ = server.accept()
    with connection:
        while data := connection.recv(4096):
            machine.receive(data)
            connection.sendall(machine.output())


def test_tcp_carries_the_bytes(listener: socket.socket) -> None:
    thread = threading.Thread(target=answer, args=(listener,))
    thread.start()
    assert hello_of(f"tcp://127.0.0.1:{listener.getsockname()[1]}").axis_counts == BOARD.axis_counts
    thread.join(10)
    assert not thread.is_alive()


def test_tcp_reset_is_said_in_words(listener: socket.socket) -> None:
    device = open_device(f"tcp://localhost:{listener.getsockname()[1]}")
    host = listener.accept()[0]
    host.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # its end is a reset
    host.close()
    with pytest.raises(DeviceError, check=coded("gone")):
        device.read(5.0)


def test_tcp_without_a_device(listener: socket.socket) -> None:
    port = listener.getsockname()[1]
    device = open_device(f"tcp://localhost:{port}")
    assert device.read(0.001) == b""
    listener.accept()[0].close()
    with pytest.raises(DeviceError, check=coded("gone")):
        device.read(5.0)
    listener.close()
    with pytest.raises(DeviceError, check=coded("no-device", "swingid emulate")) as error:
        open_device(f"tcp://127.0.0.1:{port}")
    assert (error.value.exit_code, error.value.code) == (5, "no-device")


def test_a_device_that_takes_nothing(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("swingid.live.devices.tcp.WRITE_TIME", 0.05)
    device = open_device(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    with pytest.raises(DeviceError, check=coded("no-answer")):
        device.write(bytes(100_000_000))


# ---- serial


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for end in (master, slave):
        try:
            os.close(end)
        except OSError as error:
            assert error.errno == errno.EBADF


@posix
def test_serial_carries_every_byte_and_is_locked(terminal: tuple[int, str]) -> None:
    pytest.importorskip("serialx")
    master, path = terminal
    device = open_device(path)
    assert (device.virtual, device.address) == (False, f"serial://{path}")
    assert device.read(0.0) == b""
    device.write(bytes(range(256)))
    assert os.read(master, 1000) == bytes(range(256))
    os.write(master, bytes(range(256)))
    came = b""
    while len(came) < 256:
        came += device.read(5.0)
    assert came == bytes(range(256))
    with pytest.raises(DeviceError, check=coded("busy")):
        open_device(f"serial://{path}?baud=115200")
    device.close()
    device.close()
    open_device(path).close()


@posix
def test_a_serial_port_unplugged_in_use(terminal: tuple[int, str]) -> None:
    pytest.importorskip("serialx")
    master, path = terminal
    device = open_device(path)
    os.close(master)
    with pytest.raises(DeviceError, check=coded("gone")):
        device.read(5.0)
    with pytest.raises(DeviceError, check=coded("gone")):
        device.write(b"x" * 10)
    device.close()


@posix
def test_no_such_port_and_no_port_at_all(tmp_path: Any) -> None:
    pytest.importorskip("serialx")
    with pytest.raises(DeviceError, check=coded("no-device", "/dev/ttySwing9")):
        open_device("/dev/ttySwing9")
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(DeviceError, check=coded("no-device")):
        open_device(f"serial://{file}")


@posix
def test_no_permission_names_the_group(monkeypatch: pytest.MonkeyPatch) -> None:
    serialx = pytest.importorskip("serialx")

    class Denied:
        def __init__(self, *_: object) -> None: ...

        def open(self) -> None:
            raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(serialx, "Serial", Denied)
    with pytest.raises(DeviceError, check=coded("no-permission", "/dev/ttyACM7", "usermod -aG", "$USER")):
        open_device("/dev/ttyACM7")


# ---- CAN


def test_can_messages_are_the_frames_unchanged() -> None:
    can = pytest.importorskip("can")
    bus = can.Bus(channel="swingid-test", interface="virtual", fd=True)
    device = open_device("can://swingid-test?interface=virtual")
    sent = encode("Who") + parameter_frames()
    device.write(sent[:7])
    device.write(sent[7:])
    found = [bus.recv(5.0) for _ in range(len(sent.split(b"\0")) - 1)]
    assert b"".join(wrap(message.arbitration_id, bytes(message.data)) for message in found) == sent
    assert all(message.is_fd and not message.is_extended_id for message in found)

    machine = Machine(BOARD)
    machine.receive(sent)
    answers = machine.output()
    other = CanDevice(bus, "device", from_host=False)
    bus.send(can.Message(arbitration_id=0x7FF, data=b"another node"[:8], is_extended_id=False))
    other.write(answers + b"\x05noise\0")
    came = b""
    while len(came) < len(answers):
        came += device.read(5.0)
    assert came == answers
    assert device.read(0.001) == b""
    device.close()
    with pytest.raises(UsageError, match="closed"):
        device.write(sent)
    bus.shutdown()


def test_no_can_bus() -> None:
    pytest.importorskip("can")
    with pytest.raises(DeviceError, check=coded("no-device", "CAN")):
        open_device("can://no-such-bus0")


@pytest.mark.parametrize(
    ("package", "address"), [("serialx", "/dev/ttyACM0"), ("can", "can://can0"), ("cantools", "twin://paper")]
)
def test_a_missing_package_is_one_sentence(package: str, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from swingid.live import schema

    schema.schema.cache_clear()
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(SwingidError, check=coded("missing-package", "'swingid[live]'")) as error:
        open_device(address).write(encode("Who"))
    assert error.value.exit_code == 2
    schema.schema.cache_clear()


def test_help_names_the_exit_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    assert "5 no device" in capsys.readouterr().out
