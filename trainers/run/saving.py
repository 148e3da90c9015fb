"""Which checkpoints a run writes and when, and which of them stay."""

from __future__ import annotations

import os
import shutil
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from trainers.config import CheckpointConfig
from trainers.run import checkpoint
from trainers.run.memories import MemoryFiles


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
        """Whether checkpoint.every minutes have passed since the last checkpoint."""
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
    """The memory files of a checkpoint; none if it cannot be read."""
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
