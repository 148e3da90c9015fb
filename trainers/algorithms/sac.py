"""SAC with automatic temperature, Haarnoja et al. 2018 (arXiv:1812.05905), update written out.

TorchRL's SACLoss computes the same three losses in 17 ms a step at batch 256 and 256 x 256 on one core (12 ms
compiled); the lines below take about 7 ms. The difference is in swapping parameters in and out of modules, vmap over
the two critics, TensorDict copies and, in distributions, transforms and their caches. The replay buffer is TorchRL's.

Words that are taught learn from scenes of the whole run, as in PPO, and frames are remembered with the rows of what was
truly meant: to steer, no word has to be read, and whatever is learned of them later fits frames recorded before.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from trainers.algorithms import algorithm as learning
from trainers.algorithms.relabelling import Hindsight, Relabel
from trainers.config import SACConfig
from trainers.models.grounding import REFERENT, Scenes, grounding
from trainers.models.networks import Critic, normal_log_prob
from trainers.models.policy import Policy, parameters


class SAC:
    """critic: two action values on (robot, aim, move). aim: the key of what it judges by.

    relabel: tells episodes again in hindsight; none: there is nobody who can.
    """

    metrics = (
        "loss/actor",
        "loss/critic",
        "loss/alpha",
        "entropy",
        "alpha",
        "q",
        "updates",
        "relabelled",
        *learning.METRICS,
    )

    def __init__(
        self,
        config: SACConfig,
        policy: Policy,
        critic: Critic,
        aim: str | tuple[str, str],
        relabel: Relabel | None = None,
    ) -> None:
        self.config, self.policy, self.critic, self.aim = config, policy, critic, aim
        self.target = copy.deepcopy(critic).requires_grad_(False)
        self.actor_parameters, self.critic_parameters = parameters(policy), parameters(critic)
        self.target_parameters: list[Tensor] = list(self.target.parameters())
        self.device = self.actor_parameters[0].device
        self.log_alpha = torch.tensor(math.log(config.initial_alpha), device=self.device, requires_grad=True)
        learned = [*self.actor_parameters, *self.critic_parameters, self.log_alpha]
        self.optimizer = torch.optim.Adam(learned, lr=config.lr, fused=True)
        self.wanted_entropy = config.target_entropy * len(policy.unit)
        self.memory = TensorDictReplayBuffer(storage=LazyTensorStorage(config.buffer, device=self.device))
        self.teaches = config.grounding_weight > 0 and policy.attends
        self.scenes = Scenes(config.grounding_memory, self.device, [*policy.reads, *policy.meant])
        self.hindsight = Hindsight(relabel, config.hindsight)
        self.begins: Tensor | None = None  # (worlds, 1) whether the next frame begins an episode
        self.owed = 0.0  # gradient steps earned by frames and not yet taken

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Remember a batch (worlds, steps), then take `updates_per_frame` steps for each frame.

        progress in [0, 1] anneals the learning rate.
        """
        learning.check_batch(batch)
        learning.anneal(self.optimizer, self.config, progress)
        relabelled = self.hindsight(batch)
        for frames in (batch, *relabelled):
            self.remember(frames)
        self.meet(batch, relabelled)
        if len(self.memory) < max(self.config.learning_starts, self.config.batch):
            return {"updates": 0.0}
        self.owed += batch.numel() * self.config.updates_per_frame
        steps, self.owed = int(self.owed), self.owed % 1.0
        if not steps:
            return {"updates": 0.0}
        counts = {"updates": steps, "relabelled": sum(len(episode) for episode in relabelled)}
        return learning.averages(self.learn(steps)) | {name: float(count) for name, count in counts.items()}

    def learn(self, steps: int) -> list[dict[str, Tensor]]:
        """So many gradient steps. Of frames and scenes there is one draw for all: its own cost is then paid once."""
        frames = self.memory.sample(steps * self.config.batch).split(self.config.batch)
        if not self.teaches:
            return [self.step(part) for part in frames]
        # Reading costs more than steering, and is learned in fewer steps.
        every, count = self.config.grounding_every, self.config.grounding_batch
        scenes = self.scenes.sample(-(-steps // every) * count).split(count)
        return [self.step(part, None if i % every else scenes[i // every]) for i, part in enumerate(frames)]

    def remember(self, batch: TensorDictBase) -> None:
        """Add frames (...), with only the keys that learning reads."""
        context = self.policy.context
        steers = [*self.policy.feels, context] if self.teaches else [*self.policy.feels, *self.policy.words.sees]
        kept = dict.fromkeys([*steers, *([] if self.aim == context else [self.aim])])
        after = [("next", *(key if isinstance(key, tuple) else (key,))) for key in [*kept, "reward", "terminated"]]
        frames = batch.reshape(-1)
        frames = frames.copy().set("next", frames["next"].copy())
        for end in (frames, frames["next"]):
            if self.teaches:
                self.policy.words.tell(end)
            else:
                self.policy.words.beware(end, end[REFERENT])
        self.memory.extend(frames.select(*kept, *([] if self.teaches else ["instruction"]), "move", *after))

    def meet(self, batch: TensorDictBase, relabelled: Sequence[TensorDictBase]) -> None:
        """Add the scenes that begin in a batch (worlds, steps), or that it begins with, and those told anew."""
        done = batch["next", "done"][..., 0]
        first = torch.ones_like(done[:, :1]) if self.begins is None else self.begins
        begins, self.begins = torch.cat([first, done[:, :-1]], 1), done[:, -1:].clone()
        for scenes in (batch[begins], *(episode[:1] for episode in relabelled)):
            if self.teaches and len(scenes):
                self.scenes.extend(scenes.select(*self.scenes.keys))

    def step(self, frames: TensorDictBase, scenes: TensorDictBase | None = None) -> dict[str, Tensor]:
        """One gradient step on frames (B,) for critics, actor and temperature, and on scenes (G,) for the grounding."""
        measured = self.losses(frames)
        loss = measured["loss/critic"] + measured["loss/actor"] + measured["loss/alpha"]
        if scenes is not None:
            measured |= dict(zip(learning.METRICS, grounding(self.policy.encode(scenes)), strict=True))
            loss = loss + self.config.grounding_weight * measured["loss/grounding"]
        learning.check_loss(loss, frames)
        self.optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.actor_parameters, self.config.max_grad_norm)
        self.optimizer.step()
        with torch.no_grad():
            torch._foreach_lerp_(self.target_parameters, self.critic_parameters, self.config.tau)
        return {name: value.detach() for name, value in measured.items()}

    def losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """The three losses; no gradient of one reaches the parameters of another."""
        alpha = self.log_alpha.detach().exp()
        after = frames["next"]
        if not self.teaches:
            self.policy.encode_step(frames, after)
        with torch.no_grad():
            # terminated, not done: a frame that ended by time is worth what follows it.
            action, log_prob = self.act(after)
            promise = self.target(after["robot"], after[self.aim], action).amin(0) - alpha * log_prob
            wanted = after["reward"] + self.config.gamma * promise * ~after["terminated"]
        q = self.critic(frames["robot"], frames[self.aim], frames["move"])
        action, log_prob = self.act(frames)
        with frozen(self.critic_parameters):  # and so no time is spent on their gradients
            worth = self.critic(frames["robot"], frames[self.aim], action).amin(0)
        return {
            "loss/critic": F.mse_loss(q, wanted.expand_as(q)) * len(q),
            "loss/actor": (alpha * log_prob - worth).mean(),
            "loss/alpha": -self.log_alpha * (log_prob.detach().mean() + self.wanted_entropy),
            "entropy": -log_prob.mean(),
            "alpha": alpha,
            "q": q.mean(),
        }

    def act(self, frames: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Actions (B, A), differentiable, and their log-probability (B, 1)."""
        return squashed(*self.policy.steer(frames))

    @property
    def wants_scenes(self) -> int:
        """How many scenes to give to `study` before each update."""
        return self.config.grounding_scenes if self.teaches else 0

    def study(self, scenes: TensorDictBase) -> None:
        """Keep scenes (count,) that nobody acted in, to learn grounding from."""
        self.scenes.extend(scenes)

    def state_dict(self) -> dict:
        """Everything that learning goes on from, without the memory."""
        parts = {name: getattr(self, name).state_dict() for name in ("policy", "critic", "target", "optimizer")}
        return parts | {"log_alpha": self.log_alpha.detach()}

    def load_state_dict(self, state: dict) -> None:
        for name in ("policy", "critic", "target", "optimizer"):
            getattr(self, name).load_state_dict(state[name])
        with torch.no_grad():
            self.log_alpha.copy_(state["log_alpha"])


@contextmanager
def frozen(parameters: Iterable[Tensor]) -> Iterator[None]:
    """Within this block the parameters take no gradients, while what flows through them does."""
    for parameter in parameters:
        parameter.requires_grad_(False)
    try:
        yield
    finally:
        for parameter in parameters:
            parameter.requires_grad_(True)


def squashed(loc: Tensor, scale: Tensor) -> tuple[Tensor, Tensor]:
    """A sample of tanh(Normal(loc, scale)), (B, A), and its log-probability, (B, 1)."""
    noise = torch.randn_like(loc)
    x = loc + scale * noise
    slope = 2 * (math.log(2) - x - F.softplus(-2 * x))  # log(1 - tanh(x)^2) without cancellation
    return x.tanh(), (normal_log_prob(noise, scale) - slope).sum(-1, keepdim=True)
