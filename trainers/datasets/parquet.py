"""Tables in Parquet files, written as they come, in as many files as it takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

COMPRESSION = "snappy"


class Shards:
    """chunk-000/file-000.parquet and so on in `folder`, none of which grows much beyond so many megabytes.

    files: in a chunk. rows: that are collected before they are written together; each `write` is whole in one file.
    """

    def __init__(self, folder: Path, files: int, megabytes: float, rows: int = 1) -> None:
        self._folder, self._files, self._most, self._rows = folder, files, megabytes * 2**20, rows
        self._number = 0
        self._writer: Any = None
        self._waiting: list[Any] = []

    @property
    def place(self) -> tuple[int, int]:
        """The numbers of the chunk and the file that the next rows go to."""
        return divmod(self._number, self._files)

    def write(self, columns: dict[str, Any]) -> tuple[int, int]:
        """Add rows, by column; the numbers of the chunk and the file that they go to."""
        import pyarrow

        place = self.place
        self._waiting.append(pyarrow.table(columns))
        if sum(map(len, self._waiting)) >= self._rows:
            self._flush()
        return place

    def _flush(self) -> None:
        import pyarrow
        from pyarrow import parquet

        if not self._waiting:
            return
        table, self._waiting = pyarrow.concat_tables(self._waiting), []
        path = self._folder / "chunk-{:03d}/file-{:03d}.parquet".format(*self.place)
        if self._writer is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = parquet.ParquetWriter(path, table.schema, compression=COMPRESSION)
        self._writer.write_table(table)
        if path.stat().st_size >= self._most:
            self._next()

    def _next(self) -> None:
        self._writer.close()
        self._writer, self._number = None, self._number + 1

    def close(self) -> None:
        """Write what waits. No file is readable before."""
        self._flush()
        if self._writer is not None:
            self._writer.close()


def as_column(values: NDArray) -> Any:
    """(T, n) as a column of lists of n, or of plain values where n is 1."""
    import pyarrow

    flat = pyarrow.array(values.reshape(-1))
    return flat if values.shape[1] == 1 else pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])


def write_index(path: Path, words: list[str], column: str) -> None:
    """A table that pandas reads with the words as its index and their numbers as its one column."""
    import pyarrow
    from pyarrow import parquet

    index = "__index_level_0__"

    def described(name: str | None, field: str | None, kind: str, numpy: str) -> dict[str, Any]:
        return {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}

    told = {
        "index_columns": [index],
        "column_indexes": [described(None, None, "unicode", "object") | {"metadata": {"encoding": "UTF-8"}}],
        "columns": [described(column, column, "int64", "int64"), described(None, index, "unicode", "object")],
        "creator": {"library": "pyarrow", "version": pyarrow.__version__},
        "pandas_version": "2.0.0",
    }
    table = pyarrow.table({column: pyarrow.array(range(len(words)), pyarrow.int64()), index: words})
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(told)}), path)
