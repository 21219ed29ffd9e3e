"""A rig that is not there, in real time behind a port: the firmware and the twin's motion, for `swingid emulate`.

The device's clock counts its samples. A machine that is too slow for the rate makes that clock go slower than the
real one; the rate that was held is in `Held`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from swingid.live.devices.twin import TwinDevice
from swingid.live.machine import EMULATED
from swingid.live.native import NativeProcess
from swingid.live.pace import alone
from swingid.live.plant import Plant, board_of
from swingid.live.ports import Port, PtyPort, TcpPort

if TYPE_CHECKING:
    from swingid.model.rig import Rig

MOST_BEHIND = 0.02
"""Seconds of samples that are made up for after a delay; more is left out, and the device's clock is late by it."""

BINS = 10.0 ** np.arange(-6.0, 1.01, 0.1)
"""Bounds of lateness (s) of the histogram."""


@dataclass
class Held:
    """How well a loop has kept its time. late: histogram of the lateness of its samples, bounds `BINS`."""

    samples: int = 0
    seconds: float = 0.0
    left_out: float = 0.0
    late: list[int] = field(default_factory=lambda: [0] * (len(BINS) + 1))

    @property
    def rate(self) -> float:
        """Samples per second that were held."""
        return self.samples / self.seconds if self.seconds > 0.0 else 0.0

    def percentile(self, share: float) -> float:
        """Lateness (s) that this share of the samples did not exceed, to a tenth of a decade."""
        reached = np.searchsorted(np.cumsum(self.late), share * self.samples)
        return float(BINS[min(int(reached), len(BINS) - 1)])

    def words(self, wanted: float) -> str:
        """The rate that was held, and the lateness, in one line."""
        late = ", ".join(f"{100 * p:g} % {1e3 * self.percentile(p):.2g} ms" for p in (0.5, 0.99, 0.999))
        short = f"; this machine was too slow for {self.left_out:.2f} s" if self.left_out > 0.0 else ""
        return f"{self.samples} samples, {self.rate:.1f} of {wanted:g} per second; late by at most: {late}{short}"


class PythonRig:
    """The machine in Python on the twin, behind a port."""

    processes: tuple[int, ...] = ()

    def __init__(self, device: TwinDevice, port: Port) -> None:
        self._device, self._port, self.address = device, port, port.address

    def step(self) -> None:
        """One sample."""
        data = self._port.receive(self._device.room)
        if data:
            self._device.write(data)
        self._device.step()
        out = self._device.read(0.0)
        if out:
            self._port.send(out)

    def close(self) -> None:
        """Give the port up."""
        self._port.close()


class NativeRig:
    """The firmware's process with the twin's motion as its plant."""

    def __init__(self, plant: Plant, process: NativeProcess) -> None:
        self._plant, self._process, self.address = plant, process, process.address
        self.processes: tuple[int, ...] = (process.number,)

    def step(self) -> None:
        """One sample."""
        now = round(self._plant.row * 1e6 / self._plant.rate) % 2**32
        self._plant.hold(self._process.exchange(now, self._plant.read()))

    def close(self) -> None:
        """End the process."""
        self._process.close()


def emulated(
    rig: Rig, *, native: bool, tcp: int | None, rate: float = 1000.0, seed: int = 0, draw: bool = False
) -> PythonRig | NativeRig:
    """A rig behind a TCP port (0: any free one), or behind a pseudo terminal where `tcp` is None.

    Errors as `board_of`; DeviceError for a port in use, UsageError without pseudo terminals or compiler.
    """
    _warm_up(rig)
    kind = "native" if native else "twin"
    board = board_of(rig, rate=rate, firmware=EMULATED[kind])
    plant = Plant(rig, rate=rate, seed=seed, draw=draw)
    if native:
        return NativeRig(plant, NativeProcess(board, tcp=tcp))
    port: Port = PtyPort() if tcp is None else TcpPort(tcp)
    return PythonRig(TwinDevice(plant, board), port)


def _warm_up(rig: Rig) -> None:
    """Have every kernel of a run compiled before the first sample that counts."""
    from swingid.control import law
    from swingid.control.compensator import Compensator
    from swingid.live.guard import MOST_ORDER
    from swingid.model.rig import Rig

    gains = Compensator.paper(Rig.load("paper")).parameters(1e-3)
    law.compensator_step(0.0, 0.0, 0.0, np.zeros(law.XI + MOST_ORDER), gains)
    Plant(rig, rows=1000).hold(0.0)


def keep_pace(
    step: Callable[[], None],
    rate: float,
    *,
    seconds: float | None = None,
    over: Callable[[], bool] | None = None,
    processes: tuple[int, ...] = (),
) -> Held:
    """Call `step` `rate` times a second, at absolute deadlines, for `seconds` or until `over` or KeyboardInterrupt.

    No garbage is collected meanwhile, and the process goes first where the system permits it (`pace.alone`), with
    `processes`. The samples of a delay are made up for, at most those of `MOST_BEHIND`.
    """
    held, period = Held(), 1.0 / rate
    begin = time.perf_counter()
    try:
        with alone(*processes):
            begin = due = time.perf_counter()
            while seconds is None or held.samples < round(seconds * rate):
                if over is not None and over():
                    break
                now = time.perf_counter()
                if now < due:
                    time.sleep(due - now)
                    now = time.perf_counter()
                late = now - due
                if late > MOST_BEHIND:
                    held.left_out += late - MOST_BEHIND
                    due = now - MOST_BEHIND
                step()
                held.late[int(np.searchsorted(BINS, late))] += 1
                held.samples += 1
                due += period
    except KeyboardInterrupt:
        pass
    finally:
        held.seconds = max(time.perf_counter() - begin, period)
    return held
