"""``swingid datasets``: public logs of real rigs, and how to get them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.errors import UsageError

if TYPE_CHECKING:
    from swingid.recording.datasets import DataSet


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
    json: Annotated[
        str | None, typer.Option(metavar="FILE", help='Write the list as JSON; "-": standard output.')
    ] = None,
) -> None:
    """List the public logs that swingid knows, with citation, licence, address and checksum, or get one of them."""
    from swingid.recording.datasets import CATALOGUE, find, get

    if not words:
        if source is not None:
            raise UsageError("--from belongs to datasets get NAME; give the name too", code="no-name")
        _show(CATALOGUE, json)
        return
    if words[0] != "get" or len(words) != 2:
        raise UsageError(f"datasets {' '.join(words)}: write datasets, or datasets get NAME", code="bad-words")
    from swingid.cli.output import say, tell

    dataset = find(words[1])
    if json is not None:
        _show((dataset,), json)
    folder = Path(to) / dataset.name
    for path, origin in get(dataset, folder, None if source is None else Path(source)):
        if origin == "copy-only":
            say(f"{path.name} has no address of its own, it exists as a copy only; left out")
        else:
            tell(f"{path} ({'already there' if origin == 'there' else origin})", to_error=json == "-")
    say(f"{dataset.licence}; cite {dataset.citation}; read it with examples/rigs/{dataset.rig}")


def _show(sets: tuple[DataSet, ...], json: str | None) -> None:
    from swingid.cli.output import tell, write_json

    if json is not None:
        from dataclasses import asdict
        from json import dumps

        content = {"schema": "swingid.datasets/1", "datasets": [asdict(one) for one in sets]}
        write_json(dumps(content, indent=2, ensure_ascii=False) + "\n", json)
    else:
        tell("\n\n".join(_entry(one) for one in sets))


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
