"""The folder of a run: one process at a time, nothing left of killed ones, and no links that lead out of it."""

from __future__ import annotations

import multiprocessing
import os
import re
from importlib import import_module
from pathlib import Path

from core.errors import ConfigError
from trainers.utils.files import NO_FOLLOW, remove_temporary_files

LOCK = ".lock"
SUBFOLDERS = ("", "checkpoints", "checkpoints/memory", "tensorboard")  # that a run writes to
SEMAPHORES = Path("/dev/shm")
SEMAPHORE_NAME = re.compile(r"sem\.mp-deixis-(\d+)-.*")


class FolderLock:
    """Keeps other processes out of a run's folder while the block runs. The system releases it if the process dies.

    Args:
        folder: created if it is missing.
        name: of the user of the folder, such as "run", for the error message.
    """

    def __init__(self, folder: Path, name: str = "run") -> None:
        self.folder, self.name = folder, name

    def __enter__(self) -> FolderLock:
        """Lock the folder, and remove the leftovers of killed processes. Raises ConfigError."""
        self._descriptor = locked(
            self.folder / LOCK,
            unusable=f"{self.folder} cannot be the folder of a {self.name}",
            taken=f"a {self.name} is running in {self.folder} already",
        )
        try:
            for each in SUBFOLDERS:
                _refuse_links(self.folder, self.folder / each)
                remove_temporary_files(self.folder / each)
        except BaseException:
            os.close(self._descriptor)
            raise
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self._descriptor)


def locked(path: Path, *, unusable: str, taken: str, mode: int = 0o666) -> int:
    """Lock a file, which is created if it is missing, until the descriptor that is returned is closed.

    Args:
        path: of the file; its folder is created, too.
        unusable: the message where the file cannot be opened; the reason follows it.
        taken: the message where another process has locked it.
        mode: of a new file.

    Raises:
        ConfigError: with one of these messages.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | NO_FOLLOW | getattr(os, "O_NONBLOCK", 0), mode)
    except OSError as error:
        raise ConfigError(f"{unusable}: {error.strerror}") from None
    try:
        _try_lock(descriptor)
    except (BlockingIOError, PermissionError):  # as POSIX and as Windows says it
        os.close(descriptor)
        raise ConfigError(taken) from None
    except OSError:
        pass  # a file system without locks
    return descriptor


def _try_lock(descriptor: int) -> None:
    """Lock an open file until it is closed. Raises OSError where another process has locked it."""
    try:
        fcntl = import_module("fcntl")
    except ImportError:
        msvcrt = import_module("msvcrt")  # Windows
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _refuse_links(folder: Path, place: Path) -> None:
    """Raise ConfigError if `place`, or a file in it, is a symbolic link that leads out of the run's folder."""
    inside = folder.resolve()
    for path in (place, *(place.iterdir() if place.is_dir() else ())):
        if path != folder and path.is_symlink() and not path.resolve().is_relative_to(inside):
            raise ConfigError(f"{path} is a symbolic link out of the run's folder, which a run does not write through")


def name_semaphores() -> None:
    """Give the semaphores of this process a name that shows whose they are, and remove those of dead processes."""
    config = getattr(multiprocessing.current_process(), "_config", None)
    if isinstance(config, dict):
        config["semprefix"] = f"/mp-deixis-{os.getpid()}"
    for path in SEMAPHORES.glob("sem.mp-deixis-*") if SEMAPHORES.is_dir() else ():
        match = SEMAPHORE_NAME.fullmatch(path.name)
        if match and not Path(f"/proc/{match[1]}").exists():
            try:
                path.unlink()
            except OSError:
                continue  # of another user
