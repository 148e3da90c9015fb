"""Does it listen? What becomes of the policy when the words are others, or when only the words are others."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

HEARD = ("said", "blank", "swapped")


class Misheard(TensorDictModuleBase):
    """The policy, with other words than were said.

    heard: "blank": none at all. "swapped": those that the next world was told when this world's episode began.
    Raises ValueError for swapped words of a single world.
    """

    def __init__(self, policy: TensorDictModuleBase, heard: str) -> None:
        super().__init__()
        self.policy, self.heard = policy, heard
        self.in_keys, self.out_keys = policy.in_keys, policy.out_keys
        self._said: Tensor | None = None
        self._others = torch.empty(0)

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        said = frames["instruction"]
        frames = frames.copy().set("instruction", torch.zeros_like(said) if self.heard == "blank" else self._swap(said))
        return self.policy(frames)

    def _swap(self, said: Tensor) -> Tensor:
        if len(said) < 2:
            raise ValueError("words can be swapped between two worlds at least")
        if self._said is None:
            self._said, self._others = torch.zeros_like(said), torch.zeros_like(said)
        begins = (said != self._said).any(1, keepdim=True)
        self._others = torch.where(begins, said.roll(-1, 0), self._others)
        self._said = said.clone()
        return self._others


@torch.no_grad()
def run_to_end(env: EnvBase, policy: TensorDictModuleBase, state: TensorDictBase) -> Tensor:
    """(N,) bool, in which worlds the episode that `state` begins ends in success, with the deterministic policy."""
    ended = torch.zeros(env.batch_size, dtype=torch.bool)
    success = torch.zeros(env.batch_size, dtype=torch.bool)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while not ended.all():
            state["action"] = policy(state.exclude("privileged"))["action"]
            state = env.step(state)["next"]
            success |= state["success"].flatten() & ~ended
            ended |= state["done"].flatten()
    return success
