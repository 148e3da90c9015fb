"""Critics, built from specs.

    robot, what the actor and critics read besides, goal or context ─► state value
    the same, move ─► action values

A critic may be given the goal, which the policy has to infer (asymmetric actor-critic, Pinto et al. 2018,
arXiv:1710.06542): it is not used after training.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from tensordict import NestedKey
from tensordict.nn import TensorDictModule
from torchrl.data import Composite

from trainers.config import PolicyConfig
from trainers.environment import Readers, keys_read
from trainers.models.networks import Critic, Normalise, SingleCritic
from trainers.models.policy import Policy, further_input


@dataclass(frozen=True)
class CriticBuilder:
    """Builds the critics of a policy.

    Attributes:
        config: the key `policy` of a run.
        policy: whose critics they are.
        observation: the environment's observation spec.
        device: of the networks.
        readers: which network reads which observation.
    """

    config: PolicyConfig
    policy: Policy
    observation: Composite
    device: torch.device
    readers: Readers

    @property
    def keys(self) -> tuple[NestedKey, ...]:
        """The keys that a critic reads beside the move: what the actor reads, what critics read, and the context.

        The goal and other privileged observations take the place of the context with `policy.privileged_critic`.
        """
        own = keys_read(self.readers, "critic", self.observation)
        state = "robot", *self.policy.further_keys
        if self.config.privileged_critic:
            return (*state, *own)
        return (*state, *(key for key in own if isinstance(key, str)), self.policy.context_key)

    def build_value(self) -> TensorDictModule:
        """Return a state value: writes state_value (N, 1)."""
        value = SingleCritic(self._inputs(), actions=0, heads=1, **self._options())
        return TensorDictModule(value, in_keys=list(self.keys), out_keys=["state_value"]).to(self.device)

    def build_q(self) -> Critic:
        """Return two action values on the observations of `keys` and the move: (2, N, 1)."""
        return Critic(self._inputs(), actions=self._actions, heads=2, **self._options()).to(self.device)

    def build_q_modules(self, count: int, quantiles: int = 1, normalisation: str = "none") -> list[TensorDictModule]:
        """Return `count` action values as TorchRL's losses take them: each writes state_action_value (N, quantiles)."""
        # Each has buffers of its own: TorchRL expands shared ones to views, which `load_state_dict` cannot write.
        options = self._options() | {"outputs": quantiles, "normalisation": normalisation}
        critics = [SingleCritic(self._inputs(), actions=self._actions, heads=1, **options) for _ in range(count)]
        keys = [*self.keys, "move"]
        return [
            TensorDictModule(each, in_keys=keys, out_keys=["state_action_value"]).to(self.device) for each in critics
        ]

    @property
    def _actions(self) -> int:
        return len(self.policy.action_unit)

    def _options(self) -> dict[str, Any]:
        return {"hidden": self.config.critic_hidden, "activation": self.config.activation}

    def _inputs(self) -> list[Normalise | int]:
        context = self.policy.context_key
        return [
            self.policy.encoder.outputs if key == context else further_input(self.observation, key, "critic")
            for key in self.keys
        ]
