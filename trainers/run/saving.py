"""Writing of a run's checkpoints, with the algorithm's ring buffers, such as its replay buffer, in files beside them.

Otherwise each checkpoint of a long run would write hundreds of thousands of frames. The rows that are new since the
last checkpoint go to files of their own, which are written once; a checkpoint lists the files that it needs, with
their checksums.
"""

from __future__ import annotations

import io
import os
import shutil
import time
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import ReplayBuffer

from core.safe_files import FileError
from trainers.config import CheckpointConfig
from trainers.run import checkpoint
from trainers.run.checkpoint import CheckpointError
from trainers.utils.files import atomic_file
from trainers.utils.tensor_archive import read_tensors

FILES_PER_BUFFER = 16  # a file holds at most this share of a buffer, so that few rows outlive their place in it

References = dict[str, Any]  # for each buffer: rows ever written, and its files with first row, rows and checksum


class CheckpointWriter:
    """Writes checkpoints/last.pt, best.pt and, where checkpoint.keep asks for them, <frames>.pt.

    Only best.pt lacks the running state: a run resumed from it begins new episodes with empty memories.

    Args:
        folder: of the checkpoints.
        config: how often, and how many are kept.
        memories: the files of the algorithm's ring buffers.
    """

    def __init__(self, folder: Path, config: CheckpointConfig, memories: MemoryFiles) -> None:
        self.folder, self.config, self.memories = folder, config, memories
        self.saved_at = time.monotonic()

    def due(self) -> bool:
        """Return whether checkpoint.every minutes have passed since the last checkpoint."""
        minutes = self.config.every
        return minutes is not None and time.monotonic() - self.saved_at > 60 * minutes

    def save_best(self, payload: dict[str, Any]) -> None:
        """Write best.pt."""
        checkpoint.save(self.folder / "best.pt", payload)

    def save_last(self, payload: dict[str, Any], state: dict[str, Any]) -> None:
        """Write last.pt, and remove memory files to which no checkpoint refers any more.

        Args:
            payload: the keys of a checkpoint.
            state: the running state.

        Raises:
            CheckpointError: the disk is full.
        """
        last = self.folder / "last.pt"
        payload = payload | {"state": state | {"memories": self.memories.save()}}
        checkpoint.save(last, payload)
        if self.config.keep:
            _link(last, self.folder / f"{payload['counters']['frames']}.pt")
        kept = sorted(self._kept(), key=lambda path: path.stat().st_mtime_ns, reverse=True)
        for path in kept[self.config.keep :]:
            path.unlink()
        self.memories.remove_unused(map(_references, kept[: self.config.keep]))
        self.saved_at = time.monotonic()

    def _kept(self) -> list[Path]:
        return [path for path in self.folder.glob("*.pt") if path.stem.isdecimal()]


def _references(path: Path) -> dict[str, Any]:
    """Return the memory files of a checkpoint; none if it cannot be read."""
    with suppress(checkpoint.CheckpointError):
        return checkpoint.load(path).get("state", {}).get("memories", {})
    return {}


def _link(source: Path, target: Path) -> None:
    """A second name for a file, or a copy where the file system has no such names."""
    target.unlink(missing_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


class MemoryFiles:
    """The files of a run's ring buffers.

    Args:
        folder: of the files; created when something is saved.
        buffers: by name, one-dimensional and overwritten in turn.
    """

    def __init__(self, folder: Path, buffers: Mapping[str, ReplayBuffer]) -> None:
        self.folder, self.buffers = folder, buffers
        self.files: dict[str, list[dict[str, Any]]] = {name: [] for name in buffers}
        self.earlier = dict.fromkeys(buffers, 0)  # rows that were written before, less those written by loading

    def save(self) -> References:
        """Write the rows that no file holds yet. Returns the references for `load`."""
        references = {}
        for name, buffer in self.buffers.items():
            written = self.earlier[name] + buffer.write_count
            oldest = max(0, written - _capacity(buffer))
            files = [file for file in self.files[name] if file["first"] + file["rows"] > oldest]
            first = max([oldest, *(file["first"] + file["rows"] for file in files)])
            step = max(1, _capacity(buffer) // FILES_PER_BUFFER)
            files += [self._write(name, at, min(step, written - at)) for at in range(first, written, step)]
            self.files[name] = files
            references[name] = {"written": written, "files": files}
        return references

    def load(self, references: References) -> None:
        """Fill the buffers, which are still empty, as they were at `save`.

        Raises:
            CheckpointError: a file is missing or damaged.
        """
        for name, buffer in self.buffers.items():
            entry = references.get(name, {"written": 0, "files": []})
            files, written = entry["files"], entry["written"]
            if files:
                rows = torch.cat([self._read(file) for file in files])
                _fill(buffer, rows[-_capacity(buffer) :], written)
            self.files[name] = list(files)
            self.earlier[name] = written - buffer.write_count

    def remove_unused(self, kept: Iterable[References]) -> None:
        """Remove all files that neither the latest `save` nor any of `kept` refers to."""
        used = {file["name"] for files in self.files.values() for file in files}
        used |= {file["name"] for references in kept for entry in references.values() for file in entry["files"]}
        for path in self.folder.glob("*"):
            if path.name not in used:
                path.unlink(missing_ok=True)

    def _write(self, name: str, first: int, rows: int) -> dict[str, Any]:
        buffer = self.buffers[name]
        places = torch.arange(first, first + rows) % _capacity(buffer)
        content = io.BytesIO()
        torch.save(buffer.storage.get(places).exclude("index").cpu().to_dict(), content)
        file = f"{name}-{first}-{zlib.crc32(content.getbuffer()):08x}.pt"
        self.folder.mkdir(parents=True, exist_ok=True)
        with atomic_file(self.folder / file) as out:
            out.write(content.getbuffer())
        return {"name": file, "first": first, "rows": rows, "bytes": content.tell()}

    def _read(self, file: Mapping[str, Any]) -> TensorDictBase:
        """Return the rows of a file. Its name has its checksum."""
        path = self.folder / Path(file["name"]).name
        if not path.is_file() or path.stat().st_size != file["bytes"]:
            raise CheckpointError(f"{path} is missing or damaged, so the run cannot be resumed from this checkpoint")
        if f"{zlib.crc32(path.read_bytes()):08x}" != path.stem.rpartition("-")[2]:
            raise CheckpointError(f"{path} is damaged, so the run cannot be resumed from this checkpoint")
        try:
            return TensorDict(read_tensors(path), [file["rows"]])
        except FileError as error:
            raise CheckpointError(f"{path} {error}") from None


def _capacity(buffer: ReplayBuffer) -> int:
    return buffer.storage.max_size


def _fill(buffer: ReplayBuffer, rows: TensorDictBase, written: int) -> None:
    """Put the latest rows where they would be after `written` rows in all, and the next one after them."""
    capacity = _capacity(buffer)
    if written <= capacity:
        buffer.extend(rows)
        return
    turn = written % capacity  # the place of the oldest row
    in_place = torch.cat((rows[capacity - turn :], rows[: capacity - turn]))
    buffer.extend(in_place)
    if turn:
        buffer.extend(in_place[:turn])  # once more, to move the place of the next row
