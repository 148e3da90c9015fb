"""Files that are made from other files, kept on disk for all processes and runs of a user.

They lie in `$XDG_CACHE_HOME/deixis`, or `~/.cache/deixis`; where nothing can be written there, in one folder of the
user in the temporary directory. An entry is keyed by the content of what it is made from and by the code that makes it,
never by names, sizes or dates. It is made whole or not at all, and can be deleted at any time. All entries together
take at most `MOST_BYTES`: those that have not been used for the longest time go.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from core.errors import RunError

MOST_BYTES = 64 * 2**20
TRIES = 3  # to make an entry while somebody deletes the folder
MANIFEST = ".files"  # of an entry: the names of its files, so that one that was deleted in part is noticed
MAKING = ".making-"  # how the names of unfinished entries begin
ABANDONED = 3600.0  # seconds after which an unfinished entry belongs to a process that was killed
FRESH = 2.0  # seconds since its last change within which a file may change again without another time stamp
Source = str | bytes | Path
Make = Callable[[Path], None]

_digests: dict[tuple[int, ...], str] = {}  # of files, by what the system changes with every write


def cached_folder(kind: str, sources: Iterable[Source], make: Make) -> Path:
    """Return a folder of files that depend on `sources` alone. Ask again before each use: it can be deleted any time.

    Args:
        kind: begins the folder's name.
        sources: texts, and files whose content counts. The module that makes the files is one of them.
        make: writes the files to an empty folder. It is called if they are not there.

    Raises:
        OSError: a source cannot be read.
        RunError: no folder can be written to.
    """
    name = f"{kind}-{_key(sources)}"
    failed: OSError | None = None
    for folder in (cache_folder(), temporary_folder()):
        for _ in range(TRIES):
            try:
                return _entry(folder, name, make)
            except FileNotFoundError as error:  # somebody deletes the folder meanwhile
                failed = error
            except OSError as error:  # the disk is full or read-only, or the folder belongs to somebody else
                failed = error
                break
    raise RunError(f"no folder can be written to, set XDG_CACHE_HOME to one for files made here: {failed}")


def cached_text(name: str, text: str) -> Path:
    """Return a file of this name and content."""
    return cached_folder(Path(name).stem, [name, text], lambda folder: _write(folder / name, text)) / name


def cache_folder() -> Path:
    """Return the folder of the entries."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    try:
        return (Path(home) if os.path.isabs(home) else Path("~/.cache").expanduser()) / "deixis"
    except RuntimeError:  # the user has no home folder
        return temporary_folder()


def temporary_folder() -> Path:
    """Return the folder of the entries where the other one cannot be written to: one for each user."""
    user = os.getuid() if hasattr(os, "getuid") else getpass.getuser()
    return Path(tempfile.gettempdir()) / f"deixis-cache-{user}"


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content, read again whenever the file may have changed. Raises OSError."""
    state = path.stat()
    key = (state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns)
    if key not in _digests or time.time() - max(state.st_ctime, state.st_mtime) < FRESH:
        with path.open("rb") as file:
            _digests[key] = hashlib.file_digest(file, "sha256").hexdigest()
    return _digests[key]


def _key(sources: Iterable[Source]) -> str:
    digest = hashlib.sha256()
    for source in sources:
        content = source.encode() if isinstance(source, str) else source
        part = file_digest(content) if isinstance(content, Path) else hashlib.sha256(content).hexdigest()
        digest.update(part.encode())
    return digest.hexdigest()[:32]


def _entry(folder: Path, name: str, make: Make) -> Path:
    """Return the entry of this name, made if it is not there, or not whole."""
    entry = folder / name
    _check_owner(folder)
    if _is_whole(entry):
        with suppress(OSError):  # a read-only cache
            os.utime(entry)  # its last use
        return entry
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    unfinished = Path(tempfile.mkdtemp(dir=folder, prefix=MAKING))
    try:
        make(unfinished)
        _write(unfinished / MANIFEST, "\n".join(sorted(path.name for path in unfinished.iterdir())))
        try:
            unfinished.rename(entry)
        except OSError:
            if not _is_whole(entry):  # otherwise another process was first
                _complete(entry, unfinished)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    _shrink(folder, entry)
    return entry


def _complete(entry: Path, made: Path) -> None:
    """Replace the files of an entry that was deleted in part, one by one: others may be reading, or do the same."""
    for name in [*_names(made), MANIFEST]:
        (made / name).replace(entry / name)


def _names(entry: Path) -> list[str]:
    return (entry / MANIFEST).read_text(encoding="utf-8").split("\n")


def _is_whole(entry: Path) -> bool:
    try:
        return all((entry / name).is_file() for name in _names(entry))
    except OSError:
        return False


def _check_owner(folder: Path) -> None:
    """Raise PermissionError for a folder of the temporary directory that another user has made."""
    if folder != temporary_folder() or not os.path.lexists(folder) or not hasattr(os, "getuid"):
        return
    if folder.is_symlink() or folder.lstat().st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to another user")


def _shrink(folder: Path, newest: Path) -> None:
    """Delete the entries that have not been used for the longest time, down to `MOST_BYTES`, but not the newest."""
    entries = []
    for entry in folder.iterdir():
        try:
            used, size = entry.stat().st_mtime, sum(path.stat().st_size for path in entry.iterdir())
        except OSError:
            continue  # another process deletes it, or it is no entry
        if entry.name.startswith(MAKING):
            if time.time() - used > ABANDONED:
                shutil.rmtree(entry, ignore_errors=True)
        elif entry != newest:
            entries.append((used, size, entry))
    room = MOST_BYTES - sum(path.stat().st_size for path in newest.iterdir())
    for _, size, entry in sorted(entries, reverse=True):
        room -= size
        if room < 0:
            shutil.rmtree(entry, ignore_errors=True)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
