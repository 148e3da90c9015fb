"""Files that are made from a robot's meshes, kept on disk from one process to the next.

They lie in `$XDG_CACHE_HOME/deixis`, or `~/.cache/deixis`, and can be deleted at any time. Where nothing can be written
there, they are made anew in a temporary folder of the process.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

VERSION = "1"  # raised whenever the same meshes give other files


@cache
def scratch() -> Path:
    """A temporary folder of this process, deleted when it ends."""
    folder = Path(tempfile.mkdtemp(prefix="deixis-hulls-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def kept_folder(sources: Iterable[Path], make: Callable[[Path], None]) -> Path:
    """A folder of files that depend on the content of `sources` alone.

    Args:
        sources: the files that they are made from.
        make: writes them to a folder; called if no earlier process did.
    """
    digest = hashlib.sha256(VERSION.encode())
    for source in sources:
        digest.update(source.name.encode() + b"\0" + hashlib.sha256(source.read_bytes()).digest())
    name = digest.hexdigest()[:32]
    try:
        return _made(cache_folder() / name, make)
    except (OSError, RuntimeError):  # the disk is full or read-only, or the user has no home folder
        return _made(scratch() / name, make)


def cache_folder() -> Path:
    """Where files are kept between processes."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(home) if os.path.isabs(home) else Path("~/.cache").expanduser()) / "deixis"


def _made(folder: Path, make: Callable[[Path], None]) -> Path:
    """The folder, made whole or not at all: another process may make it meanwhile, or this one may be killed."""
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".making-", ignore_cleanup_errors=True) as temporary:
        make(Path(temporary))
        Path(temporary).chmod(0o755)
        try:
            Path(temporary).rename(folder)
        except OSError:
            if not folder.is_dir():
                raise
    return folder
