"""From one file format to another: every column as it stands, with the metadata that swingid wrote."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import read_table, writer_for
from swingid.recording.large import is_large
from swingid.recording.large.convert import convert_large
from swingid.recording.load import read_bytes
from swingid.recording.save import write_whole


def convert(source: str | Path, target: str | Path) -> tuple[int, list[str], list[str]]:
    """Write the table in the file `source` to the file `target`; the endings tell the formats.

    Numbers are kept bit for bit, units of the header as "name [unit]". Returns the number of rows, the columns written,
    and those left out for they hold no numbers. Raises InputError where a file cannot be read or written, or its
    columns differ in length, which no table holds.
    """
    writer = writer_for(Path(target))
    if is_large(source):
        return convert_large(source, Path(target))
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
