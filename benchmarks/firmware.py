"""Samples per second of a device at every level: Python, the C core, its process, Cortex-M that are emulated.

A sample is one tick of a running device, with its telemetry; the plant is not in it. Levels whose tools are missing are
left out.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
WARM = 20
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "firmware")]

from live_host import BOARD, PARAMETERS, Driver, arm_frame, parameter_frames, reference_frames  # noqa: E402
from swingid.live.codes import State  # noqa: E402
from swingid.live.frames import Decoder, encode  # noqa: E402
from swingid.live.guard import Readings  # noqa: E402
from swingid.live.machine import Machine  # noqa: E402


def samples_per_second(device: Any, count: int) -> float:
    """Ticks of a device that follows a sine, with a heartbeat every 16 samples; the first 20 are not counted."""
    driver = Driver(device, answers_late=True)
    driver.tick()
    driver.tell(parameter_frames(PARAMETERS) + arm_frame(PARAMETERS))
    reference = 0.8 * np.sin(8.5e-3 * np.arange(1020))
    counts = [Readings(round(0.7 * x * 16384 / 6.2832), round(-14 * x * 16384 / 6.2832)) for x in reference]
    driver.tell(reference_frames(reference) + encode("Run", session=7))
    decoder, last, started = Decoder(), b"", 0.0
    for k in range(count + WARM):
        if k == WARM:
            started = time.perf_counter()
        if k % 16 == 0:
            device.receive(encode("Heartbeat", session=7))
        device.tick(1000 * (k + 2), counts[k % len(counts)])
        last = device.output()
    found = count / (time.perf_counter() - started)
    assert decoder.feed(last)[-1].state == State.RUNNING
    return found


def levels() -> dict[str, Callable[[], Any]]:
    """Makers of the device of each level."""
    from test_firmware_process import NativeDevice

    from firmware_build import CoreDevice
    from firmware_emulator import Emulator
    from firmware_qemu import Emulated

    return {
        "machine in Python": lambda: Machine(BOARD),
        "C core by ctypes": lambda: CoreDevice(BOARD),
        "process, TCP, lockstep": lambda: NativeDevice(BOARD, "tcp"),
        "process, pseudo terminal, lockstep": lambda: NativeDevice(BOARD, "pty"),
        "Cortex-M3 in unicorn": lambda: Emulator(BOARD),
        "Cortex-M3 board in QEMU, lockstep": lambda: Emulated("mps2-an385"),
        "Cortex-M7 board in QEMU, lockstep": lambda: Emulated("mps2-an500"),
    }


def main() -> None:
    """Print the table."""
    import pytest

    print("| level | samples per second |\n|---|---|")
    for name, make in levels().items():
        try:
            device = make()
        except pytest.skip.Exception as missing:
            print(f"| {name} | {missing.msg} |")
            continue
        found = samples_per_second(device, 1000)
        print(f"| {name} | {found:,.0f} |")
        if hasattr(device, "close"):
            device.close()


if __name__ == "__main__":
    main()
