"""Command lines of programs that take key=value: splitting of arguments, output folders, and errors."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from core.composition import compose, groups, output_folder, parse
from core.errors import ConfigError, did_you_mean
from core.overrides import check, first_value, known_keys
from core.path_keys import from_hydra, unescaped
from core.stored_config import UNUSED, config_from_file

T = TypeVar("T")
MULTIRUN = ("-m", "--multirun")
FLAGS = (*MULTIRUN, "-h", "--help", "--hydra-help", "--version", "--resolve", "--run", "-r")
CONFIGS = ("job", "hydra", "all")
INFORMATION = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")
WITH_VALUE = {"--cfg": CONFIGS, "-c": CONFIGS, "--info": INFORMATION, "-i": INFORMATION, "--package": (), "-p": ()}
COMPLETION = ("-sc", "--shell-completion")  # followed by one of these words
COMPLETION_WORDS = tuple(
    f"{do}={shell}" for do in ("install", "uninstall", "query") for shell in ("bash", "zsh", "fish")
)
REFUSED = ("--config-dir", "-cd", "--config-path", "-cp", "--config-name", "-cn", "--experimental-rerun")
STORED_HYDRA_KEYS = ("hydra.run.dir", "hydra.sweep.dir", "hydra/launcher", "hydra.launcher.n_jobs")
STORED_LAUNCHERS = ("basic", "joblib")


def split(words: Sequence[str], names: Collection[str], example: str) -> tuple[dict[str, str], list[str]]:
    """Separate a program's own arguments from overrides of the config.

    Args:
        words: arguments.
        names: the program's own keys.
        example: a valid argument, shown in the error message.

    Returns:
        The program's keys with their values, and the other arguments unchanged.

    Raises:
        ConfigError: an argument is not of the form key=value, or one of the program's own is empty, given twice or
            misspelled.
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
            continue
        if get_close_matches(key, names, n=1) and key not in groups() and "." not in key and key not in known_keys(()):
            raise ConfigError(f"{word}: {key} is not a known key" + did_you_mean(key, names))
        others.append(word)
    return own, others


def chosen(commands: Mapping[str, T], words: Sequence[str]) -> tuple[T, Sequence[str]]:
    """Return what belongs to the command that the first word names, and the words after it. Raises ConfigError."""
    command = words[0] if words else ""
    if command not in commands:
        raise ConfigError(f"{command or 'nothing'} is not a command" + did_you_mean(command, commands))
    return commands[command], words[1:]


def out_folder(name: str) -> Path:
    """Return the folder of out=..., created if it is missing. Raises ConfigError if it can't be created."""
    try:
        Path(name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"out={name} cannot be a folder: {error.strerror}") from None
    return Path(name)


def check_folder(key: str, name: str) -> None:
    """Raise ConfigError unless a folder of this name can be written, or created and written. Creates nothing."""
    _check_place(f"{key}={name} cannot be a folder", Path(name))


def check_file(key: str, name: str | Path, suffixes: Sequence[str] = (), new: bool = False) -> Path:
    """Return the path of a file to be written later, once it is known that it can be. Creates nothing.

    Args:
        key: of the argument, for the error message.
        name: of the file.
        suffixes: that it may have; () for any.
        new: whether it must not exist.

    Raises:
        ConfigError: it is a folder, has another suffix, exists already, or its folder cannot be written.
    """
    path = Path(name)
    _check_place(f"{key}={name} cannot be written", path.parent)
    if path.is_dir():
        raise ConfigError(f"{key}={name} is a folder; give the name of a file in it")
    if suffixes and path.suffix.lower() not in suffixes:
        raise ConfigError(f"{key}={name} must end in {' or '.join(suffixes)}")
    if new and path.exists():
        raise ConfigError(f"{key}={name} exists already and is not overwritten; give another name")
    return path


def _check_place(problem: str, folder: Path) -> None:
    """Raise ConfigError that begins with `problem` unless files can be created in the folder, once it is made."""
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


