"""A device written from docs/protocol.md alone, by somebody who has not seen the package: it shares no code with it.

As a program, `python tests/foreign_device.py --tcp PORT [--fault NAME]`, it runs in real time behind a TCP port
(0: any; the first line that it prints is its address). As a class, `ForeignDevice`, its time passes only while it
is read. The pendulum behind it is in foreign_rig.py, the board in foreign_board.py, law and guard in
foreign_law.py, and the ways in which it can misbehave in foreign_faults.py.
"""

import argparse
import select
import socket
import time as wall
from math import ceil

from foreign_board import Board, Build, Flaw
from foreign_rig import Bench, Mounting


class ForeignDevice:
    """Board and bench as a link of the host; its time passes only in `read`, at most 16 samples in a call."""

    virtual = True
    address = "foreign://virtual"

    def __init__(self, flaw: Flaw | None = None, mounting: Mounting | None = None, build: Build | None = None):
        mounting = mounting or Mounting()
        build = build or Build(axis_counts=mounting.axis_counts, wheel_counts=mounting.wheel_counts)
        self.board = Board(build, flaw)
        self.bench = Bench(mounting)
        self.flaw = self.board.flaw
        self.period = 1.0 / (build.rate * self.flaw.pace)  # true seconds
        self.samples = 0
        self.output = 0.0  # V that the motor gets
        self._share = self.room = max(70, int(200_000 / build.rate))  # bytes of the host that a sample may take
        self._waiting = b""
        self._label = 1e6 / build.rate * self.flaw.label
        self._first = 2**32 - 4_000_000  # us: `time` wraps after four seconds

    def tick(self) -> None:
        """One sample and the period after it, and then what waited for it."""
        time = (self._first + int(self.samples * self._label)) & 0xFFFFFFFF
        self.board.busy = self.room <= 0
        self.output = self.board.sample(time, *self.bench.read())
        self.bench.move(self.output, self.period)
        self.samples += 1
        self.room = self._share
        if self._waiting:
            self._pass()

    def _pass(self) -> None:
        data, self._waiting = self._waiting[: self.room], self._waiting[self.room :]
        self.room -= len(data)
        self.board.receive(data)

    def write(self, data: bytes) -> None:
        """Bytes of the host; no more of them go on than a sample may take, the rest waits."""
        self._waiting += data
        self._pass()

    def read(self, timeout: float) -> bytes:
        parts = [self.board.take()]
        for _ in range(min(16, ceil(timeout / self.period - 1e-6))):
            self.tick()
            parts.append(self.board.take())
        return b"".join(parts)

    def clock(self) -> float:
        return 1000.0 + self.samples * self.period

    def close(self) -> None:
        pass


class Port:
    """The device in real time behind a TCP port of this machine, for one host at a time."""

    BEHIND = 0.2  # s that samples may lag behind the clock before they are left out: time jumps, as on a halted board

    def __init__(self, device: ForeignDevice, port: int):
        self.device = device
        self.listener = socket.create_server(("127.0.0.1", port))
        self.host: socket.socket | None = None
        self.unsent = b""

    def _accept(self) -> None:
        host, _ = self.listener.accept()
        if self.host is not None:
            host.close()
            return
        host.setblocking(False)
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.host = host

    def _lose(self) -> None:
        """The host has gone: half a frame, and what waits for it, go with it. The guard sees to the motor."""
        if self.host is not None:
            self.host.close()
        self.host, self.unsent = None, b""
        self.device.board.partial.clear()
        self.device.board.take()

    def _pull(self) -> None:
        if self.host is None or self.device.room <= 0:
            return
        try:
            data = self.host.recv(self.device.room)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self.device.write(data)
        else:
            self._lose()

    def _push(self) -> None:
        board = self.device.board
        if self.host is None:
            board.take()
            return
        try:
            while self.unsent or board.queue:
                if not self.unsent:
                    self.unsent = board.queue.popleft()
                sent = self.host.send(self.unsent)
                self.unsent = self.unsent[sent:]
                board.queued -= sent
        except BlockingIOError:
            return
        except OSError:
            self._lose()

    def run(self) -> None:
        due = wall.perf_counter()
        while True:
            pause = due - wall.perf_counter()
            if pause > 0.0:
                watched: list[socket.socket] = [self.listener]
                if self.host is not None and self.device.room > 0:
                    watched.append(self.host)
                ready = select.select(watched, [], [], pause)[0]
                if self.listener in ready:
                    self._accept()
            self._pull()
            if wall.perf_counter() >= due:
                self.device.tick()
                due += self.device.period
                lag = wall.perf_counter() - due
                if lag > self.BEHIND:
                    left_out = int(lag / self.device.period)
                    self.device.samples += left_out
                    due += left_out * self.device.period
            self._push()


def main() -> None:
    from foreign_faults import FLAWS

    parser = argparse.ArgumentParser(description="A device written from docs/protocol.md alone, behind a TCP port.")
    parser.add_argument("--tcp", type=int, required=True, metavar="PORT", help="port of this machine, 0: any")
    parser.add_argument("--fault", choices=sorted(FLAWS), help="how it misbehaves")
    parser.add_argument("--signs", default="+++", help="of axis, wheel and motor, such as -+-")
    options = parser.parse_args()
    signs = [-1 if sign == "-" else 1 for sign in options.signs]
    device = ForeignDevice(FLAWS[options.fault] if options.fault else None, Mounting(*signs))
    port = Port(device, options.tcp)
    print(f"tcp://127.0.0.1:{port.listener.getsockname()[1]}", flush=True)
    port.run()


if __name__ == "__main__":
    main()
