"""A Quanser board as a device: its encoders and amplifier by lines of CSV, for ``--device hil://HOST:8700``.

Runs on the computer that has the board, with Quanser's own Python package (`quanser.hardware`), whose documented
functions it calls; it has not run on a board yet. Another closed system needs the same lines (docs/porting.md).

    python quanser_hil.py --board qube_servo2_usb --wheel 0 --axis 1 --counts 2048 2048 --limit 10
"""

from __future__ import annotations

import argparse
import math
import socket
from array import array
from typing import Any

WATCHDOG = 0.1
"""Seconds without a line after which the board itself gives 0 V and lets go of the amplifier."""


class Board:
    """Two encoders, a voltage and an enable of a board `card` of Quanser's HIL; channels of axis and wheel."""

    def __init__(self, card: Any, axis: int, wheel: int, output: int = 0, enable: int = 0) -> None:
        self._card, self._encoders = card, array("I", [axis, wheel])
        self._output, self._enable = array("I", [output]), array("I", [enable])
        self._counts = array("i", [0, 0])
        card.watchdog_set_analog_expiration_state(self._output, 1, array("d", [0.0]))
        card.watchdog_set_digital_expiration_state(self._enable, 1, array("i", [0]))
        self.off()
        card.watchdog_start(WATCHDOG)

    def alive(self) -> None:
        """A line has come. A watchdog that had expired is cleared with the amplifier off."""
        if not self._card.watchdog_reload():
            self._card.watchdog_clear()
            self.off()
            self._card.watchdog_start(WATCHDOG)

    def read(self) -> tuple[int, int]:
        """Counts of axis and wheel."""
        self._card.read_encoder(self._encoders, 2, self._counts)
        return self._counts[0], self._counts[1]

    def voltage(self, volts: float) -> None:
        """Put a voltage (V) out."""
        self._card.write_analog(self._output, 1, array("d", [volts]))

    def enable(self, on: bool) -> None:
        """Switch the amplifier."""
        self._card.write_digital(self._enable, 1, array("b", [on]))

    def off(self) -> None:
        """0 V, amplifier off."""
        self.voltage(0.0)
        self.enable(False)


def answer(board: Board, line: str, counts: tuple[int, int], limit: float) -> str | None:
    """What a line of the host does; its answer, None without one. A line that is none of the six is 0 V."""
    board.alive()
    word, _, value = line.partition(",")
    if word == "C":
        return f"{counts[0]},{counts[1]},{limit:g},{1000 * WATCHDOG:g}"
    if word == "R":
        axis, wheel = board.read()
        return f"{axis},{wheel},nan"
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if word == "U" and math.isfinite(number):
        board.voltage(min(max(number, -limit), limit))
    elif word == "E" and number in (0.0, 1.0):
        board.enable(number == 1.0)
    else:
        board.off()
    return None


def serve(board: Board, listening: socket.socket, counts: tuple[int, int], limit: float) -> None:
    """Serve one host after the other; off where it goes, or says nothing for the time of the watchdog."""
    while True:
        host, _ = listening.accept()
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        host.settimeout(WATCHDOG)
        rest = b""
        try:
            with host:
                while True:
                    try:
                        data = host.recv(4096)
                    except TimeoutError:
                        board.off()
                        continue
                    if not data:
                        break
                    *lines, rest = (rest + data).split(b"\n")
                    for line in lines:
                        said = answer(board, line.decode("ascii", "replace").strip(), counts, limit)
                        if said is not None:
                            host.sendall(f"{said}\n".encode("ascii"))
        except OSError:
            pass
        finally:
            board.off()


def main() -> None:
    """Open the board and serve it."""
    from quanser.hardware import HIL

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--board", default="qube_servo2_usb")
    parser.add_argument("--axis", type=int, default=1, help="encoder channel of the axis")
    parser.add_argument("--wheel", type=int, default=0, help="encoder channel of the wheel")
    parser.add_argument("--counts", type=int, nargs=2, default=(2048, 2048), help="counts per turn of axis and wheel")
    parser.add_argument("--limit", type=float, default=10.0, help="largest voltage (V)")
    parser.add_argument("--port", type=int, default=8700)
    given = parser.parse_args()
    card = HIL(given.board, "0")
    board = Board(card, given.axis, given.wheel)
    try:
        with socket.create_server(("", given.port)) as listening:
            serve(board, listening, tuple(given.counts), given.limit)
    finally:
        board.off()
        card.watchdog_stop()
        card.close()


if __name__ == "__main__":
    main()
