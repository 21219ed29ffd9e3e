"""``swingid stop``: the runs of this user on this machine, stopped from another terminal."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.errors import DeviceError, InputError

if TYPE_CHECKING:
    from swingid.live.registry import Found

POLL, OBEYS, ENDING = 0.05, 5.0, 2.0
"""Seconds between two looks at a run; in which it obeys (its own patience with the device is 1 s); and until a process
that was ended has gone.
"""


def stop(
    hard: Annotated[bool, typer.Option("--hard", help="0 V at once; default: the motion fades out first.")] = False,
    device: Annotated[
        str | None, typer.Option(metavar="DEV", help="Only the run on this device; default: all runs of this user.")
    ] = None,
) -> None:
    """Stop the run that goes on, also one whose command or page has died; wait until it has ended.

    Exit code 5 where nothing is running or a run does not end. A hardware emergency stop is yours to provide.
    """
    from swingid.live import registry

    try:
        runs = [run for run in registry.runs() if device is None or run.is_on(device)]
        for run in runs:
            run.ask(hard=hard)
    except OSError as error:
        text = f"the folder of this user's runs can't be used ({error.strerror or error}); use the emergency stop"
        raise InputError(text, code="no-registry") from None
    if not runs:
        where = "" if device is None else f" on {device}"
        text = f"nothing is running{where} that this user has started on this machine; if the rig moves, use the "
        raise DeviceError(f"{text}emergency stop", code="nothing-running")
    going = [run for run in runs if not _ended(run, hard=hard)]
    if going:
        names = " and ".join(run.entry.words() for run in going)
        more = "use the emergency stop" if hard else "give swingid stop --hard, or use the emergency stop"
        raise DeviceError(f"{names} has not ended; {more}", code="not-stopped")


def _ended(run: Found, *, hard: bool) -> bool:
    """Wait for a run's end and say how it ended; a process that does not obey a hard stop is ended."""
    if not _gone(run, OBEYS + (0.0 if hard else run.entry.fade)):
        if not hard:
            return False
        from swingid.live.worker import end_process

        end_process(run.entry.pid)
        if not _gone(run, ENDING):
            return False
        text = "it did not obey, so its process was ended: the firmware gives 0 V without a heartbeat"
        output.tell(f"{run.entry.words()}: {text}")
        run.last_words()
        return True
    output.tell(f"{run.entry.words()}: {run.last_words() or 'its process has ended'}")
    return True


def _gone(run: Found, seconds: float) -> bool:
    until = time.monotonic() + seconds
    while run.alive:
        if time.monotonic() > until:
            return False
        time.sleep(POLL)
    return True
