"""The overrides that compose a given config: the inverse of composing it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from conf.overrides import compose, groups
from conf.schema import ConfigError
from trainers.config_versions import without_former_keys
from trainers.sweeps.runs import flatten

FIRST = ("scenario", "task")  # their options choose options of other groups


def overrides_of(config: Mapping[str, Any]) -> list[str]:
    """The words after `python train.py` that compose this config, except keys that do not identify a configuration.

    Args:
        config: a composed config as plain values, or groups of it, with the option of each group under `choices`.

    Returns:
        Options first, then each key whose value differs from that of the options.

    Raises:
        ConfigError: the config has no `choices`, or one of its options no longer exists.
    """
    if "choices" not in config:
        raise ConfigError("the config was saved by an earlier version, which did not record the options of its groups")
    words: list[str] = []
    for group in (*FIRST, *(name for name in groups() if name not in FIRST)):
        if group not in config or group not in config["choices"]:  # a group of keys became one of options later
            continue
        option = config["choices"][group]
        if _composed(words)["choices"][group] != option:
            words.append(f"{group}={option}")
    defaults = dict(flatten(_composed(words)))
    values = flatten(without_former_keys(config))
    return words + [f"{key}={_hydra_value(value)}" for key, value in values if defaults.get(key, ...) != value]


def _composed(words: list[str]) -> dict[str, Any]:
    return _composed_once(tuple(words))


@lru_cache(maxsize=64)
def _composed_once(words: tuple[str, ...]) -> dict[str, Any]:
    from omegaconf import OmegaConf

    plain: Any = OmegaConf.to_container(compose(words), resolve=True)
    return plain


def _hydra_value(value: Any) -> str:
    """A plain value in Hydra's override syntax."""
    if isinstance(value, list):
        return f"[{','.join(map(_hydra_value, value))}]"
    if isinstance(value, str) and re.fullmatch(r"[A-Za-z][\w.-]*", value) and value not in ("true", "false", "null"):
        return value
    return json.dumps(value)
