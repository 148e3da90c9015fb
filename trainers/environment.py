"""The interface that training expects of an environment, beside TorchRL's `EnvBase`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Composite, TensorSpec

# Maps episodes (T,) and a seed to relabelled ones: those that achieved another goal, cut where they now end.
Relabel = Callable[[Sequence[TensorDictBase], int], Sequence[TensorDictBase]]


class Tokenizer(Protocol):
    """The vocabulary of instructions."""

    @property
    def vocabulary(self) -> Sequence[str]: ...


@runtime_checkable
class TrainingEnv(Protocol):
    """N worlds in one batched TorchRL environment, batch_size (N,), on the CPU.

    Observations have the keys "robot", "objects", "objects_mask", "instruction" and "hold", "success", "wrong_object",
    "at_goal" and "reward_terms", and under "privileged" at least "referent", "goal" and "kind". A row of "objects"
    (N, K, D) begins with a position, metres, and is 0 throughout in a slot that shows no object. Where a person points
    there is "gesture" too. Policies never read a privileged key. Where an algorithm imitates, the worlds that it trains
    in also observe "privileged/expert_action" (N, A), an expert's action. An exception that `step` raises may have an
    attribute `frame` (N,), the input of the step, which the run then saves.

    Attributes:
        action_unit: (A,), the action that moves the arm as far as it gets in one control step.
        reward_names: names of the columns of "reward_terms".
        kind_names: names of the values of privileged/kind.
        tokenizer: has the words that "instruction" is made of.
        moves_referent: whether the task is to move the referent.
    """

    batch_size: torch.Size
    reward_names: Sequence[str]
    kind_names: Sequence[str]
    tokenizer: Tokenizer

    @property
    def action_unit(self) -> Sequence[float]: ...

    @property
    def moves_referent(self) -> bool: ...

    def is_reachable(self, place: Tensor) -> bool:
        """Whether a gripper gets within reach of an object at place (3,), metres."""

    @property
    def observation_spec(self) -> Composite: ...

    @property
    def action_spec(self) -> TensorSpec: ...

    def reset(self) -> TensorDictBase: ...

    def step(self, tensordict: TensorDictBase) -> TensorDictBase: ...

    def step_and_maybe_reset(self, tensordict: TensorDictBase) -> tuple[TensorDictBase, TensorDictBase]: ...

    def set_seed(self, seed: int) -> Any: ...

    def close(self) -> Any: ...

    @property
    def beginnings(self) -> Sequence[Mapping[str, Any]]:
        """For each world, the state of its generator when its present episode began: plain values."""

    def continue_episodes(self, beginnings: Sequence[Mapping[str, Any]], actions: Tensor, lengths: Tensor) -> None:
        """The next reset of all worlds continues these episodes, bit for bit, instead of beginning new ones.

        Args:
            beginnings: for each world, as of `beginnings` when its episode began.
            actions: (N, T, A), those of the latest T steps.
            lengths: (N,) how many of them, the last ones, belong to the present episode.
        """

    def draw_scenes(self, count: int, seed: int) -> TensorDictBase:
        """Scenes (count,) with their sentences and labels, drawn but not simulated."""

    def hindsight(self, episodes: Sequence[TensorDictBase], seed: int) -> Sequence[TensorDictBase]:
        """Those of the episodes (T,) that achieved another goal, relabelled with it (HER)."""
