"""Parquet: columns as they are, swingid's metadata under its key in the schema."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.recording.formats.arrow import table_from_arrow
from swingid.recording.formats.table import METADATA_KEY, Table, most_unpacked

if TYPE_CHECKING:
    from collections.abc import Mapping

    from swingid.numerics.arrays import Array

ENDINGS = (".parquet", ".pq")
MAGIC = b"PAR1"


def read(content: bytes, name: str) -> Table:
    """The table in the bytes of a Parquet file; InputError naming the file when they are none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(pa.BufferReader(content))
        if 8 * file.metadata.num_rows * file.metadata.num_columns > most_unpacked(len(content)):
            raise ValueError("more numbers than the file can hold")
        table = file.read()
        raw = (table.schema.metadata or {}).get(METADATA_KEY.encode(), b"{}")
        return table_from_arrow(table, name, raw.decode("utf-8", "replace"))
    except (pa.ArrowException, OSError, ValueError, TypeError):
        message = f"{name} is not a whole Parquet file: damaged, or cut off while it was written; export it again."
        raise InputError(message, code="not-a-table") from None


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of a Parquet file with these columns, bit for bit, and this metadata (JSON values)."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table(dict(columns)).replace_schema_metadata({METADATA_KEY: json.dumps(metadata)})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return bytes(sink.getvalue())
