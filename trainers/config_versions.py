"""Configs that earlier versions saved, in checkpoints and run folders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from conf.overrides import compose

# Keys that configs of earlier versions lack, with the options of their group that have the key; None: all options.
NEW_KEYS: dict[str, tuple[str, ...] | None] = {
    "schedule_frames": None,
    "collector.name": None,
    "collector.timeout": None,
    "collector.restarts": None,
    "collector.overlap": ("local",),
    "algo.grounding_gain": ("ppo", "a2c"),
    "algo.grounding_lr": None,
    "algo.loss": ("ppo", "sac"),
    "init": None,
    "checkpoint": None,
    "eval.overlap": None,
}
# Keys that configs of earlier versions have with the value null, which means the same as no key, with the options of
# their group that no longer have the key.
FORMER_KEYS = {"algo.grounding_gain": ("bc", "crossq", "redq", "sac", "td3", "tqc")}
MISSING = object()


def of_this_version(config: Any) -> Any:
    """A config of this or an earlier version with the keys of this one, as a DictConfig; new keys have their defaults.

    Other unknown keys, and former keys with a value, are kept, so that the reader refuses them.
    """
    from omegaconf import OmegaConf

    return _with_new_keys(OmegaConf.create(without_former_keys(config)))


def without_former_keys(config: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of a config, or of groups of it, without the null values of `FORMER_KEYS`."""
    config = dict(config)
    for key, options in FORMER_KEYS.items():
        group, _, name = key.partition(".")
        node: Any = config.get(group)
        if hasattr(node, "get") and node.get("name") in options and node.get(name, MISSING) is None:
            config[group] = {other: value for other, value in node.items() if other != name}
    return config


def _with_new_keys(config: Any) -> Any:
    """The config, which is changed, with the default values of the new keys that it lacks."""
    from omegaconf import OmegaConf

    options = {"algo": OmegaConf.select(config, "algo.name"), "collector": OmegaConf.select(config, "collector.name")}
    options["collector"] = options["collector"] or "local"  # the only collector before collectors had names
    had = [key for key, names in NEW_KEYS.items() if names is None or options.get(key.partition(".")[0]) in names]
    missing = [key for key in had if OmegaConf.select(config, key, default=MISSING) is MISSING]
    if missing:
        defaults = compose([f"{group}={option}" for group, option in options.items()])
        for key in missing:
            OmegaConf.update(config, key, OmegaConf.select(defaults, key), force_add=True)
    return config
