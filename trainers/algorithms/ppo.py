"""PPO, Schulman et al. 2017 (arXiv:1707.06347), with the clipped surrogate of TorchRL.

The words are grounded once a minibatch, before the loss: the surrogate then sees a small actor on (robot, referent).
The cross-entropy of the attention, over scenes of the whole run, is added to it and alone teaches the words; without it
(grounding_weight=0) they are learned through the actor.
"""

from __future__ import annotations

import math

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.modules import IndependentNormal, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value.functional import generalized_advantage_estimate

from trainers.algorithms import algorithm as learning
from trainers.config import PPOConfig
from trainers.models.grounding import Scenes, grounding
from trainers.models.policy import Policy, parameters

LOSSES = ("loss_objective", "loss_critic", "loss_entropy")
MEASURES = {"entropy": "entropy", "kl_approx": "kl", "clip_fraction": "clip_fraction"}


class PPO:
    """critic: writes state_value; it may read privileged/goal."""

    metrics = (
        "loss/actor", "loss/critic", "loss/entropy", "entropy", "kl", "clip_fraction", "std", "lr",
        "explained_variance", *learning.METRICS,
    )  # fmt: skip

    def __init__(self, config: PPOConfig, policy: Policy, critic: TensorDictModule) -> None:
        self.config, self.policy, self.critic = config, policy, critic
        self.loss = ClipPPOLoss(
            surrogate_actor(policy),
            critic,
            clip_epsilon=config.clip,
            entropy_coeff=config.entropy,
            critic_coeff=config.critic_weight,
            loss_critic_type="l2",
            functional=False,  # networks of its own need no swapping in of parameters
            log_explained_variance=False,
        )
        self.parameters = parameters(policy, critic)
        self.optimizer = torch.optim.Adam(self.parameters, lr=config.lr, fused=True)
        self.device = self.parameters[0].device
        self.first_std = math.exp(max(log_std.max().item() for log_std in policy.noise))
        self.teaches = config.grounding_weight > 0 and policy.attends
        self.scenes = Scenes(config.grounding_memory, self.device, [*policy.reads, *policy.meant])
        self.kept = dict.fromkeys([*policy.reads, *policy.feels, "move", "move_log_prob", *critic.in_keys])
        self.kept.pop(policy.context, None)

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """batch: (worlds, steps) frames of the present policy. progress in [0, 1] anneals the learning rate."""
        learning.check_batch(batch)
        rate = learning.anneal(self.optimizer, self.config, progress)
        self.calm(progress)
        batch = batch.to(self.device)
        fresh = self.understood(self.scenes.remember(batch)) if self.teaches else {}
        frames, explained = self.judge(batch)
        rows: list[dict[str, Tensor]] = []
        for _ in range(self.config.epochs):
            for choice in torch.randperm(len(frames)).split(self.config.minibatch):
                rows.append(self.step(frames[choice.to(self.device)]))
            if self.config.target_kl and float(rows[-1]["kl"]) > 1.5 * self.config.target_kl:
                break
        return learning.averages(rows) | fresh | {"explained_variance": explained, "lr": rate}

    @torch.no_grad()
    def calm(self, progress: float) -> None:
        """Bring the exploration noise down: what only noise ever does (let go of something) the mean must learn."""
        most = self.first_std * (1 - progress) + self.config.final_std * progress
        for log_std in self.policy.noise:
            log_std.clamp_(max=math.log(most))

    @property
    def wants_scenes(self) -> int:
        """How many scenes to give to `study` before each update."""
        return self.config.grounding_scenes if self.teaches else 0

    def study(self, scenes: TensorDictBase) -> None:
        """Keep scenes (count,) that nobody acted in, to learn grounding from."""
        self.scenes.extend(scenes)

    @torch.no_grad()
    def understood(self, scenes: TensorDictBase) -> dict[str, float]:
        """The share of scenes, not learned from yet, in which the words are grounded right."""
        return {"grounding/accuracy": float(grounding(self.policy.encode(scenes))[1])}

    @torch.no_grad()
    def judge(self, batch: TensorDictBase) -> tuple[TensorDictBase, float]:
        """Frames (worlds x steps) with their advantage and value_target, and the variance that the critic explains."""
        value, next_value = self.value(batch), self.value(batch["next"])
        advantage, target = advantages(batch["next"], value, next_value, self.config.gamma, self.config.lmbda)
        explained = 1 - (target - value).var() / target.var().clamp_min(1e-8)
        advantage = (advantage - advantage.mean()) / advantage.std().clamp_min(1e-6)
        frames = batch.select(*self.kept).set("advantage", advantage).set("value_target", target)
        return frames.reshape(-1), float(explained)

    def value(self, batch: TensorDictBase) -> Tensor:
        """State values (worlds, steps, 1), in one pass over all frames."""
        reads_words = self.policy.context in self.critic.in_keys
        keys = [key for key in self.critic.in_keys if key != self.policy.context]
        flat = batch.select(*keys, *(self.policy.reads if reads_words else ())).reshape(-1)
        if reads_words:
            flat = self.policy.encode(flat)
        return self.critic(flat)["state_value"].reshape(*batch.shape, 1)

    def step(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """One step of the optimizer on a minibatch (B,)."""
        with torch.set_grad_enabled(not self.teaches):  # taught words learn from scenes: reward is noise beside that
            frames = self.policy.encode(frames)
        out = self.loss(frames)
        loss = sum(out[name] for name in LOSSES)
        measured = {
            "loss/actor": out["loss_objective"],
            "loss/critic": out["loss_critic"],
            "loss/entropy": out["loss_entropy"],
            "std": self.policy.gaussian.log_std.exp().mean(),
            **{name: out[key] for key, name in MEASURES.items()},
        }
        if self.teaches:
            taught = grounding(self.policy.encode(self.scenes.sample(self.config.grounding_batch)))
            measured["loss/grounding"] = taught[0]
            loss = loss + self.config.grounding_weight * taught[0]
        learning.check_loss(loss, frames)
        self.optimizer.zero_grad()
        loss.backward()
        for part in (self.policy, self.critic):  # each by itself: a surprised critic must not slow the actor down
            nn.utils.clip_grad_norm_(part.parameters(), self.config.max_grad_norm)
        self.optimizer.step()
        return {name: value.detach() for name, value in measured.items()}

    def state_dict(self) -> dict:
        """Everything that learning goes on from."""
        return {name: getattr(self, name).state_dict() for name in ("policy", "critic", "optimizer")}

    def load_state_dict(self, state: dict) -> None:
        for name in ("policy", "critic", "optimizer"):
            getattr(self, name).load_state_dict(state[name])


def advantages(
    after: TensorDictBase, value: Tensor, next_value: Tensor, gamma: float, lmbda: float
) -> tuple[Tensor, Tensor]:
    """Generalised advantages and value targets, (worlds, steps, 1), Schulman et al. 2016 (arXiv:1506.02438).

    after: the "next" of a batch (worlds, steps). An episode that ran out of time is worth what its last observation
    promises (`next_value`); one that terminated is worth nothing more.
    TorchRL's loop over the steps takes half a millisecond for 64 x 64 frames: only its GAE module, which calls the
    value network through vmap, is slow.
    """
    done, terminated = after["done"], after["terminated"]
    return generalized_advantage_estimate(gamma, lmbda, value, next_value, after["reward"], done, terminated)


def surrogate_actor(policy: Policy) -> ProbabilisticActor:
    """The policy's second half, (robot, context) to the distribution of "move", as TorchRL's losses take it."""
    robot, *more = policy.feels
    return ProbabilisticActor(
        TensorDictModule(policy.gaussian, in_keys=[robot, policy.context, *more], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        out_keys=["move"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )
