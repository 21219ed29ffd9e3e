"""A campaign's folder: the plan it belongs to, one Parquet file per block of trials, and all of them sorted.

campaign.json      what decides the results; another plan is refused
parts/             the data set: part-000000.parquet is block 0, and so on; whole or not there
results.parquet    all rows in the order of trials, written when the last block is there
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.errors import InputError
from swingid.study.campaign.plan import Plan, differing_key
from swingid.study.campaign.tables import RESERVED
from swingid.system import locked, write_whole

if TYPE_CHECKING:
    import pyarrow as pa

    from swingid.study.trials import Row

SCHEMA = "swingid.campaign/1"
MANIFEST, RESULTS, PARTS = "campaign.json", "results.parquet", "parts"

KINDS = {
    "int64": ("trial", "point", "repeat", "seed"),
    "string": ("method", "quantity", "status", "code", "message", "warnings"),
}
"""Types of the columns; all others hold float64."""


class Store:
    """The folder of one campaign. Raises InputError where it belongs to another plan or cannot be written."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        self.plan, self.folder = plan, folder
        self.parts = folder / PARTS
        manifest = folder / MANIFEST
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder} is a file; give a folder with --out", code="not-a-folder")
        if manifest.is_file():
            self._check_same(manifest)
        elif folder.exists() and any(folder.iterdir()):
            raise InputError(
                f"{folder} holds other files and no campaign; give an empty or a new folder with --out",
                code="not-a-campaign",
            )
        try:
            self.parts.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make {folder}: {error.strerror}", code="cannot-write") from None
        if not manifest.is_file():
            self._claim()

    def _claim(self) -> None:
        """Write whose folder this is."""
        content = {"schema": SCHEMA, **self.plan.identity(), **made_by()}
        write_whole(self.folder / MANIFEST, (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode())

    def _check_same(self, manifest: Path) -> None:
        decisive = {k: v for k, v in read_manifest(manifest).items() if k not in ("schema", *made_by())}
        key = differing_key(decisive, self.plan.identity())
        if key:
            raise InputError(
                f"{self.folder} holds results of another plan ({key} differs); give another folder with --out, or "
                "remove this one",
                code="other-plan",
            )

    def check_code(self) -> None:
        """Raise InputError where results that are there were made by other code than this."""
        if not self.done():
            self._claim()
        there = read_manifest(self.folder / MANIFEST)
        for key, value in made_by().items():
            if there.get(key) != value:
                raise InputError(
                    f"{self.folder} was begun by another version of swingid ({key} differs); go on with that, or give "
                    "another folder with --out",
                    code="other-version",
                )

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other processes from writing into the folder; InputError where one does. It ends with the process."""
        with ExitStack() as held:
            try:
                held.enter_context(locked(self.folder / ".lock", wait=False))
            except OSError:
                raise InputError(
                    f"another process runs the campaign in {self.folder}; wait for it", code="busy"
                ) from None
            yield

    def done(self) -> set[int]:
        """Numbers of the blocks that are there."""
        names = [re.fullmatch(r"part-(\d+)\.parquet", path.name) for path in self.parts.iterdir()]
        return {int(name[1]) for name in names if name}

    def write(self, block: int, rows: Sequence[Row]) -> None:
        """Write the rows of a block; the file appears whole or not at all."""
        import pyarrow as pa

        self._write(self._part(block), pa.Table.from_pylist(list(rows), schema=self._schema()))

    def finish(self) -> Path:
        """Write all rows, sorted by trial, to one file, whose bytes follow from the plan alone; returns its path."""
        import pyarrow as pa

        remedy = "remove it and start again, its trials are done anew"
        parts = [_read(self._part(block), remedy) for block in range(self.plan.blocks)]
        whole = pa.concat_tables(parts).combine_chunks()
        target = self.folder / RESULTS
        self._write(target, whole)
        for leftover in self.folder.rglob(".*.part"):
            leftover.unlink(missing_ok=True)
        return target

    def table(self) -> pa.Table:
        """The sorted results. Raises InputError where the campaign is not finished, or another version's."""
        path = self.folder / RESULTS
        if not path.is_file():
            raise InputError(f"{path} does not exist; run the campaign to its end", code="missing-file")
        table = _read(path, "remove it and start again, it is put together from the parts")
        missing = [name for name in self._schema().names if name not in table.column_names]
        if missing:
            raise InputError(
                f"{path} has no column {missing[0]}: another version of swingid wrote it; use that, or give another "
                "folder with --out",
                code="other-version",
            )
        return table

    def _part(self, block: int) -> Path:
        return self.parts / f"part-{block:06d}.parquet"

    def _schema(self) -> pa.Schema:
        """Columns: place of the trial, factors, answer."""
        import pyarrow as pa

        kinds = {name: kind for kind, names in KINDS.items() for name in names}
        factors: dict[str, Any] = {}
        for name in self.plan.tables.factors:
            labels = {type(point.labels[name]) for point in self.plan.points}
            factors[name] = pa.float64() if labels == {float} else pa.string()
        fields = [(name, pa.type_for_alias(kinds.get(name, "float64"))) for name in RESERVED]
        return pa.schema([*fields[:4], *factors.items(), *fields[4:]])

    def _write(self, target: Path, table: pa.Table) -> None:
        import pyarrow.parquet as pq

        buffer = io.BytesIO()
        pq.write_table(table, buffer, compression="zstd", row_group_size=1 << 16)
        write_whole(target, buffer.getvalue())


def _read(path: Path, remedy: str) -> pa.Table:
    """The rows of a Parquet file of ours."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.ParquetFile(io.BytesIO(path.read_bytes())).read()
    except (OSError, pa.ArrowException):
        raise InputError(f"{path} cannot be read; {remedy}", code="bad-part") from None


def read_manifest(path: Path) -> dict[str, Any]:
    """The content of campaign.json; InputError where it is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        content = None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path} is no campaign's; give another folder with --out", code="bad-json")
    return content


@cache
def made_by() -> dict[str, str]:
    """Version of swingid, and a hash of its code below the reports, for nobody changes a version with every edit."""
    import swingid

    package = Path(swingid.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] not in ("cli", "report"):
            digest.update(path.read_bytes())
    return {"swingid": swingid.__version__, "code": digest.hexdigest()[:16]}


def is_finished(folder: Path) -> bool:
    """Return whether a folder holds the results of a whole campaign."""
    return os.path.isfile(folder / RESULTS)
