"""Replayed frames: a buffer that keeps the keys that off-policy learning reads, and nothing else."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from trainers.algorithms.priorities import ProportionalSampler
from trainers.models.grounding import REFERENT
from trainers.models.policy import Policy

PRIORITY = "td_error"


class Replay:
    """Frames with their "next", drawn evenly or by priority.

    Supervised words are not stored. The frames then hold the rows of the labelled slots, so they stay valid while the
    words are being learned. Unsupervised words are stored and encoded again at each gradient step.

    Args:
        policy: chooses the keys and writes the labelled rows.
        critic_key: the key that the critic reads beside robot and move.
        capacity: frames.
        device: of the buffer.
        supervised: whether the grounding loss trains the words.
        alpha: exponent of the priorities; 0 draws evenly.
        beta: exponent of the importance weights.
    """

    def __init__(
        self,
        policy: Policy,
        critic_key: str | tuple[str, str],
        capacity: int,
        device: torch.device,
        supervised: bool,
        alpha: float = 0.0,
        beta: float = 0.0,
    ) -> None:
        self.policy, self.supervised, self.prioritised = policy, supervised, alpha > 0
        context = [policy.context_key] if supervised else list(policy.encoder.scene_keys)
        critic = [] if critic_key == policy.context_key else [critic_key]
        self.state_keys = list(dict.fromkeys([*policy.actor_keys, *context, *critic]))
        storage = LazyTensorStorage(capacity, device=device)
        sampler = ProportionalSampler(capacity, alpha, beta, device) if self.prioritised else None
        self.frames = TensorDictReplayBuffer(storage=storage, sampler=sampler)

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
        """Frames (count,)."""
        return self.frames.sample(count)

    def update_priorities(self, frames: TensorDictBase) -> None:
        """Take the temporal-difference errors of sampled frames as their priorities, where frames are drawn by them."""
        if self.prioritised:
            self.frames.update_priority(frames["index"], frames[PRIORITY].flatten())
