"""Demonstrations for off-policy learning: the first frames of a run, in which the task's expert acts."""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase

from trainers.algorithms.base_config import OffPolicyConfig
from trainers.algorithms.replay import Replay
from trainers.models.expert_mixture import LABEL, ExpertMixture
from trainers.models.policy import Policy


class ExpertFrames:
    """Lets the expert act until `config.demonstrations` frames are kept.

    Attributes:
        mixture: acts in the worlds: the expert at first, then the policy.
        replay: the expert's frames.

    Args: as of `Replay`; its capacity is that of `config`.
    """

    def __init__(
        self,
        policy: Policy,
        critic_key: str | tuple[str, str],
        config: OffPolicyConfig,
        device: torch.device,
        supervised: bool,
    ) -> None:
        self._wanted = config.demonstrations
        self.mixture = ExpertMixture(policy, expert_share=1.0)
        self.replay = Replay(policy, critic_key, self._wanted, device, supervised)

    def add(self, batch: TensorDictBase) -> bool:
        """Keep a batch (worlds, steps) if the expert acted in it. Returns whether it did.

        The actions show it, since the collector may be a batch behind.
        """
        if not torch.equal(batch["action"], batch[LABEL]):
            return False
        self.replay.extend(batch)
        if len(self.replay) >= self._wanted:
            self.mixture.expert_share.fill_(0.0)
        return True

    def running_state(self) -> dict[str, Any]:
        return {"expert_share": float(self.mixture.expert_share)}

    def load_running_state(self, state: dict[str, Any]) -> None:
        self.mixture.expert_share.fill_(state["expert_share"])
