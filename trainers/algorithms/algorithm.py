"""What the algorithms share: refusing numbers that are not numbers, and averages of what they measured."""

from __future__ import annotations

from typing import Protocol

import torch
from tensordict import TensorDictBase
from torch import Tensor

from conf.schema import RunError
from trainers.utils.observation_keys import public_keys

METRICS = ("loss/grounding", "grounding/accuracy")


class DivergedError(RunError):
    """A loss, reward or observation is not finite. `batch` is what it was found in."""

    def __init__(self, message: str, batch: TensorDictBase) -> None:
        super().__init__(message)
        self.batch = batch


class Annealed(Protocol):
    """The values of a config that its learning rate follows from."""

    @property
    def lr(self) -> float: ...

    @property
    def anneal_lr(self) -> bool: ...


class Algorithm(Protocol):
    """A learner: fed each batch that the workers collect."""

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names that `update` may return."""

    @property
    def wants_scenes(self) -> int:
        """How many scenes to give to `study` before each update."""

    def study(self, scenes: TensorDictBase) -> None:
        """Take scenes (count,) of `draw_scenes`, that nobody acted in, to learn what words mean."""

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Learn from a batch (worlds, steps). progress: the part of the run that is over, in [0, 1]."""

    def state_dict(self) -> dict:
        """Networks and optimizers."""

    def load_state_dict(self, state: dict) -> None:
        """Go on from `state_dict`."""


def anneal(optimizer: torch.optim.Optimizer, config: Annealed, progress: float) -> float:
    """Set the optimizer's learning rate to what it is at this progress in [0, 1] of a run, and return it."""
    rate = config.lr * (1 - progress if config.anneal_lr else 1.0)
    optimizer.param_groups[0]["lr"] = rate
    return rate


def check_batch(batch: TensorDictBase) -> None:
    """Raise DivergedError, with its name, for an observation, reward or action that is not finite."""
    after = batch["next"]
    floats = [key for key in public_keys(after) if after[key].is_floating_point()]
    before = [key for key in (*floats, "action") if key in batch.keys()]
    for key in (*before, *(("next", key) for key in floats), ("next", "reward")):
        if not torch.isfinite(batch[key].sum()) and not batch[key].isfinite().all():
            name = key if isinstance(key, str) else "/".join(key)
            raise DivergedError(f"{name} is not finite in a collected batch", batch)


def check_loss(loss: Tensor, batch: TensorDictBase) -> None:
    """Raise DivergedError before a loss that is not finite reaches the parameters."""
    if not torch.isfinite(loss):
        raise DivergedError(f"the loss became {loss.item()}", batch)


def averages(rows: list[dict[str, Tensor]]) -> dict[str, float]:
    """The mean of each measured name over those steps of an update that measured it."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: torch.stack([row[name] for row in rows if name in row]).mean().item() for name in names}
