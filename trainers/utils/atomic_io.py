"""Directories that are there whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from conf.schema import ConfigError


@contextmanager
def whole(place: Path) -> Iterator[Path]:
    """A new directory to write in, which is called `place` once all went well; after an error nothing of it is left.

    Raises ConfigError where `place` exists, or cannot be written.
    """
    refuse_existing(place)
    beside = place.with_name(f".{place.name}.{os.getpid()}")
    try:
        beside.mkdir(parents=True)
        yield beside
        os.rename(beside, place)
    except OSError as error:
        raise ConfigError(f"{place} cannot be written: {error.strerror or error} ({error.filename})") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def refuse_existing(place: Path) -> None:
    """Raise ConfigError where there is something of that name: nothing is overwritten."""
    if place.exists():
        raise ConfigError(f"{place} exists already, and is not overwritten; choose another name, or remove it")
