"""``swingid init``, ``inspect``, ``convert`` and ``datasets``: logs and rig files before identification."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.cli.options import Json, Report
from swingid.cli.progress import Progress
from swingid.errors import InputError, UsageError
from swingid.progress import shown

if TYPE_CHECKING:
    from swingid.recording.datasets import DataSet


TEMPLATE = Path(__file__).with_name("rig_template.toml")


def init(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder for the new rig.toml; made if need be.")],
    log: Annotated[
        str | None, typer.Option("--from", metavar="LOG", help="A log of the rig: its columns and units are guessed.")
    ] = None,
    sensor: Annotated[
        str | None, typer.Option(metavar="KIND", help="Kind of the encoders; asked for on a terminal, see the table.")
    ] = None,
) -> None:
    """Write a commented rig.toml into DIR, to be filled in with your rig's constants and columns.

    The kind of the encoders decides how far their readings may be off: AS5048A, AS5047P, AS5600, MT6701, AMT10x,
    optical, potentiometer, camera, gyroscope, ideal.
    """
    path = Path(folder) / "rig.toml"
    text = TEMPLATE.read_text(encoding="utf-8") if log is None else _text_for(log)
    text = _with_sensor(text, sensor or _asked())
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        if not path.parent.is_dir():
            raise output.cannot_write(path, f"{folder} is not a folder") from None
        raise InputError(
            f"{path} exists already; give another folder, or remove the file", code="file-exists"
        ) from None
    except OSError as error:
        raise output.cannot_write(path, error.strerror or str(error)) from None
    if log is None:
        output.tell(f"wrote {path}\nfill it in, then: swingid identify LOG --rig {quote(str(path))}")
    else:
        command = f"swingid inspect {quote(log)} --rig {quote(str(path))}"
        output.tell(f"wrote {path}\nfill it in and confirm its [log], then: {command}")


def _asked() -> str:
    """The kind of the encoders that a person at the terminal names, "" where there is none or none is named."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return ""
    from swingid.model.rig.encoder_kinds import table

    output.tell("\n".join(table()))
    return str(typer.prompt("Which encoder?", default="unknown"))


def _with_sensor(text: str, name: str) -> str:
    """The rig file with the kind of its encoders; UsageError for one that there is not."""
    if not name:
        return text
    from swingid.model.rig.encoder_kinds import NAMES, UNKNOWN, kind_of, table

    try:
        kind = kind_of(name)
    except KeyError:
        lines = "\n".join(table())
        raise UsageError(
            f"no kind of encoder {name[:40]!r}; there are {', '.join(NAMES)}\n{lines}", code="unknown-sensor"
        ) from None
    if kind is UNKNOWN:
        return text
    line = f'sensor = "{kind.name}"'.ljust(38) + f"# {kind.words}; {kind.source}"
    return re.sub(r"^# sensor = .*$", line, text, flags=re.MULTILINE)


def _text_for(log: str) -> str:
    """The rig file with the [log] guessed from the columns of a log; InputError for one without angle or rate."""
    from swingid.recording.formats import read_table
    from swingid.recording.inspect import describe, guess_roles, log_table
    from swingid.recording.inspect.rig_text import rig_text
    from swingid.recording.large import first_rows, is_large
    from swingid.recording.load import read_bytes

    read = first_rows(log) if is_large(log) else read_table(read_bytes(log), log)
    columns = {column.name: column for column in describe(read)}
    roles = guess_roles(list(columns.values()))
    if not roles.has_motion:
        names = ", ".join(repr(name[:40]) for name in list(columns)[:8])
        message = f"{log}: none of its columns ({names}) looks like the angle of a swing, its rate, or a mark on an arc"
        raise InputError(f"{message}; name it under [log] of a rig file by hand (swingid init DIR).", code="no-angle")
    table = log_table(roles)
    return rig_text(TEMPLATE.read_text(encoding="utf-8"), roles, columns, table, "my-rig", Path(log).name)


