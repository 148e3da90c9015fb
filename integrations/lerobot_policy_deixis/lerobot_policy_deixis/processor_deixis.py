"""What LeRobot does with observations and actions around the policy: it only moves them to the policy's device."""

from __future__ import annotations

from typing import Any

from lerobot.processor import PolicyProcessorPipeline, make_default_pre_post_processors

from lerobot_policy_deixis.configuration_deixis import DeixisConfig


def make_deixis_pre_post_processors(
    config: DeixisConfig, dataset_stats: dict[str, Any] | None = None
) -> tuple[PolicyProcessorPipeline, PolicyProcessorPipeline]:
    """Return the steps before and after the policy. It scales its numbers itself: the statistics are not used."""
    return make_default_pre_post_processors(config, None, normalizer_device=config.device)
