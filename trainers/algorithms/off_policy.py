"""Off-policy learning: replay, hindsight relabelling, grounding supervision and gradient steps."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor, nn
from torchrl.data import ReplayBuffer

from trainers.algorithms.algorithm import (
    GROUNDING_METRICS,
    Part,
    ReplayAlgorithm,
    adam_step,
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
from trainers.algorithms.compiled import Losses, LossGradients, loss_gradients
from trainers.algorithms.replay import ExpertFrames, Relabel, Relabelling, Replay
from trainers.algorithms.settings import OffPolicyConfig
from trainers.models.policy import ExpertMixture, Policy, parameters


class OffPolicyAlgorithm(ReplayAlgorithm):
    """Takes `updates_per_frame` gradient steps on replayed frames for each collected one.

    A subclass sets `optimizer` and defines `compute_losses` and, if it needs to, `after_step`.

    Args:
        critic_keys: the keys that the critic reads beside the move.
        relabel: the environment's `hindsight`; None: no relabelling.
    """

    metrics: tuple[str, ...] = ("updates", "relabelled", *GROUNDING_METRICS)

    def __init__(
        self,
        config: OffPolicyConfig,
        policy: Policy,
        critic_keys: Sequence[NestedKey],
        relabel: Relabel | None = None,
    ) -> None:
        super().__init__(config, policy)
        self.config: OffPolicyConfig = config
        self.critic_keys = tuple(critic_keys)
        self.actor_parameters = parameters(policy)
        self.replay = Replay(
            policy, critic_keys, capacity=config.buffer, device=self.device, supervised=self.grounding.active
        )
        self.demonstrations: ExpertFrames | None = None
        if config.demonstrations:
            self.demonstrations = ExpertFrames(
                policy, critic_keys, config, device=self.device, supervised=self.grounding.active
            )
        self.relabelling = Relabelling(relabel, config.hindsight)
        self.starts: Tensor | None = None  # (worlds, 1) whether the next frame begins an episode
        self.steps_taken = 0

    @property
    def behaviour(self) -> Policy | ExpertMixture:
        return self.policy if self.demonstrations is None else self.demonstrations.mixture

    @property
    def memories(self) -> dict[str, ReplayBuffer]:
        shown = {} if self.demonstrations is None else {"demonstrations": self.demonstrations.replay.frames}
        return super().memories | {"frames": self.replay.frames} | shown

    def running_state(self) -> dict[str, Any]:
        counts = {"pending_steps": self.pending_steps, "steps_taken": self.steps_taken}
        episodes = {"starts": self.starts, "unfinished": self.relabelling.state_dict()}
        shown = {} if self.demonstrations is None else self.demonstrations.running_state()
        return counts | episodes | shown

    def load_running_state(self, state: dict[str, Any]) -> None:
        self.pending_steps, self.steps_taken = state["pending_steps"], state["steps_taken"]
        self.starts = state["starts"]
        self.relabelling.load_state_dict(state["unfinished"])
        if self.demonstrations is not None:
            self.demonstrations.load_running_state(state)

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Add a batch (worlds, steps) to the replay buffer, then take the gradient steps that are due.

        progress anneals the learning rate.
        """
        check_batch(batch)
        self.anneal_learning_rates(progress)
        relabelled = self.relabelling(batch)
        self.add_batch_scenes(batch, relabelled)
        if self.demonstrations is not None and self.demonstrations.add(batch):
            return {"updates": 0.0}
        for frames in (batch, *relabelled):
            self.replay.extend(frames)
        starts = self.config.learning_starts if self.demonstrations is None else 0
        if len(self.replay) < max(starts, self.config.batch):
            return {"updates": 0.0}
        steps = self.due_steps(batch.numel())
        if not steps:
            return {"updates": 0.0}
        counts = {"updates": steps, "relabelled": sum(len(episode) for episode in relabelled)}
        return averages(self.learn(steps)) | {name: float(count) for name, count in counts.items()}

    def observed(self, frames: TensorDictBase) -> list[Tensor]:
        """Return what the critic reads of frames (B,) beside the move."""
        return [frames[key] for key in self.critic_keys]

    def add_batch_scenes(self, batch: TensorDictBase, relabelled: Sequence[TensorDictBase]) -> None:
        """Keep the scenes of episodes that begin in a batch (worlds, steps), and those of relabelled episodes."""
        done = batch["next", "done"][..., 0]
        starts = torch.ones_like(done[:, :1]) if self.starts is None else self.starts
        begins, self.starts = first_steps(batch, starts), done[:, -1:].clone()
        for scenes in (batch[begins], *(episode[:1] for episode in relabelled)):
            if self.grounding.active and len(scenes):
                self.grounding.add(scenes.select(*self.grounding.keys))

    def sample(self, steps: int) -> TensorDictBase:
        """Return the frames of `steps` batches in a row; half of each are demonstrations, where there are any."""
        if self.demonstrations is None:
            return self.replay.sample(steps * self.config.batch)
        shown = self.config.batch // 2
        parts = (
            source.sample(steps * count).reshape(steps, count)
            for source, count in ((self.replay, self.config.batch - shown), (self.demonstrations.replay, shown))
        )
        return torch.cat(list(parts), 1).reshape(-1)

    def step(self, frames: TensorDictBase, scenes: TensorDictBase | None = None) -> dict[str, Tensor]:
        """One gradient step on frames (B,) for actor and critics, and on scenes (G,) for the grounding."""
        self.optimizer.zero_grad()
        measured = run_parts(self.parts(frames, scenes))
        check_loss(total_loss(measured), frames)
        self.descend()
        with one_thread():
            self.steps_taken += 1
            self.after_step(frames)
        return measured

    def descend(self) -> None:
        """Take the optimizer's step. Where steps are compiled, on a thread for the actor and one for the others."""
        actor, norm = self.actor_parameters, self.config.max_grad_norm
        if not self.compiles:
            with one_thread():
                apply_gradients(self.optimizer, norm, actor)
            return

        def others() -> dict[str, Tensor]:
            chosen = set(actor)
            adam_step(self.optimizer, [parameter for parameter in self.learned if parameter not in chosen])
            return {}

        def clipped() -> dict[str, Tensor]:
            nn.utils.clip_grad_norm_(actor, norm)
            adam_step(self.optimizer, actor)
            return {}

        run_parts([others, clipped])

    def parts(self, frames: TensorDictBase, scenes: TensorDictBase | None) -> list[Part]:
        """Return the parts of a gradient step, the longest first. Each measures losses and adds their gradients."""
        if not self.compiles:
            self.encode(frames)

        parts = self._gradients.parts(frames, variant=self.variant)
        if scenes is None:
            return parts
        if self.compiles:
            return [partial(self.descend_grounding, scenes), *parts]
        return [lambda: parts[0]() | self.descend_grounding(scenes)]

    @cached_property
    def _gradients(self) -> LossGradients:
        return self.gradients(self.compute_losses, self.learned)

    @property
    def variant(self) -> object:
        """What tells apart gradient steps that compute different losses; a compiled step is one of one variant."""
        return None

    def gradients(self, losses: Losses, parameters: Sequence[Tensor]) -> LossGradients:
        """Return what measures losses of frames (B,) and further tensors, and adds their gradients.

        It is given encoded frames, except where `compiles`: then it encodes them.

        Args:
            losses: from encoded frames and the further tensors to scalars.
            parameters: that are given gradients.
        """

        def encoded(frames: TensorDictBase, *tensors: Tensor) -> dict[str, Tensor]:
            frames = frames.copy()  # other parts of the step read them, too
            self.encode(frames)
            return losses(frames, *tensors)

        modules = [getattr(self, name) for name in self.saved if name != "optimizer"]
        buffers = [buffer for module in modules for buffer in module.buffers()]
        return loss_gradients(encoded if self.compiles else losses, parameters, self.compiles, buffers)

    def descend_grounding(self, scenes: TensorDictBase) -> dict[str, Tensor]:
        """Measure the grounding loss on scenes (G,) and add its gradients."""
        measured = self.grounding.measure(scenes)
        return backward(measured, self.actor_parameters, self.config.grounding_weight)

    def losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """`compute_losses`, after encoding the words if they are not supervised."""
        self.encode(frames)
        return self.compute_losses(frames)

    def encode(self, frames: TensorDictBase) -> None:
        """Encode the words of frames (B,) where they are not supervised."""
        if not self.grounding.active:
            self.policy.encode_transition(frames, frames["next"], traced=self.compiles)

    @abstractmethod
    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """Return the scalars that a gradient step on frames (B,) measures; the sum of those named loss/...

        is minimised.
        """

    def after_step(self, frames: TensorDictBase) -> None:
        """Called after each gradient step on frames (B,): moves target networks."""
