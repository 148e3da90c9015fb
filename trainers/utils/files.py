"""Files and directories that appear under their name complete or not at all, also if the process is killed.

Each is written under a temporary name that nobody can predict, which is created new: a symbolic link or a hard link
that stands under the final name is replaced, and what it points at is not touched. Records of runs have a checksum.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from core.errors import ConfigError
from core.safe_files import FileError, parse_yaml, read_bytes, read_json

TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}\.tmp(\.\w+)?")  # names that `_temporary` gives
NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)


KEY = "sha256"
FIRST_LINE = f"# {KEY}: "
EDITED = f"damaged: its {KEY} does not fit; if you edited it, remove the {KEY}"


class WriteError(ConfigError):
    """A file or directory that cannot be written. The text names it and says why."""


@contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    """Turns an OSError of the block, such as that of a full disk, into a WriteError that names the file."""
    try:
        yield
    except OSError as error:
        raise WriteError(f"{path} cannot be written: {error.strerror or error}") from error


@contextmanager
def atomic_file(path: Path) -> Iterator[IO[bytes]]:
    """A new binary file that replaces `path` when the block ends without an error.

    It is written under a temporary name in the same directory, synced to disk and renamed: after a crash `path` is
    either the old file or the new one. Raises WriteError if the disk is full or the place cannot be written.
    """
    temporary = _temporary(path)
    try:
        with _write_errors(path):
            with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_FOLLOW, 0o666), "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
    finally:
        _remove(temporary)


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path with the suffix of `path`, for libraries that open files by name.

    The file that is there when the block ends without an error replaces `path`. Raises WriteError.
    """
    temporary = _temporary(path, path.suffix)
    try:
        with _write_errors(path):
            yield temporary
            os.replace(temporary, path)
    finally:
        _remove(temporary)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, atomically. Raises WriteError."""
    with atomic_file(path) as file:
        file.write(text.encode("utf-8"))


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write plain values as indented JSON, atomically. Raises WriteError."""
    write_text(path, json.dumps(values, indent=2) + "\n")


@contextmanager
def atomic_directory(path: Path) -> Iterator[Path]:
    """A new directory that is renamed to `path` when the block ends without an error; otherwise it is removed.

    Raises:
        ConfigError: `path` exists already, or cannot be written.
    """
    refuse_existing(path)
    temporary = _temporary(path)
    try:
        temporary.mkdir(parents=True)
        yield temporary
        os.rename(temporary, path)
    except OSError as error:
        where = f" ({error.filename})" if error.filename else ""
        raise WriteError(f"{path} cannot be written: {error.strerror or error}{where}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def refuse_existing(path: Path) -> None:
    """Raise ConfigError if `path` exists: nothing is overwritten."""
    try:
        exists = path.exists() or path.is_symlink()
    except (OSError, ValueError) as error:
        raise WriteError(f"{path} cannot be written: {getattr(error, 'strerror', None) or error}") from None
    if exists:
        raise ConfigError(f"{path} exists already and is not overwritten; choose another name or remove it")


def remove_temporary_files(folder: Path) -> list[Path]:
    """Remove the temporary files that a killed process has left in `folder`. Returns their paths.

    Only to be called by a process that holds the folder's lock: others' files may be in use.
    """
    left = [path for path in folder.glob(".*") if TEMPORARY.fullmatch(path.name) and path.is_file()]
    for path in left:
        _remove(path)
    return left


def _remove(path: Path) -> None:
    with suppress(OSError):  # an error of the block, such as a name that is too long, says more
        path.unlink(missing_ok=True)


def _temporary(path: Path, suffix: str = "") -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(8)}.tmp{suffix}")


def write_checked_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write plain values as indented JSON with a checksum, atomically. Raises WriteError."""
    write_json(path, {KEY: _digest(_canonical(values)), **values})


def read_checked_json(path: Path) -> dict[str, Any]:
    """Return the values of a JSON file without their checksum. Raises FileError for a damaged file."""
    values = read_json(path)
    if not isinstance(values, dict):
        raise FileError("is damaged: it holds no group of keys")
    checksum = values.pop(KEY, None)
    if checksum is not None and checksum != _digest(_canonical(values)):
        raise FileError(f"is {EDITED}")
    return values


def write_checked_yaml(path: Path, text: str) -> None:
    """Write YAML below a line with its checksum, atomically. Raises WriteError."""
    write_text(path, f"{FIRST_LINE}{_digest(text)}\n{text}")


def read_checked_yaml(path: Path, max_bytes: int) -> Any:
    """Return the plain value of a YAML file. Raises FileError for a damaged file."""
    content = read_bytes(path, max_bytes)
    first, _, rest = content.partition(b"\n")
    checksum = first.removeprefix(FIRST_LINE.encode())
    if checksum != first and checksum.decode(errors="replace").strip() != hashlib.sha256(rest).hexdigest():
        raise FileError(f"is {EDITED}")
    value = parse_yaml(content)
    if value is None:
        raise FileError("is damaged: it is empty")
    return value


def _canonical(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
