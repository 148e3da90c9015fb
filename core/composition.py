"""Composition of the config by Hydra: the options of its groups, then single values."""

from __future__ import annotations

import pickle
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from core.errors import ConfigError, did_you_mean

ROOT = Path(__file__).parents[1] / "conf"


def groups() -> dict[str, list[str]]:
    """Return each config group with its options."""
    return {group: list(options) for group, options in _groups_on_disk()}


@cache
def _groups_on_disk() -> list[tuple[str, list[str]]]:
    folders = [folder for folder in sorted(ROOT.iterdir()) if any(folder.glob("*.yaml"))]
    return [(folder.name, sorted(path.stem for path in folder.glob("*.yaml"))) for folder in folders]


def quoted(arguments: Iterable[str]) -> list[str]:
    """Return the arguments with numeric options (scenario=1,2) in quotes, since Hydra accepts only strings there."""
    names = set(groups())
    return [re.sub(r"(?<=[=,])\d+(?=,|$)", r"'\g<0>'", w) if w.split("=")[0] in names else w for w in arguments]


def parse(words: Sequence[str]) -> list[Any]:
    """Return Hydra's `Override` of each word. Raises ConfigError for a word that is none."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    parser, overrides = OverridesParser.create(), []
    for word in words:
        try:
            overrides += parser.parse_overrides([word])
        except (HydraException, ValueError) as error:
            key = word.partition("=")[0].lstrip("+~")
            if "=" in word and key and not key.isascii():
                raise ConfigError(f"{word}: {key} is not a known key; keys are written in Latin letters") from None
            reason = " ".join((str(error).splitlines() or ["not an override"])[0].split())
            raise ConfigError(f"{word}: {reason}; overrides are written key=value") from None
    return overrides


def compose(overrides: Iterable[str] = ()) -> Any:
    """Compose the project's config with Hydra overrides, and add the chosen options as `with_choices` does.

    Raises ConfigError for what Hydra refuses.
    """
    return with_choices(*composed(overrides))


def with_choices(config: Any, choices: Mapping[str, Any]) -> Any:
    """Add a key `choices` to a composed config: the option of each config group, such as `{"robot": "kuka", ...}`.

    A group's values alone do not determine its option: options can share a name, and single keys can be overridden.

    Args:
        config: a composed DictConfig; it is changed.
        choices: `hydra.runtime.choices`.
    """
    from omegaconf import open_dict

    with open_dict(config):
        config["choices"] = {group: str(choices[group]) for group in groups() if group in choices}
    return config


def composed(overrides: Iterable[str]) -> tuple[Any, Mapping[str, Any]]:
    """Return the composed config, which the caller may change, and the option of each group. Raises ConfigError."""
    result = _composed_once(tuple(overrides))
    return pickle.loads(result.config), result.choices


def output_folder(overrides: Iterable[str], mode: str) -> str:
    """Return `hydra.run.dir` or `hydra.sweep.dir`, with interpolations. mode: "run" or "sweep". Raises ConfigError."""
    return _composed_once(tuple(overrides)).folders[mode]


@dataclass(frozen=True)
class _Composed:
    """What Hydra composed. config: pickled, since a copy by pickle takes a fifth of the time of `deepcopy`."""

    config: bytes
    choices: Mapping[str, Any]
    folders: Mapping[str, str]


@lru_cache(maxsize=512)
def _composed_once(overrides: tuple[str, ...]) -> _Composed:
    """Compose with Hydra, which takes 0.1 s, and check that every interpolation resolves. Raises ConfigError."""
    from omegaconf import OmegaConf, open_dict
    from omegaconf.errors import OmegaConfBaseException

    config = compose_hydra(overrides)
    hydra = config.hydra
    places: Any = {mode: OmegaConf.to_container(hydra[mode], resolve=False) for mode in ("run", "sweep")}
    folders = {mode: str(place["dir"]) for mode, place in places.items()}
    with open_dict(config):
        del config["hydra"]
    try:
        OmegaConf.to_container(config, resolve=True)
    except OmegaConfBaseException as error:
        value = OmegaConf.to_container(config, resolve=False)
        for name in str(error.full_key).split("."):
            value = value[name] if isinstance(value, dict) and name in value else value
        reason = str(error.msg or error).splitlines()[0]
        raise ConfigError(f"{error.full_key}={value} cannot be resolved: {reason}; write the value itself") from None
    return _Composed(pickle.dumps(config), dict(hydra.runtime.choices), folders)


def compose_hydra(overrides: Iterable[str]) -> Any:
    """Return the composed config with Hydra's own settings under `hydra`. Raises ConfigError for what Hydra refuses."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException

    words = list(overrides)
    GlobalHydra.instance().clear()
    try:
        with initialize_config_module("conf", version_base="1.3"):
            return hydra_compose("config", quoted(words), return_hydra_config=True)
    except (HydraException, ValueError) as error:  # ValueError: a value that names no option
        raise ConfigError(_one_line(f"{error}\n{error.__cause__ or ''}", words)) from None


def _one_line(text: str, words: Sequence[str]) -> str:
    """Hydra's message in one line that begins with the word that it is about."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    merging = "Error merging override "
    if lines[0].startswith(merging) and len(lines) > 1:
        word = lines[0].removeprefix(merging)
        return f"{word}: {lines[1]}; {_present(word.partition('=')[0])}"
    about = next((word for word in words if (key := word.partition("=")[0]) and key in lines[0]), "")
    options = [line for line in lines[1:] if line.replace("_", "").isalnum()]
    ending = did_you_mean(about.partition("=")[2], options) if options else "; see python train.py --hydra-help"
    return f"{about}: {lines[0].rstrip('.')}{ending}".removeprefix(": ")


def _present(key: str) -> str:
    """Return the kind of value that a key has by default, for an error message."""
    from omegaconf import OmegaConf

    value = OmegaConf.select(compose_hydra([]), key)
    if OmegaConf.is_dict(value):
        return f"it is a group of keys: {', '.join(map(str, value))}"
    return f"its default is {value}"
