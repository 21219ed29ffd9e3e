"""Public logs of real rigs, no part of swingid: who made them, their licence, address and checksums; how to get them.

The catalogue is `datasets.toml` beside this file; a new data set is one entry there and a rig file in `examples/rigs/`.
Files come from a local copy where there is one, else from their address; checksums are verified.
"""

from __future__ import annotations

import difflib
import os
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from swingid.errors import InputError, UsageError
from swingid.recording.formats.isolated import require
from swingid.system import sha256_of, write_whole

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True, slots=True)
class DataFile:
    """One file: its name here, its SHA-256, and its upstream address, None for one that exists as a copy only."""

    name: str
    sha256: str
    address: str | None
    about: str


@dataclass(frozen=True, slots=True)
class DataSet:
    """Logs of one rig. `rig` is the rig file that reads them, below `examples/rigs/`."""

    name: str
    title: str
    citation: str
    licence: str
    repository: str
    rig: str
    files: tuple[DataFile, ...]


def _catalogue() -> tuple[DataSet, ...]:
    entries = tomllib.loads(Path(__file__).with_name("datasets.toml").read_text(encoding="utf-8"))["dataset"]
    none = {"address": None}
    return tuple(DataSet(**entry | {"files": tuple(DataFile(**none | f) for f in entry["files"])}) for entry in entries)


CATALOGUE = _catalogue()


def find(name: str) -> DataSet:
    """The data set of that name; UsageError that names the nearest where there is none."""
    names = [dataset.name for dataset in CATALOGUE]
    wanted = name.lower().replace("-", "_")
    if wanted in names:
        return CATALOGUE[names.index(wanted)]
    near = difflib.get_close_matches(wanted, names, n=1)
    hint = f"the nearest is {near[0]}" if near else f"there are {', '.join(names)}"
    raise UsageError(f"no data set is called {name!r}; {hint}.", code="unknown-dataset")


TIMEOUT = 30.0  # s, for the address to answer

Origin = Literal["there", "copied", "downloaded", "copy-only"]


def get(dataset: DataSet, folder: Path, source: Path | None = None) -> Iterator[tuple[Path, Origin]]:
    """Put the files of a data set into `folder`; yields each path and how it came there, as it is done.

    source: a local copy, with the files in it or in a folder of the data set's name; default $SWINGID_DATA. What a
    `source` that was given lacks is not downloaded. "copy-only": a file without an address that no copy holds; it is
    left out. Raises InputError for a file with another checksum than the catalogue's, where nothing can be
    downloaded, and where the folder cannot be written.
    """
    stated = os.environ.get("SWINGID_DATA")
    place = source if source is not None else Path(stated) if stated else None
    if source is not None and not source.is_dir():
        raise InputError(f"{source} is not a folder; give the folder that holds the copy.", code="missing-folder")
    for file in dataset.files:
        target = folder / file.name
        if target.exists():
            _verify(target, file, "remove it and get the data set again")
            yield target, "there"
            continue
        copies = [] if place is None else [place / dataset.name / file.name, place / file.name]
        copy = next((path for path in copies if path.is_file()), None)
        if copy is not None:
            _verify(copy, file, "use a copy of the original file")
            _put(copy, target)
            yield target, "copied"
        elif source is not None:
            message = f"{source} holds no {file.name}, neither itself nor in a folder {dataset.name}"
            raise InputError(f"{message}; leave --from out to download it.", code="missing-file")
        elif file.address is None:
            yield target, "copy-only"
        else:
            with tempfile.TemporaryDirectory() as scratch:
                _put(_download(file, file.address, Path(scratch)), target)
            yield target, "downloaded"


def _verify(path: Path, file: DataFile, advice: str) -> None:
    """Raise InputError unless the file is the one of the catalogue, byte for byte."""
    digest = sha256_of(path)
    if digest != file.sha256:
        message = f"{path} is not the published file (SHA-256 {digest[:12]}… instead of {file.sha256[:12]}…)"
        raise InputError(f"{message}; {advice}.", code="wrong-checksum")


def _put(origin: Path, target: Path) -> None:
    """Copy a file; it appears whole or not at all."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        content = origin.read_bytes()
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror}.", code="cannot-write") from None
    write_whole(target, content)


def _download(file: DataFile, address: str, scratch: Path) -> Path:
    """The file, downloaded into `scratch` and verified; InputError in one sentence where that fails."""
    pooch = require("pooch", "pooch", file.name, "to be downloaded", extra="datasets")
    pooch.get_logger().setLevel("ERROR")  # the command reports it
    try:
        fetched = pooch.retrieve(
            address,
            known_hash=f"sha256:{file.sha256}",
            fname=file.name,
            path=scratch,
            downloader=pooch.HTTPDownloader(timeout=TIMEOUT),
        )
    except ValueError:
        message = f"what {address} gives is not the published file (its SHA-256 is another)"
        raise InputError(f"{message}; get it elsewhere and use --from DIR.", code="wrong-checksum") from None
    except OSError as error:  # requests' own exceptions are OSErrors, too
        answer = getattr(error, "response", None)
        if answer is not None:
            message = f"{address} answers {answer.status_code}; get {file.name} elsewhere"
            raise InputError(f"{message} and use --from DIR.", code="download-failed") from None
        message = f"no network: {address.split('/')[2]} cannot be reached for {file.name}; try again"
        raise InputError(f"{message}, or give a local copy with --from DIR.", code="no-network") from None
    return Path(fetched)
