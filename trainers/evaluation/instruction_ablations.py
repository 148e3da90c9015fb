"""Instruction ablations: the policy acts on blank, swapped or other instructions."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from trainers.evaluation.evaluation import wilson

ABLATIONS = ("said", "blank", "swapped")  # said: no ablation


class AblatedInstructions(TensorDictModuleBase):
    """A policy that receives other instructions than the environment gives.

    Args:
        policy: reads "instruction" and writes "action".
        ablation: "blank": all tokens are padding. "swapped": the instruction that the next world had when this
            world's episode began.
    """

    def __init__(self, policy: TensorDictModuleBase, ablation: str) -> None:
        super().__init__()
        self.policy, self.ablation = policy, ablation
        self.in_keys, self.out_keys = policy.in_keys, policy.out_keys
        self._instructions: Tensor | None = None  # of the last step
        self._swapped = torch.empty(0)

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        """Return act on frames (worlds,). Raises ValueError if the instructions of a single world are to be swapped."""
        instructions = frames["instruction"]
        other = torch.zeros_like(instructions) if self.ablation == "blank" else self._swap(instructions)
        return self.policy(frames.copy().set("instruction", other))

    def _swap(self, instructions: Tensor) -> Tensor:
        if len(instructions) < 2:
            raise ValueError("swapped instructions need at least two worlds")
        if self._instructions is None:
            self._instructions, self._swapped = torch.zeros_like(instructions), torch.zeros_like(instructions)
        started = (instructions != self._instructions).any(1, keepdim=True)
        self._swapped = torch.where(started, instructions.roll(-1, 0), self._swapped)
        self._instructions = instructions.clone()
        return self._swapped


@torch.no_grad()
def run_to_end(env: EnvBase, policy: TensorDictModuleBase, state: TensorDictBase) -> Tensor:
    """Run one episode in each world with the deterministic policy.

    Args:
        env: batch_size (N,).
        policy: writes "action"; it does not receive the privileged keys.
        state: the first observation of the episodes.

    Returns:
        (N,) bool: whether each episode ended in success.
    """
    ended = torch.zeros(env.batch_size, dtype=torch.bool)
    success = torch.zeros(env.batch_size, dtype=torch.bool)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while not ended.all():
            state["action"] = policy(state.exclude("privileged"))["action"]
            state = env.step(state)["next"]
            success |= state["success"].flatten() & ~ended
            ended |= state["done"].flatten()
    return success


def success_in_turn(env: Any, policy: Any, scenes: int, seed: int) -> dict[str, Any]:
    """Return success over episodes that name each object of a scene in turn, with all else equal.

    Where a scene has more episodes than there are worlds, they take turns.

    Raises:
        ConfigError: the task has no instructions.
    """
    if not env.task.traits.speaks:
        raise ConfigError(f"in_turn needs a task with words; {env.config.task.name} has none")
    successes: list[bool] = []
    worlds = env.batch_size[0]
    for scene in range(scenes):
        episodes = env.task.each_in_turn(np.random.default_rng([seed, scene]))
        for first in range(0, len(episodes), worlds):
            part = episodes[first : first + worlds]
            successes += run_to_end(env, policy, env.start(part, seed + scene))[: len(part)].tolist()
    return {
        "scenes": scenes,
        "episodes": len(successes),
        "success_at_end": sum(successes) / len(successes),
        "ci95": list(wilson(sum(successes), len(successes))),
    }
