"""Files and directories that appear under their name complete or not at all, also if the process is killed."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from conf.schema import ConfigError


@contextmanager
def atomic_file(path: Path) -> Iterator[IO[bytes]]:
    """A new binary file that replaces `path` when the block ends without an error.

    It is written under a temporary name in the same directory, synced to disk and renamed: after a crash `path` is
    either the old file or the new one.
    """
    temporary = _temporary(path)
    try:
        with open(temporary, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, atomically."""
    with atomic_file(path) as file:
        file.write(text.encode("utf-8"))


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write plain values as indented JSON, atomically."""
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
        raise ConfigError(f"{path} cannot be written: {error.strerror or error} ({error.filename})") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def refuse_existing(path: Path) -> None:
    """Raise ConfigError if `path` exists: nothing is overwritten."""
    if path.exists():
        raise ConfigError(f"{path} exists already and is not overwritten; choose another name or remove it")


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}")
