"""On-policy learning: advantages, then epochs of minibatches, with any on-policy loss module of TorchRL.

The words are encoded once per minibatch, before the loss, so the loss sees a small actor on (robot, referent). Where
the grounding is supervised, its loss is added and alone trains the words; otherwise they are learned through the actor.
"""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.objectives.value.functional import generalized_advantage_estimate

from trainers.algorithms.algorithm import (
    Algorithm,
    ExplorationSchedule,
    anneal_learning_rate,
    averages,
    check_batch,
    descend,
    total_loss,
)
from trainers.algorithms.base_config import OnPolicyConfig
from trainers.algorithms.grounding_supervision import METRICS, first_steps
from trainers.models.policy import Policy, parameters

# Outputs of TorchRL's losses, and the names that they are reported under.
OUTPUTS = {
    "loss_objective": "loss/actor",
    "loss_critic": "loss/critic",
    "loss_entropy": "loss/entropy",
    "entropy": "entropy",
    "kl_approx": "kl",
    "clip_fraction": "clip_fraction",
}


class OnPolicyAlgorithm(Algorithm):
    """Trains with an advantage-based loss.

    Args:
        critic: writes state_value (N, 1); it may read privileged/goal.
        loss: reads the actor's keys, "move", "move_log_prob", "advantage", "value_target" and the critic's keys. It
            must be built with functional=False: its networks are not shared, so no parameters need to be swapped in.
    """

    saved = ("policy", "critic", "optimizer")

    def __init__(self, config: OnPolicyConfig, policy: Policy, critic: TensorDictModule, loss: Any) -> None:
        super().__init__(config, policy)
        self.config, self.critic, self.loss = config, critic, loss
        self.outputs = {key: name for key, name in OUTPUTS.items() if key in loss.out_keys}
        self.metrics = (*self.outputs.values(), "std", "lr", "explained_variance", *METRICS)
        self.parameters = parameters(policy, critic)
        self.optimizer = torch.optim.Adam(self.parameters, lr=config.lr, fused=True)
        self.exploration = ExplorationSchedule(policy, config.final_std)
        kept = [*policy.encoder_keys, *policy.actor_keys, "move", "move_log_prob", *critic.in_keys]
        self.frame_keys = [key for key in dict.fromkeys(kept) if key != policy.context_key]

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Learn from frames (worlds, steps) of the present policy. progress anneals learning rate and exploration."""
        check_batch(batch)
        rate = anneal_learning_rate(self.optimizer, self.config.lr, self.config.anneal_lr, progress)
        self.exploration.step(progress)
        batch = batch.to(self.device)
        fresh = self.add_batch_scenes(batch) if self.grounding.active else {}
        frames, explained = self.compute_advantages(batch)
        rows: list[dict[str, Tensor]] = []
        for _ in range(self.config.epochs):
            for choice in torch.randperm(len(frames)).split(self.config.minibatch):
                rows.append(self.step(frames[choice.to(self.device)]))
            if self.stops_early(rows[-1]):
                break
        return averages(rows) | fresh | {"explained_variance": explained, "lr": rate}

    def stops_early(self, row: dict[str, Tensor]) -> bool:
        """Whether the remaining epochs are left out, given what the latest gradient step measured."""
        return False

    @torch.no_grad()
    def add_batch_scenes(self, batch: TensorDictBase) -> dict[str, float]:
        """Keep the scenes of a batch (worlds, steps), and return the accuracy on them before they are learned from.

        Each world adds the scene of its first frame and of every episode that begins later in the batch.
        """
        begins = first_steps(batch, torch.ones_like(batch["next", "done"][:, :1, 0]))
        scenes = batch.select(*self.grounding.keys)[begins.cpu()]
        self.grounding.add(scenes)
        return {"grounding/accuracy": float(self.grounding.measure(scenes)["grounding/accuracy"])}

    @torch.no_grad()
    def compute_advantages(self, batch: TensorDictBase) -> tuple[TensorDictBase, float]:
        """Frames (worlds x steps) with normalised advantage and value_target, and the critic's explained variance."""
        value, next_value = self.value(batch), self.value(batch["next"])
        advantage, target = advantages(batch["next"], value, next_value, self.config.gamma, self.config.lmbda)
        explained = 1 - (target - value).var() / target.var().clamp_min(1e-8)
        advantage = (advantage - advantage.mean()) / advantage.std().clamp_min(1e-6)
        frames = batch.select(*self.frame_keys).set("advantage", advantage).set("value_target", target)
        return frames.reshape(-1), float(explained)

    def value(self, batch: TensorDictBase) -> Tensor:
        """State values (worlds, steps, 1), in one pass over all frames."""
        reads_context = self.policy.context_key in self.critic.in_keys
        keys = [key for key in self.critic.in_keys if key != self.policy.context_key]
        flat = batch.select(*keys, *(self.policy.encoder_keys if reads_context else ())).reshape(-1)
        if reads_context:
            flat = self.policy.encode(flat)
        return self.critic(flat)["state_value"].reshape(*batch.shape, 1)

    def step(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """One gradient step on a minibatch (B,)."""
        # The reward is a noisy teacher of words: supervised ones are trained on scenes alone.
        with torch.set_grad_enabled(not self.grounding.active):
            frames = self.policy.encode(frames)
        out = self.loss(frames)
        measured = {name: out[key] for key, name in self.outputs.items()}
        loss = total_loss(measured)
        measured["std"] = self.policy.actor.log_std.exp().mean()
        if self.grounding.active:
            measured["loss/grounding"] = self.grounding.measure(self.grounding.sample()[0])["loss/grounding"]
            loss = loss + self.grounding.config.grounding_weight * measured["loss/grounding"]
        parts = self.policy.parameters(), self.critic.parameters()
        # Clipped separately: a large critic loss must not scale down the actor's step.
        descend(self.optimizer, loss, frames, self.config.max_grad_norm, *parts)
        return {name: value.detach() for name, value in measured.items()}


def advantages(
    after: TensorDictBase, value: Tensor, next_value: Tensor, gamma: float, lmbda: float
) -> tuple[Tensor, Tensor]:
    """Generalised advantages and value targets, (worlds, steps, 1), Schulman et al. 2016 (arXiv:1506.02438).

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
