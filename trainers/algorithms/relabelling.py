"""Whole episodes out of a stream of batches, told again as if what they came to had been asked for.

Hindsight experience replay, Andrychowicz et al. 2017 (arXiv:1707.01495). TorchRL's HERReplayBuffer cannot do it here:
it puts a goal into single frames as they are sampled and asks a function of that frame for the reward, while our words
change with the goal, and success and rewards depend on what came before (picked up once, at rest for some steps). It
leaves `terminated` as it was, so that a frame that now succeeds would still be worth what follows it; and it finds
episodes in a flat storage between one `done` and the next, which batches (worlds, steps) are not in the order of.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from tensordict import TensorDictBase

# Episodes (T,) and a seed, to those of them that have another tale to tell, each up to where it then ends.
Relabel = Callable[[Sequence[TensorDictBase], int], Sequence[TensorDictBase]]


class Hindsight:
    """copies: how often each episode that ends is told again; a fraction is a probability."""

    def __init__(self, relabel: Relabel | None, copies: float) -> None:
        self.relabel, self.copies = relabel, copies
        self.running: TensorDictBase | None = None  # (worlds, steps) since the oldest episode that goes on began
        self.began: list[int] = []  # the step of `running` at which each world's present episode began

    def __call__(self, batch: TensorDictBase) -> list[TensorDictBase]:
        """Relabelled episodes (T,) of those that end in a batch (worlds, steps), the next one of the same worlds."""
        if self.relabel is None or not self.copies:
            return []
        ended = [episode for episode in self.episodes(batch) for _ in range(self._times())]
        return list(self.relabel(ended, int(torch.randint(2**31, ())))) if ended else []

    def episodes(self, batch: TensorDictBase) -> list[TensorDictBase]:
        """The episodes (T,) that end in this batch, each of one world and with all its frames."""
        before = 0 if self.running is None else self.running.shape[1]
        running = batch.clone() if self.running is None else torch.cat([self.running, batch], 1)
        began, ended = self.began or [0] * len(batch), []
        for world, step in batch["next", "done"][..., 0].nonzero().tolist():
            end = before + step + 1
            ended.append(running[world, began[world] : end])
            began[world] = end
        oldest = min(began)
        self.running, self.began = running[:, oldest:], [step - oldest for step in began]
        return ended

    def _times(self) -> int:
        return int(self.copies) + (float(torch.rand(())) < self.copies % 1.0 if self.copies % 1.0 else 0)
