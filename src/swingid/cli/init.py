"""``swingid init``: a rig file to fill in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TEMPLATE = Path(__file__).with_name("rig_template.toml")


def init(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder for the new rig.toml; made if need be.")],
) -> None:
    """Write a commented rig.toml into DIR, to be filled in with your rig's constants and columns."""
    from swingid.cli.output import cannot_write, tell
    from swingid.errors import InputError

    path = Path(folder) / "rig.toml"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(TEMPLATE.read_text(encoding="utf-8"))
    except FileExistsError:
        if not path.parent.is_dir():
            raise cannot_write(path, f"{folder} is not a folder") from None
        raise InputError(
            f"{path} exists already; give another folder, or remove the file", code="file-exists"
        ) from None
    except OSError as error:
        raise cannot_write(path, error.strerror or str(error)) from None
    tell(f"wrote {path}\nfill it in, then: swingid identify LOG --rig {path}")