def inspect(
    log: Annotated[str, typer.Argument(metavar="LOG", help="A log in any format that swingid reads.")],
    rig: Annotated[
        str | None,
        typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name; without it the file alone."),
    ] = None,
    json: Json = None,
    report: Report = None,
    plot: Annotated[
        str | None, typer.Option(metavar="FILE", help='Write the plots (.png, .svg, .pdf); "-": one in the terminal.')
    ] = None,
) -> None:
    """Report what LOG holds: columns, clock, encoders, motion, and with a rig signs, latencies and encoder errors.

    The verdict is whether it is ready for identify. Exit code 0 whenever the file could be read, whatever the verdict.
    """
    inputs = {log: "the log"} | ({rig: "the rig file"} if rig is not None else {})
    output.check_files(inputs, plot=None if plot == "-" else plot, json=json, report=report)
    from swingid.model.rig import Rig
    from swingid.model.rig.inside import has_rig
    from swingid.study.inspect import inspect_log

    if rig is None and has_rig(log):
        rig = log
    plant = None if rig is None else Rig.load(rig)
    inspection = inspect_log(log, plant)
    if report is not None:
        from swingid.report.html import write_inspection

        write_inspection(inspection, report)
    output.hand_over(inspection, json, report)
    if plot == "-":
        from swingid.report.terminal import plot_of

        output.tell(f"\n{plot_of(inspection)}", to_error=json == "-")
    elif plot is not None:
        from swingid.report.html import write_plot

        output.say(f"wrote {write_plot(inspection, plot)}")


def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="Log: any format that swingid reads.")],
    target: Annotated[
        str, typer.Argument(metavar="OUT", help="File to write: .parquet, .csv, .mat, .h5, .mcap or .jsonl.")
    ],
) -> None:
    """Write the table in IN to OUT in the format of its ending; numbers bit for bit, nothing resampled or repaired."""
    from swingid.recording.convert import convert as run

    output.check_targets({"OUT": target}, {source: "IN"})
    output.check_target(Path(target))
    with shown(Progress("million rows", 1e6)):
        rows, columns, dropped = run(source, target)
    line = f"wrote {target}: {rows} rows of {', '.join(columns)}"
    output.tell(line + (f"; left out, no numbers: {', '.join(dropped)}" if dropped else ""))


def datasets(
    words: Annotated[
        list[str] | None, typer.Argument(metavar="[get NAME]", help="Get the data set NAME; without it, list all.")
    ] = None,
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="DIR", help="A local copy; default $SWINGID_DATA, else they are downloaded."),
    ] = None,
    to: Annotated[
        str, typer.Option(metavar="DIR", help="Where the folder NAME is made; default: the current folder.")
    ] = ".",
    json: Json = None,
) -> None:
    """List the public logs in the catalogue, with citation, licence, address and checksum, or get one of them."""
    from swingid.recording.datasets import CATALOGUE, find, get

    if not words:
        if source is not None:
            raise UsageError("--from belongs to datasets get NAME; give the name too", code="no-name")
        _show(CATALOGUE, json)
        return
    if words[0] != "get" or len(words) != 2:
        raise UsageError(f"datasets {' '.join(words)}: write datasets, or datasets get NAME", code="bad-words")
    dataset = find(words[1])
    if json is not None:
        _show((dataset,), json)
    folder = Path(to) / dataset.name
    for path, origin in get(dataset, folder, None if source is None else Path(source)):
        if origin == "copy-only":
            output.say(f"{path.name} has no address of its own, it exists as a copy only; left out")
        else:
            output.tell(f"{path} ({'already there' if origin == 'there' else origin})", to_error=json == "-")
    output.say(f"{dataset.licence}; cite {dataset.citation}; read it with examples/rigs/{dataset.rig}")


def _show(sets: tuple[DataSet, ...], json: str | None) -> None:
    if json is not None:
        from swingid.study.output import json_text

        output.write_json(json_text({"schema": "swingid.datasets/1", "datasets": sets}), json)
    else:
        output.tell("\n\n".join(_entry(dataset) for dataset in sets))


def _entry(dataset: DataSet) -> str:
    """Some lines on one data set."""
    rows = {
        "cite": dataset.citation,
        "licence": dataset.licence,
        "from": f"https://github.com/{dataset.repository}",
        "rig": f"examples/rigs/{dataset.rig}",
    }
    lines = [f"{dataset.name}: {dataset.title}", *(f"    {key:8s}{value}" for key, value in rows.items())]
    for file in dataset.files:
        lines.append(f"    {file.name}: {file.about}")
        lines += [f"        sha256 {file.sha256}", f"        {file.address or 'a copy only, no address'}"]
    return "\n".join(lines)
