"""Replay of frames for off-policy algorithms: what is kept, relabelled with achieved goals, or shown by an expert."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from trainers.algorithms.settings import OffPolicyConfig
from trainers.environment import Relabel
from trainers.models.grounding import REFERENT
from trainers.models.policy import LABEL, ExpertMixture, Policy


class Replay:
    """Frames with their "next", drawn evenly.

    Supervised words are not stored. The frames then hold the rows of the labelled slots, so they stay valid while the
    words are being learned. Unsupervised words are stored and encoded again at each gradient step.

    Args:
        policy: chooses the keys and writes the labelled rows.
        critic_keys: the keys that the critic reads beside the move.
        capacity: frames.
        device: of the buffer.
        supervised: whether the grounding loss trains the words.
    """

    def __init__(
        self,
        policy: Policy,
        critic_keys: Sequence[NestedKey],
        *,
        capacity: int,
        device: torch.device,
        supervised: bool,
    ) -> None:
        self.policy, self.supervised = policy, supervised
        context = [policy.context_key] if supervised else list(policy.encoder.scene_keys)
        critic = [key for key in critic_keys if key != policy.context_key]
        self.state_keys = list(dict.fromkeys([*policy.actor_keys, *context, *critic]))
        self.frames = TensorDictReplayBuffer(storage=LazyTensorStorage(capacity, device=device))

    def __len__(self) -> int:
        return len(self.frames)

    def extend(self, batch: TensorDictBase) -> None:
        """Add frames (...)."""
        frames = batch.reshape(-1)
        frames = frames.copy().set("next", frames["next"].copy())
        for end in (frames, frames["next"]):
            if self.supervised:
                self.policy.encoder.select_labelled(end)
            else:
                self.policy.encoder.write_obstacle(end, end[REFERENT])
        after = [
            ("next", *(key if isinstance(key, tuple) else (key,))) for key in (*self.state_keys, "reward", "terminated")
        ]
        words = [] if self.supervised else ["instruction"]
        self.frames.extend(frames.select(*self.state_keys, *words, "move", *after))

    def sample(self, count: int) -> TensorDictBase:
        """Return frames (count,)."""
        return self.frames.sample(count)


class Relabelling:
    """Collects the episodes that end, and asks the environment to relabel them.

    Args:
        relabel: the environment's `hindsight`; None: no relabelling.
        copies: relabelled copies of each episode; a fraction is a probability.
    """

    def __init__(self, relabel: Relabel | None, copies: float) -> None:
        self.relabel, self.copies = relabel, copies
        self.unfinished: TensorDictBase | None = None  # (worlds, steps) since the oldest unfinished episode began
        self.begins: list[int] = []  # the step of `unfinished` at which each world's present episode began

    def __call__(self, batch: TensorDictBase) -> list[TensorDictBase]:
        """Return relabelled copies (T,) of the episodes that end in a batch (worlds, steps) after the last one."""
        if self.relabel is None or not self.copies:
            return []
        ended = [episode for episode in self.episodes(batch) for _ in range(self._draw_copies())]
        return list(self.relabel(ended, int(torch.randint(2**31, ())))) if ended else []

    def episodes(self, batch: TensorDictBase) -> list[TensorDictBase]:
        """Return the episodes (T,) that end in this batch, each of one world and with all its frames."""
        before = 0 if self.unfinished is None else self.unfinished.shape[1]
        frames = batch.clone() if self.unfinished is None else torch.cat([self.unfinished, batch], 1)
        begins, ended = self.begins or [0] * len(batch), []
        for world, step in batch["next", "done"][..., 0].nonzero().tolist():
            end = before + step + 1
            ended.append(frames[world, begins[world] : end])
            begins[world] = end
        oldest = min(begins)
        self.unfinished, self.begins = frames[:, oldest:], [step - oldest for step in begins]
        return ended

    def state_dict(self) -> dict[str, Any] | None:
        """Return the frames of the unfinished episodes, as plain values and tensors; None if there are none."""
        if self.unfinished is None:
            return None
        worlds, steps = self.unfinished.shape
        frames = self.unfinished[self._is_unfinished(worlds, steps)].clone()
        return {"frames": frames.to_dict(), "begins": list(self.begins), "steps": steps}

    def load_state_dict(self, state: dict[str, Any] | None) -> None:
        """Continue the unfinished episodes of a `state_dict`."""
        if state is None:
            self.unfinished, self.begins = None, []
            return
        self.begins = list(state["begins"])
        worlds, steps = len(self.begins), int(state["steps"])
        chosen = self._is_unfinished(worlds, steps)
        frames = TensorDict(state["frames"], [int(chosen.sum())])
        self.unfinished = frames.apply(lambda x: x.new_zeros(worlds, steps, *x.shape[1:]), batch_size=[worlds, steps])
        self.unfinished[chosen] = frames

    def _is_unfinished(self, worlds: int, steps: int) -> Tensor:
        """Return which frames belong to an unfinished episode, (worlds, steps) bool."""
        return torch.arange(steps).expand(worlds, steps) >= torch.tensor(self.begins)[:, None]

    def _draw_copies(self) -> int:
        return int(self.copies) + (float(torch.rand(())) < self.copies % 1.0 if self.copies % 1.0 else 0)


class ExpertFrames:
    """Lets the expert act until `config.demonstrations` frames are kept.

    Attributes:
        mixture: acts in the worlds: the expert at first, then the policy.
        replay: the expert's frames.

    Args: as of `Replay`; its capacity is that of `config`.
    """

    def __init__(
        self,
        policy: Policy,
        critic_keys: Sequence[NestedKey],
        config: OffPolicyConfig,
        *,
        device: torch.device,
        supervised: bool,
    ) -> None:
        self._wanted = config.demonstrations
        self.mixture = ExpertMixture(policy, expert_share=1.0)
        self.replay = Replay(policy, critic_keys, capacity=self._wanted, device=device, supervised=supervised)

    def add(self, batch: TensorDictBase) -> bool:
        """Keep a batch (worlds, steps) if the expert acted in it. Returns whether it did.

        The actions show it, since the collector may be a batch behind.
        """
        if not torch.equal(batch["action"], batch[LABEL]):
            return False
        self.replay.extend(batch)
        if len(self.replay) >= self._wanted:
            self.mixture.expert_share.fill_(0.0)
        return True

    def running_state(self) -> dict[str, Any]:
        return {"expert_share": float(self.mixture.expert_share)}

    def load_running_state(self, state: dict[str, Any]) -> None:
        self.mixture.expert_share.fill_(state["expert_share"])
