"""Sentences to queries for the attention over object slots."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

QUERIES = 4  # for each choice: the object, its two anchors, and the relation
UNIQUE_ABOVE = 64  # sentences; larger batches are searched for repetitions


class QueryEncoder(nn.Module):
    """An instruction (N, L) int64, 0 = pad, to queries (N, Q, E): Q = 4 * choices, and one more for the verb.

    choices: how many objects the words name: the referent and, if it is to be brought somewhere, its target.
    reads_verb: whether the last query is for the verb.
    """

    hash_weights: Tensor

    def __init__(
        self, word_embedding: nn.Module, length: int, width: int, choices: int = 1, reads_verb: bool = False
    ) -> None:
        super().__init__()
        self.word_embedding = word_embedding  # (N, L) to (N, L, E)
        self.positions = nn.Parameter(0.1 * torch.randn(length, width))
        self.convolutions = nn.ModuleList(nn.Linear(3 * width, width) for _ in range(2))
        queries = QUERIES * choices + reads_verb
        self.roles = nn.Linear(width, queries)
        # Referent and target differ even if the words describe neither: one can be moved, the other marks a place.
        self.base_queries = nn.Parameter(0.1 * torch.randn(queries, width)) if choices > 1 else None
        generator = torch.Generator().manual_seed(1)
        self.register_buffer("hash_weights", torch.randint(2**62, (length,), generator=generator))

    def forward(self, tokens: Tensor) -> Tensor:
        # The words are the same at every step of an episode, so a training batch repeats few sentences many times.
        if len(tokens) <= UNIQUE_ABOVE:
            return self.encode(tokens)
        _, copy = torch.unique((tokens * self.hash_weights).sum(-1), return_inverse=True)
        first = copy.new_empty(int(copy.max()) + 1).scatter_(0, copy, torch.arange(len(copy), device=copy.device))
        return self.encode(tokens[first])[copy]

    def encode(self, tokens: Tensor) -> Tensor:
        """Queries, without the search for repetitions.

        Which words belong to which query depends on the whole sentence; their content depends on each word alone. So a
        known word means the same beside an unknown one, and pairs of words that were never trained together have the
        meaning of their parts: 98 % accuracy on such pairs in fresh scenes, against 97 % with queries of mixed words.
        """
        present = (tokens != 0).unsqueeze(-1)
        words = self.word_embedding(tokens) * present
        x = words + self.positions * present
        for convolution in self.convolutions:
            # A convolution of width 3, written as one product: PyTorch's own takes 3 times as long at these sizes.
            before, after = F.pad(x, (0, 0, 1, 0))[:, :-1], F.pad(x, (0, 0, 0, 1))[:, 1:]
            x = x + F.relu(convolution(torch.cat([before, x, after], -1))) * present
        weights = self.roles(x).sigmoid() * present
        queries = weights.transpose(1, 2) @ words
        return queries if self.base_queries is None else queries + self.base_queries
