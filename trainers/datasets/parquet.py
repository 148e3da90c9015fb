"""Tables in Parquet files of limited size, written incrementally."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

COMPRESSION = "snappy"


class Shards:
    """Writes a table to chunk-000/file-000.parquet and so on. The rows of one `write` go to the same file.

    Args:
        folder: the directory of the chunks.
        files: in a chunk.
        megabytes: size after which a new file is started.
        rows: how many are collected before they are written together.
    """

    def __init__(self, folder: Path, files: int, megabytes: float, rows: int = 1) -> None:
        self._folder, self._files, self._max_bytes, self._rows = folder, files, megabytes * 2**20, rows
        self._number = 0
        self._writer: Any = None
        self._pending: list[Any] = []

    @property
    def place(self) -> tuple[int, int]:
        """The numbers of the chunk and the file of the next rows."""
        return divmod(self._number, self._files)

    def write(self, columns: dict[str, Any]) -> tuple[int, int]:
        """Add rows, given by column; returns the numbers of their chunk and file."""
        import pyarrow

        place = self.place
        self._pending.append(pyarrow.table(columns))
        if sum(map(len, self._pending)) >= self._rows:
            self._flush()
        return place

    def _flush(self) -> None:
        import pyarrow
        from pyarrow import parquet

        if not self._pending:
            return
        table, self._pending = pyarrow.concat_tables(self._pending), []
        path = self._folder / "chunk-{:03d}/file-{:03d}.parquet".format(*self.place)
        if self._writer is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = parquet.ParquetWriter(path, table.schema, compression=COMPRESSION)
        self._writer.write_table(table)
        if path.stat().st_size >= self._max_bytes:
            self._start_next_file()

    def _start_next_file(self) -> None:
        self._writer.close()
        self._writer, self._number = None, self._number + 1

    def close(self) -> None:
        """Write the pending rows and close the last file, which is not readable before."""
        self._flush()
        if self._writer is not None:
            self._writer.close()


def as_column(values: NDArray) -> Any:
    """Values (T, n) as a column of lists of length n, or of plain values if n is 1."""
    import pyarrow

    flat = pyarrow.array(values.reshape(-1))
    return flat if values.shape[1] == 1 else pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])


def write_index(path: Path, words: list[str], column: str) -> None:
    """Write a table that pandas reads with the words as its index and their numbers as its only column."""
    import pyarrow
    from pyarrow import parquet

    index = "__index_level_0__"

    def column_metadata(name: str | None, field: str | None, kind: str, numpy: str) -> dict[str, Any]:
        return {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}

    metadata = {
        "index_columns": [index],
        "column_indexes": [column_metadata(None, None, "unicode", "object") | {"metadata": {"encoding": "UTF-8"}}],
        "columns": [
            column_metadata(column, column, "int64", "int64"),
            column_metadata(None, index, "unicode", "object"),
        ],
        "creator": {"library": "pyarrow", "version": pyarrow.__version__},
        "pandas_version": "2.0.0",
    }
    table = pyarrow.table({column: pyarrow.array(range(len(words)), pyarrow.int64()), index: words})
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(metadata)}), path)
