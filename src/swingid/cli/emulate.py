"""``swingid emulate``: a rig that is not there, in real time behind a port."""

from __future__ import annotations

import signal
import threading
from typing import Annotated, Literal

import typer

from swingid.cli import output
from swingid.cli.options import Rate, RigFile
from swingid.errors import UsageError

PORT = 8765


def emulate(
    rig: RigFile,
    tcp: Annotated[
        int | None, typer.Option(metavar="PORT", min=0, max=65535, help=f"TCP port (default {PORT}; 0: any free one).")
    ] = None,
    pty: Annotated[bool, typer.Option("--pty", help="A pseudo terminal, which a host opens as a serial port.")] = False,
    firmware: Annotated[
        Literal["auto", "native", "python"],
        typer.Option(help="The C firmware as a process, or the same device in Python; auto: C with a compiler."),
    ] = "auto",
    rate: Rate = 1000.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    draw: Annotated[
        bool, typer.Option("--draw", help="Draw every constant with a stated uncertainty, by the seed.")
    ] = False,
    duration: Annotated[
        float | None, typer.Option(metavar="S", min=0.001, help="End after this time; otherwise by Ctrl-C.")
    ] = None,
) -> None:
    """Emulate a rig in real time, as a device that `swingid run` connects to."""
    from swingid.live import native
    from swingid.live.emulator import emulated, keep_pace
    from swingid.model.rig import Rig

    if pty and tcp is not None:
        raise UsageError("--tcp and --pty exclude each other; give one", code="bad-option")
    if not 20.0 <= rate <= 10_000.0:
        raise UsageError(
            f"--rate {rate:g} is out of range; an emulated device makes 20 to 10000 per second", code="bad-rate"
        )
    obstacle = native.obstacle()
    if firmware == "native" and obstacle is not None:
        raise UsageError(f"{obstacle}; use --firmware python", code="no-compiler")
    compiled = firmware != "python" and obstacle is None
    device = emulated(
        Rig.load(rig),
        native=compiled,
        tcp=None if pty else PORT if tcp is None else tcp,
        rate=rate,
        seed=seed,
        draw=draw,
    )
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    what = "the C firmware" if compiled else "the firmware in Python"
    if firmware == "auto" and not compiled:
        what += f" ({obstacle})"
    try:
        output.tell(f"{device.address}: {what} on the twin of {rig}, {rate:g} samples per second; Ctrl-C ends it")
        reference = '--reference "sine 0.8 rad 8.5 rad/s"'
        output.tell(f"connect by: swingid run --device {device.address} --rig {rig} {reference} --out run.mcap")
        pace = keep_pace(device.step, rate, seconds=duration, processes=device.processes)
    finally:
        device.close()
    output.tell(pace.words(rate))
