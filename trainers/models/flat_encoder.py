"""The baseline's encoder: everything flattened into one row."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from trainers.models.grounding import GESTURE, SCENE_KEYS
from trainers.models.networks import Normalise


class FlatEncoder(nn.Module):
    """Instruction and scene to one row (N, F): normalised objects, mask, mean embedding of the words, and the ray.

    It has the interface of `GroundingEncoder`, without attention: `select_likeliest` and the like do nothing.

    Args:
        objects: normalises object rows.
        slots: K.
        vocabulary: number of words.
        embedding: width of a word.
        gesture: width of the ray; 0 where nobody points.
    """

    out_keys = ("scene",)
    logit_keys = ()
    observes_obstacles = False
    verbs = 0

    def __init__(self, objects: Normalise, slots: int, vocabulary: int, embedding: int, gesture: int = 0) -> None:
        super().__init__()
        self.scene_keys = (*SCENE_KEYS, GESTURE) if gesture else SCENE_KEYS
        self.normalise = objects
        self.word_embedding = nn.EmbeddingBag(vocabulary, embedding, mode="mean", padding_idx=0)
        self.outputs = slots * (objects.shape[-1] + 1) + embedding + gesture

    def forward(self, instruction: Tensor, *scene: Tensor) -> tuple[Tensor, ...]:
        return self.attend(self.encode_words(instruction), *scene)

    def encode_words(self, instruction: Tensor) -> Tensor:
        """Tokens (N, L) to their mean embedding (N, E); zeros, which need no gradient, for tasks without words."""
        if not instruction.any():
            return self.word_embedding.weight.new_zeros(len(instruction), self.word_embedding.embedding_dim)
        return self.word_embedding(instruction)

    def attend(self, words: Tensor, objects: Tensor, mask: Tensor, *gesture: Tensor) -> tuple[Tensor, ...]:
        """`forward`, given the result of `encode_words`."""
        present = mask.to(objects.dtype)
        rows = self.normalise(objects) * present.unsqueeze(-1)
        return (torch.cat([rows.flatten(1), present, words, *gesture], -1),)

    def keep_mean(self, frames: TensorDictBase) -> None:
        """Does nothing: there is no attention."""

    select_likeliest = select_labelled = keep_mean

    def write_obstacle(self, frames: TensorDictBase, referent: Tensor) -> None:
        """Does nothing: the actor is given all rows."""
