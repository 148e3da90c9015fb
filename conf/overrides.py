"""Overrides of the config: checks with suggestions, composition by Hydra, and application to a saved config."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

from conf.schema import ConfigError, did_you_mean

ROOT = Path(__file__).parent


def groups() -> dict[str, list[str]]:
    """Returns each config group with its options."""
    return {f.name: sorted(y.stem for y in f.glob("*.yaml")) for f in sorted(ROOT.iterdir()) if any(f.glob("*.yaml"))}


def comment(group: str, option: str) -> str:
    """Returns the comment at the top of an option's YAML."""
    lines = (ROOT / group / f"{option}.yaml").read_text(encoding="utf-8").splitlines()
    top = itertools.takewhile(lambda line: line.startswith("#"), lines)
    return " ".join(line.lstrip("# ") for line in top if "@package" not in line)


def quoted(arguments: Iterable[str]) -> list[str]:
    """Returns the arguments with numeric options (scenario=1,2) in quotes, since Hydra accepts only strings there."""
    names = set(groups())
    return [re.sub(r"(?<=[=,])\d+(?=,|$)", r"'\g<0>'", w) if w.split("=")[0] in names else w for w in arguments]


def check(arguments: Sequence[str]) -> None:
    """Raises ConfigError for an override of an unknown group, option or key. Flags (--help) are ignored."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    words = [word for word in arguments if not word.startswith("-")]
    try:
        overrides = OverridesParser.create().parse_overrides(words)
    except HydraException as error:
        raise ConfigError(f"{str(error).splitlines()[0]}; overrides are written key=value") from None
    chosen = [_check_choice(o) for o in overrides if o.key_or_group in groups()]
    plain = [o for o in overrides if o.key_or_group not in groups() and not o.is_add() and not o.is_delete()]
    keys = None
    for override in plain:
        if override.key_or_group.startswith("hydra"):
            continue
        keys = keys or set(_keys(_compose([word for word in chosen if word])[0]))
        if override.key_or_group not in keys:
            known = [*keys, *groups()]
            raise ConfigError(
                f"{override.input_line}: {override.key_or_group} is not a known key"
                + did_you_mean(override.key_or_group, known)
            )


def compose(overrides: Iterable[str] = ()) -> Any:
    """The project's config with Hydra overrides, and the chosen options as `with_choices` adds them.

    Raises ConfigError for what Hydra refuses.
    """
    return with_choices(*_compose(overrides))


def with_choices(config: Any, choices: Mapping[str, Any]) -> Any:
    """The composed config with a key `choices`: the option of each config group, such as `{"robot": "kuka", ...}`.

    A group's values alone do not tell its option: options can share a name, and single keys can be overridden.

    Args:
        config: a composed DictConfig; it is changed.
        choices: `hydra.runtime.choices`.
    """
    from omegaconf import open_dict

    with open_dict(config):
        config["choices"] = {group: str(choices[group]) for group in groups() if group in choices}
    return config


def _compose(overrides: Iterable[str]) -> tuple[Any, Mapping[str, Any]]:
    """The composed config, which the caller may change, and the option of each group. Raises ConfigError."""
    config, choices = _composed_once(tuple(overrides))
    return deepcopy(config), choices


@lru_cache(maxsize=256)
def _composed_once(overrides: tuple[str, ...]) -> tuple[Any, Mapping[str, Any]]:
    """As `_compose`. A composition takes Hydra 0.25 s, a copy 0.01 s."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException
    from omegaconf import open_dict

    GlobalHydra.instance().clear()
    try:
        with initialize_config_module("conf", version_base="1.3"):
            config = hydra_compose("config", quoted(overrides), return_hydra_config=True)
    except HydraException as error:
        raise ConfigError(str(error)) from None
    choices = config.hydra.runtime.choices
    with open_dict(config):
        del config["hydra"]
    return config, choices


FIXED_BY_TRAINING = ("robot", "control", "policy", "algo")  # groups that a checkpoint can't change


def apply(config: Any, overrides: Sequence[str]) -> Any:
    """Returns the config of a checkpoint with overrides.

    An option replaces its whole group. The option of a group in `FIXED_BY_TRAINING` can't change.

    Args:
        config: of the checkpoint, a plain dict.
        overrides: key=value.

    Raises:
        ConfigError: an unknown key or option, or one that the checkpoint can't change.
    """
    from omegaconf import OmegaConf

    check(overrides)
    fresh = compose([word for word in overrides if word.split("=")[0] in groups()])
    changed = OmegaConf.create(config)
    for word in overrides:
        key, _, value = word.partition("=")
        if key == "scenario":
            raise ConfigError(f"{word}: a checkpoint keeps the scenario that it was trained in")
        if key in FIXED_BY_TRAINING and fresh[key].get("name") != changed[key].get("name"):
            raise ConfigError(f"{word}: the checkpoint was trained with {key}={changed[key].get('name')}, and keeps it")
        if key == "gesture" and key in changed:
            changed[key].source = fresh[key].source  # the options differ in nothing else; the other keys are the run's
        elif key in groups():
            OmegaConf.update(changed, key, fresh[key], merge=False)
        elif OmegaConf.select(changed, key, default=ROOT) is ROOT:
            raise ConfigError(f"{word}: {key} is not a key of this run's config" + did_you_mean(key, _keys(changed)))
        else:
            OmegaConf.update(changed, key, OmegaConf.from_dotlist([f"v={value}"]).v)
        if key in groups() and "choices" in changed:
            changed.choices[key] = fresh.choices[key]
    return changed


def _check_choice(override: Any) -> str:
    group, value = override.key_or_group, override.value()
    options = groups()[group]
    given = list(override.sweep_iterator()) if override.is_sweep_override() else [value]
    choices = [
        str(getattr(choice, "text", choice)).strip("'\"") for choice in given
    ]  # `text`: the attribute of a quoted string
    for choice in choices:
        if choice not in options:
            raise ConfigError(f"{group}={choice} is not known" + did_you_mean(choice, options))
    return f"{group}={choices[0]}" if choices else ""


def _keys(config: Any, prefix: str = "") -> Iterable[str]:
    for key in config:
        yield f"{prefix}{key}"
        value = config._get_node(key) if hasattr(config, "_get_node") else config[key]
        if hasattr(value, "keys") and not getattr(value, "_is_none", lambda: False)():
            yield from _keys(value, f"{prefix}{key}.")
