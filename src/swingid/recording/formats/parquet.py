"""Parquet: columns as they are, whole or in pieces; swingid's metadata under its key in the schema."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.recording.formats.arrow import parse_metadata, table_from_arrow
from swingid.recording.formats.table import METADATA_KEY, PartFile, Table, header_of, most_unpacked

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa
    import pyarrow.parquet as pq

    from swingid.numerics.arrays import Array


ENDINGS = (".parquet", ".pq")
MAGIC = b"PAR1"


def read(content: bytes, name: str) -> Table:
    """The table in the bytes of a Parquet file; InputError naming the file when they are none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with _damaged(name):
        file = pq.ParquetFile(pa.BufferReader(content))
        if 8 * file.metadata.num_rows * file.metadata.num_columns > most_unpacked(len(content)):
            raise ValueError("more numbers than the file can hold")
        table = file.read(use_threads=False)  # as `csv.read_rows`
        return table_from_arrow(table, name, _metadata(table.schema))


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of a Parquet file with these columns, bit for bit, and this metadata (JSON values)."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table(dict(columns)).replace_schema_metadata({METADATA_KEY: json.dumps(metadata)})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return bytes(sink.getvalue())


BUFFER, GROUP = 1 << 22, 1 << 28
"""Bytes of a column that are read at once where a row group has more bytes than `GROUP`, so that a file of one row
group needs no more memory than others. Small groups are read whole: then a damaged size of a page allocates nothing."""


class File(PartFile):
    """A Parquet file."""

    @classmethod
    def open(cls, path: str) -> File:
        """Look at the footer; InputError where there is none."""
        with _damaged(path):
            file = _opened(path)
            names = [str(name).strip() for name in file.schema_arrow.names]
            header = header_of(names, parse_metadata(_metadata(file.schema_arrow)))
            return cls(path, int(file.metadata.num_rows), header)

    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in pieces of `rows` rows; InputError where the file is damaged."""
        import pyarrow as pa

        with _damaged(self.path):
            file = _opened(self.path)
            wanted = [name for name in file.schema_arrow.names if str(name).strip() in columns]
            for batch in file.iter_batches(batch_size=rows, columns=wanted):
                if batch.num_rows:
                    yield table_from_arrow(pa.Table.from_batches([batch]), self.path, "{}", shared=True)


def _metadata(schema: pa.Schema) -> str:
    """JSON text of swingid's metadata."""
    return str((schema.metadata or {}).get(METADATA_KEY.encode(), b"{}").decode("utf-8", "replace"))


def _opened(path: str) -> pq.ParquetFile:
    import pyarrow.parquet as pq

    file = pq.ParquetFile(path, pre_buffer=False)
    groups = file.metadata
    if max((groups.row_group(k).total_byte_size for k in range(groups.num_row_groups)), default=0) <= GROUP:
        return file
    file.close()
    return pq.ParquetFile(path, buffer_size=BUFFER, pre_buffer=False)


@contextmanager
def _damaged(path: str) -> Iterator[None]:
    """What a damaged file raises, in one sentence."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError, ValueError, TypeError):
        message = f"{path} is not a whole Parquet file: damaged, or cut off while it was written; export it again."
        raise InputError(message, code="not-a-table") from None
