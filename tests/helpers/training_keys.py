"""The part of a composed config that training depends on."""

from __future__ import annotations

from typing import Any

from omegaconf import OmegaConf


def training_keys(config: Any) -> dict[str, Any]:
    """The part of a config that training depends on."""
    plain = OmegaConf.to_container(config, resolve=True)
    ignored = ("eval", "logger", "device", "resume", "sweep", "update_threads")
    plain["collector"].pop("workers")
    return {name: value for name, value in plain.items() if name not in ignored}
