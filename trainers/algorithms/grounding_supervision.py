"""The grounding loss: cross-entropy of a policy's attention over object slots, on scenes of the whole run.

The environment knows which slot a sentence means, so the words are learned by supervision. At test time the policy is
given the words alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from trainers.algorithms.base_config import AlgorithmConfig
from trainers.models.grounding import grounding_loss
from trainers.models.policy import Policy

METRICS = ("loss/grounding", "grounding/accuracy")
LEAST_SHARE = 1 / 8  # least share of gradient steps with scenes, however small the error
SMOOTHING = 0.5  # weight of the latest batch in the error


class GroundingSupervision:
    """Keeps scenes and computes the grounding loss on samples of them.

    A batch of PPO holds a hundred or two scenes, each at many steps. Relations learned from the latest batch alone
    reached 92 % of fresh sentences; learned from all scenes of the run they reach more than 99 %.

    Attributes:
        active: False if the weight is 0 or the policy has no attention; then the words are learned from reward alone.
        gain: the share of gradient steps with scenes, divided by the error; None: all steps have scenes.
        error: running mean of the attention's error rate on fresh scenes; 1 before the first batch.
    """

    def __init__(self, config: AlgorithmConfig, policy: Policy, device: torch.device) -> None:
        self.config, self.policy = config, policy
        self.active = config.grounding_weight > 0 and policy.attends
        self.keys = [*policy.encoder_keys, *policy.label_keys]
        self.scenes = TensorDictReplayBuffer(storage=LazyTensorStorage(config.grounding_memory, device=device))
        self.gain: float | None = None
        self.error = 1.0

    @property
    def share(self) -> float:
        """The share of gradient steps with scenes: in proportion to the error, between LEAST_SHARE and 1."""
        return 1.0 if self.gain is None else min(1.0, max(LEAST_SHARE, self.gain * self.error))

    @property
    def scenes_per_update(self) -> int:
        """How many unsimulated scenes are added before each update."""
        return math.ceil(self.share * self.config.grounding_scenes) if self.active else 0

    def add(self, scenes: TensorDictBase) -> None:
        """Keep scenes (count,). Those that are simulated may have fewer slots than those that were drawn first."""
        slots = self.scenes[:1]["objects"].shape[1] if len(self.scenes) else 0
        self.scenes.extend(with_slots(scenes, slots))

    def sample(self, count: int = 1) -> Sequence[TensorDictBase]:
        """`count` batches of scenes (grounding_batch,), drawn evenly with replacement in one draw."""
        return self.scenes.sample(count * self.config.grounding_batch).split(self.config.grounding_batch)

    def paired(
        self, parts: Iterable[TensorDictBase], count: int, share: float
    ) -> Iterator[tuple[TensorDictBase, TensorDictBase | None]]:
        """Pairs each of `count` parts with a batch of scenes for the same gradient step, or with None.

        A pass over scenes costs more than one over frames, and fewer passes suffice. So only a share of the parts,
        evenly spaced, has scenes; none has if the words are not supervised. All scenes are drawn at once.
        """
        chosen = math.ceil(count * share) if self.active else 0
        drawn = self.sample(chosen) if chosen else ()
        scenes = {i * count // chosen: each for i, each in enumerate(drawn)}
        for i, part in enumerate(parts):
            yield part, scenes.get(i)

    def measure_fresh(self, scenes: TensorDictBase) -> float:
        """The accuracy on scenes (count,) that no step has learned from yet. Updates `error`."""
        accuracy = float(self.measure(scenes)["grounding/accuracy"])
        self.error += SMOOTHING * (1 - accuracy - self.error)
        return accuracy

    def measure(self, scenes: TensorDictBase) -> dict[str, Tensor]:
        """The loss, before its weight, and the accuracy on scenes (count,), under the names of METRICS."""
        return dict(zip(METRICS, grounding_loss(self.policy.encode(scenes)), strict=True))


def with_slots(scenes: TensorDictBase, slots: int) -> TensorDictBase:
    """The scenes (count,) with at least so many slots: those that are added show nothing."""
    missing = slots - scenes["objects"].shape[1]
    if missing <= 0:
        return scenes
    rows = {"objects": (0, 0, 0, missing), "objects_mask": (0, missing)}
    return scenes.copy().update({key: F.pad(scenes[key], padding) for key, padding in rows.items()})


def first_steps(batch: TensorDictBase, starts: Tensor) -> Tensor:
    """(worlds, steps) bool: whether a frame is the first one of its episode. starts: (worlds, 1) of the first step."""
    return torch.cat([starts, batch["next", "done"][:, :-1, 0]], 1)
