"""``swingid commission``: what a device's counts and voltage mean, into rig.toml."""

from __future__ import annotations

import json as jsons
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.cli.failure import decided
from swingid.cli.options import Json, RigFile
from swingid.errors import DeviceError, SwingidError, UsageError
from swingid.system import write_whole

if TYPE_CHECKING:
    from swingid.live.session import Session
    from swingid.model.rig import Rig


def commission(
    rig: RigFile,
    device: Annotated[
        str | None,
        typer.Option(metavar="DEV", help="Address such as serial:///dev/ttyACM0; default: device.address of the rig."),
    ] = None,
    out: Annotated[
        str | None, typer.Option(metavar="NEW.toml", help="Write there; default: the rig file itself, comments kept.")
    ] = None,
    clear: Annotated[
        bool, typer.Option("--clear", help="Clear a fault of an earlier run, after a look at the rig.")
    ] = False,
    encoders_only: Annotated[
        bool, typer.Option("--encoders-only", help="First of all, motor off: turn body and wheel by hand for 20 s.")
    ] = False,
    json: Json = None,
) -> None:
    """Find zero, noise, signs, delay and counts of a live rig, hanging still and by tiny pulses; write its rig.toml."""
    from swingid.live.commission import commission as found_on
    from swingid.live.devices.table import open_device
    from swingid.live.session import Session
    from swingid.model.rig import BUILTIN_RIGS, Rig

    if out is not None and not out.lower().endswith(".toml"):
        raise UsageError(f"--out {out} must end in .toml, as every rig file", code="bad-target")
    target = out if out is not None or rig in BUILTIN_RIGS else rig
    output.check_targets({"--json": json}, {rig: "the rig file"})
    output.check_writable(target, json)
    stated = Rig.load(rig)
    address = device or stated.device.address
    if address is None:
        text = f"{rig} states no device.address; give --device, such as serial:///dev/ttyACM0 or twin://{rig}"
        raise UsageError(text, code="no-device")
    with Session(open_device(address)) as session, stopped_at_once(session, rig):
        if clear:
            session.connect()
            session.clear()
        if encoders_only:
            from swingid.live.firmware_encoders import by_hand

            for encoder in by_hand(session, progress=output.tell):
                output.tell(f"{encoder.name}: seen over {encoder.range:.0f} deg, every sample with a reading")
            return
        commissioning = found_on(session, stated, progress=lambda line: output.tell(line, to_error=True))
    values = commissioning.values(stated, address)
    if json is not None:
        document = {**asdict(commissioning), "values": values, "rig": rig, "device": address}
        output.write_json(jsons.dumps(document, indent=2) + "\n", json)
    for line in commissioning.lines() if json != "-" else ():
        output.tell(line)
    _write(stated, values, target, quiet=json == "-")


@contextmanager
def stopped_at_once(session: Session, rig: str) -> Iterator[None]:
    """Ctrl-C and `swingid stop` are 0 V at the next turn of the link and a DeviceError: a pulse has nothing to fade."""
    from swingid.live.interrupt import stopping
    from swingid.live.registry import announced

    asked: list[str] = []

    def look() -> None:
        request = run.asked()
        why = asked[0] if asked else "" if request is None else request[1]
        if why:
            run.ended = f"{why}: 0 V at once; {rig} stays as it was"
            raise DeviceError(run.ended, code="stopped")

    device = session.link.stream.address
    with announced(device, "", duration=0.0, fade=0.0) as run, stopping(lambda _, why: asked.append(why)):
        session.link.each_turn = look
        try:
            yield
            look()
            run.ended = "the commissioning has ended"
        except SwingidError as error:
            decided()
            run.ended = error.message
            raise


def _write(rig: Rig, values: dict[str, object], target: str | None, *, quiet: bool) -> None:
    """Write the rig file with what was found, where there is a target, and say so."""
    from swingid.model.rig import Rig as Rigs
    from swingid.model.rig.edit import edited

    text, kept = edited(rig.text, values)
    Rigs.from_text(text, rig.source, default_name=rig.name)
    if target is None:
        output.tell("a built-in rig stays as it is; --out NEW.toml writes its file with these values", to_error=quiet)
        return
    write_whole(Path(target), text.encode())
    lost = "" if kept else "; its comments were lost because of its layout"
    output.tell(f"wrote {target}{lost}", to_error=quiet)
