"""On-policy learning: advantages, then epochs of minibatches.

Where the grounding is supervised, its loss alone trains the words. The actor then learns from the referent that the
policy attended to when the frame was collected: no gradient step encodes frames, and the likelihood ratio compares two
actors on the same input. Otherwise each minibatch is encoded, and the words are learned through the actor.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.objectives.value.functional import generalized_advantage_estimate

from trainers.algorithms.algorithm import (
    GROUNDING_METRICS,
    Algorithm,
    ExplorationSchedule,
    averages,
    check_batch,
    descend,
    first_steps,
    total_loss,
)
from trainers.algorithms.settings import OnPolicyConfig
from trainers.models.policy import Policy, parameters


class OnPolicyAlgorithm(Algorithm):
    """Trains with an advantage-based loss, which a subclass computes.

    Args:
        critic: writes state_value (N, 1); it may read privileged/goal.
        measured: names of the values that `compute_losses` returns.
    """

    saved = ("policy", "critic", "optimizer")

    def __init__(
        self, config: OnPolicyConfig, policy: Policy, critic: TensorDictModule, measured: Sequence[str]
    ) -> None:
        super().__init__(config, policy)
        self.config, self.critic = config, critic
        self.grounding.gain = config.grounding_gain
        self.metrics = (*measured, "std", "lr", "explained_variance", *GROUNDING_METRICS)
        self.parameters = parameters(policy, critic)
        self.clipped = parameters(policy.encoder), parameters(policy.actor), parameters(critic)
        self.optimizer = self.make_optimizer(self.parameters)
        self.exploration = ExplorationSchedule(policy, config.final_std)
        self.gamma = config.gamma
        self.actor_learns = True
        encoded = (policy.context_key,) if self.grounding.active else policy.encoder_keys
        kept = [*encoded, *policy.actor_keys, "move", "move_log_prob", *critic.in_keys]
        self.frame_keys = [key for key in dict.fromkeys(kept) if key != policy.context_key or self.grounding.active]

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Learn from frames (worlds, steps) of the present policy. progress anneals learning rate and exploration."""
        check_batch(batch)
        rate = self.anneal_learning_rates(progress)
        self.actor_learns = progress >= self.config.critic_warmup
        self.gamma = self.config.discount(progress)
        self.exploration.step(progress)
        batch = batch.to(self.device)
        fresh = self.add_batch_scenes(batch) if self.grounding.active else {}
        frames, explained = self.compute_advantages(batch)
        rows: list[dict[str, Tensor]] = []
        steps, share = -(-len(frames) // self.config.minibatch), self.grounding.share
        for _ in range(self.config.epochs):
            order = torch.randperm(len(frames)).to(self.device)
            minibatches = frames[order].split(self.config.minibatch)
            rows += [self.step(part, scenes) for part, scenes in self.grounding.paired(minibatches, steps, share)]
            if self.stops_early(rows[-1]):
                break
        return averages(rows) | fresh | {"explained_variance": explained, "lr": rate}

    def stops_early(self, row: dict[str, Tensor]) -> bool:
        """Return whether to skip the remaining epochs, given the measured values of the latest gradient step."""
        return False

    @torch.no_grad()
    def add_batch_scenes(self, batch: TensorDictBase) -> dict[str, float]:
        """Keep the scenes of a batch (worlds, steps), and return the accuracy on them before they are learned from.

        Each world adds the scene of its first frame and of every episode that begins later in the batch.
        """
        begins = first_steps(batch, torch.ones_like(batch["next", "done"][:, :1, 0]))
        scenes = batch.select(*self.grounding.keys)[begins.cpu()]
        self.grounding.add(scenes)
        return {"grounding/accuracy": self.grounding.measure_fresh(scenes)}

    def running_state(self) -> dict[str, Any]:
        return {"grounding_error": self.grounding.error}

    def load_running_state(self, state: dict[str, Any]) -> None:
        self.grounding.error = state["grounding_error"]

    @torch.no_grad()
    def compute_advantages(self, batch: TensorDictBase) -> tuple[TensorDictBase, float]:
        """Return frames (worlds x steps) with advantage and value_target, and the critic's explained variance."""
        value, next_value = self.value(batch), self.value(batch["next"])
        advantage, target = advantages(batch["next"], value, next_value, self.gamma, self.config.lmbda)
        explained = 1 - (target - value).var() / target.var().clamp_min(1e-8)
        advantage = (advantage - advantage.mean()) / advantage.std().clamp_min(1e-6)
        frames = batch.select(*self.frame_keys).set("advantage", advantage).set("value_target", target)
        return frames.reshape(-1), float(explained)

    def value(self, frames: TensorDictBase) -> Tensor:
        """Return state values (worlds, steps, 1), in one pass over all frames, which are encoded if they are not."""
        context = self.policy.context_key
        encodes = context in self.critic.in_keys and context not in frames.keys()
        keys = [key for key in self.critic.in_keys if key != context or not encodes]
        flat = frames.select(*keys, *(self.policy.encoder_keys if encodes else ())).reshape(-1)
        if encodes:
            flat = self.policy.encode(flat)
        return self.critic(flat)["state_value"].reshape(*frames.shape, 1)

    def step(self, frames: TensorDictBase, scenes: TensorDictBase | None = None) -> dict[str, Tensor]:
        """One gradient step on a minibatch (B,) for actor and critic, and on scenes (G,) for the grounding."""
        if not self.grounding.active:
            frames = self.policy.encode(frames)
        measured = self.compute_losses(frames)
        loss = total_loss(measured) if self.actor_learns else measured["loss/critic"]
        measured["std"] = self.policy.actor.log_std.exp().mean()
        if scenes is not None:
            measured["loss/grounding"] = self.grounding.measure(scenes)["loss/grounding"]
            loss = loss + self.config.grounding_weight * measured["loss/grounding"]
        # Clipped separately: a large loss of one must not scale down the step of another.
        descend(self.optimizer, loss, frames, self.config.max_grad_norm, *self.clipped)
        return {name: value.detach() for name, value in measured.items()}

    @abstractmethod
    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """Return the scalars that a step on encoded frames (B,) measures; the sum of those named loss/... is minimised.

        The frames have the keys of actor and critic, "move", "move_log_prob" (B,), "advantage" and "value_target"
        (B, 1).
        """


def advantages(
    after: TensorDictBase, value: Tensor, next_value: Tensor, gamma: float, lmbda: float
) -> tuple[Tensor, Tensor]:
    """Return generalised advantages and value targets, (worlds, steps, 1), Schulman et al. 2016 (arXiv:1506.02438).

    A truncated episode bootstraps from `next_value` of its last observation; a terminated one does not.
    TorchRL's loop over the steps takes half a millisecond for 64 x 64 frames. Only its GAE module, which calls the
    value network through vmap, is slow.

    Args:
        after: the "next" of a batch (worlds, steps).
        value: of the frames, (worlds, steps, 1).
        next_value: of their "next".
        gamma: discount factor.
        lmbda: exponential weight of the longer returns.
    """
    done, terminated = after["done"], after["terminated"]
    return generalized_advantage_estimate(gamma, lmbda, value, next_value, after["reward"], done, terminated)
