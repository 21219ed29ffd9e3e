"""``swingid run``, ``stop``, ``record``, ``recover``, ``firmware``: a live rig, its board and its logs."""

from __future__ import annotations

import math
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first, kernels_of
from swingid.cli.failure import decided
from swingid.cli.options import JsonOrRefusal, Method, Report, RigFile
from swingid.cli.simulate import Gains, compensator_of
from swingid.errors import DeviceError, InputError, SwingidError, UsageError
from swingid.methods.table import DEFAULT
from swingid.system import write_whole

if TYPE_CHECKING:
    from swingid.live.experiment import Order
    from swingid.live.progress import Progress
    from swingid.live.registry import Found
    from swingid.model.rig import Rig
    from swingid.result.result import Result

POLL, OBEYS, ENDING = 0.05, 5.0, 2.0
"""Seconds between two looks at a run; in which it obeys (its own patience with the device is 1 s); and until a process
that was ended has gone.
"""


def recover(
    file: Annotated[str, typer.Argument(metavar="FILE.mcap", help="Journal that was cut off or is damaged.")],
    out: Annotated[
        str | None, typer.Option(metavar="FILE", help="File to write; default: FILE.recovered.mcap beside it.")
    ] = None,
) -> None:
    """Write a whole journal of what a broken one holds: every block whose checksum is right.

    A journal that is cut off can be identified as it is; other programs (Foxglove) want a whole file.
    """
    output.check_files({file: "the broken file"}, out=out)
    from swingid.live.recover import recover as rescue

    recovered, path = rescue(file, out)
    counts = ", ".join(f"{count} of {topic}" for topic, count in recovered.messages.items())
    if path is None:
        output.tell(f"{file} is whole ({counts}); nothing to recover")
        return
    lost = f"; {recovered.damaged} damaged blocks left out" if recovered.damaged else ""
    output.tell(f"wrote {path}: {counts}{lost}")


def run(
    rig: RigFile,
    reference: Annotated[str, typer.Option(metavar="MOTION", help='Motion, such as "sine 0.8 rad 8.5 rad/s".')],
    out: Annotated[str, typer.Option(metavar="FILE.mcap", help="Journal to write.")],
    device: Annotated[
        str | None,
        typer.Option(
            metavar="DEV", help="Such as serial:///dev/ttyACM0; default: device.address of RIG, else its twin."
        ),
    ] = None,
    duration: Annotated[float, typer.Option(help="Length of the run, s.")] = 25.0,
    until: Annotated[
        str | None,
        typer.Option(metavar="SHARE", help='Stop when the estimate has this relative uncertainty, such as "0.05%".'),
    ] = None,
    gains: Annotated[Gains | None, typer.Option(help="Of the compensator; default: the paper's experiment.")] = None,
    method: Method = DEFAULT,
    clear: Annotated[
        bool, typer.Option("--clear", help="You have looked at the rig: clear its latched fault.")
    ] = False,
    json: JsonOrRefusal = None,
    report: Report = None,
) -> None:
    """Run an experiment on a live rig, record it, and identify what it shows.

    The twin of RIG rehearses it first. Ctrl-C stops softly, a second one gives 0 V at once. However the run ends, the
    rig is at 0 V; a hardware emergency stop is yours to provide.
    """
    if not out.endswith(".mcap"):
        raise UsageError(f"--out {out}: a journal is MCAP; give a name that ends in .mcap", code="bad-target")
    output.check_files({rig: "the rig file"}, out=out, json=json, report=report)
    from swingid.control.references import reference_for
    from swingid.live.experiment import Order, required
    from swingid.model.rig import Rig

    plant = Rig.load(rig)
    share = 0.0 if until is None else _share(until)
    order = Order(reference_for(reference, plant), compensator_of(plant, gains), duration, share, clear=clear)
    required(order)
    compile_first("simulate")
    address = address_of(device, plant)
    provenance: dict[str, object] = {"log": out, "rig_source": rig}
    with measured(out), output.refusals_to(json, method, provenance, report):
        conduct(plant, address, order, out)
        result = identified(out, plant, method, provenance, report)
        output.hand_over(result, json, report)


def address_of(device: str | None, plant: Rig) -> str:
    """The device of --device, else of the rig file, else the emulator (""), which is said."""
    address = device if device is not None else plant.device.address or ""
    if not address:
        output.say(f"no --device given: this is the emulator of {plant.name}, its twin in virtual time")
    return address


@contextmanager
def measured(out: str) -> Iterator[None]:
    """A run and what is made of it: Ctrl-C after the run is a DeviceError that says what is kept."""
    try:
        yield
    except KeyboardInterrupt:
        decided()
        text = f"interrupted by Ctrl-C after the run; {out} holds it: identify it with swingid identify {out}"
        raise DeviceError(text, code="interrupted") from None


