"""Assembles whole episodes from a stream of batches, and has them relabelled with the goals that they achieved (HER).

Hindsight experience replay, Andrychowicz et al. 2017 (arXiv:1707.01495). TorchRL's HERReplayBuffer does not fit, for
three reasons:

* It puts a goal into single frames as they are sampled and computes the reward from that frame alone. Here the words
  change with the goal, and success and rewards depend on earlier frames (picked up once, at rest for some steps).
* It leaves `terminated` as it was, so the value of a frame that now succeeds would still be bootstrapped.
* It takes an episode to lie between two `done` flags of a flat storage; batches (worlds, steps) are not in that order.
"""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from trainers.environment import Relabel


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
        """Relabelled copies (T,) of the episodes that end in a batch (worlds, steps), which continues the last one."""
        if self.relabel is None or not self.copies:
            return []
        ended = [episode for episode in self.episodes(batch) for _ in range(self._draw_copies())]
        return list(self.relabel(ended, int(torch.randint(2**31, ())))) if ended else []

    def episodes(self, batch: TensorDictBase) -> list[TensorDictBase]:
        """The episodes (T,) that end in this batch, each of one world and with all its frames."""
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
        """The frames of the unfinished episodes, as plain values and tensors; None if there are none."""
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
        """(worlds, steps) bool: which frames belong to an unfinished episode."""
        return torch.arange(steps).expand(worlds, steps) >= torch.tensor(self.begins)[:, None]

    def _draw_copies(self) -> int:
        return int(self.copies) + (float(torch.rand(())) < self.copies % 1.0 if self.copies % 1.0 else 0)
