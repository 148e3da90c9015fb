"""What a run needs of its machine, so that it is refused before the work instead of failing in the middle of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.errors import ConfigError
from core.machine_limits import require_disk, require_docstrings, require_files, require_shared_memory, require_threads
from core.system import cores
from trainers.config import TrainingConfig, frames_per_batch, uses_processes, workers

if TYPE_CHECKING:
    from tensordict import TensorDictBase
    from torchrl.data import ReplayBuffer

START_FREE = 128 * 2**20  # bytes of disk space without which no run is started
MIN_SHARED = 2 * 2**20  # bytes of shared memory, before the size of a batch is known
FILES, WORKER_FILES = 180, 75  # open files of a run with worker processes, and for each of them: shared tensors
FILES_ALONE = 40  # of a run without worker processes
OUTPUTS = 1.3  # size of a batch over that of what the environment returns: a policy adds what the loss needs
MOMENTS = 3  # size of a checkpoint with the optimizer's moments over that of the networks alone


def check_start(training: TrainingConfig, folder: Path, new: bool = True) -> None:
    """Check what is known from the config alone, before anything slow is imported. Raises ConfigError.

    Args:
        training: the settings.
        folder: of the run.
        new: whether the run begins, and so must not overwrite another one.
    """
    if new:
        _check_unused(folder)
    count = workers(training.collector) if uses_processes(training.collector) else 0
    require_docstrings()
    require_threads(2 * cores() + 2 + 2 * count)
    require_files(FILES + WORKER_FILES * count if count else FILES_ALONE)
    if count:
        require_shared_memory(MIN_SHARED)
    require_disk(folder, START_FREE, "a run needs at least")


def _check_unused(folder: Path) -> None:
    """Check that a new run overwrites no other one. Raises ConfigError."""
    if any((folder / "checkpoints").glob("*.pt")):
        raise ConfigError(
            f"hydra.run.dir={folder} has the checkpoints of a run: go on with resume={folder}, or give another folder"
        )


def check_sizes(
    training: TrainingConfig, folder: Path, step: TensorDictBase, payload: Any, memories: Mapping[str, ReplayBuffer]
) -> None:
    """Check what is known once the networks are built, before the worlds of the workers are. Raises ConfigError.

    Args:
        training: the settings.
        folder: of the run.
        step: (1,) one step of one world, with what follows it.
        payload: of a checkpoint.
        memories: the algorithm's ring buffers by name.
    """
    from trainers.run.checkpoint import MIN_FREE_BYTES, size_in_bytes

    frame, copies = size_in_bytes(step.to_dict()), 1 + training.collector.batches_ahead
    if uses_processes(training.collector):
        policy, batch = size_in_bytes(payload["algorithm"]["policy"]), OUTPUTS * frame * frames_per_batch(training)
        require_shared_memory(copies * int(policy + batch))
    kept = 3 + training.checkpoint.keep  # beside last and best, the one that is being written
    rows = sum(min(int(memory.storage.max_size), training.run.total_frames) for memory in memories.values())
    needed = kept * MOMENTS * size_in_bytes(payload["algorithm"]) + rows * frame // 2 + MIN_FREE_BYTES
    require_disk(folder, needed, "the checkpoints of this run need")
