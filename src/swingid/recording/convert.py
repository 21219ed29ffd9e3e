"""From one file format to another: every column as it stands, with the metadata that swingid wrote."""

from __future__ import annotations

import json
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.progress import advanced
from swingid.recording.formats import parquet, read_table, writer_for
from swingid.recording.formats.table import METADATA_KEY, Table
from swingid.recording.large.log import PIECE, is_large, opened
from swingid.recording.load import read_bytes
from swingid.system import write_whole

if TYPE_CHECKING:
    from swingid.recording.formats.table import PartFile


def convert(source: str | Path, target: str | Path) -> tuple[int, list[str], list[str]]:
    """Write the table in the file `source` to the file `target`; the endings give the formats.

    Numbers are kept bit for bit, units of the header as "name [unit]". Returns the number of rows, the columns written,
    and those left out for they hold no numbers. Raises InputError where a file cannot be read or written, or its
    columns differ in length, which no table holds.
    """
    writer = writer_for(Path(target))
    if is_large(source):
        return _convert_large(opened(source), Path(target))
    table = read_table(read_bytes(source), str(source))
    columns, dropped = {}, []
    for name in table.columns:
        values, _ = table.numbers(name)
        if np.isnan(values).all():
            dropped.append(name)
            continue
        unit = table.units.get(name)
        columns[f"{name} [{unit}]" if unit else name] = values
    lengths = {len(values) for values in columns.values()}
    if not columns:
        raise InputError(f"{source} has no column of numbers to convert.", code="no-numbers")
    if len(lengths) > 1:
        message = f"{source} holds columns of {', '.join(map(str, sorted(lengths)))} values, which is no table"
        raise InputError(f"{message}; resample them where they were made.", code="unequal-length")
    write_whole(Path(target), writer.write(columns, table.metadata))
    return lengths.pop(), list(columns), dropped


def _convert_large(file: PartFile, target: Path) -> tuple[int, list[str], list[str]]:
    """Convert a large log into Parquet, in bounded memory.

    A column without a number in its first rows is left out.

    Raises InputError where the target is not Parquet, or a file cannot be read or written.
    """
    if target.suffix.lower() not in parquet.ENDINGS:
        message = (
            f"{file.path} is a log of more than a million rows, which only Parquet holds well; give a name ending in"
        )
        raise InputError(f"{message} .parquet in the place of {target}.", code="too-large")
    import pyarrow as pa
    import pyarrow.parquet as pq

    pieces, units = file.pieces(PIECE, file.together()), file.header().units
    first = next(pieces, Table({}))
    dropped = [name for name in first.columns if np.isnan(first.numbers(name)[0]).all()]
    names = {
        name: f"{name} [{units[name]}]" if name in units else name for name in first.columns if name not in dropped
    }
    if not names:
        raise InputError(f"{file.path} has no column of numbers to convert.", code="no-numbers")
    schema = pa.schema([(named, pa.float64()) for named in names.values()])
    schema = schema.with_metadata({METADATA_KEY: json.dumps(file.header().metadata)})
    partial, rows = target.with_name(f".{target.name}.part"), 0
    try:
        with pq.ParquetWriter(partial, schema, compression="zstd") as writer:
            for table in chain([first], pieces):
                columns = [table.numbers(name)[0] for name in names]
                writer.write_table(pa.table(dict(zip(names.values(), columns, strict=True)), schema=schema))
                rows += len(columns[0])
                advanced(min(rows, file.rows), file.rows)
        advanced(file.rows, file.rows)
        partial.replace(target)
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror or error}", code="cannot-write") from None
    finally:
        partial.unlink(missing_ok=True)
    return rows, list(names.values()), dropped
