"""The state from which the running episodes of the training worlds can be continued.

A world's state follows from the generator state when its episode began and the actions since; the environment's
`continue_episodes` replays them. The main process records both from each batch, so it needs no worker to save a
checkpoint, or to replace a worker that was lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

Beginning = Mapping[str, Any]  # the state of a world's generator when its episode began: plain values


@dataclass(frozen=True)
class Episodes:
    """The episodes that N worlds are in after a batch.

    beginnings: for each world, the state of its generator when the episode began. actions: (N, T, A), those of the
    latest T steps. lengths: (N,) how many of them, the last ones, belong to the present episode.
    """

    beginnings: Sequence[Beginning]
    actions: Tensor
    lengths: Tensor

    def part(self, first: int, count: int) -> Episodes:
        """Those of worlds first to first + count - 1."""
        worlds = slice(first, first + count)
        lengths = self.lengths[worlds]
        return Episodes(self.beginnings[worlds], self.actions[worlds, -int(lengths.max()) or None :], lengths)

    def state_dict(self) -> dict[str, Any]:
        """Plain values and tensors."""
        return {"beginnings": list(self.beginnings), "actions": self.actions.clone(), "lengths": self.lengths.clone()}


class EpisodeLog:
    """Follows the worlds of all workers. `episodes` is None before the first batch."""

    def __init__(self, episodes: Episodes | None = None) -> None:
        self.episodes = episodes

    def add(self, batch: TensorDictBase, beginnings: Mapping[int, Beginning]) -> None:
        """Take a batch (worlds, steps). beginnings: of the worlds whose episode began in it, or of all worlds."""
        done, steps = batch["next", "done"][..., 0], batch.shape[1]
        since = steps - 1 - _last(done)  # steps after the last end; all of them where no episode ended
        actions, lengths = batch["action"], since
        known = [beginnings.get(i) for i in range(len(done))]
        if self.episodes is not None:
            known = [new or old for new, old in zip(known, self.episodes.beginnings, strict=True)]
            lengths = torch.where(done.any(1), since, self.episodes.lengths + steps)
            actions = torch.cat((self.episodes.actions, actions), 1)
        keep = int(lengths.max())
        self.episodes = Episodes([each or {} for each in known], actions[:, actions.shape[1] - keep :].clone(), lengths)


def _last(flags: Tensor) -> Tensor:
    """(N,) the index of the last true value in each row of (N, T); -1 where there is none."""
    order = torch.arange(1, flags.shape[1] + 1)
    return (flags * order).amax(1) - 1
