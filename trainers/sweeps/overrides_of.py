"""What one types to get a config: the inverse of composing it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from conf.overrides import compose, groups
from trainers.sweeps.runs import flatten

FIRST = ("scenario", "task")  # they choose options of other groups
DEFAULT = ("none", "default")


def overrides(config: Mapping[str, Any]) -> list[str]:
    """The words after `python train.py` that compose this config, but for what runs are not told apart by.

    config: as composed, plain values. Options first, then every key that is left.
    """
    words: list[str] = []
    for group in (*FIRST, *(name for name in groups() if name not in FIRST)):
        words += _option(group, config, words)
    here = _composed(words)
    return words + [f"{key}={_value(value)}" for key, value in flatten(dict(config)) if here.get(key, ...) != value]


def _option(group: str, config: Mapping[str, Any], words: list[str]) -> list[str]:
    """The option of a group that comes nearest to the config, as a word; none where the default does."""
    here = _composed(words)
    if all(here.get(key, ...) == value for key, value in _part(config, group)):
        return []
    fitting = [f"{group}={option}" for option in groups()[group] if _fits(option, config.get(group))]
    return min(([], *([word] for word in fitting)), key=lambda more: _apart(config, [*words, *more]))


def _fits(option: str, node: Any) -> bool:
    """Whether an option could be what this group was composed from: nl_reach_large calls itself nl_reach."""
    name = node.get("name", node.get("source")) if isinstance(node, Mapping) else node
    return f"{option}_".startswith(f"{name}_") and option not in DEFAULT


def _part(config: Mapping[str, Any], group: str) -> list[tuple[str, Any]]:
    return flatten({group: config[group]}) if group in config else []


def _apart(config: Mapping[str, Any], words: list[str]) -> int:
    """In how many keys the config differs from what these words compose."""
    here = _composed(words)
    return sum(here.get(key, ...) != value for key, value in flatten(dict(config)))


def _composed(words: list[str]) -> dict[str, Any]:
    return _flat(tuple(words))


@lru_cache(maxsize=64)
def _flat(words: tuple[str, ...]) -> dict[str, Any]:
    from omegaconf import OmegaConf

    plain: Any = OmegaConf.to_container(compose(words), resolve=True)
    return dict(flatten(plain))


def _value(value: Any) -> str:
    """A plain value as Hydra reads it."""
    if isinstance(value, list):
        return f"[{','.join(map(_value, value))}]"
    if isinstance(value, str) and re.fullmatch(r"[A-Za-z][\w.-]*", value) and value not in ("true", "false", "null"):
        return value
    return json.dumps(value)
