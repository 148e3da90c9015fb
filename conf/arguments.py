"""Programs that take key=value: what is theirs, what is left for the config, and how they end on bad input."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from conf.schema import ConfigError


def split(words: Sequence[str], names: Collection[str], example: str) -> tuple[dict[str, str], list[str]]:
    """The program's own keys, `names`, with their values, and the other words as they are.

    Raises ConfigError for a word that is not key=value; `example` shows one that is.
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
    """The folder that out=... names, made where it is missing. Raises ConfigError where it cannot be."""
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
