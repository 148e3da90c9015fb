"""Acts with a mixture of a policy and an expert, to collect states for imitation, or demonstrations."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn

from trainers.models.policy import Act, Policy

LABEL = ("privileged", "expert_action")


def expert_move(frames: TensorDictBase, policy: Policy) -> Tensor:
    """(N, A) the expert's action as a move of the policy, relative to `hold`, in [-1, 1]."""
    return ((frames[LABEL] - frames["hold"]) / policy.action_unit).clamp(-1.0, 1.0)


class ExpertMixture(nn.Module):
    """At each step of each world the expert acts with a probability, else the policy does.

    This is the behaviour policy of DAgger, Ross et al. 2011 (arXiv:1011.0686).

    Attributes:
        expert_share: () the probability, in [0, 1].
    """

    expert_share: Tensor

    def __init__(self, policy: Policy, expert_share: float = 1.0) -> None:
        super().__init__()
        self.policy = policy
        self.register_buffer("expert_share", torch.tensor(expert_share))

    @property
    def act(self) -> MixedAct:
        """The module from an observation with the expert's action to "action"."""
        return MixedAct(self)


class MixedAct(TensorDictModuleBase):
    """Observations (N,) with privileged/expert_action (N, A) to "action" (N, A) and the equal "move" (N, A)."""

    def __init__(self, mixture: ExpertMixture) -> None:
        super().__init__()
        self.mixture, self.policy_act = mixture, Act(mixture.policy)
        self.in_keys, self.out_keys = [*self.policy_act.in_keys, LABEL], self.policy_act.out_keys

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        action, expert = self.policy_act(frames)["action"], frames[LABEL]
        follows = torch.rand(len(action), 1, device=action.device) < self.mixture.expert_share
        frames.set("move", torch.where(follows, expert_move(frames, self.mixture.policy), frames["move"]))
        return frames.set("action", torch.where(follows, expert, action))
