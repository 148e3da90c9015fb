"""Command lines of programs that take key=value: splitting of arguments, output folders, and errors."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from conf.schema import ConfigError


def split(words: Sequence[str], names: Collection[str], example: str) -> tuple[dict[str, str], list[str]]:
    """Separates a program's own arguments from overrides of the config.

    Args:
        words: arguments.
        names: the program's own keys.
        example: a valid argument, shown in the error message.

    Returns:
        The program's keys with their values, and the other arguments unchanged.

    Raises:
        ConfigError: an argument is not of the form key=value, or one of the program's own is empty or given twice.
    """
    own: dict[str, str] = {}
    others = []
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise ConfigError(f"{word}: arguments are written key=value, like {example}")
        if key in names and key in own:
            raise ConfigError(f"{word}: {key} is given twice, with {key}={own[key]} before; give it once")
        if key in names and not value:
            raise ConfigError(f"{word} has no value; give {key}=<value>, or leave it out")
        if key in names:
            own[key] = value
        else:
            others.append(word)
    return own, others


def out_folder(name: str) -> Path:
    """Returns the folder of out=..., created if it is missing. Raises ConfigError if it can't be created."""
    try:
        Path(name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"out={name} cannot be a folder: {error.strerror}") from None
    return Path(name)


def check_folder(key: str, name: str) -> None:
    """Raises ConfigError unless a folder of this name can be written, or created and written. Creates nothing."""
    _check_place(f"{key}={name} cannot be a folder", Path(name))


def check_file(key: str, name: str | Path, suffixes: Sequence[str] = ()) -> Path:
    """Returns the path of a file to be written later, once it is known that it can be. Creates nothing.

    Args:
        key: of the argument, for the error message.
        name: of the file.
        suffixes: that it may have; () for any.

    Raises:
        ConfigError: it is a folder, has another suffix, or its folder cannot be written.
    """
    path = Path(name)
    _check_place(f"{key}={name} cannot be written", path.parent)
    if path.is_dir():
        raise ConfigError(f"{key}={name} is a folder; give the name of a file in it")
    if suffixes and path.suffix.lower() not in suffixes:
        raise ConfigError(f"{key}={name} must end in {' or '.join(suffixes)}")
    return path


def _check_place(problem: str, folder: Path) -> None:
    """Raises ConfigError that begins with `problem` unless files can be created in the folder, once it is made."""
    if "\0" in str(folder):
        raise ConfigError(f"{problem}: its name holds a NUL")
    try:
        path = folder.absolute()
        existing = next(each for each in (path, *path.parents) if each.exists() or each.is_symlink())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{problem}: {getattr(error, 'strerror', None) or error}") from None
    if not existing.is_dir():
        raise ConfigError(f"{problem}: {existing} is a file; choose another place")
    if not os.access(existing, os.W_OK | os.X_OK) or str(existing).startswith(("/proc", "/sys")):
        raise ConfigError(f"{problem}: nothing can be created in {existing}; choose another place")


def run(main: Callable[[list[str]], object], help_text: str | None, words: Sequence[str] | None = None) -> None:
    """Run a program: print its help for -h or --help; otherwise call `main`. Exits with one line for bad input.

    Args:
        main: takes the words; raises ConfigError for bad input.
        help_text: the program's help.
        words: command-line words; by default those of this process.
    """
    words = sys.argv[1:] if words is None else list(words)
    if any(word in ("-h", "--help") for word in words):
        print(help_text)
        return
    try:
        main(words)
    except ConfigError as error:
        sys.exit(f"error: {error}")
