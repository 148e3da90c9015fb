"""Checkpoints from before words were added to the end of the vocabulary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

UNKNOWN_ROW = 1  # the embedding of words that are not in the vocabulary


def extend_vocabulary(payload: dict[str, Any], vocabulary: Sequence[str]) -> dict[str, Any]:
    """The payload of a checkpoint, with its policy's word embeddings extended to a vocabulary that begins with its own.

    The policy reads the added words as unknown ones, and all others as before. Returns the payload itself where its
    vocabulary is not a proper beginning of this one.
    """
    known = list(payload["vocabulary"])
    if len(known) >= len(vocabulary) or known != list(vocabulary[: len(known)]):
        return payload
    weights = {
        name: _extended(weight, len(vocabulary)) if _is_word_embedding(name, weight, len(known)) else weight
        for name, weight in payload["algorithm"]["policy"].items()
    }
    return payload | {"vocabulary": list(vocabulary), "algorithm": payload["algorithm"] | {"policy": weights}}


def _is_word_embedding(name: str, weight: torch.Tensor, words: int) -> bool:
    return name.endswith("word_embedding.weight") and len(weight) == words


def _extended(weight: torch.Tensor, words: int) -> torch.Tensor:
    return torch.cat((weight, weight[UNKNOWN_ROW].expand(words - len(weight), -1)))