def check_run(words: Sequence[str]) -> None:
    """Check the words after `train.py`. Raises ConfigError before Hydra starts, whose messages take many lines."""
    overrides = _without_flags(words)
    check(overrides)
    parsed = parse(overrides)
    sweeps = [each for each in parsed if each.is_sweep_override()]
    multirun = any(word in MULTIRUN for word in words)
    if sweeps and not multirun:
        word = sweeps[0].input_line
        raise ConfigError(f"{word} are several runs; give one value, or sweep over them: python train.py -m {word}")
    if not overrides:
        return
    mode = "sweep" if multirun else "run"
    folder = output_folder([first_value(each) for each in parsed], mode)
    fixed = re.split(r"(?<!\\)\$\{", folder)[0]  # what stands before the first interpolation
    check_folder(f"hydra.{mode}.dir", unescaped(fixed) or ".")


def check_stored(words: Sequence[str], source: Path) -> None:
    """Check overrides that a file stores: keys of this project with plain values, and few of Hydra's.

    Args:
        words: overrides.
        source: the file, named in the message.

    Raises:
        ConfigError: a word adds a key, sets another key of Hydra (its callbacks import what they name), or holds an
            interpolation (`${oc.env:HOME}`), or names a place (`core.stored_config`).
    """
    try:
        check([word for word in words if not word.startswith("hydra")])
        for override in parse(words):
            _check_stored(override, source)
    except ConfigError as error:
        raise ConfigError(f"{source} is refused: {error}; give the overrides on the command line instead") from None


def _check_stored(override: Any, source: Path) -> None:
    word, key = override.input_line, override.key_or_group
    if override.is_add() or override.is_force_add() or override.package is not None:
        raise ConfigError(f"{word} adds a key, and a file may only set keys that exist")
    if "${" in word or "_target_" in word:
        raise ConfigError(f"{word} is not a plain value")
    if key in STORED_HYDRA_KEYS:
        if key == "hydra/launcher" and override.value() not in STORED_LAUNCHERS:
            raise ConfigError(f"{word} is not known; choose from {', '.join(STORED_LAUNCHERS)}")
    elif key not in groups() and key not in known_keys(()) and key.split(".")[0] not in groups():
        raise ConfigError(f"{word} is not accepted from a file; its keys are those of the config")
    else:
        _check_places(override, source)


def _check_places(override: Any, source: Path) -> None:
    """Raise ConfigError where one of the values of an override, with what its option sets, names a place."""
    from omegaconf import OmegaConf

    key = override.key_or_group
    if key in UNUSED:
        raise ConfigError(f"{override.input_line} is not accepted from a file")
    values = override.sweep_string_iterator() if override.is_sweep_override() else [override.input_line]
    for value in values:
        word = value if value == override.input_line else from_hydra(f"{key}={value}")
        config: Any = OmegaConf.to_container(compose([word]), resolve=True)
        config_from_file(config, source, to_train=True)


def _without_flags(words: Sequence[str]) -> list[str]:
    """Return the overrides among the words. Raises ConfigError for a flag that is unknown or not accepted."""
    overrides, rest = [], list(words)
    while rest:
        word = rest.pop(0)
        flag, _, value = word.partition("=")
        if flag in REFUSED:
            raise ConfigError(f"{word}: the config is that of this project; change its keys with key=value")
        if flag in COMPLETION:
            value = rest.pop(0) if rest else ""
            if value not in COMPLETION_WORDS or (value.startswith("query") and "COMP_LINE" not in os.environ):
                raise ConfigError(f"{flag} {value}".strip() + f" needs one of {', '.join(COMPLETION_WORDS[:6])}")
        elif flag in WITH_VALUE:
            value = value or (rest.pop(0) if rest else "")
            choices = WITH_VALUE[flag]
            if choices and value not in choices:
                raise ConfigError(f"{flag} {value} is not known" + did_you_mean(value, choices))
        elif word.startswith("-"):
            if flag not in FLAGS:
                raise ConfigError(
                    f"{word} is not a flag of this program" + did_you_mean(flag, [*FLAGS, *WITH_VALUE, *COMPLETION])
                )
        else:
            overrides.append(word)
    return overrides
