"""``swingid init``: a rig file to fill in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TEMPLATE = Path(__file__).with_name("rig_template.toml")


def init(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder for the new rig.toml; made if need be.")],
    log: Annotated[
        str | None, typer.Option("--from", metavar="LOG", help="A log of the rig: its columns and units are guessed.")
    ] = None,
) -> None:
    """Write a commented rig.toml into DIR, to be filled in with your rig's constants and columns."""
    from swingid.cli.output import cannot_write, tell
    from swingid.errors import InputError

    path = Path(folder) / "rig.toml"
    text = TEMPLATE.read_text(encoding="utf-8") if log is None else _text_for(log)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        if not path.parent.is_dir():
            raise cannot_write(path, f"{folder} is not a folder") from None
        raise InputError(
            f"{path} exists already; give another folder, or remove the file", code="file-exists"
        ) from None
    except OSError as error:
        raise cannot_write(path, error.strerror or str(error)) from None
    if log is None:
        tell(f"wrote {path}\nfill it in, then: swingid identify LOG --rig {path}")
    else:
        tell(f"wrote {path}\nfill it in and confirm its [log], then: swingid inspect {log} --rig {path}")


def _text_for(log: str) -> str:
    """The rig file with the [log] that the columns of a log speak for; InputError for one that has no angle."""
    from swingid.errors import InputError
    from swingid.recording.formats import read_table
    from swingid.recording.inspect import describe, guess_roles, log_table
    from swingid.recording.inspect.rig_text import rig_text
    from swingid.recording.large import first_rows, is_large
    from swingid.recording.load import read_bytes

    found = first_rows(log) if is_large(log) else read_table(read_bytes(log), log)
    columns = {column.name: column for column in describe(found)}
    roles = guess_roles(list(columns.values()))
    if "angle" not in roles.found:
        names = ", ".join(repr(name[:40]) for name in list(columns)[:8])
        raise InputError(f"{log}: none of its columns ({names}) looks like the angle of a swing", code="no-angle")
    table = log_table(roles)
    return rig_text(TEMPLATE.read_text(encoding="utf-8"), roles, columns, table, "my-rig", Path(log).name)
