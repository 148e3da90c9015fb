"""Command lines of programs that take key=value: splitting of arguments, output folders, and errors."""

from __future__ import annotations

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
        ConfigError: an argument is not of the form key=value.
    """
    own, others = {}, []
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise ConfigError(f"{word}: arguments are written key=value, like {example}")
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
