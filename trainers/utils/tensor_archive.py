"""Reading of torch.save files: nothing in them is executed, and sizes are checked before memory is allocated.

`torch.load(weights_only=True)` calls a list of known functions only, but some of these allocate as much as the file
asks for (`bytearray`), and it inflates compressed archives. So the archive and the opcodes of its pickle are checked
first, and the tensors afterwards: a file costs as much as it has bytes.
"""

from __future__ import annotations

import pickletools
import zipfile
from pathlib import Path
from typing import Any

import torch

from core.safe_files import MAX_DEPTH, FileError, check_size

MAX_BYTES = 8 * 2**30  # of a file
MAX_PICKLE_BYTES = 2**20  # of the structure of a file, without its tensors
MAX_ENTRIES = 20_000  # files of an archive
MAX_VALUES = 500_000  # keys, values and containers, counted each time that they occur
SLACK = 2**20  # bytes; small tensors may share a storage
STORAGES = ("Double", "Float", "Half", "BFloat16", "Long", "Int", "Short", "Char", "Byte", "Bool")
GLOBALS = {  # what the pickle of a payload of plain values and dense tensors names
    "collections OrderedDict",
    "torch Size",  # in the state of TorchRL's losses
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
    *(f"torch {name}Storage" for name in STORAGES),
}
REFUSED_OPCODES = {"STACK_GLOBAL", "INST", "OBJ", "NEWOBJ", "NEWOBJ_EX", "EXT1", "EXT2", "EXT4", "PERSID", "BYTEARRAY8"}


def read_tensors(path: Path) -> Any:
    """Return the value of a torch.save file, with its tensors on the CPU.

    Raises:
        FileError: the file is no such archive, is damaged, names a function, or describes more than it holds.
        Exception: of torch, for a damaged pickle.
    """
    size = check_size(path, MAX_BYTES)
    with zipfile.ZipFile(path) as archive:
        _check_archive(archive, size)
    value = torch.load(path, map_location="cpu", weights_only=True)
    check_tensors(value, 2 * size + SLACK)
    return value


def _check_archive(archive: zipfile.ZipFile, size: int) -> None:
    entries = archive.infolist()
    if len(entries) > MAX_ENTRIES:
        raise FileError(f"holds {len(entries):,} files; at most {MAX_ENTRIES:,} are accepted")
    if any(entry.compress_type != zipfile.ZIP_STORED or entry.compress_size != entry.file_size for entry in entries):
        raise FileError("is compressed, and torch.save does not compress")
    if sum(entry.file_size for entry in entries) > size or len(set(archive.namelist())) != len(entries):
        raise FileError("describes more than it holds")
    damaged = archive.testzip()  # torch ignores the checksums: a flipped bit would load as a weight
    if damaged is not None:
        raise FileError(f"is damaged (in {damaged})")
    for entry in entries:
        if entry.filename.endswith(".pkl"):
            if entry.file_size > MAX_PICKLE_BYTES:
                raise FileError(
                    f"has a structure of {entry.file_size:,} bytes; at most {MAX_PICKLE_BYTES:,} are accepted"
                )
            _check_pickle(archive.read(entry))


def _check_pickle(data: bytes) -> None:
    for opcode, argument, _ in pickletools.genops(data):
        if opcode.name in REFUSED_OPCODES or (opcode.name == "GLOBAL" and argument not in GLOBALS):
            raise FileError(f"names {argument or opcode.name}; only tensors and plain values are accepted")


def check_tensors(value: Any, max_bytes: int) -> None:
    """Check the tensors in nested dicts, lists and tuples: dense, at most `max_bytes` together. Raises FileError."""
    values, used, stack = MAX_VALUES, 0, [(value, 0)]
    while stack:
        item, depth = stack.pop()
        inner = list(item.values()) if isinstance(item, dict) else item if isinstance(item, list | tuple | set) else ()
        values -= 1 + len(inner)
        if values < 0 or depth > MAX_DEPTH:
            raise FileError("describes more than it holds")
        stack += [(each, depth + 1) for each in inner]
        if isinstance(item, torch.Tensor):
            if item.layout != torch.strided or item.device.type != "cpu":
                raise FileError("holds a tensor that is not dense")
            used += item.numel() * item.element_size()
            if used > max_bytes:
                raise FileError("describes tensors that are larger than the file")