def conduct(plant: Rig, address: str, order: Order, out: str) -> None:
    """Run an order with its progress on standard error; raises where the run left no log to identify."""
    from swingid.live.experiment import require_usable
    from swingid.live.interrupt import stopping
    from swingid.live.processes import conductor_of

    conductor = conductor_of(plant, address, say=output.say, show=LiveLine())
    with stopping(conductor.stop):
        try:
            done = conductor.run(order, Path(out))
            output.overwrite("", last=True)
            for note in done.notes:
                output.say(note)
            require_usable(done, out)
        except SwingidError:
            decided()  # a key that is still held does not change how it ended
            raise
    lost = f", {done.lost} samples lost" if done.lost else ""
    output.say(f"{done.end.sentence}: {done.end.zero}{lost}; wrote {out}")


def identified(out: str, plant: Rig, method: str, provenance: dict[str, object], report: str | None) -> Result:
    """The result of a journal, and its report."""
    from swingid.identification import identify
    from swingid.recording.recording import Recording

    log = Recording.load(out, plant)
    provenance |= {"rig": plant.name, "log_sha256": log.source.sha256, "rows": len(log)}
    compile_first(*kernels_of(method, log, plant))
    result = identify(log, plant, method)
    output.write_report(result, log, plant, report)
    return result


def _share(text: str) -> float:
    """A relative uncertainty such as "0.05%"; UsageError for what is none."""
    from swingid.errors import InputError
    from swingid.units import parse_quantity

    try:
        share = parse_quantity(text, "", "--until").value
    except InputError as error:
        raise UsageError(f'{error.message}; write for example "0.05%"', code=error.code) from None
    if not 0.0 < share < 1.0:
        raise UsageError(f'--until {text} is no share of the inertia; write for example "0.05%"', code="out-of-range")
    return share


class LiveLine:
    """Shows the progress: a line that overwrites itself on a terminal, else one per `EVERY` seconds of the run."""

    EVERY = 5.0

    def __init__(self) -> None:
        self._shown = -math.inf

    def __call__(self, progress: Progress) -> None:
        """Show it where it is time, or a swing has its estimate."""
        due = progress.time - self._shown >= (0.25 if output.on_terminal() else self.EVERY)
        if not due and not (progress.fresh and output.on_terminal()):
            return
        self._shown = progress.time
        if not output.overwrite(f"{progress.line():<110}", last=False) and progress.rows:
            output.say(progress.line())


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


def record(
    device: Annotated[
        str, typer.Option(metavar="DEV", help="csv:///dev/ttyACM0?baud=115200, or csv://FILE that a program writes.")
    ],
    out: Annotated[str, typer.Option(metavar="FILE.csv", help="Log to write.")],
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.001, help="End after this time.")] = None,
    idle: Annotated[
        float | None, typer.Option(metavar="S", min=0.001, help="End after so long without a byte.")
    ] = None,
    columns: Annotated[
        str | None, typer.Option(metavar="NAMES", help='Names of the columns, as "t,q1,q2,u", where none are printed.')
    ] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", min=1e-3, help="Lines per second, where no time is printed.")
    ] = None,
) -> None:
    """Record the columns that a device prints, until Ctrl-C; nothing is sent to it."""
    from swingid.live.devices.columns import open_columns
    from swingid.live.record import record as read

    if not out.lower().endswith(".csv"):
        raise UsageError(f"--out {out} must end in .csv", code="bad-target")
    if not device.lower().startswith("csv://"):
        text = f"--device {device} does not only print; record takes csv://PORT or csv://FILE, swingid run the others"
        raise UsageError(text, code="bad-address")
    names = [name.strip() for name in columns.split(",")] if columns else []
    if not all(names):
        raise UsageError(f"--columns {columns!r}: a name is empty", code="bad-columns")
    stream = open_columns(device)
    output.check_files({stream.path: "what is recorded"} if stream.path else {}, out=out)
    try:
        recorded = read(stream, out, seconds=duration, idle=idle, names=names, rate=rate, cut=not stream.path)
    finally:
        stream.close()
    bad = f", {recorded.bad} lines were no row" if recorded.bad else ""
    output.tell(f"wrote {out}: {recorded.rows} rows of {', '.join(recorded.columns)}{bad}; ended: {recorded.end}")
    if not recorded.named:
        output.say("nothing names the columns: give --columns, or name them in [log] of rig.toml")


def firmware(
    board: Annotated[str, typer.Argument(metavar="BOARD", help="nucleo: the reference board, Nucleo-F446RE.")],
    out: Annotated[
        str,
        typer.Option(metavar="FILE.bin", help="File on this computer; copy it onto the board's drive."),
    ],
) -> None:
    """Write the firmware of a board, which the package ships; no compiler is needed."""
    from swingid.live.firmware import image

    output.check_writable(out)
    content = image(board)
    write_whole(Path(out), content)
    output.tell(f"wrote {out}: {len(content)} bytes, which state firmware {zlib.crc32(content):08x}")
    output.tell("copy it onto the drive that the board is on USB (NODE_F446RE), and wait until its LED stands still")
