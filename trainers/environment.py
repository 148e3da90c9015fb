"""The interface that training expects of an environment, beside TorchRL's `EnvBase`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor
from torchrl.data import Composite, TensorSpec

# Maps episodes (T,) and a seed to relabelled ones: those that achieved another goal, cut where they now end.
Relabel = Callable[[Sequence[TensorDictBase], int], Sequence[TensorDictBase]]


# The readers of an environment that does not declare them. Those of its keys that it does not observe are left out.
DEFAULT_READERS: dict[NestedKey, str] = {
    "robot": "actor",
    "objects": "scene",
    "objects_mask": "scene",
    "objects_near": "actor",
    "instruction": "scene",
    "gesture": "scene",
    "stage": "actor",
    ("privileged", "goal"): "critic",
}
Readers = Mapping[NestedKey, str]  # key of an observation -> "scene", "actor" or "critic"


class HasVocabulary(Protocol):
    """The words that instructions are made of."""

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

    An environment may have an attribute `readers`: by the key of an observation, the network that reads it; without it,
    `DEFAULT_READERS` holds. "scene": the encoder of words and scene; "actor": the actor, and the critics too; "critic":
    the critics alone. Keys beyond those above need finite bounds: they are normalised, and are further inputs.

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
    tokenizer: HasVocabulary

    @property
    def action_unit(self) -> Sequence[float]: ...

    @property
    def moves_referent(self) -> bool: ...

    def is_reachable(self, place: Tensor) -> bool:
        """Return whether a gripper gets within reach of an object at place (3,), metres."""

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
        """Return scenes (count,) with their sentences and labels, drawn but not simulated."""

    def hindsight(self, episodes: Sequence[TensorDictBase], seed: int) -> Sequence[TensorDictBase]:
        """Return those of the episodes (T,) that achieved another goal, relabelled with it (HER)."""


def readers_of(env: Any) -> Readers:
    """Return the network that reads each observation of an environment."""
    readers: Readers = getattr(env, "readers", DEFAULT_READERS)
    return readers


def keys_read(readers: Readers, reader: str, observation_spec: Composite, further: bool = False) -> list[NestedKey]:
    """Return the keys of an environment's observations that one network reads, in the order of their declaration.

    Args:
        readers: by key.
        reader: "scene", "actor" or "critic".
        observation_spec: of the environment.
        further: only those that `DEFAULT_READERS` lacks, which have no meaning of their own for a network.
    """
    observed = set(observation_spec.keys(include_nested=True))
    keys = [key for key, each in readers.items() if each == reader and key in observed]
    return [key for key in keys if key not in DEFAULT_READERS] if further else keys
