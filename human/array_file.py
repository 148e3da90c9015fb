"""Reading of .npz files: sizes are checked before an array is allocated, and nothing is unpickled."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from conf.safe_files import FileError, check_size

MAX_BYTES = 8 * 2**20  # of a file
MAX_ARRAY_BYTES = 32 * 2**20  # of all arrays of a file
MAX_ARRAYS = 200


def read_arrays(path: Path) -> dict[str, Any]:
    """Returns the arrays of a .npz file by name.

    Raises:
        FileError: the file is too large, or an array is of Python objects or has other bytes than its shape needs.
        Exception: of numpy and zipfile, for a damaged file.
    """
    check_size(path, MAX_BYTES)
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if len(entries) > MAX_ARRAYS or sum(entry.file_size for entry in entries) > MAX_ARRAY_BYTES:
            raise FileError(f"describes more than {MAX_ARRAYS} arrays or {MAX_ARRAY_BYTES / 2**20:.0f} MiB")
        for entry in entries:
            _check_shape(archive, entry)
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _check_shape(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> None:
    with archive.open(entry) as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
    if dtype.hasobject or min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize > entry.file_size:
        raise FileError(f"has an array {entry.filename} that does not fit its shape {shape} of {dtype}")
