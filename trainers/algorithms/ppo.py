"""PPO, Schulman et al. 2017 (arXiv:1707.06347), with the clipped surrogate of TorchRL."""

from __future__ import annotations

from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.objectives import ClipPPOLoss

from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.algorithms.ppo_config import PPOConfig
from trainers.algorithms.specs import Specs
from trainers.models.actors import stochastic_actor
from trainers.models.policy import Policy


class PPO(OnPolicyAlgorithm):
    """critic: writes state_value; it may read privileged/goal."""

    def __init__(self, config: PPOConfig, policy: Policy, critic: TensorDictModule) -> None:
        loss = ClipPPOLoss(
            stochastic_actor(policy),
            critic,
            clip_epsilon=config.clip,
            entropy_coeff=config.entropy,
            critic_coeff=config.critic_weight,
            loss_critic_type="l2",
            functional=False,
            log_explained_variance=False,
        )
        super().__init__(config, policy, critic, loss)
        self.target_kl = config.target_kl

    @classmethod
    def build(cls, config: PPOConfig, policy: Policy, specs: Specs) -> PPO:
        return cls(config, policy, specs.build_value(policy))

    def stops_early(self, row: dict[str, Tensor]) -> bool:
        """Whether the policy has moved beyond 1.5 times target_kl."""
        return bool(self.target_kl) and float(row["kl"]) > 1.5 * self.target_kl
