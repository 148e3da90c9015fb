"""Imitation of an expert that labels every state the policy meets: DAgger, Ross et al. 2011 (arXiv:1011.0686).

All labelled frames are kept, and the mean move is regressed on the expert's, both before the tanh. As with all other
algorithms, the grounding loss trains the words.
"""

from __future__ import annotations

import math
from typing import Any

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, ReplayBuffer, TensorDictReplayBuffer

from trainers.algorithms.algorithm import (
    GROUNDING_METRICS,
    ReplayAlgorithm,
    apply_gradients,
    averages,
    backward,
    check_batch,
    check_loss,
    first_steps,
    one_thread,
    run_parts,
    total_loss,
)
from trainers.algorithms.compiled import loss_gradients
from trainers.algorithms.settings import BCConfig
from trainers.environment import Relabel
from trainers.models.critics import CriticBuilder
from trainers.models.policy import ExpertMixture, Policy, expert_move, parameters

FULL = 0.95  # of the largest move, which labels have at most: that of 1 has no finite preimage
BOUND = 0.9999  # of a mean whose preimage is computed
WIDTH = 0.1  # of a move: the loss is quadratic in smaller errors and linear in larger ones


class BC(ReplayAlgorithm):
    """Collects with a mixture of policy and expert; learns from all frames collected so far."""

    metrics: tuple[str, ...] = ("loss/imitation", "expert_share", "updates", "lr", *GROUNDING_METRICS)

    def __init__(self, config: BCConfig, policy: Policy) -> None:
        super().__init__(config, policy)
        self.config: BCConfig = config
        self.parameters = parameters(policy)
        self.optimizer = self.make_optimizer(self.parameters)
        self.mixture = ExpertMixture(policy)
        self.frames = TensorDictReplayBuffer(storage=LazyTensorStorage(config.buffer, device=self.device))
        self.gradients = loss_gradients(self.imitation_loss, self.parameters, self.compiles)
        context = [policy.context_key] if self.grounding.active else list(policy.encoder_keys)
        self.frame_keys = list(dict.fromkeys([*policy.actor_keys, *context]))
        with torch.no_grad():
            for log_std in policy.log_stds:
                log_std.fill_(math.log(config.std))

    @classmethod
    def build(cls, config: BCConfig, policy: Policy, critics: CriticBuilder, relabel: Relabel | None) -> BC:
        return cls(config, policy)

    @property
    def behaviour(self) -> ExpertMixture:
        return self.mixture

    @property
    def memories(self) -> dict[str, ReplayBuffer]:
        return super().memories | {"frames": self.frames}

    def running_state(self) -> dict[str, Any]:
        return {"pending_steps": self.pending_steps, "expert_share": float(self.mixture.expert_share)}

    def load_running_state(self, state: dict[str, Any]) -> None:
        self.pending_steps = state["pending_steps"]
        self.mixture.expert_share.fill_(state["expert_share"])

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Keep a batch of labelled frames (worlds, steps), and take the gradient steps that are due.

        progress anneals the learning rate and the expert's share of the steps that are collected next.
        """
        check_batch(batch)
        rate = self.anneal_learning_rates(progress)
        share = float(self.mixture.expert_share)
        self.mixture.expert_share.fill_(max(0.0, 1.0 - progress / max(self.config.expert_until, 1e-9)))
        batch = batch.to(self.device)
        if self.grounding.active:
            begins = first_steps(batch, torch.ones_like(batch["next", "done"][:, :1, 0]))
            self.grounding.add(batch.select(*self.grounding.keys)[begins])
        self.frames.extend(self.labelled(batch.reshape(-1)))
        steps = self.due_steps(batch.numel())
        return averages(self.learn(steps)) | {"expert_share": share, "updates": float(steps), "lr": rate}

    def labelled(self, frames: TensorDictBase) -> TensorDictBase:
        """Return what is kept of frames (B,): the inputs of actor or encoder, and the expert's "move"."""
        frames = frames.copy()
        if self.grounding.active:
            self.policy.encoder.select_labelled(frames)
        return frames.select(*self.frame_keys).set("move", expert_move(frames, self.policy))

    def sample(self, steps: int) -> TensorDictBase:
        return self.frames.sample(steps * self.config.batch)

    def step(self, frames: TensorDictBase, scenes: TensorDictBase | None = None) -> dict[str, Tensor]:
        """One gradient step on frames (B,) for the actor and, where the words are supervised, on scenes (G,)."""
        self.optimizer.zero_grad()
        measured = run_parts(self.gradients.parts(frames))
        if scenes is not None:
            measured |= backward(self.grounding.measure(scenes), self.parameters, self.config.grounding_weight)
        check_loss(total_loss(measured), frames)
        with one_thread():
            apply_gradients(self.optimizer, self.config.max_grad_norm, self.parameters)
        return measured

    def imitation_loss(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """Return the distance of the mean moves on frames (B,) from the expert's, after encoding them if needed."""
        if not self.grounding.active:
            self.policy.encode(frames, traced=self.compiles)
        move, _ = self.policy.move_parameters(frames)
        return {"loss/imitation": F.smooth_l1_loss(preimage(move), preimage(FULL * frames["move"]), beta=WIDTH)}


def preimage(move: Tensor) -> Tensor:
    """Return the inverse of the actor's tanh.

    The loss compares preimages, because a saturated tanh has no gradient: a gripper command that is right in nearly all
    states could then not be corrected in the few states where the opposite is right.
    """
    return torch.atanh(move.clamp(-BOUND, BOUND))
