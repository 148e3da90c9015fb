"""Checks of the words that start a run: flags, sweeps, and overrides that a file stores. Imports Hydra where needed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from conf.arguments import check_folder
from conf.composition import compose_hydra, groups, parse
from conf.overrides import check, known_keys
from conf.schema import ConfigError, did_you_mean

MULTIRUN = ("-m", "--multirun")
FLAGS = (
    *MULTIRUN,
    "-h",
    "--help",
    "--hydra-help",
    "--version",
    "--resolve",
    "--run",
    "-r",
    "-sc",
    "--shell-completion",
)
WITH_VALUE = {"--cfg": ("job", "hydra", "all"), "-c": ("job", "hydra", "all"), "--info": (), "-i": (), "--package": ()}
REFUSED = ("--config-dir", "-cd", "--config-path", "-cp", "--config-name", "-cn", "--experimental-rerun")
STORED_HYDRA_KEYS = ("hydra.run.dir", "hydra.sweep.dir", "hydra/launcher", "hydra.launcher.n_jobs")
STORED_LAUNCHERS = ("basic", "joblib")


def check_run(words: Sequence[str]) -> None:
    """Checks the words after `train.py`. Raises ConfigError before Hydra starts, whose messages take many lines."""
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
    from omegaconf import OmegaConf

    config: Any = compose_hydra([_first(each) for each in parsed])
    key = "sweep" if multirun else "run"
    places: Any = OmegaConf.to_container(config.hydra[key], resolve=False)
    check_folder(f"hydra.{key}.dir", str(places["dir"]).partition("${")[0] or ".")


def check_stored(words: Sequence[str], source: Path) -> None:
    """Checks overrides that a file stores: keys of this project with plain values, and few of Hydra's.

    Args:
        words: overrides.
        source: the file, named in the message.

    Raises:
        ConfigError: a word adds a key, sets another key of Hydra (its callbacks import what they name), or holds an
            interpolation (`${oc.env:HOME}`).
    """
    try:
        check([word for word in words if not word.startswith("hydra")])
        for override in parse(words):
            _check_stored(override)
    except ConfigError as error:
        raise ConfigError(f"{source} is refused: {error}; give the overrides on the command line instead") from None


def _check_stored(override: Any) -> None:
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


def _without_flags(words: Sequence[str]) -> list[str]:
    """The overrides among the words. Raises ConfigError for a flag that is unknown or not accepted."""
    overrides, rest = [], list(words)
    while rest:
        word = rest.pop(0)
        flag, _, value = word.partition("=")
        if flag in REFUSED:
            raise ConfigError(f"{word}: the config is that of this project; change its keys with key=value")
        if flag in WITH_VALUE:
            value = value or (rest.pop(0) if rest else "")
            choices = WITH_VALUE[flag]
            if choices and value not in choices:
                raise ConfigError(f"{flag} {value} is not known" + did_you_mean(value, choices))
        elif word.startswith("-"):
            if flag not in FLAGS:
                raise ConfigError(f"{word} is not a flag of this program" + did_you_mean(flag, [*FLAGS, *WITH_VALUE]))
        else:
            overrides.append(word)
    return overrides


def _first(override: Any) -> str:
    """The override with the first of its values, if it has several."""
    if not override.is_sweep_override():
        return str(override.input_line)
    return f"{override.key_or_group}={next(iter(override.sweep_string_iterator()))}"
